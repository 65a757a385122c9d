"""Drive a robot by the keyboard or a gamepad: any base that has ``robot.speed`` (docs/robot-api.md, "Mobile robots").

The server has the dead man (``drive.u``): without an order for ``TIMEOUT_S`` the base stands.  The base also stands
when the program ends in whatever way, when it is suspended, and when the terminal or the gamepad is gone.  A stop by
anybody else holds until all keys are released.
"""

from __future__ import annotations

import argparse
import contextlib
import math
import os
import select
import signal
import sys
import termios
import time
import tty
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, Final

from urbihw.cli.console import address
from urbihw.cli.drivekeys import HELP, LEAST_FULL, MOST_FULL, STAND, KeyOrder, Keys, Wish, change_full
from urbihw.cli.drivepad import Pad
from urbihw.cli.lobby_client import LobbyClient
from urbihw.cli.options import DEFAULT_PORT, CliRefused, complain, number
from urbihw.cli.reach import add_access, credentials, resolve_server
from urbihw.client.driving import PROGRAM, order_text, parse_answer
from urbihw.exitcodes import EX_CONFIG, EX_OK, EX_UNAVAILABLE
from urbihw.settings import one_line

PERIOD_S: Final = 0.1
"""Seconds between two orders."""
TIMEOUT_S: Final = 0.5
"""Seconds without an order after which the server lets the base stand."""
ANSWER_TIMEOUT_S: Final = 5.0
"""Seconds within which a busy server must answer an order; then the program ends.  The base stands long before that."""
SPAN_S: Final = 0.5
"""Seconds over which the measured speeds are averaged."""
STANDING: Final = (0.02, 0.05)
"""Measured speeds, m/s and rad/s, below which the base stands."""
STANDING_TIMEOUT_S: Final = 10.0
"""Seconds for which the end of the program waits until the base stands."""
CHUNK: Final = 4096
_ENDING: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw drive``."""
    parser.add_argument("server", nargs="?", type=address, default=(None, DEFAULT_PORT), metavar="HOST:PORT",
                        help=f"address of the server, or path of its UNIX socket (this machine, {DEFAULT_PORT})")
    add_access(parser)
    parser.add_argument("--speed", type=number(LEAST_FULL, MOST_FULL, "speed in m/s"), metavar="M/S",
                        help="speed at first (default: robot.defaultXSpeed)")
    parser.add_argument("--turn", type=number(LEAST_FULL, MOST_FULL, "speed in rad/s"), metavar="RAD/S",
                        help="yaw rate at first (default: robot.defaultYawSpeed)")
    parser.add_argument("--gamepad", metavar="DEVICE",
                        help="a gamepad, such as /dev/input/event7; needs the extra evdev")


def run(options: argparse.Namespace) -> int:
    """Drive until the user leaves; returns the exit code."""
    try:
        if not sys.stdin.isatty() and options.gamepad is None:
            raise CliRefused("this needs a terminal, or a --gamepad", EX_CONFIG)
        pad = None if options.gamepad is None else Pad.open(options.gamepad)
        host, port = options.server
        who = credentials(options)
        with LobbyClient(resolve_server(host, port, options.tls), who) as link:
            base = RemoteBase(link)
            speeds = options.speed or base.speeds[0], options.turn or base.speeds[1]
            return KeyDriver(base, speeds, pad).run()
    except CliRefused as error:
        return complain("urbihw drive", error)


class RemoteBase:
    """The base at the other end of a connection.

    Attributes:
        name: of the robot; speeds: its default speeds, m/s and rad/s.
        deferred: whether somebody else has stopped it, so that orders wait until the keys are released.
        late: whether the last order came too late to be carried out.
        ordered: the speeds in force; measured: those of the last SPAN_S; position: x, y, theta, in m and rad.
    """

    def __init__(self, link: LobbyClient) -> None:
        """Raises CliRefused if the server has no base."""
        self._link = link
        link.read_banner()
        link.send(PROGRAM.encode())
        found = self._ask("drive.check")
        if found == "none":
            raise CliRefused(f"{link.peer} has no robot that drives: robot is no Interface.Mobile", EX_UNAVAILABLE)
        now, x, yaw, name = found.split("|", 3)
        # The name may be that of a device, and goes to a terminal.
        self.name = one_line(name)
        self._set_time(float(now))
        self.speeds = float(x), float(yaw)
        self.deferred = self.late = False
        self.ordered = self.measured = (0.0, 0.0)
        self.position = (0.0, 0.0, 0.0)
        self._track: deque[tuple[float, float, float, float]] = deque()

    def order(self, x: float, yaw: float) -> None:
        """Order speeds, m/s and rad/s to the left.  Raises CliRefused: the order failed, or the server is gone."""
        made = self._server_ahead + time.monotonic()
        driven = parse_answer(self._ask(order_text(x, yaw, TIMEOUT_S, made)))
        self.deferred, self.late = driven.deferred, driven.late
        self.ordered = driven.x, driven.yaw
        self.position = driven.position
        self._set_time(driven.time)
        self._measure(driven.time)

    def _set_time(self, now: float) -> None:
        """Take the server's time from its answer.  It is older by the way of the answer, so that orders never seem
        younger than they are."""
        self._server_ahead = now - time.monotonic()

    @property
    def stands(self) -> bool:
        """Whether nothing is ordered or measured."""
        slow = all(abs(speed) < most for speed, most in zip(self.measured, STANDING, strict=True))
        return slow and self.ordered == (0.0, 0.0)

    def _ask(self, expression: str) -> str:
        return self._link.ask(expression, ANSWER_TIMEOUT_S).shown.strip('"')

    def _measure(self, now: float) -> None:
        x, y, theta = self.position
        self._track.append((now, x, y, theta))
        while now - self._track[0][0] > SPAN_S and len(self._track) > 2:
            self._track.popleft()
        then, from_x, from_y, from_theta = self._track[0]
        past = now - then
        if past > 0:
            forward = (x - from_x) * math.cos(theta) + (y - from_y) * math.sin(theta)
            self.measured = forward / past, math.remainder(theta - from_theta, math.tau) / past

    @property
    def ended(self) -> bool:
        """Whether the connection has ended."""
        return self._link.ended


class KeyDriver:
    """Reads keys and gamepad, sends orders, shows speeds."""

    def __init__(self, base: RemoteBase, speeds: tuple[float, float], pad: Pad | None) -> None:
        self._base = base
        self._full, self._full_turn = speeds
        self._pad = pad
        self._keys = Keys()
        self._terminal = sys.stdin.fileno() if sys.stdin.isatty() else None
        self._modes: list[Any] = []
        self._ending = ""
        self._suspending = False
        self._problem = ""

    def run(self) -> int:
        """Drive until the end; returns the exit code."""
        print(f"{self._base.name}: drive it\n{HELP}", flush=True)
        with self._signals(), contextlib.ExitStack() as terminal:
            terminal.enter_context(self._cbreak())
            try:
                while not self._ending:
                    self._wait()
                    self._order(self._wish())
                    self._show()
                    if self._suspending:
                        self._suspend()
            finally:
                with contextlib.suppress(CliRefused):
                    self._base.order(0.0, 0.0)
            reason, self._ending = self._ending, ""
            outcome = self._bring_to_rest()
        with contextlib.suppress(OSError):
            print(f"\n{outcome}: {reason}", flush=True)
        return EX_OK

    def _bring_to_rest(self) -> str:
        """Wait until the base stands, or the user leaves once more; returns what became of it, in words."""
        base = self._base
        end = time.monotonic() + STANDING_TIMEOUT_S
        try:
            while not base.stands and not self._ending and time.monotonic() < end:
                self._wait()
                base.order(0.0, 0.0)
                self._show()
        except CliRefused as error:
            return f"{base.name} was told to stand ({error})"
        if base.stands:
            return f"{base.name} stands"
        if base.ordered != (0.0, 0.0):
            return f"{base.name} is driven by somebody else"
        speeds = f"{base.measured[0]:+.2f} m/s {base.measured[1]:+.2f} rad/s"
        return f"{base.name} was told to stand, and still moves: {speeds}"

    # ---------------------------------------------------------------- what the user wants

    def _wait(self) -> None:
        """Wait for keys or the stick, at most until the next order is due."""
        sources: list[Any] = [one for one in (self._terminal, self._pad) if one is not None]
        ready, _, _ = select.select(sources, [], [], PERIOD_S)
        if self._terminal in ready:
            self._read_keys()
        if self._pad is not None and self._pad in ready:
            try:
                self._pad.read()
            except OSError:
                self._ending = "the gamepad is gone"

    def _read_keys(self) -> None:
        assert self._terminal is not None
        try:
            data = os.read(self._terminal, CHUNK)
        except OSError:
            data = b""
        if not data:
            self._ending = "the terminal is gone"
        for order in self._keys.feed(data.decode("ascii", "replace"), time.monotonic()):
            if order is KeyOrder.LEAVE:
                self._ending = "left"
            elif order is KeyOrder.SUSPEND:
                self._suspending = True
            else:
                self._full, self._full_turn = (change_full(full, order) for full in (self._full, self._full_turn))

    def _wish(self) -> Wish:
        if self._ending or self._suspending:
            return STAND
        wish = STAND if self._pad is None else self._pad.wish()
        return self._keys.wish(time.monotonic()) if wish == STAND else wish

    def _order(self, wish: Wish) -> None:
        """Order the wished speeds; a refusal by the robot is shown, the loss of the server ends the program."""
        try:
            self._base.order(wish.forward * self._full, wish.left * self._full_turn)
        except CliRefused as error:
            if self._base.ended or "did not answer" in str(error):
                raise
            self._problem = one_line(str(error))
            self._keys.release()
        else:
            if wish != STAND:
                self._problem = ""

    def _show(self) -> None:
        base = self._base
        text = (
            f"ordered {base.ordered[0]:+.2f} m/s {base.ordered[1]:+.2f} rad/s"
            f"  measured {base.measured[0]:+.2f} {base.measured[1]:+.2f}"
            f"  full {self._full:.2f} {self._full_turn:.2f}"
        )
        if base.deferred:
            text = "somebody else stopped or moved the robot: release the keys  " + text
        elif base.late:
            text = f"the order came more than {TIMEOUT_S} s late: the base stands  " + text
        if self._problem:
            text = f"{self._problem}  {text}"
        with contextlib.suppress(OSError):
            width = os.get_terminal_size(self._terminal).columns if self._terminal is not None else 200
            print(f"\r\x1b[K{text[: width - 1]}", end="", flush=True)

    # ---------------------------------------------------------------- terminal and signals

    @contextlib.contextmanager
    def _cbreak(self) -> Iterator[None]:
        """Keys arrive at once and are not echoed, Ctrl-C and Ctrl-Z as well."""
        if self._terminal is None:
            yield
            return
        self._modes = termios.tcgetattr(self._terminal)
        self._take_keys()
        try:
            yield
        finally:
            self._restore()

    def _take_keys(self) -> None:
        if self._terminal is not None:
            tty.setcbreak(self._terminal, termios.TCSADRAIN)
            modes = termios.tcgetattr(self._terminal)
            modes[3] &= ~termios.ISIG
            termios.tcsetattr(self._terminal, termios.TCSADRAIN, modes)

    def _restore(self) -> None:
        # A terminal that is gone cannot be restored.
        with contextlib.suppress(termios.error):
            if self._terminal is not None:
                termios.tcsetattr(self._terminal, termios.TCSADRAIN, self._modes)

    @contextlib.contextmanager
    def _signals(self) -> Iterator[None]:
        def end(number: int, _: object) -> None:
            self._ending = signal.Signals(number).name

        def suspend(*_: object) -> None:
            self._suspending = True

        handlers: dict[signal.Signals, Callable[..., None]] = {**dict.fromkeys(_ENDING, end), signal.SIGTSTP: suspend}
        before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
        try:
            yield
        finally:
            for each, handler in before.items():
                signal.signal(each, handler)

    def _suspend(self) -> None:
        """The base has the order to stand; stop this process when it does, until the shell continues it."""
        outcome = self._bring_to_rest()
        self._suspending = False
        if self._ending:
            return
        self._keys.release()
        if self._pad is not None:
            self._pad.release()
        self._restore()
        handler = signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        print(f"\n{outcome}", flush=True)
        os.kill(os.getpid(), signal.SIGTSTP)
        signal.signal(signal.SIGTSTP, handler)
        self._take_keys()
