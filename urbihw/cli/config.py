"""Check a settings file, show the settings in force, print the JSON schema of the settings."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Iterable
from pathlib import Path

from urbihw.cli import serve
from urbihw.daemon.config import SettingInForce, entries, load, unusable_files
from urbihw.daemon.schema import schema
from urbihw.exitcodes import EX_CONFIG
from urbihw.kernel.uobject import BadConfig


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw config``."""
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB", parser_class=type(parser))
    check = verbs.add_parser("check", help="report all mistakes of a file; no port is opened")
    check.add_argument("--config", type=Path, metavar="FILE", help="the same as FILE, as for serve")
    check.add_argument("--platform", metavar="NAME", help="the robot, if the file does not name it")
    check.add_argument("--json", action="store_true", help="the mistakes as JSON, for programs")
    show = verbs.add_parser("show", help="show every setting, its value and its source")
    show.add_argument("--json", action="store_true", help="as JSON, for programs")
    serve.options(show)
    for verb, what in ((check, "the settings file"), (show, "the same as --config FILE")):
        verb.add_argument("file", nargs="?", type=Path, metavar="FILE", help=what)
    verbs.add_parser("schema", help="print the JSON schema of a settings file, for editors")


def run(options: argparse.Namespace) -> int:
    """Run the verb of the command; 78 if there are mistakes in the settings."""
    if options.verb == "schema":
        try:
            _print(json.dumps(schema(), indent=2, ensure_ascii=False))
        except BadConfig as error:
            return _complain([str(error)])
        return 0
    if options.file is not None and options.config is not None:
        return _complain(["give one file: FILE, or --config FILE"])
    file = options.file or options.config
    if options.verb == "check":
        if file is None:
            return _complain(["which file? Give FILE, or --config FILE"])
        loaded = load(file, {"platform": options.platform})
    else:
        loaded = load(file, serve.flags(options))
    mistakes = [*loaded.mistakes, *(unusable_files(loaded) if options.verb == "check" else ())]
    if options.verb == "check" and options.json:
        rows = [{"setting": each.setting, "text": each.line} for each in mistakes]
        _print(json.dumps({"file": str(file), "mistakes": rows}, indent=2, ensure_ascii=False))
        return EX_CONFIG if rows else 0
    if mistakes:
        return _complain(each.line for each in mistakes)
    if options.verb == "check":
        _print(f"{file}: nothing wrong")
    elif options.json:
        settings = {each.key: {"value": each.value, "from": each.source} for each in entries(loaded)}
        _print(json.dumps(settings, indent=2, ensure_ascii=False))
    else:
        _print(as_toml(list(entries(loaded))))
    return 0


def _complain(lines: Iterable[str]) -> int:
    for line in lines:
        print(f"urbihw: {line}", file=sys.stderr)
    return EX_CONFIG


def as_toml(rows: list[SettingInForce]) -> str:
    """The settings in force as TOML, which is also a valid settings file."""
    settings = [
        f"# {each.key}" if each.value is None else f"{each.key} = {json.dumps(each.value, ensure_ascii=False)}"
        for each in rows
    ]
    width = max(map(len, settings))
    return "\n".join(
        f"{text:{width}}  # {'; '.join(filter(None, (each.source, each.note)))}"
        for text, each in zip(settings, rows, strict=True)
    )


def _print(text: str) -> None:
    try:
        print(text, flush=True)
    except BrokenPipeError:
        # The reader of the pipe, such as head, has ended; Python would try to flush again at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
