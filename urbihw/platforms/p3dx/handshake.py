"""Getting in touch with a controller: what it may still be doing, its speed, SYNC0 to SYNC2, OPEN, its configuration.

A controller that was connected before goes on with its last motion as soon as it hears any packet (its watchdog only
holds it), so the first word is always STOP.  If it then sends SIPs, a connection is still open: it is closed first.
Sources: ARIA (``ArRobot.cpp``), Player (``p2os.cc``), the ARCOS chapter of the Pioneer 3 manual.
"""

from __future__ import annotations

import errno
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from urbihw.buses.errors import BadFrame, Unavailable
from urbihw.buses.link import Link, has_line_speed, set_line_speed
from urbihw.platforms.p3dx import packets, sip
from urbihw.platforms.p3dx.commands import encode
from urbihw.platforms.p3dx.options import HOST_BAUDS
from urbihw.platforms.p3dx.protocol import Framer, command

BAUDS: Final = (9600, 38400, 19200, 115200, 57600)
"""Speeds to try, most likely first (Player)."""
ANSWER, QUICK_ANSWER = 1.0, 0.4
"""Seconds to wait for a SYNC: where there is one speed to try, and where there are several."""
TRIES: Final = 2
OPEN_SIGNS: Final = 0.15
"""Seconds in which a connection that is open shows itself by a SIP."""
SETTLE: Final = 0.1
CONFIG_PATIENCE: Final = 0.4
BAUD_PAUSE, BAUD_PATIENCE = 0.01, 0.9

LOST_COUNT: Final = 255
_SIPS: Final = (sip.STOPPED, sip.MOVING)


@dataclass(frozen=True, slots=True)
class RobotInfo:
    """A robot as found: its names from SYNC2, its configuration (0 and "" where old firmware tells nothing)."""

    name: str
    kind: str
    subclass: str
    config: Mapping[str, int | str]


class Greeting:
    """One attempt to connect over an open link."""

    def __init__(self, link: Link, framer: Framer) -> None:
        self._link = link
        self._framer = framer
        self._wait = ANSWER

    def greet(self, host_baud: int = 0) -> RobotInfo:
        """Connect.  Raises Unavailable when nobody answers as a Pioneer does, LinkGone."""
        link = self._link
        several = has_line_speed(link) and "baud" not in link.url.options
        bauds = BAUDS if several else (link.baud,)
        self._wait = QUICK_ANSWER if several else ANSWER
        for baud in bauds:
            set_line_speed(link, baud)
            names = self._try_at_speed()
            if names is not None:
                return self._open(names, host_baud)
        speeds = ", ".join(map(str, bauds))
        at = f" at {speeds} baud" if has_line_speed(link) else ""
        raise Unavailable(
            errno.ETIMEDOUT,
            f"no Pioneer answers on {link.url.text}{at}: is it switched on, is the cable plugged in, is this its port?",
        )

    def _try_at_speed(self) -> tuple[str, str, str] | None:
        self._send("STOP")
        if self._hears_sip(OPEN_SIGNS):
            self._close()
        for _ in range(TRIES):
            self._framer.reset()
            names = self._synchronize()
            if names is not None:
                return names
            # Silent, out of step or still open: it may listen after a CLOSE.
            self._close()
        return None

    def _synchronize(self) -> tuple[str, str, str] | None:
        body = b""
        for number in range(3):
            self._link.write(command(number))
            body = self._answer(number)
            if not body:
                return None
        try:
            return packets.parse_names(body[1:])
        except BadFrame:
            return None

    def _answer(self, number: int) -> bytes:
        """The echo of a SYNC; b"" when there is none, or the controller is out of step, or a SIP comes instead."""
        deadline = self._link.clock.now() + self._wait
        while (bodies := self._read(deadline)) is not None:
            for body in bodies:
                if body[0] == number:
                    return body
                if body[0] == LOST_COUNT or body[0] in _SIPS:
                    return b""
        return b""

    def _open(self, names: tuple[str, str, str], host_baud: int) -> RobotInfo:
        clock = self._link.clock
        clock.sleep_until(clock.now() + SETTLE)
        self._send("OPEN")
        self._send("STOP")
        config = self._configuration()
        if host_baud and config["auto_baud"] == 2:
            self._faster(host_baud)
        return RobotInfo(*names, config)

    def _configuration(self) -> dict[str, int | str]:
        for _ in range(TRIES):
            self._send("CONFIG")
            deadline = self._link.clock.now() + CONFIG_PATIENCE
            while (bodies := self._read(deadline)) is not None:
                for body in bodies:
                    if body[0] == packets.CONFIG:
                        return packets.parse_config(body[1:])
        return packets.parse_config(b"")

    def _faster(self, baud: int) -> None:
        """Both sides go over to another speed; back to the old one if nothing is heard at it."""
        link, old = self._link, self._link.baud
        if not has_line_speed(link) or baud == old:
            return
        link.write(encode("HOSTBAUD", HOST_BAUDS[baud]))
        for speed in (baud, old):
            link.clock.sleep_until(link.clock.now() + BAUD_PAUSE)
            set_line_speed(link, speed)
            self._framer.reset()
            link.clock.sleep_until(link.clock.now() + BAUD_PAUSE)
            self._send("PULSE")
            if self._hears_sip(BAUD_PATIENCE):
                return

    def _hears_sip(self, seconds: float) -> bool:
        deadline = self._link.clock.now() + seconds
        while (bodies := self._read(deadline)) is not None:
            if any(body[0] in _SIPS for body in bodies):
                return True
        return False

    def _close(self) -> None:
        self._send("CLOSE")
        clock = self._link.clock
        clock.sleep_until(clock.now() + SETTLE)
        self._link.discard()
        self._framer.reset()

    def _read(self, deadline: float) -> list[bytes] | None:
        """Bodies that have come by the deadline; None when it passes without a byte."""
        data = self._link.read(4096, deadline)
        if not data and self._link.clock.now() >= deadline:
            return None
        return self._framer.feed(data)

    def _send(self, name: str) -> None:
        self._link.write(encode(name))
