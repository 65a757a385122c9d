"""Drives after CiA 402 in simulated time: see ``lab``."""

from __future__ import annotations

from typing import Any

from lab import RobotLab

from fakes.can.device import CanDevice
from fakes.can.records import Records
from fakes.cia402.node import Drive
from urbihw.buses.link import Context
from urbihw.buses.pipe import PipeEnd


class Lab(RobotLab):
    """A drive with the number 5 on a pipe."""

    platform = "cia402"
    url = "can://pipe/robot"

    def __init__(self, drive: Drive | None = None, **options: Any) -> None:
        self.drive = drive if drive is not None else Drive(5)
        self.device = CanDevice(self.drive, Records())
        self.end = PipeEnd(lambda data, at: self._send(self.device.feed(data, at)))
        super().__init__(**options)

    def context(self) -> Context:
        """See ``RobotLab``."""
        return Context(self.bus_clock, {"robot": self.end})

    def step(self) -> None:
        """See ``RobotLab``; the drive speaks unasked."""
        answers = self.device.tick(self.bus_clock.now())
        if self.end.plugged:
            self._send(answers)
        super().step()

    def _send(self, answers: list[Any]) -> None:
        for answer in answers:
            self.end.send(answer.data, answer.at)


def lab() -> Lab:
    """A drive that is open, for the contract of all robots."""
    return Lab.ready()
