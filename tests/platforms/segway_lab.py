"""A Segway RMP in simulated time: see ``lab``.  The base is on its USB link, or, in ``CanLab``, on a CAN bus."""

from __future__ import annotations

from typing import Any

from lab import SpeakingLab

from fakes.can.device import CanDevice, Codec
from fakes.can.records import Records
from fakes.console import Console
from fakes.segway.console import commands
from fakes.segway.rmp import SegwayRmp
from fakes.segway.usb import UsbLink

BAUD = 460_800


class Lab(SpeakingLab):
    """A base on a pipe."""

    platform = "segway"
    url = f"pipe://robot?baud={BAUD}"
    tick = 0.02

    def __init__(self, base: SegwayRmp | None = None, **options: Any) -> None:
        self.base = base if base is not None else SegwayRmp()
        self.device = CanDevice(self.base, self.codec())
        super().__init__(**options)

    def codec(self) -> Codec:
        """What stands between the base and the pipe."""
        return UsbLink()

    def console(self) -> Console:
        """See ``RobotLab``."""
        return self.console_of(self.device, self.end, commands(self.base))


class CanLab(Lab):
    """A base on a bus."""

    url = "can://pipe/robot"

    def codec(self) -> Codec:
        """See ``Lab``."""
        return Records()


def lab() -> Lab:
    """A base that is open, for the contract of all robots."""
    return Lab.ready()
