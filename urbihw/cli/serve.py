"""Serve a robot as urbiscript objects on a TCP port."""

from __future__ import annotations

import argparse
import asyncio
import logging
import sys
from pathlib import Path

from urbihw.daemon.service import Service, ServiceSettings, StartError

EX_OK, EX_CONFIG = 0, 78


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw serve``."""
    parser.add_argument("--platform", required=True, metavar="NAME", help="which robot (see: urbihw platforms)")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--url", default="", help="its bus, such as /dev/ttyUSB0?baud=1000000 or socket://host:port")
    where.add_argument("--fake", action="store_true", help="serve the same robot in software")
    parser.add_argument("--host", help="address to listen on (127.0.0.1)")
    parser.add_argument("--port", type=port, help="port to listen on, 0 for a free one (54000)")
    parser.add_argument("--port-file", type=Path, metavar="FILE", help="write the port to FILE when clients may come")
    parser.add_argument("--quiet", action="store_true", help="no banner for clients")
    parser.add_argument("--config", type=Path, metavar="FILE", help="settings, as TOML")


def port(text: str) -> int:
    """A port number."""
    if not text.isdigit() or int(text) > 65535:
        raise argparse.ArgumentTypeError(f"{text!r} is no port; give a number from 0 to 65535")
    return int(text)


def settings(options: argparse.Namespace) -> ServiceSettings:
    """What the options ask for."""
    return ServiceSettings(
        platform=options.platform,
        url=options.url,
        fake=options.fake,
        host=options.host or "127.0.0.1",
        port=54000 if options.port is None else options.port,
        port_file=options.port_file,
        quiet=options.quiet,
    )


def run(options: argparse.Namespace) -> int:
    """Serve until told to stop."""
    logging.basicConfig(format="urbihw: %(message)s", level=logging.INFO, stream=sys.stderr)

    async def serve() -> int:
        return await Service(settings(options), lambda: settings(options)).run()

    try:
        return asyncio.run(serve())
    except StartError as error:
        print(f"urbihw: {error}", file=sys.stderr)
        return EX_CONFIG
