"""Talk to a server: history, editing, colours, completion, help.

Reading order: ``session`` (the connection, and how it comes back), ``assistant`` and ``assistant.u`` (what the console
asks for itself, on a connection of its own), ``subject`` (what stands before the cursor), ``lexer`` and ``colours``
(how urbiscript and answers look), ``completion``, ``help``, ``screen`` (the prompt), ``plain`` (the console in a pipe).

``plain`` and all that it needs work without prompt_toolkit and Pygments (extra ``console``).
"""

from __future__ import annotations

import argparse
import asyncio
import os
import sys
from importlib.util import find_spec

from urbihw.cli.link import Link
from urbihw.cli.options import DEFAULT_PORT, EX_CONFIG, INTERRUPTED, Refused, complain
from urbihw.cli.reach import add_access, credentials, reached

NEEDED = ("prompt_toolkit", "pygments")


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw console``."""
    parser.add_argument("server", nargs="?", type=address, default=(None, DEFAULT_PORT), metavar="HOST:PORT",
                        help=f"where the server listens, or the path of its UNIX socket (this machine, {DEFAULT_PORT})")
    add_access(parser)
    parser.add_argument("--plain", action="store_true",
                        help="no editing and no colours, as when input or output is no terminal, or a dumb one")


def address(text: str) -> tuple[str | None, int]:
    """``HOST``, ``HOST:PORT``, ``:PORT``, ``[IPv6]:PORT``, a port alone, or a path with a ``/``; no host is None."""
    if "/" in text:
        return text, DEFAULT_PORT
    if text.isdigit():
        host, port = "", text
    elif text.startswith("["):
        host, _, port = text[1:].partition("]")
        port = port.removeprefix(":")
    else:
        host, _, port = text.partition(":")
    if port and not (port.isdigit() and 0 < int(port) < 65536) or ":" in host and not text.startswith("["):
        raise argparse.ArgumentTypeError(f"{text!r} is no address; give HOST:PORT, such as robot:54000")
    return host or None, int(port) if port else DEFAULT_PORT


def run(options: argparse.Namespace) -> int:
    """Talk until Ctrl-D, or until the input has ended and what it said is run."""
    try:
        host, port = options.server
        where, who = reached(host, port, options.tls), credentials(options)
        if options.plain or not (sys.stdin.isatty() and sys.stdout.isatty()) or os.environ.get("TERM") == "dumb":
            from urbihw.cli.console import plain

            return plain.talk(where, who, sys.stdin.buffer)
        missing = [name for name in NEEDED if find_spec(name) is None]
        if missing:
            raise Refused(f"this needs {' and '.join(missing)}: pip install 'urbihw[console]'; or use --plain",
                          EX_CONFIG)
        from urbihw.cli.console import screen

        if where.tls:
            Link(where, who).close()  # What is to be asked, it asks; afterwards the prompt has the terminal.
        return asyncio.run(screen.talk(where, who, os.environ))
    except Refused as error:
        return complain("urbihw console", error)
    except KeyboardInterrupt:
        return INTERRUPTED
