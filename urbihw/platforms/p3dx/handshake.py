"""The connection to a controller: stop of an old motion, line speed, SYNC0 to SYNC2, OPEN, configuration.

A controller that was connected before continues its last motion as soon as it receives any packet (its watchdog only
suspends it), so the first packet is always STOP.  If it then sends SIPs, a connection is still open and closed first.
Sources: ARIA (``ArRobot.cpp``), Player (``p2os.cc``), the ARCOS chapter of the Pioneer 3 manual.
"""

from __future__ import annotations

import errno
from collections.abc import Mapping
from typing import Final

from urbihw.buses.errors import BadFrame, Unavailable
from urbihw.buses.link import Link, has_line_speed, set_line_speed
from urbihw.frozen import frozen
from urbihw.platforms.p3dx import packets, sip
from urbihw.platforms.p3dx.commands import encode
from urbihw.platforms.p3dx.options import HOST_BAUDS
from urbihw.platforms.p3dx.protocol import ArcosFramer, command

BAUDS: Final = (9600, 38400, 19200, 115200, 57600)
"""Speeds to try, most likely first (Player)."""
SYNC_TIMEOUT_S, QUICK_SYNC_TIMEOUT_S = 1.0, 0.4
"""Seconds to wait for the echo of a SYNC: with one line speed to try, and with several."""
TRIES: Final = 2
OPEN_CHECK_S: Final = 0.15
"""Seconds within which an open connection is recognised by a SIP."""
SETTLE_S: Final = 0.1
CONFIG_TIMEOUT_S: Final = 0.4
BAUD_PAUSE_S, BAUD_TIMEOUT_S = 0.01, 0.9

LOST_COUNT: Final = 255
_SIPS: Final = (sip.STOPPED, sip.MOVING)


@frozen
class ArcosRobotInfo:
    """The description of a robot: names from SYNC2, configuration (0 and "" where old firmware reports nothing)."""

    name: str
    kind: str
    subclass: str
    config: Mapping[str, int | str]


class ArcosHandshake:
    """One attempt to connect over an open link."""

    def __init__(self, link: Link, framer: ArcosFramer) -> None:
        self._link = link
        self._framer = framer
        self._sync_timeout = SYNC_TIMEOUT_S

    def connect(self, host_baud: int = 0) -> ArcosRobotInfo:
        """Connect.  Raises Unavailable when no Pioneer answers, LinkGone."""
        link = self._link
        several = has_line_speed(link) and "baud" not in link.url.options
        bauds = BAUDS if several else (link.baud,)
        self._sync_timeout = QUICK_SYNC_TIMEOUT_S if several else SYNC_TIMEOUT_S
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
        if self._receives_sip(OPEN_CHECK_S):
            self._close()
        for _ in range(TRIES):
            self._framer.reset()
            names = self._synchronize()
            if names is not None:
                return names
            # No answer, wrong state, or still open: it may accept a SYNC0 after a CLOSE.
            self._close()
        return None

    def _synchronize(self) -> tuple[str, str, str] | None:
        body = b""
        for number in range(3):
            self._link.write(command(number))
            body = self._read_sync_echo(number)
            if not body:
                return None
        try:
            return packets.parse_names(body[1:])
        except BadFrame:
            return None

    def _read_sync_echo(self, number: int) -> bytes:
        """Return the echo of a SYNC; b"" without one, or when the controller reports a wrong count or sends a SIP."""
        deadline = self._link.clock.now() + self._sync_timeout
        while (bodies := self._read(deadline)) is not None:
            for body in bodies:
                if body[0] == number:
                    return body
                if body[0] == LOST_COUNT or body[0] in _SIPS:
                    return b""
        return b""

    def _open(self, names: tuple[str, str, str], host_baud: int) -> ArcosRobotInfo:
        clock = self._link.clock
        clock.sleep_until(clock.now() + SETTLE_S)
        self._send("OPEN")
        self._send("STOP")
        config = self._configuration()
        if host_baud and config["auto_baud"] == 2:
            self._change_baud(host_baud)
        return ArcosRobotInfo(*names, config)

    def _configuration(self) -> dict[str, int | str]:
        for _ in range(TRIES):
            self._send("CONFIG")
            deadline = self._link.clock.now() + CONFIG_TIMEOUT_S
            while (bodies := self._read(deadline)) is not None:
                for body in bodies:
                    if body[0] == packets.CONFIG:
                        return packets.parse_config(body[1:])
        return packets.parse_config(b"")

    def _change_baud(self, baud: int) -> None:
        """Change the line speed of both sides; back to the old one if no SIP arrives at the new speed."""
        link, old = self._link, self._link.baud
        if not has_line_speed(link) or baud == old:
            return
        link.write(encode("HOSTBAUD", HOST_BAUDS[baud]))
        for speed in (baud, old):
            link.clock.sleep_until(link.clock.now() + BAUD_PAUSE_S)
            set_line_speed(link, speed)
            self._framer.reset()
            link.clock.sleep_until(link.clock.now() + BAUD_PAUSE_S)
            self._send("PULSE")
            if self._receives_sip(BAUD_TIMEOUT_S):
                return

    def _receives_sip(self, seconds: float) -> bool:
        deadline = self._link.clock.now() + seconds
        while (bodies := self._read(deadline)) is not None:
            if any(body[0] in _SIPS for body in bodies):
                return True
        return False

    def _close(self) -> None:
        self._send("CLOSE")
        clock = self._link.clock
        clock.sleep_until(clock.now() + SETTLE_S)
        self._link.discard()
        self._framer.reset()

    def _read(self, deadline: float) -> list[bytes] | None:
        """Return the packet bodies received by the deadline; None when it passes without a byte."""
        data = self._link.read(4096, deadline)
        if not data and self._link.clock.now() >= deadline:
            return None
        return self._framer.feed(data)

    def _send(self, name: str) -> None:
        self._link.write(encode(name))
