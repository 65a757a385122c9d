"""A Spykee in simulated time: see ``lab``; and what it says of its motion: see ``motions``."""

from __future__ import annotations

from typing import Any, Final

from lab import SpeakingLab
from motions import Kind, Motion, Numbers, OtherMaster
from slot_units import BATTERY, BUS, GAINS, MOBILE, PICTURE, UnitTable

from urbihw.platforms.spykee.robot import Spykee as SpykeeRobot
from urbihw_fakes.console import Console
from urbihw_fakes.spykee.console import commands
from urbihw_fakes.spykee.device import Spykee

NOWHERE = "/nonexistent/calibration.json"
"""No calibration of the user who runs the tests."""


class Lab(SpeakingLab):
    """A robot at the end of a connection."""

    robot: SpykeeRobot

    platform = "spykee"
    url = "pipe://robot?baud=10000000"
    tick = 0.02

    def __init__(self, device: Spykee | None = None, **options: Any) -> None:
        self.device: Spykee = device if device is not None else Spykee()
        super().__init__(**{"calibration": NOWHERE} | options)
        self.end.on_open = self._connected
        self.device.on_close = self.end.hang_up

    def _connected(self) -> None:
        self.end.hang_up()  # what was said on another connection is gone with it
        self.device.connect()

    def unplug(self) -> None:
        """The network is gone."""
        self.end.unplug()
        self.device.disconnect()

    def console(self) -> Console:
        return self.console_of(self.device, self.end, commands(self.device, self.bus_clock.now))


def _body(lab: Lab) -> tuple[Numbers, Numbers]:
    body = lab.device.body
    return tuple(body.speeds), tuple(body.ways)


MOTION = Motion(
    make=Lab.ready,
    look=_body,
    slot="Spykee",
    unplug=Lab.unplug,
    plug=lambda lab: lab.end.replug(),
    standstill=0.5,
    kinds={
        "tracks": Kind("trackL.val = 60 | trackR.val = 60;", 0.2),
        "trajectory": Kind("trackL.val = 0 sin:2s ampli:60,", 0.15, lead=2.3, live=True),
        "at": Kind(
            "trip!;", 0.1, lead=1.5, live=True,
            prepare='if (!Global.hasLocalSlot("trip")) var Global.trip = Event.new|;'
            " at (trip?) loop { trackR.val = 50; sleep(200ms); trackR.val = -50; sleep(400ms) };",
        ),
        "go": Kind("robot.go(2);", 0.15, error=True),
        "turn": Kind("robot.turn(20);", 0.07, error=True),
        "dock": Kind("Spykee.findBase;", 0.1, again="trackL.val = 60;"),
        "remote": Kind("trackL.val = 60", 0.2, remote=True),
    },
    others={
        "search for its dock": OtherMaster(lambda lab: lab.device.body.find_dock(), 0.1),
        "tracks": OtherMaster(lambda lab: lab.device.body.drive(60, 60), 0.2),
    },
)  # fmt: skip


UNITS: Final[UnitTable] = {
    "Spykee": BUS | {"%": "power volume", "m/s": "fullSpeed", "rad/s": "fullTurn"},
    "SpykeeTrack": {"%": "val requested applied", "1": GAINS},  # -100 to 100: chapter "Spykee"
    "SpykeeLed": {"ratio": "val"},
    "SpykeeCamera": PICTURE | {"1": "frames gain wb quality resolution"},
    "SpykeeMicro": {"ms": "duration", "ratio": "gain"},
    "SpykeeSpeaker": {"ms": "remain", "dB": "volume"},
    "SpykeeMp3": {"ratio": "sent"},
    "SpykeeBattery": BATTERY,
    "robot": MOBILE,
}  # fmt: skip
