"""The driver of a Slamtec RPLIDAR: 360 readings of a whole turn, ``BINS`` of ``rplidar``.

The motor of an A1 turns while the line DTR of its USB adapter is off, that of an A2 or A3 at a duty cycle that is
ordered; each ignores what is meant for the other (Slamtec's application notes; UNCONFIRMED for other adapters).
"""

from __future__ import annotations

import math
import struct
from typing import ClassVar, Final

from urbihw.buses.link import Link, set_dtr
from urbihw.navigation.lasers import rplidar
from urbihw.navigation.lasers.driver import LaserDriver, LaserInfo, LaserScan

BAUD: Final = 115200
"""Bits per second of an A1 and A2; an A3 needs ``?baud=256000``."""
ANSWER_TIMEOUT_S: Final = 0.5
STOP_PAUSE_S: Final = 0.02
"""Seconds to wait after STOP before the next request (at least 1 ms)."""
DUTY_CYCLE: Final = 660
"""Duty cycle of the motor as the maker sets it; 1023 is full."""
FARTHEST: Final = 0xFFFF / 4000
"""m: the largest distance of the protocol.  The maker's A1 measures to 12 m, the A2 to 18 m."""
_RESOLUTION: Final = 2 * math.pi / rplidar.BINS


class RplidarDriver(LaserDriver):
    """Reads the turns of an RPLIDAR."""

    silence: ClassVar[float] = 5.0
    """The motor needs some seconds."""

    def __init__(self) -> None:
        super().__init__()
        self._turns = rplidar.TurnReader()

    def start(self, link: Link) -> LaserInfo:
        self.set_baud(link, BAUD)
        set_dtr(link, on=False)
        link.write(rplidar.request(rplidar.STOP))
        link.clock.sleep_until(link.clock.now() + STOP_PAUSE_S)
        link.discard()
        info = self._ask(link, rplidar.GET_INFO, rplidar.INFO_TYPE).feed(b"")
        health = self._ask(link, rplidar.GET_HEALTH, rplidar.HEALTH_TYPE).feed(b"")
        if info is None or health is None:
            raise self.no_answer(link)
        if health.data[0] == rplidar.HEALTH_ERROR:
            code = int.from_bytes(health.data[1:], "little")
            raise self.refuse(link, f"reports that it is broken (error {code:#x}): switch it off and on")
        link.write(rplidar.request(rplidar.SET_MOTOR_PWM, struct.pack("<H", DUTY_CYCLE)))
        reader = self._ask(link, rplidar.SCAN, rplidar.SCAN_TYPE)
        self._turns = rplidar.TurnReader()
        self._turns.feed(reader.rest)
        model, minor, major, hardware = info.data[:4]
        return LaserInfo(
            2 * math.pi - _RESOLUTION, _RESOLUTION, nearest=0.15, serial=info.data[4:].hex().upper(),
            model=f"RPLIDAR model {model:#04x}, firmware {major}.{minor:02d}, hardware {hardware}",
        )  # fmt: skip

    def stop(self, link: Link) -> None:
        link.write(rplidar.request(rplidar.STOP))
        link.write(rplidar.request(rplidar.SET_MOTOR_PWM, struct.pack("<H", 0)))
        set_dtr(link, on=True)

    def take_bytes(self, data: bytes) -> LaserScan | None:
        nodes, turn = self._turns.feed(data)
        self.damaged = self._turns.damaged
        if nodes:
            self.note_telegram()
        return LaserScan(tuple(turn), FARTHEST) if turn is not None else None

    def _ask(self, link: Link, command: int, kind: int) -> rplidar.ResponseReader:
        """Send a request and wait for its response, which the returned reader has."""
        reader = rplidar.ResponseReader(kind)
        link.write(rplidar.request(command))
        if self.read_until(link, ANSWER_TIMEOUT_S, reader.feed) is None:
            raise self.no_answer(link)
        return reader
