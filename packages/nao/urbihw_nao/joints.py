"""Joints and hands, and walking."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from urbihw.buses import messages as m
from urbihw.kernel.uobject import EffectorDevice, Motion, finite_numbers, function, number, owned, reading, set_range
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.hooks import LimitNamer, LimitTable
from urbihw.platforms.limits import DeviceLimits
from urbihw.platforms.measured import MeasuredDevice
from urbihw_nao import words
from urbihw_nao.gait import parse_gait
from urbihw_nao.orders import SLACK, JointInfo
from urbihw_nao.walk_part import AXES, FASTEST, WALK
from urbihw_nao.wholebody_part import EFFECTORS, HANDS

SETTLING_S: Final = 0.5
"""Seconds in which a stiffness that was written is measured; then what is measured counts."""
Failed = Callable[[str, str], None]
"""Called for what NAOqi has not done: slot, reason."""
Explain = Callable[[], str]
"""Tells why the robot cannot walk or balance now, "" if it may."""


class NaoJoint(EffectorDevice, MeasuredDevice):
    """A joint: ``val`` is its angle in rad, ``load`` its stiffness, 0 (slack) to 1.  A slack joint does not move.

    A joint that gets stiff stays where it is.
    """

    slot_words = words.JOINT

    val = owned(math.nan)
    load = owned(0.0)
    torque = reading(math.nan)
    temperature = reading(math.nan)
    naoqiName = reading("")

    def init(self, channel: DeviceChannel, motion: Motion, info: JointInfo, device: str) -> None:
        """Show a joint; ``device`` is its name in the worker, which two joints share that have one motor."""
        self.device, self._channel, self._motion = device, channel, motion
        self._wanted: tuple[float, float] | None = None
        self.naoqiName.sense(info.name)
        set_range(self.val, info.low, info.high)
        set_range(self.load, 0.0, 1.0)
        self._guard = self.guard(motion, device, self.val)
        self.notify_change(self.val, self._write)
        self.notify_change(self.load, self._write_load)

    @property
    def stiffness(self) -> float:
        """What was written a short time ago, or what is measured."""
        if self._wanted is not None and self._motion.now() - self._wanted[1] < SETTLING_S:
            return self._wanted[0]
        return float(self.load.sensed)

    def explain_off(self) -> str:
        return "" if self.stiffness > SLACK else f"{self.naoqiName.sensed} is slack: make it stiff with load = 1"

    def _write(self) -> None:
        if not self.explain_off():
            self._channel.set_target(self.device, "angle", number(self.val), self._guard.origin, 1.0)

    def _write_load(self) -> None:
        stiffness = number(self.load)
        origin = self._motion.origin()
        if stiffness > 0:
            origin = self._motion.admit(self.device)
        self._wanted = stiffness, self._motion.now()
        self._channel.set_target(self.device, "stiffness", stiffness, origin if stiffness > 0 else None)

    def show(self, values: Mapping[str, float], stamp: float) -> None:
        """Show what was measured."""
        self.mark_fresh()
        if "angle" in values:
            self.val.sense(values["angle"], stamp)
        if "stiffness" in values:
            self.load.sense(values["stiffness"], stamp)
        if "temperature" in values:
            self.temperature.sense(values["temperature"], stamp)

    def limits_in_counts(self, limits: DeviceLimits, named: LimitNamer) -> tuple[LimitTable, Sequence[m.Threshold]]:
        """See ``platforms.hooks.LimitedDevice``: rad and rad/s, as the worker has them too."""
        return {(self.device, "angle"): m.Limit(*limits.position, limits.speed, named("position"), named("speed"))}, ()

    def was_limited(self, message: m.Limited) -> None:
        if message.device == self.device and message.item == "angle":
            self.limit_applied(message.applied, message.limit)


class NaoHand(NaoJoint):
    """A hand: ``val`` is 0 closed, 1 open.  ``open`` and ``close`` (``nao.u``) return when they are done.

    ``pos`` is its place [x, y, z] in m, seen from the middle between the feet: ahead, to the left, up.  A place that is
    written is where the whole body tries to bring it.
    """

    slot_words = words.HAND

    pos = owned()

    def init(  # type: ignore[override]
        self, channel: DeviceChannel, motion: Motion, info: JointInfo, device: str, explain: Explain, failed: Failed
    ) -> None:
        """``explain`` tells why the robot cannot balance, ``failed`` gets what NAOqi did not do."""
        super().init(channel, motion, info, device)
        self._explain, self._failed = explain, failed
        self._effector = EFFECTORS[info.name]
        self.pos.sense([math.nan] * 3)
        self.notify_change(self.pos, self._reach)
        self.notify_access(self.pos, self._watch_places)

    def _reach(self) -> None:
        place = finite_numbers(self.pos.value, 3, 3, "[x, y, z] in m")
        origin = self._motion.admit(self._effector)
        unable = self._explain()
        if unable:
            self.warn(origin, unable)

        def done(reply: m.Reply) -> None:
            if not reply.ok:
                self._failed(f"{self.naoqiName.sensed}.pos", reply.error)

        self._channel.write(self._effector, "pos", place, done, origin)

    def _watch_places(self) -> None:
        if not self._watches:
            self._watches = True
            self._channel.watch(HANDS, ("pos",), 0.0)

    _watches = False

    def show(self, values: Mapping[str, float], stamp: float) -> None:
        """See ``NaoJoint``; also where it is."""
        if "x" in values:
            self.pos.sense([values[axis] for axis in ("x", "y", "z")], stamp)
        super().show(values, stamp)

    @function("checkHand")
    def check_hand(self) -> None:
        """Raise the error if it may not move now."""
        self._motion.check_device(self.device)


class NaoWalk(EffectorDevice, MeasuredDevice):
    """Walking: speeds ahead and to the left (m/s), and turning to the left (rad/s); where it has come.

    ``moveConfig`` has the parameters of its steps, such as [["MaxStepX", 0.02]]; those that are not named are NAOqi's.
    """

    slot_words = words.WALK

    xSpeed = owned(0.0)
    ySpeed = owned(0.0)
    yawSpeed = owned(0.0)
    moveConfig = owned()
    x = reading(0.0)
    y = reading(0.0)
    theta = reading(0.0)
    walks = reading(False)
    speeds = reading()

    def init(self, channel: DeviceChannel, motion: Motion, explain: Explain) -> None:
        """Speak to the worker through ``channel``; ``motion`` is who may move the robot, ``explain`` tells why it
        cannot walk.
        """
        self._channel, self._explain = channel, explain
        self.speeds.sense([0.0] * 3)
        for var, axis in zip((self.xSpeed, self.ySpeed, self.yawSpeed), AXES, strict=True):
            set_range(var, -FASTEST[axis], FASTEST[axis])
            self._bind(var, axis, motion)
        self.moveConfig.sense([])
        self.notify_change(self.moveConfig, self._set_steps)

    def _set_steps(self) -> None:
        self.moveConfig.sense([list(row) for row in parse_gait(self.moveConfig.value)])
        self.send_steps()

    def send_steps(self) -> None:
        """Tell the worker, also one that was started later."""
        self._channel.write(WALK, "config", self.moveConfig.sensed, lambda reply: None)

    def _bind(self, var: Any, axis: str, motion: Motion) -> None:
        guard = self.guard(motion, WALK, var)

        def write() -> None:
            self._channel.set_target(WALK, axis, number(var), guard.origin)
            var.sense(number(var))

        self.notify_change(var, write)

    def explain_off(self) -> str:
        """See ``EffectorDevice``; a speed of 0 needs no explanation."""
        return "" if self.requested.sensed == 0 else self._explain()

    def show(self, values: Mapping[str, Any], stamp: float) -> None:
        """Show where it is, and whether it walks, for any client."""
        self.mark_fresh()
        for var, item in ((self.x, "x"), (self.y, "y"), (self.theta, "theta")):
            if item in values:
                var.sense(values[item], stamp)
        if "walks" in values:
            self.walks.sense(bool(values["walks"]), stamp)
        if "speeds" in values:
            self.speeds.sense(values["speeds"], stamp)

    def lose(self) -> None:
        """The link is lost: if it walked, it walks on, and how fast is not known."""
        if self.walks.sensed or any(var.sensed for var in (self.xSpeed, self.ySpeed, self.yawSpeed)):
            self.walks.sense(True)
            self.speeds.sense([math.nan] * 3)
            for var in (self.xSpeed, self.ySpeed, self.yawSpeed):
                var.sense(math.nan)
        self.mark_stale()

    def halted(self) -> None:
        """The joint stands, whatever its last order was."""
        for var in (self.xSpeed, self.ySpeed, self.yawSpeed):
            var.sense(0.0)

    def limits_in_counts(self, limits: DeviceLimits, named: LimitNamer) -> tuple[LimitTable, Sequence[m.Threshold]]:
        """See ``platforms.hooks.LimitedDevice``: m/s and rad/s."""
        rate = limits.acceleration
        straight = m.Limit(-limits.speed, limits.speed, rate, named("speed"), named("acceleration"))
        return {
            (WALK, "x"): straight, (WALK, "y"): straight,
            (WALK, "yaw"): m.Limit(-limits.turn, limits.turn, rate, named("turn"), named("acceleration")),
        }, ()  # fmt: skip

    def was_limited(self, message: m.Limited) -> None:
        if message.device == WALK:
            self.limit_applied(message.applied, message.limit)
