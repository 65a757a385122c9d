"""A TriBot in simulated time, behind the framing of Bluetooth: see ``lab``."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from lab import RobotLab

from fakes.console import Console
from fakes.nxt.console import commands
from fakes.nxt.stream import NxtDevice
from fakes.nxt.tribot import TriBot
from urbihw.buses.link import Context
from urbihw.buses.pipe import PipeEnd


class Lab(RobotLab):
    """A TriBot on a pipe, 1.5 m before the wall unless ``tribot`` stands elsewhere."""

    platform = "nxt"

    def __init__(self, tribot: TriBot | None = None, **options: Any) -> None:
        self.tribot = tribot if tribot is not None else TriBot()
        self.brick = self.tribot.brick
        self.device = NxtDevice(self.tribot)
        self.end = PipeEnd(self._receive)
        super().__init__(**options)

    def context(self) -> Context:
        """See ``RobotLab``."""
        return Context(self.bus_clock, {"robot": self.end})

    def step(self) -> None:
        """See ``RobotLab``; the robot lives also while nobody asks it."""
        super().step()
        self.device.tick(self.bus_clock.now())

    def console(self) -> Console:
        """See ``RobotLab``."""
        clock, plug = self.bus_clock.now, self.end.replug
        cable: Any = SimpleNamespace(device=self.device, clock=clock, unplug=self.unplug, plug=plug)
        return Console(cable, commands(self.device, clock))

    def unplug(self) -> None:
        """The link is gone."""
        self.device.hang_up()
        self.end.unplug()

    def powers(self) -> list[int]:
        """What the motors A, B and C were told."""
        return [motor.power for motor in self.brick.motors]

    def _receive(self, data: bytes, at: float) -> None:
        self.device.tick(at)
        for answer in self.device.feed(data, at):
            self.end.send(answer.data, answer.at)
