"""A Segway RMP in simulated time: see ``lab``.  The base is on its USB link, which a pipe can carry."""

from __future__ import annotations

from typing import Any

from lab import RobotLab

from fakes.can.device import CanDevice
from fakes.segway.rmp import SegwayRmp
from fakes.segway.usb import UsbLink
from urbihw.buses.link import Context
from urbihw.buses.pipe import PipeEnd

BAUD = 460_800


class Lab(RobotLab):
    """A base on a pipe."""

    platform = "segway"
    url = f"pipe://robot?baud={BAUD}"
    tick = 0.02

    def __init__(self, base: SegwayRmp | None = None, **options: Any) -> None:
        self.base = base if base is not None else SegwayRmp()
        self.device = CanDevice(self.base, UsbLink())
        self.end = PipeEnd(lambda data, at: self._send(self.device.feed(data, at)))
        super().__init__(**options)

    def context(self) -> Context:
        """See ``RobotLab``."""
        return Context(self.bus_clock, {"robot": self.end})

    def step(self) -> None:
        """See ``RobotLab``; the base speaks unasked."""
        answers = self.device.tick(self.bus_clock.now())
        if self.end.plugged:
            self._send(answers)
        super().step()

    def _send(self, answers: list[Any]) -> None:
        for answer in answers:
            self.end.send(answer.data, answer.at)


def lab() -> Lab:
    """A base that is open, for the contract of all robots."""
    return Lab.ready()
