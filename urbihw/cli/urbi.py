"""``urbi``: an urbiscript server, with the options of the manual (section 18.3).

Exit codes: 0 after ``shutdown``, or 65 or 70 if a syntax error or an uncaught run-time error was in what ``-e`` and
``-f`` gave; 64 a bad option, 66 a file is missing, 69 cannot listen, 78 a module cannot be loaded or a
port file cannot be written.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Final, NoReturn

from urbihw.cli import logs
from urbihw.cli.options import (
    CliRefused,
    GetoptParser,
    add_sources,
    complain,
    number,
    port,
    source_bytes,
    split,
    whole,
)
from urbihw.cli.server import UrbiSettings, serve
from urbihw.exitcodes import INTERRUPTED
from urbihw.kernel.server.bounds import HOLD_LIMIT
from urbihw.kernel.server.exit_watchdog import leave

ROOT: Final = Path(__file__).resolve().parents[1]
DAY_S: Final = 86_400
"""Maximum of ``--hold-limit``, in seconds."""
MAX_KB: Final = 1 << 30


def parser() -> GetoptParser:
    """The options of ``urbi``."""
    usage = "%(prog)s [OPTION...] [SCRIPT [ARGUMENT...]] [-- ARGUMENT...]"
    made = GetoptParser("urbi", "Run an urbiscript server.", usage, script=True)
    made.add_argument("--print-root", action="store_true", help="print the folder of urbihw (or URBI_ROOT) and exit")
    tuning = made.add_argument_group("tuning")
    tuning.add_argument("-d", "--debug", type=logs.level, metavar="LEVEL",
                        help=f"what to log: {', '.join(logs.LEVELS)} (GD_LEVEL, or LOG)")
    tuning.add_argument("-v", "--verbose", action="store_const", const="TRACE", dest="debug", help="--debug=TRACE")
    tuning.add_argument("-F", "--fast", action="store_true", help="simulated time: sleeping costs nothing")
    tuning.add_argument("-s", "--stack-size", type=whole(1, MAX_KB, "size in kilobytes"), metavar="KB",
                        help="accepted and ignored: stacks grow")
    tuning.add_argument("-q", "--quiet", "--no-banner", action="store_true", help="no banner and no hints for clients")
    network = made.add_argument_group("networking")
    network.add_argument("-H", "--host", default="127.0.0.1", help="address to listen on (%(default)s)")
    network.add_argument("-P", "--port", type=partial(port, least=-1), default=-1,
                         help="listen on PORT (0: any free one; -1: none)")
    network.add_argument("--hold-limit", type=number(0, DAY_S, "number of seconds"), default=HOLD_LIMIT,
                         metavar="SECONDS",
                         help="processor time for a job to block all others, with a port (%(default)g; 0: no limit)")
    network.add_argument("-w", "--port-file", type=Path, metavar="FILE", help="write the port to FILE when ready")
    add_sources(made)
    made.add_argument("-i", "--interactive", action="store_true", help="read and run standard input")
    made.add_argument("-m", "--module", action="append", dest="modules", default=[], metavar="MODULE",
                      help="load a Python module of UObjects (see URBI_UOBJECT_PATH)")
    made.add_argument("script", nargs="?", help="a file to run; what follows is System.arguments")
    made.add_argument("arguments", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)
    return made


def main(argv: Sequence[str] | None = None) -> int:
    """The command; returns the exit code."""
    return run(sys.argv[1:], "urbi", (), leave) if argv is None else run(argv, "urbi", ())


def run(
    argv: Sequence[str], program: str, modules: Sequence[str], ended: Callable[[int], None] = lambda code: None
) -> int:
    """A server with modules of UObjects; the options are those of ``urbi``, whatever the program is called.

    ``ended`` is called with the exit code of a server that has ended, and may exit the process.
    """
    own, behind = split(argv)
    made = parser()
    made.prog = program
    options = made.parse(own)
    if options.print_root:
        print(os.environ.get("URBI_ROOT") or ROOT)
        return 0
    logs.set_up(program, options.debug, os.environ)
    sources = list(options.sources)
    if options.script is not None:
        sources.append(("file", options.script))
    try:
        settings = UrbiSettings(
            program=sys.argv[0],
            texts=tuple(_text(kind, value) for kind, value in sources),
            # manual: without any input, the console is interactive
            interactive=options.interactive or (not sources and options.port < 0),
            host=options.host,
            port=options.port,
            port_file=options.port_file,
            quiet=options.quiet,
            fast=options.fast,
            hold_limit=options.hold_limit,
            modules=(*modules, *options.modules),
            arguments=(*options.arguments, *behind),
        )
        code = asyncio.run(serve(settings, ended))
    except CliRefused as error:
        return complain(program, error)
    except KeyboardInterrupt:  # before the server has its own handler
        return INTERRUPTED
    return _start_anew() if code is None else code


def _start_anew() -> NoReturn:
    """``reboot``: execute the same program with the same arguments in this process."""
    sys.stdout.flush()
    sys.stderr.flush()
    os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])


def _text(kind: str, value: str) -> bytes:
    """A text to feed to the console; errors in a file contain its name."""
    data = source_bytes(kind, value)
    if kind == "text":
        return data
    if data.startswith(b"#!"):
        data = b"//" + data
    name = value.replace("\\", "\\\\").replace('"', '\\"')
    return f'//#push 1 "{name}"\n'.encode() + data + b"\n//#pop\n"


if __name__ == "__main__":
    sys.exit(main())
