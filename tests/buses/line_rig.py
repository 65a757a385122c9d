"""A servo kit on a line with a speed, in simulated time."""

from __future__ import annotations

from collections.abc import Iterable

from urbihw import buses
from urbihw.buses.clock import BusSimClock
from urbihw.buses.link import Context, Link
from urbihw.buses.pipe import PipeEnd
from urbihw.buses.servos.line import ServoLine
from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.bioloid.console import commands
from urbihw_fakes.console import Command
from urbihw_fakes.dynamixel.ax12 import Ax12
from urbihw_fakes.dynamixel.bus import ServoBus
from urbihw_fakes.dynamixel.unit import Unit
from urbihw_fakes.dynamixel.xseries import XSeries


class LineRig:
    """A kit on a line with a speed, in simulated time: its units hear only their own speed.

    `delay`: seconds for which the adapter keeps each answer back.
    """

    def __init__(
        self, units: Iterable[Unit], baud: int = 1_000_000, kit: ServoBus | None = None, delay: float = 0.0
    ) -> None:
        self._delay = delay
        self.kit = Bioloid(units=units) if kit is None else kit
        self.clock = BusSimClock(100.0)
        self.end = PipeEnd(self.receive)
        self.sent: list[bytes] = []
        self._context = Context(self.clock, {"robot": self.end})
        self.line = ServoLine("pipe://robot", self._open_at, baud, has_speed=True)

    def _open_at(self, baud: int) -> Link:
        self.kit.baud = baud
        self.kit.pace(baud)
        self.end.hang_up()
        return buses.open_link(f"pipe://robot?baud={baud}", self._context)

    def receive(self, data: bytes, at: float) -> None:
        """Pass what the host has sent to the kit, and its answers back."""
        self.sent.append(data)
        self.kit.tick(at)
        for answer in self.kit.feed(data, at):
            self.end.send(answer.data, answer.at + self._delay)

    def console(self) -> dict[str, Command]:
        """The words of the kit's console."""
        assert isinstance(self.kit, Bioloid)
        return commands(self.kit, self.clock.now)

    def instructions(self) -> set[int]:
        """The instruction codes that were sent."""
        return {data[7] if data.startswith(b"\xff\xff\xfd\x00") else data[4] for data in self.sent}


def ax(number: int, baud: int = 1_000_000, **registers: int) -> Ax12:
    unit = Ax12(number)
    unit.set_baud(baud)
    for name, value in registers.items():
        unit.registers.put(name, value)
    return unit


def xl(number: int, baud: int = 57_600) -> XSeries:
    unit = XSeries("XL430-W250", number)
    unit.set_baud(baud)
    return unit
