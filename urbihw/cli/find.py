"""Find the robots of the network that announce themselves (setting announce)."""

from __future__ import annotations

import argparse
import json
import time
from typing import Any, Final

from urbihw.cli import control
from urbihw.cli.options import number
from urbihw.cli.reports import clean
from urbihw.exitcodes import EX_CONFIG, EX_OK, EX_UNAVAILABLE
from urbihw.extras import install_command

SERVICE_TYPE: Final = "_urbi._tcp.local."
SEARCH_S: Final = 3.0
"""Seconds of a search: an answer that was sent just before may be held back for a second (RFC 6762)."""
_TEXT_BYTES: Final = 255
"""Longest entry of a TXT record (RFC 6763)."""


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw find``."""
    parser.add_argument("--seconds", type=number(0.1, 60, "number of seconds"), default=SEARCH_S, metavar="S",
                        help="how long to search (3)")
    parser.add_argument("--json", action="store_true", help="for programs")


def run(options: argparse.Namespace) -> int:
    """Print a line for each robot: its name, address, port, platform; 0 if there is one."""
    try:
        found = find(options.seconds)
    except ImportError:
        return control.complain(f"this needs a package: {install_command('find')}; or: avahi-browse -rt _urbi._tcp",
                                EX_CONFIG)
    except OSError as error:
        return control.complain(f"the network cannot be searched: {error.strerror or error}", EX_UNAVAILABLE)
    if options.json:
        print(json.dumps(found, indent=2))
    for row in [] if options.json else found:
        about = ", ".join(str(row[key]) for key in ("platform", "version") if row[key])
        print(clean(f"{row['name']}: {' '.join(row['addresses']) or row['host']} port {row['port']}: {about}"))
    if not found:
        return control.complain("no robot announces itself; is announce set, and is it the same network?",
                                EX_UNAVAILABLE)
    return EX_OK


def find(seconds: float) -> list[dict[str, Any]]:
    """The robots that answer within some seconds, by name.  Raises ImportError without zeroconf, OSError."""
    from zeroconf import IPVersion, ServiceBrowser, ServiceListener, Zeroconf

    names: dict[str, None] = {}

    class NameCollector(ServiceListener):
        """Collects the names of the servers that answer."""

        def add_service(self, zc: Zeroconf, type_: str, name: str) -> None:
            names[name] = None

        def update_service(self, zc: Zeroconf, type_: str, name: str) -> None:
            names[name] = None

        def remove_service(self, zc: Zeroconf, type_: str, name: str) -> None:
            names.pop(name, None)

    found: list[dict[str, Any]] = []
    with Zeroconf(ip_version=IPVersion.V4Only) as network:
        browser = ServiceBrowser(network, SERVICE_TYPE, NameCollector())
        time.sleep(seconds)
        browser.cancel()
        for name in sorted(names):
            info = network.get_service_info(SERVICE_TYPE, name, timeout=1000)
            if info is None:
                continue
            properties = {key: _text(value) for key, value in info.properties.items()}
            found.append({
                "name": name.removesuffix(f".{SERVICE_TYPE}"),
                "addresses": info.parsed_addresses(),
                "host": info.server or "",
                "port": info.port,
                "platform": properties.get(b"platform", ""),
                "version": properties.get(b"version", ""),
            })  # fmt: skip
    return found


def _text(value: bytes | None) -> str:
    return (value or b"")[:_TEXT_BYTES].decode("utf-8", "replace")
