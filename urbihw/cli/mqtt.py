"""Tell a broker of MQTT, such as that of Home Assistant, of a robot.

By default the home only sees the robot, and can stop it. It needs the extra `mqtt`.
"""

from __future__ import annotations

import argparse
import asyncio
import logging
import re
import sys
from pathlib import Path
from typing import Final

from urbihw.cli.options import CliRefused, complain, number, port
from urbihw.cli.reach import add_server, credentials, server
from urbihw.exitcodes import EX_CONFIG, EX_NOINPUT, INTERRUPTED
from urbihw.extras import install_command
from urbihw.neighbours.home.settings import BridgeSettings
from urbihw.neighbours.orders import OrderSettings

_NAME: Final = re.compile(r"[A-Za-z0-9_]{1,64}")


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw mqtt``."""
    parser.add_argument("broker", metavar="HOST", help="the broker")
    add_server(parser)
    parser.add_argument("--broker-port", type=port, default=1883, metavar="PORT", help="its port (%(default)s)")
    parser.add_argument("--broker-tls", action="store_true", help="use TLS to the broker")
    parser.add_argument("--user", default="", help="user at the broker")
    parser.add_argument("--password-file", type=Path, metavar="FILE", help="file with the password of that user")
    parser.add_argument("--name", default="", help="name in topics, letters, digits and _ (default: that of the robot)")
    parser.add_argument("--allow", default="", metavar="JOINTS", help="joints, behind commas, that the home may move")
    parser.add_argument("--speed", type=number(0.001, 1000, "speed"), default=0.5, metavar="SPEED",
                        help="greatest speed of these, in their unit a second (%(default)s)")
    parser.add_argument("--rate", type=number(0.1, 50, "rate"), default=1.0, metavar="HZ",
                        help="states a second at most (%(default)s)")


def run(options: argparse.Namespace) -> int:
    """Serve until Ctrl-C; returns the exit code."""
    try:
        settings = _settings(options)
        try:
            from urbihw.neighbours.home.bridge import HomeBridge
        except ImportError:
            raise CliRefused(f"it needs the extra mqtt: {install_command('mqtt')}", EX_CONFIG) from None
        logging.basicConfig(level=logging.INFO, format="urbihw mqtt: %(message)s", stream=sys.stderr)
        asyncio.run(HomeBridge(settings).run())
    except (CliRefused, ValueError) as error:
        return complain("urbihw mqtt", error if isinstance(error, CliRefused) else CliRefused(str(error), EX_CONFIG))
    except KeyboardInterrupt:
        pass
    return INTERRUPTED


def _settings(options: argparse.Namespace) -> BridgeSettings:
    """The settings from the options.  Raises CliRefused."""
    if options.name and not _NAME.fullmatch(options.name):
        raise CliRefused(f"{options.name}: a name has letters, digits and _", EX_CONFIG)
    password = ""
    if options.password_file is not None:
        try:
            password = options.password_file.read_text("utf-8").strip()
        except (OSError, UnicodeDecodeError) as error:
            raise CliRefused(f"cannot read {options.password_file}: {error}", EX_NOINPUT) from error
    joints = tuple(name.strip() for name in options.allow.split(",") if name.strip())
    orders = OrderSettings(server(options), credentials(options), "home")
    return BridgeSettings(
        orders, options.broker, options.broker_port, options.broker_tls, options.user, password, options.name,
        joints=joints, rate=options.rate, speed=options.speed,
    )  # fmt: skip
