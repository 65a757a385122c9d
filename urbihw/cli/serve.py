"""Serve a robot as urbiscript objects on a TCP port."""

from __future__ import annotations

import argparse
import asyncio
import logging
import os
import sys
from functools import partial
from pathlib import Path
from typing import Any

from urbihw.cli.logs import LineFormatter, make_handler
from urbihw.cli.options import port
from urbihw.daemon.config import Config, Loaded, load_faultless
from urbihw.daemon.journal import journal_handler
from urbihw.daemon.notify import ServiceNotifier
from urbihw.daemon.service import DaemonService, StartError
from urbihw.exitcodes import EX_CONFIG
from urbihw.kernel.server.exit_watchdog import leave
from urbihw.kernel.uobject import BadConfig
from urbihw.settings import escape_unprintable
from urbihw.started import as_typed


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw serve``."""
    parser.add_argument("--platform", metavar="NAME", help="which robot (see: urbihw platforms)")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--url", help="url of its bus, such as /dev/ttyUSB0?baud=1000000 or socket://host:port")
    where.add_argument("--fake", action="store_true", default=None, help="serve a simulated robot of the same kind")
    parser.add_argument("--world", help="with --fake: the simulated world of its body, such as room")
    parser.add_argument("--host", help="address to listen on (127.0.0.1); clients of other machines need a token")
    parser.add_argument("--port", type=partial(port, least=0), help="port to listen on, 0 for a free one (54000)")
    parser.add_argument("--port-file", metavar="FILE", help="write the port to FILE when clients can connect")
    parser.add_argument("--file", action="append", dest="load", metavar="FILE",
                        help="run a file of urbiscript at the start, as the setting load; may be given several times")
    parser.add_argument("--quiet", action="store_true", default=None, help="no banner for clients")
    parser.add_argument("--web", action="store_true", default=None, help="serve the panel for browsers")
    parser.add_argument("--panel-port", type=port, help="port for browsers (54080)")
    parser.add_argument("--fleet", metavar="NAME", help="join this fleet of robots")
    parser.add_argument("--name", help="name of the robot in its fleet (that of the host)")
    parser.add_argument("--ros", action="store_const", const="auto", help="serve the robot as a node of ROS")
    parser.add_argument("--config", type=Path, metavar="FILE", help="settings file (TOML)")


def flags(options: argparse.Namespace) -> dict[str, Any]:
    """The settings that have a flag, by their names; None for those not given."""
    return {name: getattr(options, name) for name in Config.rules() if hasattr(options, name)}


def load_settings(options: argparse.Namespace) -> Loaded:
    """The settings that the options ask for.  Raises BadConfig."""
    made = load_faultless(options.config, flags(options))
    if not made.config.platform:
        lists = f"({as_typed('urbihw platforms')} lists them)"
        if options.config:
            raise BadConfig(f"{options.config}: no robot is named: add platform = \"NAME\" {lists}")
        raise BadConfig(f"which robot? Give --platform NAME {lists}")
    return made


def run(options: argparse.Namespace) -> int:
    """Serve until the process is told to stop."""
    try:
        settings = load_settings(options).config
        logging.basicConfig(handlers=[_log_handler()], level=settings.log_level.upper())
        with ServiceNotifier.from_environment(os.environ) as notifier:
            return asyncio.run(_serve(DaemonService(settings, notifier, lambda: load_settings(options))))
    except (StartError, BadConfig) as error:
        print("urbihw: " + "\n".join(map(escape_unprintable, str(error).split("\n"))), file=sys.stderr)
        return EX_CONFIG


def _log_handler() -> logging.Handler:
    """The journal where standard error is the journal, else standard error."""
    handler = journal_handler(os.environ)
    if handler is None:
        return make_handler("urbihw")
    handler.setFormatter(LineFormatter())
    return handler


async def _serve(service: DaemonService) -> int:
    code = await service.run()
    leave(code)  # before the service is freed, which takes long
