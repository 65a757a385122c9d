"""Show the stages of compiling urbiscript to Python."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from urbihw.exitcodes import EX_CONFIG, EX_SYNTAX
from urbihw.kernel.stages import dump


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw dump``."""
    stage = parser.add_mutually_exclusive_group()
    for name, what in (("tokens", "words and signs"), ("ast", "the syntax tree"), ("python", "the code that is run")):
        stage.add_argument(f"--{name}", dest="stage", action="store_const", const=name, help=what)
    parser.set_defaults(stage="python")
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("-e", "--expression", metavar="CODE", help="show this code")
    source.add_argument("file", nargs="?", type=Path, metavar="FILE", help="show this file")


def run(options: argparse.Namespace) -> int:
    """Print the chosen stage of each statement.  Syntax errors go to standard error and set the exit code 65."""
    text, name = options.expression, None
    if text is None:
        name = str(options.file)
        try:
            text = options.file.read_text("latin-1")
        except OSError as error:
            print(f"urbihw dump: cannot read {name}: {error.strerror}", file=sys.stderr)
            return EX_CONFIG
    shown, problems = dump(text, options.stage, name)
    for statement in shown:
        print(statement)
    for problem in problems:
        print(problem, file=sys.stderr)
    return EX_SYNTAX if any(": syntax error: " in problem for problem in problems) else 0
