"""A Segway RMP in simulated time: see ``lab``.  The base is on its USB link, or, in ``CanLab``, on a CAN bus."""

from __future__ import annotations

from typing import Any

from lab import RobotLab

from fakes.can.device import CanDevice, Codec
from fakes.can.records import Records
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
        self.device = CanDevice(self.base, self.codec())
        self.end = PipeEnd(lambda data, at: self._send(self.device.feed(data, at)))
        super().__init__(**options)

    def codec(self) -> Codec:
        """What stands between the base and the pipe."""
        return UsbLink()

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


class CanLab(Lab):
    """A base on a bus."""

    url = "can://pipe/robot"

    def codec(self) -> Codec:
        """See ``Lab``."""
        return Records()


def lab() -> Lab:
    """A base that is open, for the contract of all robots."""
    return Lab.ready()
