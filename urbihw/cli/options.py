"""The common part of the programs named after those of the SDK: options and error messages.

Manual, chapter 18 (Programs).  The exit codes are in ``urbihw.exitcodes``.
"""

from __future__ import annotations

import argparse
import math
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, NoReturn

from urbihw.exitcodes import EX_NOINPUT, EX_UNAVAILABLE, EX_USAGE
from urbihw.release import installed_version

DEFAULT_PORT: Final = 54000
_PORT: Final = re.compile("-1|[0-9]{1,5}")
_DIGITS: Final = re.compile("[0-9]{1,12}")


class CliRefused(Exception):
    """The program cannot carry out the request; the message is one line that tells what to do."""

    def __init__(self, message: str, code: int = EX_UNAVAILABLE) -> None:
        super().__init__(message)
        self.code = code


class VersionAction(argparse.Action):
    """``--version``."""

    def __init__(self, option_strings: Sequence[str], dest: str, *, text: str) -> None:
        """``text`` contains ``{}`` for the version."""
        super().__init__(option_strings, argparse.SUPPRESS, 0, help="show program's version number and exit")
        self._text = text

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        """Print the version and exit."""
        print(self._text.format(installed_version()))
        parser.exit()


class GetoptParser(argparse.ArgumentParser):
    """Parses options as ``getopt_long`` does: the word behind an option that needs a value is its value."""

    def __init__(self, prog: str, description: str, usage: str | None = None, *, script: bool = False) -> None:
        """``script``: the first word that is no option is a program, and all words behind it are the program's
        arguments."""
        super().__init__(prog=prog, description=description, usage=usage)
        self._script = script
        self.add_argument("--version", action=VersionAction, text=prog + " (urbihw {}), urbiscript 2.3")

    def parse(self, argv: Sequence[str] | None = None) -> argparse.Namespace:
        """The options of a command line; exits with 64 when they are wrong."""
        words = self._joined(sys.argv[1:] if argv is None else argv)
        return self.parse_args(words) if self._script else self.parse_intermixed_args(words)

    def _joined(self, argv: Sequence[str]) -> list[str]:
        """The arguments with values joined to their options, so that ``-e '-1;'`` is not read as an option ``-1``."""
        long = {
            name: next((other for other in action.option_strings if other.startswith("--")), name)
            for action in self._actions
            if action.nargs is None
            for name in action.option_strings
        }
        joined: list[str] = []
        words = iter(argv)
        for word in words:
            if word == "--" or self._script and not word.startswith("-"):
                return [*joined, word, *words]
            value = next(words, None) if word in long else None
            joined.append(word if value is None else f"{long[word]}={value}")
        return joined

    def error(self, message: str) -> NoReturn:
        """Print the error in the manual's words (specs/process, stderr), and exit with 64."""
        unknown = message.removeprefix("unrecognized arguments: ")
        text = message if unknown == message else f"invalid option: {unknown.split()[0]}"
        self.exit(EX_USAGE, f"{self.prog}: {text}\nTry `{self.prog} --help' for more information.\n")


class SourceAction(argparse.Action):
    """Collects ``-e`` and ``-f`` in the given order, as pairs of ``const`` and value."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: str | Sequence[object] | None,
        option_string: str | None = None,
    ) -> None:
        namespace.sources = [*namespace.sources, (self.const, values)]


def add_sources(parser: argparse.ArgumentParser) -> None:
    """Add the options ``-e`` and ``-f``, whose values become ``sources``."""
    parser.set_defaults(sources=[])
    parser.add_argument("-e", "--expression", action=SourceAction, const="text", dest="sources", metavar="EXP",
                        help="send EXP; no separator is added")
    parser.add_argument("-f", "--file", action=SourceAction, const="file", dest="sources", metavar="FILE",
                        help="send the contents of FILE (- is standard input)")


def port(text: str, least: int = 1) -> int:
    """Parse a TCP port.  ``least`` is 1 for a port to connect to, 0 for one to listen on (0: any free one), -1 to allow
    -1 (none).

    Raises ArgumentTypeError.
    """
    number = int(text) if _PORT.fullmatch(text) else least - 1
    if not least <= number <= 65535:
        none = ", or -1 for none" if least < 0 else ""
        raise argparse.ArgumentTypeError(f"{text!r} is no port; give a number from {max(least, 0)} to 65535{none}")
    return number


def whole(least: int, most: int, name: str = "whole number") -> Callable[[str], int]:
    """The type of an option that is a whole number within bounds; ``name`` describes it in the message."""

    def read(text: str) -> int:
        if not _DIGITS.fullmatch(text) or not least <= int(text) <= most:
            raise argparse.ArgumentTypeError(f"{text!r} is no {name} from {least} to {most}")
        return int(text)

    return read


def number(least: float, most: float, name: str) -> Callable[[str], float]:
    """The type of an option that is a number within bounds; ``name`` describes it in the message."""

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"{text!r} is no {name} from {least:g} to {most:g}")
        return value

    return read


def source_bytes(kind: str, value: str) -> bytes:
    """The bytes of an entry of ``sources``.  Raises CliRefused when a file cannot be read."""
    if kind == "text":
        return value.encode("utf-8", "surrogateescape")
    try:
        return sys.stdin.buffer.read() if value == "-" else Path(value).read_bytes()
    except OSError as error:
        raise CliRefused(f"failed to process file {value}: {error.strerror}", EX_NOINPUT) from error


def complain(program: str, error: CliRefused) -> int:
    """Print the error of a program; returns the exit code."""
    print(f"{program}: {error}", file=sys.stderr)
    return error.code


def split(argv: Sequence[str]) -> tuple[list[str], list[str]]:
    """The arguments before and behind ``--``."""
    words = list(argv)
    at = words.index("--") if "--" in words else len(words)
    return words[:at], words[at + 1 :]
