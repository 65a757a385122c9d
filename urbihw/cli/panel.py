"""Serve the panel for browsers, and manage the browsers that may use it."""

from __future__ import annotations

import argparse
import asyncio
import getpass
import json
import logging
import re
import socket
import sys
from functools import partial
from pathlib import Path
from ssl import SSLContext
from typing import TYPE_CHECKING, Final

from urbihw.cli.options import DEFAULT_PORT, CliRefused, complain, number, port
from urbihw.cli.reach import add_access, control_by_port, credentials, resolve_server
from urbihw.client.where import is_loopback, why
from urbihw.daemon import tls
from urbihw.daemon.state import credential, state_folder
from urbihw.exitcodes import EX_CONFIG, EX_OK, EX_UNAVAILABLE
from urbihw.extras import install_command
from urbihw.started import as_typed

if TYPE_CHECKING:
    from urbihw.web.gateway import Gateway
    from urbihw.web.settings import WebSettings

log = logging.getLogger("urbihw.web")

PANEL_PORT: Final = 54080
VERBS: Final = ("pair", "list", "remove")
_UNSAFE: Final = re.compile(r"[^A-Za-z0-9_.@-]+")


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw panel``."""
    parser.add_argument("words", nargs="*", metavar="WHAT",
                        help="HOST:PORT of the server (this machine, 54000), or: pair, list, remove NAME")
    parser.add_argument("--host", default="127.0.0.1", help="address to listen on (%(default)s); others get TLS")
    parser.add_argument("--port", type=partial(port, least=0), default=PANEL_PORT,
                        help="port for browsers (%(default)s)")
    parser.add_argument("--role", choices=("view", "drive", "full"), default="drive",
                        help="of a browser to pair: look; drive slowly; all, with the language (%(default)s)")
    parser.add_argument("--name", help="name of a browser to pair, for the log and for remove (default: the role)")
    parser.add_argument("--control", type=Path, metavar="PATH",
                        help="control socket of the robot (default: by the port, none for a path)")
    parser.add_argument("--platform", default="", metavar="NAME",
                        help="platform of the robot, for the title (default: by the control socket)")
    parser.add_argument("--fake", action="store_true", help="the robot is simulated: show that")
    parser.add_argument("--child", action="store_true",
                        help="end when standard input ends, for a program that starts this")
    parser.add_argument("--port-file", type=Path, metavar="FILE",
                        help="write the port to FILE when browsers can connect")
    parser.add_argument("--tls-cert", default="", metavar="FILE",
                        help="certificate in PEM (default: that of the daemon)")
    parser.add_argument("--tls-key", default="", metavar="FILE", help="its key, if the certificate has none")
    parser.add_argument("--speed", type=number(0.01, 100, "speed in rad/s"), default=1.0, metavar="RAD/S",
                        help="of joints, for role drive (%(default)s)")
    parser.add_argument("--json", action="store_true", help="the list for programs")
    add_access(parser)


def run(options: argparse.Namespace) -> int:
    """Serve until the user or the daemon ends it, or manage browsers; returns the exit code."""
    words = options.words
    try:
        if words[:1] == ["pair"] and len(words) == 1:
            return _pair(options)
        if words[:1] == ["list"] and len(words) == 1:
            return _list(options.json)
        if words[:1] == ["remove"] and len(words) == 2:
            return _remove(words[1])
        if len(words) > 1 or words and words[0] in VERBS:
            raise CliRefused("give a server, or one of: pair, list, remove NAME", EX_CONFIG)
        return _serve(options)
    except CliRefused as error:
        return complain("urbihw panel", error)
    except ImportError as error:
        if (error.name or "").partition(".")[0] not in ("aiohttp", "segno"):
            raise
        return complain("urbihw panel", CliRefused(f"this needs a package: {install_command('web')}", EX_CONFIG))
    except ValueError as error:  # BadConfig, BadPairing
        return complain("urbihw panel", CliRefused(str(error), EX_CONFIG))


# ---------------------------------------------------------------- serve


def _serve(options: argparse.Namespace) -> int:
    from urbihw.web import serving

    logging.basicConfig(format="urbihw: %(message)s", level=logging.INFO)
    settings = _settings(options)
    try:
        listener = serving.listen(options.host, options.port)
    except (OSError, UnicodeError) as error:
        reason = f"cannot listen on {options.host}:{options.port}: {why(error)}; choose another --port"
        raise CliRefused(reason, EX_UNAVAILABLE) from error
    with listener:
        asyncio.run(serving.serve(settings, listener, _show_address, ends_with_input=options.child))
    return EX_OK


def _settings(options: argparse.Namespace) -> WebSettings:
    """What the options ask for.  Raises CliRefused or BadConfig."""
    from urbihw.cli.console import address
    from urbihw.web.settings import WebLimits, WebSettings

    try:
        host, server_port = address(options.words[0]) if options.words else (None, DEFAULT_PORT)
    except argparse.ArgumentTypeError as error:
        raise CliRefused(str(error), EX_CONFIG) from error
    where = resolve_server(host, server_port, options.tls)
    control = options.control or (None if options.child else control_by_port(host, server_port))
    platform = options.platform
    if not platform and control is not None and control.stem.endswith(f"-{server_port}"):
        platform = control.stem.removesuffix(f"-{server_port}")
    folder = state_folder()
    return WebSettings(
        where, credentials(options), folder, control, platform, options.fake, options.host, options.port,
        options.port_file, _tls_context(options, folder), _UNSAFE.sub("-", getpass.getuser())[:40] or "owner",
        WebLimits(speed=options.speed),
    )  # fmt: skip


def _tls_context(options: argparse.Namespace, folder: Path) -> SSLContext | None:
    """TLS with the certificate of the daemon for an address that other machines reach; None for this machine alone."""
    if _is_own_machine(options.host):
        return None
    passed = credential(tls.CREDENTIAL)
    if passed is not None and not options.tls_cert:
        return tls.context(tls.Files(passed, passed))
    if not options.tls_cert:
        tls.make(folder)
    return tls.context(tls.files(options.tls_cert, options.tls_key, folder))


def _is_own_machine(host: str) -> bool:
    try:
        found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError) as error:
        raise CliRefused(f"{host!r} is no address: {why(error)}; give 127.0.0.1 or 0.0.0.0", EX_CONFIG) from error
    return all(is_loopback(str(row[4][0])) for row in found)


def _show_address(address: str, gateway: Gateway) -> None:
    """Show the address with a code, for the browser of the user who has started this."""
    code = gateway.pairings.make_code(gateway.settings.owner or "owner", "full", gateway.port)
    log.info("panel: open %s/pair?c=%s (good once, for two minutes; later: urbihw panel pair)", address, code)


# ---------------------------------------------------------------- browsers


def _pair(options: argparse.Namespace) -> int:
    import segno

    from urbihw.web.pairing import CODE_LIFETIME_S, Pairings

    folder = state_folder()
    address = _address_in(folder, options.port)
    code = Pairings(folder).make_code(options.name or options.role, options.role, options.port)
    url = f"{address}/pair?c={code}"
    if sys.stdout.isatty():
        segno.make(url, error="m").terminal(compact=True, border=1)
        print(f"role {options.role}, good once, for {CODE_LIFETIME_S:g} s:")
    print(url)
    return EX_OK


def _address_in(folder: Path, number: int) -> str:
    try:
        return (folder / f"panel-{number}").read_text("ascii").strip()
    except FileNotFoundError:
        raise CliRefused(f"there is no panel on port {number}: start it (web = true in the settings, or "
                         f"{as_typed('urbihw panel')}), "
                         "or give its --port") from None
    except OSError as error:
        raise CliRefused(f"cannot read {error.filename}: {error.strerror}; use sudo for a service") from error


def _list(as_json: bool) -> int:
    from urbihw.web.pairing import Pairings

    browsers = Pairings(state_folder(create=False)).browsers()
    if as_json:
        rows = [{"name": each.name, "role": each.role, "port": each.port, "since": str(each.made)} for each in browsers]
        print(json.dumps(rows, indent=2, ensure_ascii=False))
    for each in [] if as_json else browsers:
        print(f"{each.name}  {each.role}  port {each.port}  since {each.made}")
    return EX_OK


def _remove(name: str) -> int:
    from urbihw.web.pairing import Pairings

    count = Pairings(state_folder(create=False)).remove(name)
    print(f"{name}: {count} browser{'s' if count > 1 else ''} removed")
    return EX_OK
