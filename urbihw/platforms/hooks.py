"""What a platform with one wire implements: the hooks that ``WiredRobot`` and its parts call.

``on_found``, ``on_samples``, ``is_complete`` and ``summary`` must be there; the others do nothing.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Hashable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Protocol

from urbihw.buses import messages as m
from urbihw.figure import Figure
from urbihw.figure.model import figure_file, read
from urbihw.platforms.limits import DeviceLimits

LimitNamer = Callable[[str], str]
"""Returns the setting's name of a kind of limit of one device, for messages."""
LimitTable = Mapping[tuple[Any, str], m.Limit]


class LimitedDevice(Protocol):
    """A device that can have limits."""

    def limits_in_counts(self, limits: DeviceLimits, named: LimitNamer) -> tuple[LimitTable, Sequence[m.Threshold]]:
        """Convert limits from SI units to raw counts of the device."""
        ...

    def was_limited(self, message: m.Limited) -> None:
        """A limit changed a target, of this device or another."""
        ...


class RobotHooks:
    """A robot on one wire, as its platform describes it."""

    family: ClassVar[str]
    """The driver of the wire: a row of ``urbihw.buses.driver.FAMILIES``, or "module:Class"."""
    robot_name: ClassVar[str]
    """Its name in the log, and the value of ``name`` for a robot that has none."""
    model_name: ClassVar[str] = ""
    """The value of ``model`` for a robot that does not tell it."""

    def summary(self) -> str:
        """Return the status of the robot in a few words, while the link is up: see ``status`` of ``PlatformRobot``."""
        raise NotImplementedError

    def figure(self) -> Figure | None:
        """Return its links, joints and shapes: those of ``figure.toml`` beside its class; None for no such file.

        Raises BadFigure.
        """
        path = figure_file(Path(sys.modules[type(self).__module__].__file__ or ""))
        return None if path is None else read(path)

    def has_own_limits(self) -> bool:
        """Return whether devices have limits of their own, besides those of the settings."""
        return False

    def limited_devices(self) -> Mapping[str, LimitedDevice]:
        """Return the devices that can have limits, by the names of their slots."""
        return {}

    def joint_names(self) -> Mapping[str, str]:
        """Return the names of joints -> their names in ``limited_devices``; ``[limits]`` may use either."""
        return {}

    def signed_target(self, device: Any, item: str, raw: Any) -> float:
        """Return a raw target as a signed number; override it where a sign bit makes it another one."""
        return float(raw)

    def raw_target(self, device: Any, item: str, signed: float) -> Any:
        """Return the raw target of a signed number: the inverse of ``signed_target``."""
        return signed

    def on_found(self, message: m.Found) -> None:
        """Handle the devices found after the link came up: the first time and after each loss."""
        raise NotImplementedError

    def build_absent(self) -> bool:
        """Begin to build the tree of a robot that is absent at the start, although nothing of it is known from the last
        run; return False if that is not possible.

        When the tree is built, ``wait_for_readings`` or ``answer`` of ``arrival`` is called, as after ``on_found``.
        """
        return False

    def on_absent(self) -> None:
        """The robot does not answer at the start, or cannot be served."""

    def on_gone(self, message: m.GuestsGone) -> None:
        """Handle devices that were found on another robot, which is gone."""

    def on_samples(self, message: m.Samples) -> None:
        """Handle measured values; add ``offset`` to their times."""
        raise NotImplementedError

    def is_complete(self) -> bool:
        """Return whether all devices have been read once, so that clients may be accepted."""
        raise NotImplementedError

    def on_happened(self, message: m.DeviceReport) -> None:
        """Handle an event that a device reported."""

    def on_device_state(self, message: m.DeviceState) -> None:
        """Handle the loss or return of a device."""

    def on_threshold_crossed(self, message: m.ThresholdCrossed) -> None:
        """A measured value passed a threshold, or left it; the limits have shown it."""

    def on_refused(self, message: m.Refused) -> None:
        """A target or watch was invalid, or is refused at present; it is logged afterwards."""

    def unusable_devices(self) -> list[str]:
        """Return a line for each device that answers and is not used; ``report.show`` is called when one changes."""
        return []

    def on_statistics(self, message: m.Statistics) -> None:
        """Handle the statistics of a second."""

    def on_link_down(self, reason: str) -> None:
        """The link is down: measured values are stale from now on."""

    def on_halt(self, reason: str, devices: tuple[Hashable, ...] | None = None) -> None:
        """All motion, or that of some devices, has ended: cancel pending motion of the platform's own code."""

    def on_freed(self) -> None:
        """The last emergency stop was released: what the platform itself sets, and was refused meanwhile, is due."""

    def on_stopped(self, reason: str) -> None:
        """The worker stopped the robot, or some devices."""
