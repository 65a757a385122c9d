"""Manage access from the network: make, list and remove tokens, and show the fingerprint of the certificate."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from urbihw.daemon import tls
from urbihw.daemon.access import Tokens
from urbihw.daemon.config import Config, configure
from urbihw.daemon.state import state_folder
from urbihw.exitcodes import EX_CONFIG
from urbihw.kernel.uobject import BadConfig


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw access``."""
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB")
    add = verbs.add_parser("add", help="make a token for a user, and print it once")
    add.add_argument("name", metavar="NAME", help="its owner, such as alice@laptop, for the log and for remove")
    listed = verbs.add_parser("list", help="list the owners of tokens, with dates")
    listed.add_argument("--json", action="store_true", help="for programs")
    remove = verbs.add_parser("remove", help="remove a token; its owner is disconnected")
    remove.add_argument("name", metavar="NAME", help="name given to add")
    fingerprint = verbs.add_parser("fingerprint", help="print that of the certificate, which clients show")
    fingerprint.add_argument("--config", type=Path, metavar="FILE", help="settings file, if it has a tls_cert")


def run(options: argparse.Namespace) -> int:
    """Run the verb of the command; returns the exit code."""
    try:
        folder = state_folder(create=options.verb in ("add", "fingerprint"))
        tokens = Tokens(folder)
        if options.verb == "add":
            _add(tokens, options.name, folder)
        elif options.verb == "list" and options.json:
            rows = [{"name": entry.name, "since": str(entry.made)} for entry in tokens.entries()]
            print(json.dumps(rows, indent=2, ensure_ascii=False))
        elif options.verb == "list":
            for entry in tokens.entries():
                print(f"{entry.name}  since {entry.made}")
        elif options.verb == "remove":
            tokens.remove(options.name)
        else:
            print(_fingerprint(Config() if options.config is None else configure(options.config), folder))
    except BadConfig as error:
        print(f"urbihw: {error}", file=sys.stderr)
        return EX_CONFIG
    return 0


def _add(tokens: Tokens, name: str, folder: Path) -> None:
    """Add a token.  Standard output gets the token alone, for scripts."""
    token = tokens.add(name)
    print(f"The token of {name}, shown this once (its hash is kept in {folder}):",
          file=sys.stderr, flush=True)
    print(token)


def _fingerprint(config: Config, folder: Path) -> str:
    if not config.tls_cert:
        tls.make(folder)
    return tls.fingerprint(tls.files(config.tls_cert, config.tls_key, folder))
