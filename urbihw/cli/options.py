"""What the programs named after those of the SDK share: how they read options, and how they complain.

Manual, chapter 18 (Programs).  Their exit codes are those of the original where it had one (server protocol, section
9): 64 for a bad option, 66 for a file that cannot be read, 69 for a port or a server that is not available.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NoReturn

EX_SYNTAX: Final = 65
EX_RUNTIME: Final = 70
EX_CONFIG: Final = 78
EX_USAGE: Final = 64
EX_NOINPUT: Final = 66
EX_UNAVAILABLE: Final = 69
INTERRUPTED: Final = 130
"""What a shell says of a program that Ctrl-C ended."""

DEFAULT_PORT: Final = 54000


class Refused(Exception):
    """The program cannot do what it was asked for; the message is one line that says what to do."""

    def __init__(self, message: str, code: int = EX_UNAVAILABLE) -> None:
        super().__init__(message)
        self.code = code


class Version(argparse.Action):
    """``--version``; looked up only when it is asked for, since every start would pay for it."""

    def __init__(self, option_strings: Sequence[str], dest: str, *, text: str) -> None:
        """``text`` has ``{}`` in the place of the version."""
        super().__init__(option_strings, argparse.SUPPRESS, 0, help="show program's version number and exit")
        self._text = text

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        """Say it and end."""
        from importlib.metadata import version

        print(self._text.format(version("urbihw")))
        parser.exit()


class Parser(argparse.ArgumentParser):
    """Options as ``getopt_long`` reads them: whatever follows an option that wants a value is its value."""

    def __init__(self, prog: str, description: str, usage: str | None = None, *, script: bool = False) -> None:
        """``script``: the first word that is no option is a program, and all that follows is its own."""
        super().__init__(prog=prog, description=description, usage=usage)
        self._script = script
        self.add_argument("--version", action=Version, text=prog + " (urbihw {}), urbiscript 2.3")

    def parse(self, argv: Sequence[str] | None = None) -> argparse.Namespace:
        """The options of a command line; exits with 64 when they are wrong."""
        words = self._joined(sys.argv[1:] if argv is None else argv)
        return self.parse_args(words) if self._script else self.parse_intermixed_args(words)

    def _joined(self, argv: Sequence[str]) -> list[str]:
        """Values tied to their options, so that ``-e '-1;'`` is no option ``-1``."""
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
        """Say what is wrong in the manual's words (specs/process, stderr), and exit with 64."""
        unknown = message.removeprefix("unrecognized arguments: ")
        text = message if unknown == message else f"invalid option: {unknown.split()[0]}"
        self.exit(EX_USAGE, f"{self.prog}: {text}\nTry `{self.prog} --help' for more information.\n")


class Source(argparse.Action):
    """Collects ``-e`` and ``-f`` in the order in which they were given: pairs of ``const`` and value."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: str | Sequence[object] | None,
        option_string: str | None = None,
    ) -> None:
        namespace.sources = [*namespace.sources, (self.const, values)]


def add_sources(parser: argparse.ArgumentParser) -> None:
    """``-e`` and ``-f``, as ``sources``."""
    parser.set_defaults(sources=[])
    parser.add_argument("-e", "--expression", action=Source, const="text", dest="sources", metavar="EXP",
                        help="send EXP; no separator is added")
    parser.add_argument("-f", "--file", action=Source, const="file", dest="sources", metavar="FILE",
                        help="send the contents of FILE (- is standard input)")


def port(text: str) -> int:
    """A port to connect to."""
    if not text.isdigit() or not 0 < int(text) < 65536:
        raise argparse.ArgumentTypeError(f"{text!r} is no port; give a number from 1 to 65535")
    return int(text)


def source_bytes(kind: str, value: str) -> bytes:
    """What an entry of ``sources`` stands for.  Raises Refused when a file cannot be read."""
    if kind == "text":
        return value.encode("utf-8", "surrogateescape")
    try:
        return sys.stdin.buffer.read() if value == "-" else Path(value).read_bytes()
    except OSError as error:
        raise Refused(f"failed to process file {value}: {error.strerror}", EX_NOINPUT) from error


def complain(program: str, error: Refused) -> int:
    """Print why the program cannot go on; its exit code."""
    print(f"{program}: {error}", file=sys.stderr)
    return error.code


def split(argv: Sequence[str]) -> tuple[list[str], list[str]]:
    """What stands before and behind ``--``."""
    words = list(argv)
    at = words.index("--") if "--" in words else len(words)
    return words[:at], words[at + 1 :]


def why(error: Exception) -> str:
    """Why a host or port cannot be had, in a few words.  A name that no host can have is a UnicodeError."""
    if isinstance(error, TimeoutError):
        return "no answer"
    if isinstance(error, UnicodeError):
        return "this is no name of a host"
    number = getattr(error, "errno", None)
    return os.strerror(number) if number and number > 0 else getattr(error, "strerror", None) or str(error)
