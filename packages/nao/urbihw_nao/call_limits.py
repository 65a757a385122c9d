"""What calls of services let joints and the walk do, as far as it is known: limits hold for that too; no I/O.

Methods fall into three kinds.  For some it is known which angles and speeds their arguments mean (``METHODS``).  Some
are never refused: they stop something, set a stiffness, or let the robot stand up or sit down, at NAOqi's own pace
(``FREE``).  All others of the services that move (``MOVING``) may do anything: where a joint or the walk has a limit,
they are refused.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, Final

from urbihw.buses.driver import ImpliedTarget
from urbihw_nao.call_part import BEHAVIOURS, may_move
from urbihw_nao.finding import MOTION
from urbihw_nao.orders import SHARED_MOTORS, JointOrders
from urbihw_nao.reading import PREFIX
from urbihw_nao.walk_part import AXES, FASTEST, WALK

DCM: Final = "DCM"
MOVING: Final = frozenset({
    MOTION, DCM, "ALRobotPosture", BEHAVIOURS, "ALFrameManager", "ALTracker", "ALNavigation", "ALAutonomousLife",
    "ALAutonomousMoves", "ALBasicAwareness", "ALAnimationPlayer", "ALAnimatedSpeech", "ALMovementDetection",
})  # fmt: skip
"""Services that move joints, or let the robot walk."""
FREE: Final = frozenset({
    "stopMove", "stopWalk", "killMove", "killWalk", "killAll", "killTask", "killTasksUsingResources", "stop",
    "stopBehavior", "stopAllBehaviors", "stopTracker", "setStiffnesses", "stiffnessInterpolation", "wakeUp", "rest",
    "moveInit", "walkInit", "waitUntilMoveIsFinished", "waitUntilWalkIsFinished", "wait",
    "wbFootState", "wbEnableBalanceConstraint", "setMotionConfig", "setWalkArmsEnable", "preloadBehavior",
})  # fmt: skip
"""Methods of those services that no limit refuses; so are those whose names end with "Enabled"."""
CHAINS: Final[Mapping[str, Sequence[str]]] = {
    "Body": ("",), "Joints": ("",), "JointActuators": ("",), "Actuators": ("",), "Head": ("Head",),
    "LArm": ("LS", "LE", "LW", "LHand"), "RArm": ("RS", "RE", "RW", "RHand"),
    "LLeg": ("LHip", "LK", "LA"), "RLeg": ("RHip", "RK", "RA"),
}  # fmt: skip
"""Names of several joints, and how the names of those begin."""
PEAK: Final = 2.0
"""How much faster than on average a joint is in an interpolation of NAOqi, at most."""

Targets = Iterator[ImpliedTarget]


class CallLimits:
    """Finds the targets that calls imply."""

    def __init__(self, orders: JointOrders) -> None:
        self._orders = orders
        self._speeds: dict[str, float] = {}

    def begin(self, speeds: Mapping[str, float]) -> None:
        """The joints of the robot, in its order, and the greatest speed of each, rad/s."""
        self._speeds = dict(speeds)

    def find_targets(self, service: str, method: str, arguments: Sequence[Any]) -> Iterable[ImpliedTarget]:
        """What a call lets move."""
        free = method in FREE or method.endswith("Enabled") or (method == "wbEnable" and arguments[:1] == (False,))
        if service not in MOVING or free or not may_move(service, method):
            return ()
        find = METHODS.get((service, method))
        if find is not None:
            try:
                return list(find(self, *arguments))
            except (TypeError, ValueError, IndexError, KeyError):
                # Whatever such arguments mean to NAOqi.
                pass
        return list(self.find_anything())

    def find_anything(self, walk: bool = True) -> Targets:
        """The moving parts are unknown."""
        for joint in self._speeds:
            yield _target(joint, math.nan, math.inf)
        if walk:
            for axis in AXES:
                yield ImpliedTarget(WALK, axis, math.nan, math.inf)

    # ---------------------------------------------------------------- joints

    def _named(self, names: Any) -> list[str]:
        """The joints of a name, of a chain, or of several.  Raises KeyError."""
        found: list[str] = []
        for name in names if isinstance(names, list | tuple) else [names]:
            if name in self._speeds:
                found.append(name)
            else:
                begins = tuple(CHAINS[name])
                found += [joint for joint in self._speeds if joint.startswith(begins)]
        return found

    def _pair(self, names: Any, values: Any) -> list[tuple[str, Any]]:
        """Joints and their values, of which one may count for all.  Raises ValueError."""
        joints = self._named(names)
        rows = list(values) if isinstance(values, list | tuple) else [values]
        return list(zip(joints, rows * len(joints) if len(rows) == 1 else rows, strict=True))

    def _set_angles(self, names: Any, angles: Any, fraction: Any, *_: Any) -> Targets:
        for joint, angle in self._pair(names, angles):
            yield _target(joint, _last(angle), self._speeds[joint] * float(fraction))

    def _change_angles(self, names: Any, changes: Any, fraction: Any) -> Targets:
        for joint, change in self._pair(names, changes):
            yield _target(joint, self._orders.where[joint] + float(change), self._speeds[joint] * float(fraction))

    def _interpolate(self, names: Any, angles: Any, times: Any, absolute: Any) -> Targets:
        joints = self._named(names)
        if len(joints) == 1:
            # The list may be that of the joint, or hold it.
            angles, times = [_flat(angles)], [_flat(times)]
        for (joint, places), (_, moments) in zip(self._pair(joints, angles), self._pair(joints, times), strict=True):
            where = self._orders.where[joint]
            shift = 0.0 if absolute else where
            course = [(0.0, where)]
            course += zip(map(float, _flat(moments)), (shift + float(each) for each in _flat(places)), strict=True)
            for (begun, start), (due, end) in pairwise(course):
                yield _target(joint, end, PEAK * abs(end - start) / (due - begun) if due > begun else math.inf)

    def _move_hand(self, place: float, name: Any) -> Targets:
        yield _target(name, place, self._speeds[name])

    def _open_hand(self, name: Any) -> Targets:
        return self._move_hand(1.0, name)

    def _close_hand(self, name: Any) -> Targets:
        return self._move_hand(0.0, name)

    # ---------------------------------------------------------------- the DCM

    def _set_actuator(self, command: Any) -> Targets:
        key, _, points = command
        joint, _, what = str(key).removeprefix(PREFIX).partition("/")
        if joint not in self._speeds:
            yield from self.find_anything(walk=False)
        elif what.startswith("Position"):
            for value, *_ in points:
                yield _target(joint, float(value), math.inf)

    # ---------------------------------------------------------------- walking

    def _walk(self, x: Any, y: Any, turn: Any, config: Any = ()) -> Targets:
        for axis, speed in zip(AXES, (x, y, turn), strict=True):
            if speed:
                # NAOqi speeds up as it likes.
                yield ImpliedTarget(WALK, axis, float(speed), math.inf)

    def _walk_by_shares(self, x: Any, y: Any, turn: Any, *config: Any) -> Targets:
        # The steps are those of the configuration, or of NAOqi.
        fastest = dict.fromkeys(AXES, math.nan) if config else FASTEST
        for axis, share in zip(AXES, (x, y, turn), strict=True):
            if share:
                yield ImpliedTarget(WALK, axis, float(share) * fastest[axis], math.inf)

    def _walk_by_frequency(self, x: Any, y: Any, turn: Any, frequency: Any, *config: Any) -> Targets:
        return self._walk_by_shares(x, y, turn, *config)

    def _walk_to(self, x: Any, y: Any, turn: Any, *config: Any) -> Targets:
        return self._walk_by_shares(*(math.copysign(float(way != 0), way) for way in (x, y, turn)), *config)


def _target(joint: str, place: float, speed: float) -> ImpliedTarget:
    return ImpliedTarget(SHARED_MOTORS.get(joint, joint), "angle", place, speed)


def _flat(values: Any) -> list[Any]:
    """Numbers, however deep they are in lists."""
    if not isinstance(values, list | tuple):
        return [values]
    return [each for part in values for each in _flat(part)]


def _last(value: Any) -> float:
    (number,) = _flat(value)
    return float(number)


METHODS: Final[Mapping[tuple[str, str], Callable[..., Targets]]] = {
    (MOTION, "setAngles"): CallLimits._set_angles,
    (MOTION, "changeAngles"): CallLimits._change_angles,
    (MOTION, "angleInterpolation"): CallLimits._interpolate,
    (MOTION, "angleInterpolationWithSpeed"): CallLimits._set_angles,
    (MOTION, "openHand"): CallLimits._open_hand,
    (MOTION, "closeHand"): CallLimits._close_hand,
    (MOTION, "move"): CallLimits._walk,
    (MOTION, "moveToward"): CallLimits._walk_by_shares,
    (MOTION, "setWalkTargetVelocity"): CallLimits._walk_by_frequency,
    (MOTION, "moveTo"): CallLimits._walk_to,
    (MOTION, "walkTo"): CallLimits._walk_to,
    (DCM, "set"): CallLimits._set_actuator,
}
"""Methods of which it is known what their arguments mean."""
