"""A Bioloid in simulated time: see ``lab``."""

from __future__ import annotations

from typing import Any

from lab import RobotLab

from fakes.bioloid import Bioloid as Kit
from fakes.bioloid_console import commands
from fakes.console import Console
from urbihw.buses.link import Context
from urbihw.buses.pipe import PipeEnd

BAUD = 1_000_000


class Lab(RobotLab):
    """A Bioloid on a pipe."""

    platform = "bioloid"
    url = f"pipe://robot?baud={BAUD}"

    def __init__(self, kit: Kit | None = None, **options: Any) -> None:
        self.kit = kit if kit is not None else Kit(baud=BAUD)
        for unit in self.kit:
            unit.registers.put("return_delay", 0)
        self.kit.pace(BAUD)
        self.end = PipeEnd(self._receive)
        super().__init__(**options)

    def context(self) -> Context:
        """See ``RobotLab``."""
        return Context(self.bus_clock, {"robot": self.end})

    def console(self) -> Console:
        """See ``RobotLab``."""
        return self.console_of(self.kit, self.end, commands(self.kit, self.bus_clock.now))

    def register(self, unit: int, name: str) -> int:
        """A register of the fake, by the fake's own name."""
        return self.kit[unit].registers.get(name)

    def _receive(self, data: bytes, at: float) -> None:
        self.kit.tick(at)
        for answer in self.kit.feed(data, at):
            self.end.send(answer.data, answer.at)


def lab() -> Lab:
    """For the contract of all platforms."""
    return Lab.ready()
