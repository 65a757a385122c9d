"""Who may move a robot, and what stops and limits it, as the daemon sees it: the worker has the last word.

``motion`` decides who may move the robot: each stop advances its epoch, and writes of an older epoch are dropped.  A
platform whose own code has pending motion cancels it in ``on_halt``.
"""

from __future__ import annotations

import logging
import math
import os
from collections.abc import Callable, Hashable
from functools import partial
from typing import Any, Final

from urbihw.buses import messages as m
from urbihw.control_address import local_user
from urbihw.kernel.uobject import Motion, Origin, event, function, owned, reading
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.clipping import TargetLimits
from urbihw.platforms.devicelog import DeviceLog
from urbihw.platforms.hooks import RobotHooks
from urbihw.platforms.limits import LimitSettings

SAME_STOP_S: Final = 0.05
"""Seconds within which a second stop, with no motion since, counts as the same one: no person is so quick."""


class GuardedRobot(RobotHooks):
    """A robot that can be stopped and limited."""

    stopped = event()
    released = event()
    guarded = event()
    estop = owned(False)
    epoch = reading(0.0)
    stops = reading(0.0)

    def init(self) -> None:
        """Called by ``new``."""
        self.log = DeviceLog(logging.getLogger(f"urbihw.{self.robot_name}"), self.host.now, self.call_later)
        self.motion = Motion(self.host, self.robot_name, self._stop_released)
        self.motion.on_unarmed = self._tell_unarmed
        self.channel = DeviceChannel(self.send_message, self.motion)
        self.limits = LimitSettings({}, {})
        self._standstills = 0
        self._target_limits = TargetLimits(self, self.on_limited)
        self._stop_asked_at = -math.inf
        self._unknown_limits: set[str] = set()
        self._has_sent_limits = False
        self.notify_change(self.estop, self._set_estop)

    def show_problems(self) -> None:
        """Show what keeps the robot from working as it should, in the slot ``problems``."""
        raise NotImplementedError

    def send_message(self, message: m.ToWorker) -> None:
        """Send a message to the worker, if there is one."""
        raise NotImplementedError

    def call_later(self, seconds: float, action: Callable[[], None]) -> Callable[[], None]:
        """Call ``action`` once after some seconds; return a function that cancels it."""
        handle = 0

        def over() -> None:
            self.remove_timer(handle)
            action()

        handle = self.set_timer(seconds, over)
        return lambda: self.remove_timer(handle)

    # ---------------------------------------------------------------- what urbiscript calls

    @function
    def stop(self) -> None:
        """Execute the safe stop of this robot now; statements that begin afterwards may move it again.

        Earlier statements that would move it later end with an error.
        """
        self.halt_all(self.motion.asked())

    @function
    def rearm(self) -> None:
        """Let programs that began before the release of an emergency stop move the robot again, if they still run."""
        self.motion.rearm()

    @function("checkMotion")
    def check_motion(self) -> None:
        """Raise an error if the running statement began before the last stop."""
        self.motion.check()

    @function("beginMovement")
    def begin_movement(self, tag: Any, end: Any) -> None:
        """Begin a movement of the jobs of a tag; a write by others to a device that it moves calls ``end`` first."""
        self.motion.begin_movement(tag, end)

    @function("endMovement")
    def end_movement(self, tag: Any) -> None:
        """The movement of a tag is over."""
        self.motion.end_movement(tag)

    @function("estopHolders")
    def estop_holders(self) -> list[str]:
        """The names of those whose emergency stops hold the robot."""
        return list(self.motion.holders.values())

    @function("releaseOf")
    def release_of(self, name: str) -> None:
        """Release the emergency stop of somebody else, by the name that ``estopHolders`` tells."""
        if name not in self.motion.holders.values():
            held = ", ".join(self.motion.holders.values())
            raise ValueError(f"{name} does not hold {self.robot_name}" + (f"; it is held by {held}" if held else ""))
        self._release(lambda user, who: who == name, (name,))

    def _set_estop(self) -> None:
        if not isinstance(self.estop.value, bool):
            raise ValueError("this slot takes true or false")
        if not self.estop.value:
            mine = self._holder()
            self._release(lambda user, who: user in ("", mine))
            return
        who = str(self.motion.origin())
        self._end_motion(f"emergency stop by {who}")
        self.motion.renew()
        # Messages to the worker keep their order, so the latch takes effect here at once.
        self.motion.hold(self.motion.holders | {self._holder(): who})
        self.send_message(m.EmergencyStop(who, self._holder()))
        self.estop.sense(True)

    def _holder(self) -> str:
        """Whose emergency stop the running statement presses or releases."""
        return self.motion.person() or local_user(os.getuid())

    def _release(self, freed: Callable[[str, str], bool], others: tuple[str, ...] = ()) -> None:
        """Release the emergency stops for which ``freed(user, name)`` is true; the robot is free if none is left.

        Raises ValueError if there is none of them, and others hold the robot.
        """
        origin, holders = self.motion.origin(), self.motion.holders
        left = {user: who for user, who in holders.items() if not freed(user, who)}
        names = " and ".join(left.values())
        hint = f'who has pressed it releases it, or say {self.robot_name}.releaseOf("NAME")'
        if left and len(left) == len(holders):
            raise ValueError(f"an emergency stop of {names} holds: {hint}")
        self.send_message(m.Release(str(origin), self._holder(), others))
        if left:
            self.motion.hold(left)
            origin.warn(f"an emergency stop of {names} still holds: {hint}")
        else:
            self.motion.release()
            self.motion.order_anew()
        self.estop.sense(bool(left))

    # ---------------------------------------------------------------- what a subclass calls

    def halt_all(self, reason: str) -> None:
        """Stop the robot; the running job, which asked for the stop, may move it again."""
        now = self.host.now()
        if self.motion.at_rest and now - self._stop_asked_at < SAME_STOP_S:
            # A program stops repeatedly, and nothing has begun since the last stop.
            self.motion.renew()
            return
        self._stop_asked_at = now
        self._end_motion(reason)
        self.motion.renew()
        self.send_message(m.Stop(self.motion.epoch, reason))

    def _tell_unarmed(self) -> None:
        self.show_problems()
        waiting = self.motion.explain_unarmed()
        if waiting:
            self.log.warning("%s", waiting)

    def _end_motion(self, reason: str, epoch: int | None = None) -> None:
        """The robot is stopped: end all motion of the earlier epochs."""
        self.motion.advance(reason, epoch)
        self.on_halt(reason)
        self._publish_stops()

    def _publish_stops(self) -> None:
        self.epoch.sense(float(self.motion.epoch))
        self.stops.sense(float(self.motion.stops + self._standstills))

    def count_standstill(self) -> None:
        """The robot has stood, or was stopped at its return, because it could not be reached: orders of speeds that
        were given before are no longer in force, although running movements go on."""
        self._standstills += 1
        self._publish_stops()

    def _stop_released(self, devices: tuple[Hashable, ...], reason: str) -> None:
        """Stop the devices that a client moved whose connection has ended."""
        self.log.warning("%s: stopped: %s", _names(devices), reason)
        self.on_halt(reason, devices)
        self._publish_stops()
        self.send_message(m.Stop(self.motion.epoch, reason, devices))

    def send_limits(self) -> None:
        """Send all limits to the worker; called when the devices are known, and when one has changed its mode."""
        limited = self.has_limits()
        if not limited and not self._has_sent_limits:
            return
        self._has_sent_limits = limited
        table: dict[tuple[Any, str], m.Limit] = {}
        thresholds: list[m.Threshold] = []
        names: dict[str, None] = {}
        joints = self.joint_names()
        for name, device in self.limited_devices().items():
            called = (name, *(joint for joint, device_name in joints.items() if device_name == name))
            names |= dict.fromkeys(called)
            limits, own = device.limits_in_counts(self.limits.device(*called), partial(self._named_limit, called))
            table.update(limits)
            thresholds += own
        for name in self.limits.unknown(names):
            if name not in self._unknown_limits:
                self._unknown_limits.add(name)
                self.log.warning("limits.%s: there is no such device; there are: %s", name, ", ".join(names))
        self._target_limits.set_table(table)
        self.channel.check_target = self._target_limits.check_target if table else None
        self.send_message(m.Limits(table, tuple(thresholds)))

    def _named_limit(self, device: tuple[str, ...], kind: str) -> str:
        """The setting's name of a limit of a device by its names."""
        return self.limits.named(kind, *device)

    def warn_writer(self, origin: Origin, text: str, *values: Any) -> None:
        """Log that a write was not executed, and warn the client that wrote, unless a stop has ended the write."""
        self.log.warning(text, *values)
        if self.motion.is_live(origin):
            self.motion.warn(origin, text % values)

    def _end_movements(self, device: Hashable, reason: str) -> None:
        """End the movements of a device that was lost (``on_lost = "end"``)."""
        self.motion.end(device, reason)
        self.on_halt(reason, (device,))

    # ---------------------------------------------------------------- hooks

    def on_limited(self, message: m.Limited) -> None:
        """A limit of the settings changed a target: inform all devices."""
        for device in self.limited_devices().values():
            device.was_limited(message)

    def on_threshold_crossed(self, message: m.ThresholdCrossed) -> None:
        """A measured value passed a threshold, or left it."""
        what = "passed" if message.passed else "is back from"
        self.log.warning("%s: %s %s %s", message.device, message.item, what, message.name, event="limit")
        self.guarded.emit(str(message.device), message.name, message.passed)

    def on_refused(self, message: m.Refused) -> None:
        """A target or watch was invalid, or is refused at present."""
        self.log.warning("%s: %s: %s", message.device, message.item, message.reason)

    # ---------------------------------------------------------------- messages of the worker

    def _show_absence(self, message: m.DeviceState) -> None:
        if message.device in self.channel.blocked:
            # It answers, and remains absent for other reasons.
            return
        if message.new == "lost":
            name = f"the {message.device}" if isinstance(message.device, str) else f"device {message.device}"
            self.motion.set_absent(message.device, f"{name} is lost: {message.reason}")
        elif message.new in ("back", "ok"):
            self.motion.set_absent(message.device, "")

    def _handle_stopped(self, message: m.Stopped) -> None:
        if message.devices is None:
            self.log.info("%s stopped: %s", self.robot_name, message.reason, event="stopped")
        if message.devices is None and message.epoch > self.motion.epoch:
            self._end_motion(message.reason, message.epoch)
        self.on_stopped(message.reason)
        self.stopped.emit(message.reason)

    def _handle_latched(self, message: m.Latched) -> None:
        if message.reason:
            self.motion.hold(dict(message.holders))
        else:
            self.motion.release()
        self.estop.sense(bool(message.reason))
        if message.freed:
            stops = " and ".join(message.freed)
            left = f"; that of {message.reason} holds" if message.reason else ""
            self.log.warning("emergency stop of %s released by %s%s", stops, message.who, left, event="released")
        else:
            text = "emergency stop by %s: nothing moves until it is released"
            self.log.warning(text, message.who or message.reason, event="estop")
        if not message.reason:
            self.released.emit(message.who)


def _names(devices: tuple[Hashable, ...]) -> str:
    return ", ".join(map(str, devices))
