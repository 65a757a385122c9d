"""The object ``cia402``: the bus, with its drives as they are found."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

from urbihw.buses import messages as m
from urbihw.kernel.uobject import Opened, Origin, RobotSettings, event, function
from urbihw.platforms.base import WiredRobot
from urbihw.platforms.cia402 import words
from urbihw.platforms.cia402.servo import ServoDrive
from urbihw.platforms.devicelog import LOST, DeviceEvent
from urbihw.platforms.hooks import LimitedDevice
from urbihw.platforms.teach.motions import TaughtMotions
from urbihw.platforms.words import counted

BACK_OFF: Final = DeviceEvent("{who} is back, and off", "{count} drives are back, and off: {who}", "back")
TREE: Final = "cia402.u"
"""Builds the standard robot API, when the drives are there."""


class Cia402(WiredRobot):
    """Drives on one bus."""

    classes = (ServoDrive,)

    slot_words = words.BUS

    parts = (TaughtMotions,)

    robot_name = "cia402"
    model_name = "CiA 402 drives"
    family = "urbihw.buses.can.drives:DrivesDriver"

    lost = event()
    back = event()
    refused = event()
    emergency = event()

    def init(self) -> None:
        """Called by ``new``; nothing happens before ``open``."""
        super().init()
        self.motions = TaughtMotions(self, self.robot_name, self.motion, self.log)
        self.members: dict[int, ServoDrive] = {}

    def open(self, settings: RobotSettings, opened: Opened) -> None:
        self.motions.use_folder(settings.motions)
        super().open(settings, opened)

    def summary(self) -> str:
        """Return the number of drives, the rate, and which are lost."""
        lost = [str(number) for number, drive in self.members.items() if drive.state.sensed == "lost"]
        count = counted(len(self.members), "drive") + self.worker.rate_words()
        return count + (f", lost: {' '.join(lost)}" if lost else "")

    @function
    def drives(self) -> list[ServoDrive]:
        """All drives, in order of their numbers."""
        return [self.members[number] for number in sorted(self.members)]

    @function
    def drive(self, number: int) -> ServoDrive:
        """The drive with this number."""
        if number not in self.members:
            known = ", ".join(map(str, sorted(self.members))) or "none"
            raise ValueError(f"no drive {number}; there are: {known}")
        return self.members[number]

    # ---------------------------------------------------------------- the worker

    def on_found(self, message: m.Found) -> None:
        """Make an object for each new drive; those that are back become "ok"."""
        for info in message.devices:
            known = self.members.get(info.id)
            if known is not None:
                known.changed_state("ok", "")
                continue
            about = (self.channel, info, self._report_refused, self.motion)
            drive = self.host.create(ServoDrive, f"drive{info.id}", *about)
            drive.log, drive.fault_changed = self.log, self.report.show
            self.members[info.id] = drive
            if not info.watches:
                self.log.warning("drive %d cannot watch us: it goes on if this machine dies", info.id)
        if self.arrival.tree_begun:
            self.limits.send()
        else:
            self.build_tree(Path(__file__).with_name(TREE))

    def limited_devices(self) -> Mapping[str, LimitedDevice]:
        """Return the drives as ``drive1`` to ``driveN``."""
        return {f"drive{number}": drive for number, drive in self.members.items()}

    def on_samples(self, message: m.Samples) -> None:
        """Pass the values of each drive to it."""
        for number, values in message.values.items():
            drive = self.members.get(number)
            if drive is not None:
                drive.update_values(values, message.times[number] + self.offset)

    def is_complete(self) -> bool:
        """Return whether the tree is built and all drives have been read once."""
        return self.has_tree and bool(self.members) and not any(drive.stale.sensed for drive in self.members.values())

    def on_happened(self, message: m.DeviceReport) -> None:
        """Show an emergency message, and log a node that is not commanded."""
        drive = self.members.get(message.device)
        if message.what == "emergency" and drive is not None:
            text = drive.show_emergency(message.value[0])
            self.emergency.emit(drive, float(message.value[0]), text)
        elif message.what == "left alone":
            self.log.warning("%s; it is left alone", message.value)

    def unusable_devices(self) -> list[str]:
        """See ``RobotHooks``: drives in fault."""
        return [drive.explain_off() for drive in self.members.values() if drive.fault.sensed]

    def on_device_state(self, message: m.DeviceState) -> None:
        """Show, log and emit the loss and the return of a drive."""
        drive = self.members.get(message.device)
        if drive is None:
            return
        drive.changed_state(message.new, message.reason)
        if message.new == "lost":
            self.log.log_event(LOST, f"drive {message.device}", message.reason)
            self.lost.emit(drive)
        elif message.new == "back":
            self.log.log_event(BACK_OFF, f"drive {message.device}")
            self.back.emit(drive)

    def on_link_down(self, reason: str) -> None:
        """Mark all drives as lost."""
        for drive in self.members.values():
            drive.changed_state("lost", reason)

    def _report_refused(self, drive: ServoDrive, slot: str, reason: str, origin: Origin) -> None:
        self.guard.warn_writer(origin, "drive %d: %s not done: %s", drive.number, slot, reason)
        self.refused.emit(drive, slot, reason)
