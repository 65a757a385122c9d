"""Check a settings file, show what is in force, print the JSON schema of the settings."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Iterable
from pathlib import Path

from urbihw.cli import serve
from urbihw.cli.options import EX_CONFIG
from urbihw.daemon.config import Entry, entries, load
from urbihw.daemon.schema import schema
from urbihw.kernel.uobject import BadConfig


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw config``."""
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB", parser_class=type(parser))
    check = verbs.add_parser("check", help="say all that is wrong with a file; nothing is opened")
    check.add_argument("file", type=Path, metavar="FILE")
    check.add_argument("--platform", metavar="NAME", help="the robot, if the file does not say it")
    show = verbs.add_parser("show", help="every setting, its value and where that comes from")
    show.add_argument("--json", action="store_true", help="for programs")
    serve.options(show)
    verbs.add_parser("schema", help="print the JSON schema of a settings file, for editors")


def run(options: argparse.Namespace) -> int:
    """Do what a verb says; 78 if something is wrong with the settings."""
    if options.verb == "schema":
        try:
            _print(json.dumps(schema(), indent=2, ensure_ascii=False))
        except BadConfig as error:
            return _complain([str(error)])
        return 0
    if options.verb == "check":
        loaded = load(options.file, {"platform": options.platform})
    else:
        loaded = load(options.config, serve.flags(options))
    if loaded.mistakes:
        return _complain(each.line for each in loaded.mistakes)
    if options.verb == "check":
        _print(f"{options.file}: nothing wrong")
    elif options.json:
        rows = {each.key: {"value": each.value, "from": each.source} for each in entries(loaded)}
        _print(json.dumps(rows, indent=2, ensure_ascii=False))
    else:
        _print(as_toml(list(entries(loaded))))
    return 0


def _complain(lines: Iterable[str]) -> int:
    for line in lines:
        print(f"urbihw: {line}", file=sys.stderr)
    return EX_CONFIG


def as_toml(rows: list[Entry]) -> str:
    """What is in force, to be read, or to be used as a settings file."""
    settings = [f"{each.key} = {json.dumps(each.value, ensure_ascii=False)}" for each in rows]
    width = max(map(len, settings))
    return "\n".join(
        f"{text:{width}}  # {'; '.join(filter(None, (each.source, each.note)))}"
        for text, each in zip(settings, rows, strict=True)
    )


def _print(text: str) -> None:
    try:
        print(text, flush=True)
    except BrokenPipeError:
        # Who reads it, such as head, has seen enough; at the end Python would try again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
