"""Who may move a robot, and what stops it, as the daemon sees it: the worker has the last word.

``motion`` decides who may move the robot: each stop advances its epoch, and writes of an older epoch are dropped.  A
platform whose own code has pending motion cancels it in ``on_halt``.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Hashable
from typing import Any, Final

from urbihw.buses import messages as m
from urbihw.buses.latch_view import LatchOrder, LatchView
from urbihw.buses.latches import SHARED
from urbihw.control_address import local_user
from urbihw.kernel.uobject import DevicePart, Motion, Origin, RobotSettings, UObject, event, function, owned, reading
from urbihw.platforms.devicelog import DeviceLog
from urbihw.platforms.hooks import RobotHooks

SAME_STOP_S: Final = 0.05
"""Seconds within which a second stop, with no motion since, counts as the same one: no person is so quick."""


class MotionGuard(DevicePart):
    """Stop, emergency stop and epoch of one robot.

    Attributes:
        motion: decides who may move it.
    """

    stopped = event()
    released = event()
    estop = owned(False)
    epoch = reading(0.0)
    stops = reading(0.0)

    def __init__(
        self, device: UObject, name: str, send: Callable[[m.ToWorker], None], log: DeviceLog, hooks: RobotHooks
    ) -> None:
        """``name`` is that of the robot, for messages; ``send`` passes a message to the worker."""
        super().__init__(device)
        self._name, self._send, self._log, self._hooks = name, send, log, hooks
        self.motion = Motion(self.host, name, self._stop_left_devices)
        self._latches = LatchView()
        self._resume = True
        self._standstills = 0
        self._stop_asked_at = -math.inf
        device.notify_change(self.estop, self._set_estop)

    def configure(self, settings: RobotSettings) -> None:
        """Apply whether movements outlive their client, and the loss of a device or of the link."""
        self.motion.keep = settings.keep_motion
        self._resume = settings.resume

    # ---------------------------------------------------------------- what urbiscript calls

    @function
    def rearm(self) -> None:
        """Let programs that began before the release of an emergency stop move the robot again, if they still run."""
        self.motion.arming.rearm()

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
        return list(self._latches.holders.values())

    @function("releaseOf")
    def release_of(self, name: str) -> None:
        """Release the emergency stop of somebody else, by the name that ``estopHolders`` tells, and one's own."""
        if name not in self._latches.holders.values():
            held = ", ".join(self._latches.holders.values())
            raise ValueError(f"{name} does not hold {self._name}" + (f"; it is held by {held}" if held else ""))
        self._release((name,))

    def _set_estop(self) -> None:
        if not isinstance(self.estop.value, bool):
            raise ValueError("this slot takes true or false")
        if not self.estop.value:
            self._release()
            return
        origin, mine = self.motion.origin(), self._holder()
        self.end_motion(f"emergency stop by {origin}")
        self.motion.arming.press(mine, origin.lobby)
        self.motion.renew()
        self._order(m.EmergencyStop(str(origin), mine, self._latches.next_number()))
        self.motion.hold(self._latches.holders.values())
        self.estop.sense(True)

    def _holder(self) -> str:
        """Whose emergency stop the running statement presses or releases."""
        return self.motion.person() or local_user(os.getuid())

    def _order(self, order: LatchOrder) -> None:
        """Send a press or a release to the worker.  Messages keep their order, so it takes effect here at once."""
        self._latches.order(order)
        self._send(order)

    def _release(self, others: tuple[str, ...] = ()) -> None:
        """Release the emergency stops of who runs the statement, and of ``others`` by name; the robot is free if none
        is left.

        Raises ValueError if there is none of them, and others hold the robot; MovementRefused if this was ordered
        before the stop.
        """
        origin, holders = self.motion.origin(), self._latches.holders
        release = m.Release(str(origin), self._holder(), others, order=self._latches.next_number())
        left = self._latches.preview(release)
        names = " and ".join(left.values())
        hint = f'who has pressed it releases it, or say {self._name}.releaseOf("NAME")'
        # Whose the shared latch is, only the worker knows.
        if left and len(left) == len(holders) and SHARED not in holders:
            raise ValueError(f"an emergency stop of {names} holds: {hint}")
        self.motion.arming.check_release(holders.keys() - left.keys())
        frees = bool(self.motion.latched) and not left
        self._order(release)
        if left:
            self.motion.hold(left.values())
            origin.warn(f"an emergency stop of {names} still holds: {hint}")
        else:
            self._free()
        # An `at` of another client that waits for the release is not ordered by it: so the order comes behind.
        self.estop.sense(bool(left))
        if frees:
            self.motion.arming.order_anew()

    def _free(self) -> None:
        """No emergency stop holds any more, if one did."""
        held = self.motion.latched
        self.motion.release()
        if held:
            self._hooks.on_freed()

    # ---------------------------------------------------------------- what the robot calls

    def halt_all(self, reason: str) -> None:
        """Stop the robot; the running job, which asked for the stop, may move it again."""
        now = self.host.now()
        if self.motion.at_rest and now - self._stop_asked_at < SAME_STOP_S:
            # A program stops repeatedly, and nothing has begun since the last stop.
            self.motion.renew()
            return
        self._stop_asked_at = now
        self.end_motion(reason)
        self.motion.renew()
        self._send(m.Stop(self.motion.epoch, reason))

    def end_motion(self, reason: str, epoch: int | None = None) -> None:
        """The robot is stopped: end all motion of the earlier epochs."""
        self.motion.advance(reason, epoch)
        self._hooks.on_halt(reason)
        self._publish_stops()

    def _publish_stops(self) -> None:
        self.epoch.sense(float(self.motion.epoch))
        self.stops.sense(float(self.motion.stops + self._standstills))

    def count_standstill(self) -> None:
        """The robot has stood, or was stopped at its return, because it could not be reached: orders of speeds that
        were given before are no longer in force, although running movements go on."""
        self._standstills += 1
        self._publish_stops()

    def _stop_left_devices(self, devices: tuple[Hashable, ...], reason: str) -> None:
        """Stop the devices that a client moved whose connection has ended."""
        self._log.warning("%s: stopped: %s", _names(devices), reason)
        self._hooks.on_halt(reason, devices)
        self._publish_stops()
        self._send(m.Stop(self.motion.epoch, reason, devices))

    def warn_writer(self, origin: Origin, text: str, *values: Any) -> None:
        """Log that a write was not executed, and warn the client that wrote, unless a stop has ended the write."""
        self._log.warning(text, *values)
        if self.motion.is_live(origin):
            self.motion.warn(origin, text % values)

    def end_movements(self, device: Hashable, reason: str) -> None:
        """End the movements of a device."""
        self.motion.end(device, reason)
        self._hooks.on_halt(reason, (device,))

    def link_lost(self, reason: str) -> None:
        """End all motion, unless it is to go on when the link is back (``on_lost``)."""
        if not self._resume:
            self.end_motion(f"the link was lost: {reason}")

    def device_lost(self, device: Hashable, reason: str) -> None:
        """End the movements of a device, unless they are to go on when it is back (``on_lost``)."""
        if not self._resume:
            self.end_movements(device, f"it was lost: {reason}")

    # ---------------------------------------------------------------- messages of the worker

    def show_absence(self, message: m.DeviceState) -> None:
        """Refuse writes to a device that is lost, and accept them when it is back."""
        if message.new == "lost":
            name = f"the {message.device}" if isinstance(message.device, str) else f"device {message.device}"
            self.motion.set_absent(message.device, f"{name} is lost: {message.reason}")
        elif message.new in ("back", "ok"):
            self.motion.set_absent(message.device, "")

    def handle_stopped(self, message: m.Stopped) -> None:
        """The worker has stopped the robot, or some devices."""
        if message.devices is None:
            self._log.info("%s stopped: %s", self._name, message.reason, event="stopped")
        if message.devices is None and message.epoch > self.motion.epoch:
            self.end_motion(message.reason, message.epoch)
        self._hooks.on_stopped(message.reason)
        self.stopped.emit(message.reason)

    def handle_latched(self, message: m.Latched) -> None:
        """The worker holds the robot in an emergency stop, or has released it."""
        new = self._latches.report(message)
        for user in new:
            self.motion.arming.press(user)
        holders = self._latches.holders
        if holders:
            self.motion.hold(holders.values())
        else:
            self._free()
        self.estop.sense(bool(holders))
        if message.freed:
            self._send(m.ReleaseKnown())
            stops = " and ".join(message.freed)
            left = f"; that of {message.reason} holds" if message.reason else ""
            self._log.warning("emergency stop of %s released by %s%s", stops, message.who, left, event="released")
            if not message.reason:
                self.released.emit(message.who)
        elif message.who or new:
            text = "emergency stop by %s: nothing moves until it is released"
            self._log.warning(text, message.who or message.reason, event="estop")


def _names(devices: tuple[Hashable, ...]) -> str:
    return ", ".join(map(str, devices))
