"""The limits of a robot's devices, as the daemon sees them: it sends them to the bus worker, which enforces them, and
shows what they have changed."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any, Final

from urbihw.buses import messages as m
from urbihw.kernel.uobject import DevicePart, Motion, UObject, event
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.clipping import TargetLimits
from urbihw.platforms.devicelog import DeviceLog
from urbihw.platforms.hooks import RobotHooks
from urbihw.platforms.limits import LimitSettings

LOOSER_SHOWN_S: Final = 600.0
"""Seconds for which a reload that removed or raised limits is a problem."""


class RobotLimits(DevicePart):
    """The limits of one robot.

    Attributes:
        settings: the limits of the settings.
    """

    guarded = event()

    def __init__(
        self, device: UObject, send: Callable[[m.ToWorker], None], channel: DeviceChannel, motion: Motion,
        log: DeviceLog, hooks: RobotHooks,
    ) -> None:
        """``send`` passes a message to the worker."""  # fmt: skip
        super().__init__(device)
        self._send, self._channel, self._motion, self._log, self._hooks = send, channel, motion, log, hooks
        self.settings = LimitSettings({}, {})
        self._targets = TargetLimits(hooks, self._show_limited)
        self._reference = self.settings
        self._raised_at = -math.inf
        self._unknown: set[str] = set()
        self._has_sent = False

    def take(self, settings: LimitSettings) -> tuple[list[str], list[str]]:
        """Replace the limits; return in words those that allow more than they did before, and those that allow more
        than before the first of such changes in ``LOOSER_SHOWN_S``.  ``send`` comes next.
        """
        before, self.settings = self.settings, settings
        now = self._motion.now()
        if now > self._raised_at + LOOSER_SHOWN_S:
            self._reference = before
        raised = self._looser_than(before)
        if raised:
            self._raised_at = now
        return raised, self._looser_than(self._reference)

    def _looser_than(self, before: LimitSettings) -> list[str]:
        known = self._names().values()
        present = {name for names in known for name in names}
        absent = [(name,) for name in before.names if name not in present]
        return self.settings.looser(before, [*(known or [()]), *absent])

    def _names(self) -> dict[str, tuple[str, ...]]:
        """The names of each device that has limits: its own, and those of its joint."""
        joints = self._hooks.joint_names()
        return {
            name: (name, *(joint for joint, device_name in joints.items() if device_name == name))
            for name in self._hooks.limited_devices()
        }

    def send(self) -> None:
        """Send all limits to the worker; called when the devices are known, and when one has changed its mode."""
        limited = bool(self.settings) or self._hooks.has_own_limits()
        if not limited and not self._has_sent:
            return
        self._has_sent = limited
        table: dict[tuple[Any, str], m.Limit] = {}
        thresholds: list[m.Threshold] = []
        names: dict[str, None] = {}
        all_names = self._names()
        for name, device in self._hooks.limited_devices().items():
            called = all_names[name]
            names |= dict.fromkeys(called)
            limits, own = device.limits_in_counts(self.settings.device(*called), partial(self._named, called))
            table.update(limits)
            thresholds += own
        for name in self.settings.unknown(names):
            if name not in self._unknown:
                self._unknown.add(name)
                self._log.warning("limits.%s: there is no such device; there are: %s", name, ", ".join(names))
        self._targets.set_table(table)
        self._channel.check_target = self._targets.check_target if table else None
        self._send(m.Limits(table, tuple(thresholds)))

    def _named(self, device: tuple[str, ...], kind: str) -> str:
        """The setting's name of a limit of a device by its names."""
        return self.settings.named(kind, *device)

    def show_limited(self, message: m.Limited) -> None:
        """The worker has changed a target, unless the program has written another one since."""
        if not self._targets.is_outdated(message):
            self._show_limited(message)

    def _show_limited(self, message: m.Limited) -> None:
        """A limit of the settings changed a target: inform all devices."""
        for device in self._hooks.limited_devices().values():
            device.was_limited(message)

    def show_crossed(self, message: m.ThresholdCrossed) -> None:
        """A measured value passed a threshold, or left it."""
        what = "passed" if message.passed else "is back from"
        self._log.warning("%s: %s %s %s", message.device, message.item, what, message.name, event="limit")
        self.guarded.emit(str(message.device), message.name, message.passed)
