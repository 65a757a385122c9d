"""Play motions or poses of a robot that is served, or list them.

The motion ends with this program: after Ctrl-C, or if it is killed, the joints hold.
"""

from __future__ import annotations

import argparse
import math
import sys
from typing import Final

from urbihw.cli.lobby_client import LobbyClient
from urbihw.cli.options import CliRefused, complain, number
from urbihw.cli.reach import add_server, credentials, server
from urbihw.client.session import Message
from urbihw.exitcodes import EX_OK, EX_UNAVAILABLE, INTERRUPTED
from urbihw.settings import one_line
from urbihw.started import as_typed

LONGEST_S: Final = 1e6
"""Seconds for which a motion may last."""
_HAS_JOINTS: Final = 'Global.hasLocalSlot("robot") && robot.hasSlot("motionPlayer")'


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw play``."""
    parser.add_argument("names", nargs="*", metavar="NAME",
                        help="motions to play one after the other, such as wave or bow.mtn:Bow; without: list them")
    parser.add_argument("--pose", action="store_true", help="the names are those of poses")
    parser.add_argument("--speed", type=number(0.01, 10, "factor"), default=1.0, metavar="FACTOR",
                        help="so many times as fast (%(default)g)")
    parser.add_argument("--loop", type=_count, default=1, metavar="COUNT", help="so many times, 0 for ever (1)")
    add_server(parser)


def run(options: argparse.Namespace) -> int:
    """Play, and wait until the end; returns the exit code."""
    try:
        with LobbyClient(server(options), credentials(options), EX_UNAVAILABLE) as link:
            link.read_banner()
            require_joints(link)
            if not options.names:
                told = [_names(link, kind) for kind in ("motions", "poses")]
                nothing = f"no motion and no pose is kept yet: {as_typed('urbihw teach')} records them"
                print("; ".join(filter(None, told)) or nothing)
                return EX_OK
            how = link.ask(statement(options), LONGEST_S, show_warning).shown.strip('"')
            if how != "finished":
                raise CliRefused(
                    f"{' '.join(options.names)} was ended by others: by a stop, or by a write to its joints",
                    EX_UNAVAILABLE,
                )
    except CliRefused as error:
        return complain("urbihw play", error)
    except KeyboardInterrupt:
        return INTERRUPTED
    return EX_OK


def _names(link: LobbyClient, kind: str) -> str:
    """The names of the motions or poses that the robot has, as `motions: bow wave`; "" for none."""
    names = one_line(link.ask(f'robot.{kind}.join(" ")').shown.strip('"'))
    return names and f"{kind}: {names}"


def statement(options: argparse.Namespace) -> str:
    """Return the statement that plays what the options name; its value is how that ended."""
    speed = repr(options.speed)
    if options.pose:
        # Each one is played only if the one before it was not ended by others.
        run = f'robot.motionPlayer.run("pose", "pose", %s, {speed}, 1).how'
        poses = " | ".join(f'if (how == "finished") how = {run % quoted(name)}' for name in options.names)
        return f'{{ var how = "finished" | {poses} | how }}'
    count = options.loop if math.isfinite(options.loop) else "inf"
    names = ", ".join(map(quoted, options.names))
    return f"robot.motionPlayer.run(\"play\", \"motion\", [{names}], {speed}, {count}).how"


def show_warning(line: Message) -> None:
    """Show a warning of the server, such as that a joint is off."""
    if line.is_error:
        print(f"urbihw play: {one_line(line.text.removeprefix('!!! '))}", file=sys.stderr)


def require_joints(link: LobbyClient) -> None:
    """Raise CliRefused if the server has no robot with joints."""
    if link.ask(_HAS_JOINTS).shown != "true":
        raise CliRefused(f"{link.peer} has no robot with joints", EX_UNAVAILABLE)


def quoted(text: str) -> str:
    """Return a text as a String of urbiscript."""
    return '"' + one_line(text).replace("\\", "\\\\").replace('"', '\\"') + '"'


def _count(text: str) -> float:
    """Return a number of repetitions; 0 is for ever.  Raises ArgumentTypeError."""
    if not text.isascii() or not text.isdigit() or int(text) > 1_000_000:
        raise argparse.ArgumentTypeError(f"expected 1, 2 ... or 0 for ever, given {text!r}")
    return int(text) or math.inf
