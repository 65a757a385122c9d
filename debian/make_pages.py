"""Write the manual pages and the completion of shells for all commands, made from their parsers: make_pages.py FOLDER

Used when the Debian package is built.  The manual pages are written here: argparse-manpage of Debian 12 (1.2.2) leaves
out the description that ``whatis`` shows.  The completion is made by shtab.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Final

import shtab

from urbihw.cli.entry import MODULES
from urbihw.cli.main import full_parser

BASH: Final = "bash-completion/completions"
ZSH: Final = "zsh/vendor-completions"
SECTIONS: Final = {
    "FILES": [
        ("/etc/urbihw/NAME.toml", "settings of the robot NAME, served by urbihw@NAME.service"),
        ("/run/urbihw", "sockets of the services; members of the group urbihw may use them"),
        ("/var/lib/urbihw", "certificate and tokens of the services"),
    ],
    "EXIT STATUS": [
        ("0", "success"),
        ("64", "wrong options, of the urbi commands"),
        ("65", "an error in a program"),
        ("66", "a file is missing"),
        ("69", "nobody answers"),
        ("70", "an internal error"),
        ("78", "a mistake in the set-up; one line on standard error tells the cause and the remedy"),
    ],
}
"""Sections that every page has."""


def parsers() -> Iterator[argparse.ArgumentParser]:
    """The parsers of all commands of this package."""
    for module in MODULES.values():
        yield full_parser() if module == "urbihw.cli.main" else import_module(module).parser()


def commands(parser: argparse.ArgumentParser) -> dict[str, tuple[argparse.ArgumentParser, str]]:
    """The commands below a parser, by name, with the help text of each."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            texts = {row.dest: row.help or "" for row in action._choices_actions}
            return {name: (each, texts.get(name, "")) for name, each in action.choices.items()}
    return {}


def pages(parser: argparse.ArgumentParser, help_: str = "") -> Iterator[tuple[str, str]]:
    """Name and text of the manual page of a parser, and of one page for each of its commands."""
    name = parser.prog.replace(" ", "-")
    below = commands(parser)
    summary = (help_ or parser.description or "").rstrip(".")
    rows = [f'.TH {name.upper()} 1 "" urbihw "User Commands"', ".SH NAME", f"{name} \\- {_roff(summary)}"]
    rows += [".SH SYNOPSIS", *_synopsis(parser), ".SH DESCRIPTION", _roff(parser.description or summary)]
    rows += [".SH OPTIONS", *_options(parser)]
    if " " not in parser.prog and below:
        rows += [".SH COMMANDS"]
        for command, (_, text) in below.items():
            rows += [".TP", f".BR {_roff(f'{name}-{command}')} (1)", _roff(text)]
            yield from pages(below[command][0], text)
    else:
        rows += [row for each, text in below.values() for row in _subcommand(each, text)]
    for title, entries in SECTIONS.items():
        rows += [f".SH {title}"]
        for entry, text in entries:
            rows += [".TP", f".B {_roff(entry)}", _roff(text)]
    yield name, "\n".join(rows) + "\n"


def _subcommand(parser: argparse.ArgumentParser, help_: str) -> Iterator[str]:
    """The section of a command of a command, such as ``urbihw config check``."""
    yield f".SS {_roff(parser.prog)}"
    yield _roff(parser.description or help_)
    yield from _synopsis(parser)
    yield from _options(parser)
    for each, text in commands(parser).values():
        yield from _subcommand(each, text)


def _synopsis(parser: argparse.ArgumentParser) -> Iterator[str]:
    yield from (".PP", ".nf")
    yield from map(_roff, parser.format_usage().removeprefix("usage: ").splitlines())
    yield ".fi"


def _options(parser: argparse.ArgumentParser) -> Iterator[str]:
    """Options and arguments with their texts, as ``--help`` formats them."""
    formatter = parser._get_formatter()
    for action in parser._actions:
        if action.help is argparse.SUPPRESS or isinstance(action, argparse._SubParsersAction):
            continue
        yield ".TP"
        yield f".B {_roff(formatter._format_action_invocation(action))}"
        yield _roff(formatter._expand_help(action) if action.help else "")


def _make_choices_sequences(parser: argparse.ArgumentParser) -> None:
    """Replace choices that are the keys of a dictionary, which shtab of Debian 12 (1.5.5) cannot read."""
    for action in parser._actions:
        if action.choices is not None and not isinstance(action, argparse._SubParsersAction):
            action.choices = tuple(action.choices)
    for each, _ in commands(parser).values():
        _make_choices_sequences(each)


def _roff(text: str) -> str:
    """A text as roff shows it unchanged; an empty one would be read as a paragraph."""
    shown = text.replace("\\", "\\e").replace("-", "\\-").replace("'", "\\(aq").replace("\n", " ")
    return f"\\&{shown}" if not shown or shown[0] in ".'" else shown


def main(folder: Path) -> None:
    """Write all files below a folder, as they are in ``/usr/share``."""
    for below in ("man", BASH, ZSH):
        (folder / below).mkdir(parents=True, exist_ok=True)
    for parser in parsers():
        for name, text in pages(parser):
            (folder / "man" / f"{name}.1").write_text(text, "utf-8")
        _make_choices_sequences(parser)
        (folder / BASH / parser.prog).write_text(shtab.complete(parser, "bash"), "utf-8")
        (folder / ZSH / f"_{parser.prog}").write_text(shtab.complete(parser, "zsh"), "utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
