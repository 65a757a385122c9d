"""The address and credentials of a server, from the options of the programs that connect to one."""

from __future__ import annotations

import argparse
import socket
import sys
from pathlib import Path
from typing import Final

from urbihw.cli.options import DEFAULT_PORT, CliRefused, port
from urbihw.client.credentials import Credentials
from urbihw.client.where import DEFAULT_HOST, Where, is_loopback, where_is
from urbihw.daemon.runtime import client_sockets, control_sockets
from urbihw.exitcodes import EX_CONFIG, EX_NOINPUT

PROBE_TIMEOUT_S: Final = 0.5
"""Maximum seconds for a daemon on this machine to accept a connection."""


def add_server(parser: argparse.ArgumentParser) -> None:
    """The options of the programs that connect to a server: ``server`` and ``credentials`` read them."""
    parser.add_argument("-H", "--host", help="address to connect to, or path of a UNIX socket (this machine)")
    parser.add_argument("-P", "--port", type=port, default=DEFAULT_PORT, help=f"port to connect to ({DEFAULT_PORT})")
    parser.add_argument("--port-file", type=Path, metavar="FILE", help="connect to the port contained in FILE")
    add_access(parser)


def add_access(parser: argparse._ActionsContainer) -> None:
    """Add the options for TLS, tokens and certificates; ``credentials`` reads them."""
    parser.add_argument("--tls", action=argparse.BooleanOptionalAction,
                        help="use TLS and a token (the default for other machines), or do not")
    parser.add_argument("--token-file", type=Path, metavar="FILE",
                        help="read the token from FILE (default: URBIHW_TOKEN, ~/.config/urbihw/tokens)")
    parser.add_argument("--trust", action="store_true", help="trust the certificate of an unknown server")


def server(options: argparse.Namespace) -> Where:
    """The server that ``add_server``'s options name.  Raises CliRefused for a port file without a port."""
    number = options.port if options.port_file is None else _port_in(options.port_file)
    return resolve_server(options.host, number, options.tls)


def resolve_server(host: str | None, number: int, tls: bool | None) -> Where:
    """The address of a server.  Without a host it is the server of this machine: the UNIX socket of the daemon with
    this port, if it exists and is accessible, else TCP."""
    if host is None and not tls:
        for path in _sockets(number):
            if accepts(path):
                return Where(str(path), number)
    return where_is(DEFAULT_HOST if host is None else host, number, tls)


def control_by_port(host: str | None, number: int) -> Path | None:
    """The control socket of the robot that the server at a port of this machine serves; None if it is not known.

    ``host`` is None for this machine.  A path tells no port: the robot at the usual port is another one, which is not
    ours to stop.  Nor may a child of a daemon ask: the daemon gives it the socket of its robot if there is one.
    """
    if host is not None and not is_loopback(host):
        return None
    return next((path for path in control_sockets() if path.stem.endswith(f"-{number}")), None)


def only_port() -> int | None:
    """The port of the daemon of this machine; None if there is none, or several."""
    names = {path.stem.partition("-")[2] for path in _sockets("*") if accepts(path)}
    return int(names.pop()) if len(names) == 1 else None


def credentials(options: argparse.Namespace) -> Credentials:
    """The credentials from the options of ``add_access``.  At a terminal, the user is asked for missing ones."""
    asks = sys.stdin.isatty() and sys.stderr.isatty()
    return Credentials(options.token_file, options.trust, _confirmed if asks else None, _secret if asks else None)


def _port_in(file: Path) -> int:
    try:
        text = file.read_text("ascii", "replace").strip()
    except OSError as error:
        raise CliRefused(f"cannot read the port file {file}: {error.strerror}", EX_NOINPUT) from error
    try:
        return port(text)
    except argparse.ArgumentTypeError:
        raise CliRefused(f"{file} has no port in it; is the server listening (--port)?", EX_CONFIG) from None


def _sockets(number: int | str) -> list[Path]:
    try:
        return client_sockets(number)
    except ValueError:  # BadConfig for a folder without permission: use TCP.
        return []


def accepts(path: Path) -> bool:
    """Whether a daemon listens at a socket; a killed daemon leaves its socket behind."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        probe.settimeout(PROBE_TIMEOUT_S)
        try:
            probe.connect(str(path))
        except OSError:
            return False
    return True


def _confirmed(question: str) -> bool:
    print(f"{question} (yes/no) ", end="", file=sys.stderr, flush=True)
    return sys.stdin.readline().strip().lower() == "yes"


def _secret(question: str) -> str:
    from getpass import getpass

    try:
        return getpass(question, sys.stderr)
    except EOFError:
        return ""
