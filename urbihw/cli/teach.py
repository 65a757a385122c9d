"""Teach a robot a motion by hand: its joints are switched off, and what you do with them is recorded.

Hold the robot: a joint without torque gives way.  At the end by q the joints are switched on again, and hold where they
are.  If the program ends in another way, the recording is kept, but the joints stay off.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import select
import sys
import termios
import time
import tty
from collections.abc import Iterator
from importlib.resources import files
from typing import Final, TextIO

from urbihw.cli.lobby_client import LobbyClient
from urbihw.cli.options import CliRefused, complain, number
from urbihw.cli.play import quoted, require_joints
from urbihw.cli.reach import add_server, credentials, server
from urbihw.cli.rows import RowsInPlace
from urbihw.client.values import value_of
from urbihw.exitcodes import EX_OK, EX_RUNTIME, EX_UNAVAILABLE, INTERRUPTED
from urbihw.platforms.teach.store import check_name
from urbihw.settings import one_line
from urbihw.started import as_typed

PERIOD_S: Final = 0.2
"""Seconds between two looks at the joints."""
WAIT_S: Final = 0.02
"""The same until the joints are off."""
_KEYS: Final = {"q": "end", "\x03": "end", "\x04": "end", "\n": "pose", "\r": "pose"}


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw teach``."""
    parser.add_argument("name", type=_motion_name, metavar="NAME", help="name of the motion")
    parser.add_argument("--joints", metavar="JOINT,...", default="", help="only these joints (default: all)")
    parser.add_argument("--rate", type=number(1, 100, "rate in Hz"), default=25.0, metavar="HZ",
                        help="poses in a second (%(default)g)")
    parser.add_argument("--key-poses", action="store_true",
                        help="record only the poses at which Enter is pressed")
    add_server(parser)


def _motion_name(text: str) -> str:
    try:
        check_name(text, "motion")
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return text


def run(options: argparse.Namespace) -> int:
    """Record until q; returns the exit code."""
    try:
        with LobbyClient(server(options), credentials(options), EX_UNAVAILABLE) as link:
            return Lesson(link, options.name, options.key_poses).run(options.joints, options.rate)
    except CliRefused as error:
        return complain("urbihw teach", error)
    except KeyboardInterrupt:
        return INTERRUPTED


class Lesson:
    """A recording, as seen by who moves the joints."""

    def __init__(self, link: LobbyClient, name: str, key_poses: bool) -> None:
        """Raises CliRefused if the server has no robot with joints."""
        self._link = link
        self._name = name
        self._key_poses = key_poses
        self._taken = 0
        self._rows = RowsInPlace()
        link.read_banner()
        require_joints(link)
        link.send(files("urbihw.cli").joinpath("teach.u").read_bytes())

    def run(self, joints: str, rate: float) -> int:
        """Record, show the joints, take key poses; returns the exit code.  Raises CliRefused."""
        chosen = ", ".join(quoted(name.strip()) for name in joints.split(",") if name.strip())
        rate = 0.0 if self._key_poses else rate
        self._link.send(f"teach.begin({quoted(self._name)}, [{chosen}], {rate!r}),\n".encode())
        how = "Enter: take a pose; q: end" if self._key_poses else "q: end"
        begun: float | None = None
        with _single_keys(), self._telling_interruption():
            ended = False
            while not ended:
                state, _, told = self._ask("look").partition("|")
                if state == "over":
                    break
                if state == "wait":
                    time.sleep(WAIT_S)
                    continue
                if begun is None:
                    print(f"Move the joints by hand.  {how}", flush=True)
                    begun = time.monotonic()
                self._show(told, time.monotonic() - begun)
                ended = self._carry_out(_keys(PERIOD_S))
            problem = self._ask("end").partition("|")[2]
        if problem:
            raise CliRefused(problem, EX_RUNTIME)
        print(f"{self._name} is kept: {as_typed('urbihw play')} {self._name}", flush=True)
        return EX_OK

    @contextlib.contextmanager
    def _telling_interruption(self) -> Iterator[None]:
        """Tell in which state Ctrl-C leaves the robot."""
        try:
            yield
        except KeyboardInterrupt:
            print(f"interrupted: {self._name} is kept as far as it was recorded; the joints stay off",
                  file=sys.stderr, flush=True)
            raise

    def _carry_out(self, keys: list[str]) -> bool:
        """Take key poses; returns whether to end."""
        for key in keys:
            if key == "pose" and self._key_poses:
                self._link.ask("robot.keyPose | true")
                self._taken += 1
        return "end" in keys

    def _ask(self, function: str) -> str:
        return str(value_of(self._link.ask(f"teach.{function}")))

    def _show(self, told: str, seconds: float) -> None:
        """Show the time, and each joint with its angle, in place; nothing where standard output is no terminal."""
        if not sys.stdout.isatty():
            return
        lines = [f"{seconds:6.1f} s" + (f", {self._taken} poses" if self._key_poses else "")]
        for part in filter(None, told.split("|")):
            name, _, angle = part.rpartition("=")
            lines.append(f"  {one_line(name):<20} {float(angle):+8.3f} rad")
        self._rows.show(sys.stdout, lines)


@contextlib.contextmanager
def _single_keys(stream: TextIO | None = None) -> Iterator[None]:
    """Keys of a terminal arrive at once, and are not shown."""
    source = sys.stdin if stream is None else stream
    if not source.isatty():
        yield
        return
    modes = termios.tcgetattr(source)
    try:
        tty.setcbreak(source, termios.TCSADRAIN)
        yield
    finally:
        with contextlib.suppress(termios.error):
            termios.tcsetattr(source, termios.TCSADRAIN, modes)


def _keys(seconds: float) -> list[str]:
    """Return what the keys of the next seconds mean; the end of the input ends the recording."""
    ready, _, _ = select.select([sys.stdin], [], [], seconds)
    if not ready:
        return []
    data = os.read(sys.stdin.fileno(), 1024)
    if not data:
        return ["end"]
    return [_KEYS[key] for key in data.decode("ascii", "replace") if key in _KEYS]
