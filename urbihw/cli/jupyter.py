"""Make notebooks in urbiscript known to Jupyter.

It writes the kernel specification into this environment of Python, or for this user. It needs the extra `jupyter`.
"""

from __future__ import annotations

import argparse
import re
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from urbihw.cli.options import CliRefused, complain
from urbihw.exitcodes import EX_CONFIG, EX_OK
from urbihw.extras import install_command
from urbihw.neighbours.notebook.spec import install

_NAME: Final = re.compile(r"[a-z0-9._-]+")
_USERS: Final = Path(".local", "share", "jupyter")


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw jupyter``."""
    parser.add_argument("address", nargs="?", default="127.0.0.1:54000", metavar="HOST:PORT",
                        help="server that runs the cells (%(default)s)")
    parser.add_argument("--name", default="urbiscript", help="name of the kernel (%(default)s)")
    parser.add_argument("--title", default="urbiscript", help="what the menu of Jupyter shows (%(default)s)")
    parser.add_argument("--user", action="store_true", help="write it for this user, not into this environment")


def run(options: argparse.Namespace) -> int:
    """Write the specification; returns the exit code."""
    try:
        if not _NAME.fullmatch(options.name):
            raise CliRefused(f"{options.name}: a name has small letters, digits, . _ and -", EX_CONFIG)
        if find_spec("ipykernel") is None:
            raise CliRefused(f"it needs the extra jupyter: {install_command('jupyter')}", EX_CONFIG)
        folder = Path.home() / _USERS if options.user else Path(sys.prefix) / "share" / "jupyter"
        try:
            file = install(folder, options.name, options.title, options.address)
        except OSError as error:
            raise CliRefused(f"{error.filename}: {error.strerror}", EX_CONFIG) from error
    except CliRefused as error:
        return complain("urbihw jupyter", error)
    print(f"{file}: Jupyter offers it as {options.title}")
    return EX_OK
