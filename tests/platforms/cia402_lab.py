"""Drives after CiA 402 in simulated time: see ``lab``."""

from __future__ import annotations

from typing import Any

from lab import SpeakingLab

from fakes.can.device import CanDevice
from fakes.can.records import Records
from fakes.cia402.node import Drive
from fakes.cia402.start import words_of
from fakes.console import Console


class Lab(SpeakingLab):
    """A drive with the number 5 on a pipe."""

    platform = "cia402"
    url = "can://pipe/robot"

    def __init__(self, drive: Drive | None = None, **options: Any) -> None:
        self.drive = drive if drive is not None else Drive(5)
        self.device = CanDevice(self.drive, Records())
        super().__init__(**options)

    def console(self) -> Console:
        """See ``RobotLab``."""
        return self.console_of(self.device, self.end, words_of(self.drive))


def lab() -> Lab:
    """A drive that is open, for the contract of all robots."""
    return Lab.ready()
