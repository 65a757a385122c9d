"""The part of ALMotion that moves hands in space: the place of a hand, and the whole body balancer.

An arm is two links: from the shoulder to the elbow, and from there to the hand; the wrist does not matter.  The
balancer turns the joints of an arm, a little each step, so that its hand comes nearer to its target; it leans the torso
ahead for a target that the arm does not reach.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from urbihw_nao_fakes.body import Body, Joint
from urbihw_nao_fakes.services import Failed, Service, finite, method

SHOULDER = (0.0, 0.098, 0.1)
"""The left shoulder, from the torso: ahead, left, up, m."""
UPPER, LOWER = 0.105, 0.114
"""Lengths of the links, m."""
HEIGHT = 0.33
"""Height of the torso above the feet, m."""
ARMS = {"LArm": "L", "RArm": "R"}
TURNED = ("ShoulderPitch", "ShoulderRoll", "ElbowYaw", "ElbowRoll")
PACE = 1.2
"""rad/s of the joints of an arm under control."""
LEAN_PACE, MOST_LEAN = 0.03, 0.06
"""How fast, and how far, the torso comes ahead: m/s, m."""
TORSO, WORLD, ROBOT = range(3)

Place = tuple[float, float, float]


def place_of(angles: Mapping[str, float], side: int) -> Place:
    """The hand of an arm from the torso; ``side`` is 1 for the left one, -1 for the right one."""
    pitch, roll = angles["ShoulderPitch"], angles["ShoulderRoll"]
    yaw, bend = angles["ElbowYaw"], angles["ElbowRoll"]
    # In the frame of the upper arm, which points along x.
    hand = (UPPER + LOWER * math.cos(bend), LOWER * math.sin(bend), 0.0)
    hand = (hand[0], hand[1] * math.cos(yaw) - hand[2] * math.sin(yaw), hand[1] * math.sin(yaw))
    x, y, z = hand
    x, y = x * math.cos(roll) - y * math.sin(roll), x * math.sin(roll) + y * math.cos(roll)
    x, z = x * math.cos(pitch) + z * math.sin(pitch), -x * math.sin(pitch) + z * math.cos(pitch)
    return SHOULDER[0] + x, side * SHOULDER[1] + y, SHOULDER[2] + z


class WholeBody(Service):
    """These methods of ALMotion.

    Attributes:
        balancing: whether the balancer is on; controlled: the targets of effectors under control, None without one.
        lean: how far the torso is ahead of the feet, m.
    """

    def __init__(self, body: Body) -> None:
        super().__init__()
        self.body = body
        self.balancing = False
        self.controlled: dict[str, Place | None] = {}
        self.lean = 0.0
        self._stepped_at = 0.0
        body.on_step.append(self._step)
        body.on_posture.append(self._drop_targets)

    # ---------------------------------------------------------------- places

    def _arm(self, effector: str) -> dict[str, Joint]:
        if effector not in ARMS:
            raise Failed(f"ALMotion: {effector} is no effector")
        return {name: self.body.joints[ARMS[effector] + name] for name in TURNED}

    def find_hand(self, effector: str, angles: Mapping[str, float] | None = None) -> Place:
        """The hand in the frame of the robot, with these angles or its own.  Raises Failed."""
        if angles is None:
            angles = {name: joint.angle for name, joint in self._arm(effector).items()}
        x, y, z = place_of(angles, 1 if effector == "LArm" else -1)
        return x + self.lean, y, z + HEIGHT

    @method("getPosition", "(sib)", "[f]")
    def get_place(self, name: str, frame: int, sensors: bool) -> list[float]:
        """Place and rotation (which is not simulated) of a hand; only in the frames of the torso and of the robot."""
        x, y, z = self.find_hand(name)
        if frame == TORSO:
            x, z = x - self.lean, z - HEIGHT
        elif frame != ROBOT:
            raise Failed("ALMotion: the simulated robot tells places in the frames 0 and 2")
        return [x, y, z, 0.0, 0.0, 0.0]

    # ---------------------------------------------------------------- the balancer

    @method("wbEnable", "(b)")
    def set_balancer(self, on: bool) -> None:
        """Switch it.  Raises Failed for a robot that does not stand."""
        if on and not (self.body.standing and self.body.legs_stiff):
            raise Failed("ALMotion: the whole body balancer needs a robot that stands on stiff legs")
        if not on:
            self._hold()
        self.balancing = on

    @method("wbFootState", "(ss)")
    def set_feet(self, state: str, legs: str) -> None:
        """Fixed, Plane or Free."""
        self._check(state in ("Fixed", "Plane", "Free") and legs in ("Legs", "LLeg", "RLeg"), f"{state} {legs}")

    @method("wbEnableBalanceConstraint", "(bs)")
    def set_constraint(self, on: bool, legs: str) -> None:
        """Keep the balance over these legs."""
        self._check(legs in ("Legs", "LLeg", "RLeg"), legs)

    @method("wbEnableEffectorControl", "(sb)")
    def set_control(self, effector: str, on: bool) -> None:
        """Take an arm under control, or leave it where it is."""
        self._arm(effector)
        if on:
            self._check(True, effector)
            self.controlled.setdefault(effector, None)
        elif self.controlled.pop(effector, None) is not None:
            self._hold_arm(effector)

    @method("wbSetEffectorControl", "(sm)")
    def set_target(self, effector: str, target: Any) -> None:
        """Where its hand is to go, in the frame of the robot."""
        self._check(effector in self.controlled, f"{effector} is not under control")
        x, y, z = map(finite, target)
        self.controlled[effector] = x, y, z

    def _check(self, good: bool, what: str) -> None:
        if not self.balancing or not good:
            raise Failed(f"ALMotion: the whole body balancer is off, or refuses: {what}")

    def _drop_targets(self) -> None:
        """A posture takes the arms; they stay under control."""
        self.controlled = dict.fromkeys(self.controlled)

    def _hold(self) -> None:
        for effector in list(self.controlled):
            self._hold_arm(effector)
        self.controlled.clear()

    def _hold_arm(self, effector: str) -> None:
        for joint in self._arm(effector).values():
            joint.hold()

    # ---------------------------------------------------------------- motion

    def _step(self, now: float) -> None:
        dt, self._stepped_at = min(now - self._stepped_at, 0.02), now
        if not self.balancing or dt <= 0:
            return
        if not self.body.standing:
            self._hold()
            self.balancing = False
        for effector, target in self.controlled.items():
            if target is not None:
                self._approach(effector, target, dt)

    def _approach(self, effector: str, target: Place, dt: float) -> None:
        """Turn each joint of the arm by a step, to the side that brings the hand nearer."""
        joints = self._arm(effector)
        angles = {name: joint.angle for name, joint in joints.items()}
        before = math.dist(self.find_hand(effector, angles), target)
        step = min(PACE * dt, before * 4)
        for name, joint in joints.items():
            tried = []
            for turn in (-step, 0.0, step):
                angle = min(max(angles[name] + turn, joint.low), joint.high)
                tried.append((math.dist(self.find_hand(effector, {**angles, name: angle}), target), angle))
            angles[name] = min(tried)[1]
        for name, joint in joints.items():
            joint.order(angles[name], 1.0)
        left = target[0] - self.find_hand(effector, angles)[0]
        if abs(left) > 0.005:
            self.lean = min(max(self.lean + math.copysign(LEAN_PACE * dt, left), -MOST_LEAN), MOST_LEAN)
