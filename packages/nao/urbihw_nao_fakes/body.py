"""The body of a Nao: 26 joints with speed, limits and stiffness, two legs that carry it, where it is, what it feels.

A joint with stiffness goes to its command, no faster than its motor and the asked share of that; a slack one falls as
its weight pulls it, or stays where nothing pulls.  A command stays when the stiffness goes: a joint that gets stiff
again with an old command goes there.  Standing with slack legs it falls, and one that has fallen does not walk.
Walking has a speed that grows and shrinks as steps allow.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

ROWS = """
HeadYaw -2.0857 2.0857 8.268
HeadPitch -0.6720 0.5149 7.194 0.5
LShoulderPitch -2.0857 2.0857 8.268 1.5
LShoulderRoll -0.3142 1.3265 7.194 0.1
LElbowYaw -2.0857 2.0857 8.268
LElbowRoll -1.5446 -0.0349 7.194 -0.1
LWristYaw -1.8239 1.8239 24.62
LHand 0 1 8.33
LHipYawPitch -1.1453 0.7407 4.162
LHipRoll -0.3794 0.7905 4.162
LHipPitch -1.5359 0.4840 6.402 -0.95
LKneePitch -0.0923 2.1126 6.402 2.1
LAnklePitch -1.1894 0.9226 6.402 -1.18
LAnkleRoll -0.3978 0.7690 4.162
RHipYawPitch -1.1453 0.7407 4.162
RHipRoll -0.7905 0.3794 4.162
RHipPitch -1.5359 0.4840 6.402 -0.95
RKneePitch -0.0923 2.1126 6.402 2.1
RAnklePitch -1.1863 0.9320 6.402 -1.18
RAnkleRoll -0.7690 0.3978 4.162
RShoulderPitch -2.0857 2.0857 8.268 1.5
RShoulderRoll -1.3265 0.3142 7.194 -0.1
RElbowYaw -2.0857 2.0857 8.268
RElbowRoll 0.0349 1.5446 7.194 0.1
RWristYaw -1.8239 1.8239 24.62
RHand 0 1 8.33
"""
"""Joint, limits in rad (hands: 0 closed, 1 open), greatest speed in rad/s, where its weight pulls it."""
FALL = 3.0
"""rad/s of a slack joint."""
STEP = 0.01
"""Seconds of a step of the simulation at most."""
FASTEST = (0.12, 0.08, 0.6)
"""Largest speeds of walking: m/s, m/s, rad/s."""
ACCELERATION = (0.3, 0.3, 1.5)
"""What walking speeds up and slows down by: m/s2, m/s2, rad/s2."""
STIFF = 0.05
"""Stiffness from which a motor holds."""
NEAR = 0.01
"""rad (hands: share) from its command at which a joint has arrived."""
WEIGHT = 5.2
"""kg, shared by two feet."""
STAND = {
    "HeadYaw": 0.0, "HeadPitch": -0.17, "ShoulderPitch": 1.45, "ShoulderRoll": 0.2, "ElbowYaw": -1.2,
    "ElbowRoll": -0.4, "WristYaw": 0.1, "Hand": 0.3, "HipYawPitch": 0.0, "HipRoll": 0.0, "HipPitch": -0.45,
    "KneePitch": 0.7, "AnklePitch": -0.35, "AnkleRoll": 0.0,
}  # fmt: skip
CROUCH = {"HipPitch": -0.95, "KneePitch": 2.1, "AnklePitch": -1.18, "ShoulderPitch": 1.5}
"""The torso is upright, so that the robot stays there when it goes slack, in a world, too.  The maker's angle of the
hips is not known."""
ZERO: dict[str, float] = {}
LEGS = ("Hip", "Knee", "Ankle")
"""Words in the names of the joints of the legs."""
POSTURES = {"Stand": STAND, "StandInit": STAND, "StandZero": ZERO, "Crouch": CROUCH}


@dataclass
class Joint:
    """A joint; ``moves_at`` is its speed in the last step, rad/s."""

    name: str
    low: float
    high: float
    fastest: float
    pulled_to: float | None
    angle: float = 0.0
    command: float = 0.0
    share: float = 1.0
    stiffness: float = 0.0
    moves_at: float = 0.0

    @property
    def arrived(self) -> bool:
        """Whether its motion is over."""
        return abs(self.angle - self.command) < NEAR

    def hold(self) -> None:
        """Stay where it is."""
        self.command = self.angle

    def advance(self, dt: float) -> None:
        """Let some time pass, in seconds."""
        before = self.angle
        if self.stiffness >= STIFF:
            goal, speed = self.command, self.fastest * self.share
        elif self.pulled_to is not None:
            goal, speed = self.pulled_to, FALL
        else:
            goal, speed = self.angle, 0.0
        way = goal - self.angle
        self.angle = goal if abs(way) <= speed * dt else self.angle + math.copysign(speed * dt, way)
        self.moves_at = (self.angle - before) / dt

    def order(self, angle: float, share: float) -> None:
        """A new command, cut to what the joint can; it replaces the last."""
        self.command = min(max(angle, self.low), self.high)
        self.share = min(max(share, 0.0), 1.0)


def joints() -> dict[str, Joint]:
    """All joints of a crouching Nao, by name."""
    found = {}
    for row in ROWS.split("\n"):
        if row:
            name, *numbers = row.split()
            low, high, fastest, *pulled = map(float, numbers)
            made = found[name] = Joint(name, low, high, fastest, pulled[0] if pulled else None)
            made.angle = made.command = pulled[0] if pulled else min(max(0.0, low), high)
    return found


def posture(name: str) -> dict[str, float]:
    """The angles of a posture, right ones mirrored."""
    found = {}
    for joint in joints().values():
        side, part = joint.name[0], joint.name[1:]
        plain = joint.name if joint.name.startswith("Head") else part
        angle = POSTURES[name].get(plain, 0.0)
        mirrored = side == "R" and part.endswith(("Roll", "Yaw"))
        found[joint.name] = min(max(-angle if mirrored else angle, joint.low), joint.high)
    return found


@dataclass(frozen=True)
class PostureMotion:
    """The way to a posture: the angles of all joints."""

    joints: Mapping[str, Joint]
    goals: Mapping[str, float]

    def reached(self) -> bool:
        """Whether all joints are there."""
        return all(joint.arrived and joint.command == self.goals[name] for name, joint in self.joints.items())

    def ended(self) -> bool:
        """Whether it is over: all joints are there, or one got another order since, or is slack."""
        replaced = (joint.command != self.goals[name] or joint.stiffness < STIFF for name, joint in self.joints.items())
        return self.reached() or any(replaced)


@dataclass(frozen=True)
class Feeling:
    """What its sensors feel: of the inertial unit in the torso, and under the feet.

    Attributes:
        acceleration: ahead, left, up, with gravity: m/s2.
        turning: about these axes: rad/s.
        lean: to its right, and ahead: rad.
        weights: under each foot (``LFoot``, ``RFoot``): front left, front right, rear left, rear right; kg.
    """

    acceleration: tuple[float, float, float]
    turning: tuple[float, float, float]
    lean: tuple[float, float]
    weights: Mapping[str, tuple[float, float, float, float]]


class Body:
    """The whole robot; ``x``, ``y``, ``heading`` are where it is, ``walk`` its speeds, ``asked`` those of its orders.

    ``on_step`` are called before each step of the simulation, with its time; ``on_posture`` before a posture begins;
    ``on_tip`` when it tips over, ``on_fall`` when it has fallen.
    """

    def __init__(self) -> None:
        self.joints = joints()
        self.x = self.y = self.heading = 0.0
        self.walk = [0.0, 0.0, 0.0]
        self.asked = [0.0, 0.0, 0.0]
        self.step_shares = [1.0, 1.0, 1.0]
        self.goal: tuple[float, float, float] | None = None
        self.standing = self.fallen = False
        self.powered = True
        self.charge = 0.8
        self.plugged_in = False
        self.touched: dict[str, float] = {}
        self.sonars = [1.2, 1.5]
        self.on_tip: Callable[[], None] = lambda: None
        self.on_fall: Callable[[], None] = lambda: None
        self.on_step: list[Callable[[float], None]] = []
        self.on_posture: list[Callable[[], None]] = []
        self._now: float | None = None

    # ---------------------------------------------------------------- time

    def advance(self, now: float) -> None:
        """Let time pass until ``now``."""
        if self._now is None:
            self._now = now
        left = now - self._now
        steps = math.ceil(left / STEP - 1e-9) if left > 0 else 0
        for index in range(steps):
            for act in self.on_step:
                act(self._now + left * (index + 1) / steps)
            self._step(left / steps)
        self._now = max(now, self._now)

    def due(self) -> float | None:
        """When it wants to move on, without a request: never."""
        return None

    def _step(self, dt: float) -> None:
        self._move(dt)
        self._steps(dt)
        if not self.plugged_in and self.powered:
            self.charge = max(0.0, self.charge - dt * 1e-5)

    def _move(self, dt: float) -> None:
        for joint in self.joints.values():
            joint.advance(dt)
        left, right = self.joints["LHipYawPitch"], self.joints["RHipYawPitch"]
        right.angle, right.command, right.moves_at = left.angle, left.command, left.moves_at
        right.stiffness = left.stiffness
        if self.standing and not self.legs_stiff:
            self._fall()

    def _fall(self) -> None:
        self._give_up_standing()
        self.fallen = True
        self.on_fall()

    def _give_up_standing(self) -> None:
        self.standing, self.goal = False, None
        self.walk = [0.0, 0.0, 0.0]
        self.asked = [0.0, 0.0, 0.0]

    def _steps(self, dt: float) -> None:
        if self.goal is not None:
            self._steer()
        for axis, (most, acceleration) in enumerate(zip(FASTEST, ACCELERATION, strict=True)):
            most *= self.step_shares[axis]
            wanted = min(max(self.asked[axis], -most), most) if self.standing else 0.0
            change = wanted - self.walk[axis]
            self.walk[axis] += min(max(change, -acceleration * dt), acceleration * dt)
        forward, left, turn = self.walk
        self.x += (forward * math.cos(self.heading) - left * math.sin(self.heading)) * dt
        self.y += (forward * math.sin(self.heading) + left * math.cos(self.heading)) * dt
        self.heading += turn * dt

    def _steer(self) -> None:
        """Speeds towards a goal, so that it can still brake there."""
        assert self.goal is not None
        dx, dy, turn = self.goal[0] - self.x, self.goal[1] - self.y, self.goal[2] - self.heading
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        ways = (dx * cos + dy * sin, dy * cos - dx * sin, turn)
        for axis, way in enumerate(ways):
            self.asked[axis] = math.copysign(min(FASTEST[axis], math.sqrt(1.2 * ACCELERATION[axis] * abs(way))), way)
        if all(abs(way) < 0.004 for way in ways) and all(abs(speed) < 0.03 for speed in self.walk):
            self.goal, self.asked = None, [0.0, 0.0, 0.0]

    # ---------------------------------------------------------------- its orders

    @property
    def legs_stiff(self) -> bool:
        """Whether the legs carry it."""
        legs = ("LHipPitch", "LKneePitch", "LAnklePitch", "RHipPitch", "RKneePitch", "RAnklePitch")
        return all(self.joints[name].stiffness >= STIFF for name in legs)

    @property
    def feeling(self) -> Feeling:
        """What its sensors feel."""
        foot = WEIGHT / 8
        weights = (0.0,) * 4 if self.fallen else (foot,) * 4
        return Feeling(
            (0.0, 0.0, 0.0) if self.fallen else (0.1, 0.0, 9.8), (0.0, 0.0, self.walk[2]),
            (0.0, -math.pi / 2 if self.fallen else 0.0), {"LFoot": weights, "RFoot": weights},
        )  # fmt: skip

    @property
    def doing(self) -> str:
        """What it does, in a word."""
        stance = "standing" if self.standing else "crouching"
        return "fallen" if self.fallen else "walking" if self.walking else stance

    @property
    def posture_name(self) -> str:
        """What NAOqi calls the posture that it is in."""
        return "LyingBack" if self.fallen else "Stand" if self.standing else "Crouch"

    @property
    def walking(self) -> bool:
        """Whether it walks, or is about to."""
        return self.goal is not None or any(self.asked) or any(abs(speed) > 1e-6 for speed in self.walk)

    def go_to_posture(self, name: str, share: float) -> PostureMotion:
        """Go to a posture with stiff motors."""
        for act in self.on_posture:
            act()
        goals = posture(name)
        for joint in self.joints.values():
            joint.stiffness = 1.0
        self._order(goals, share * 0.3)
        self.fallen = False
        self.standing = name.startswith("Stand")
        return PostureMotion(self.joints, goals)

    def ready_to_walk(self) -> bool:
        """Stand as for walking, if the legs carry it; whether they do."""
        if not self.legs_stiff or self.fallen:
            return False
        if not self.standing:
            goals = posture("StandInit")
            legs = {name: goal for name, goal in goals.items() if any(part in name for part in LEGS)}
            self._order(legs, 0.5)
            self.standing = True
        return True

    def _order(self, goals: Mapping[str, float], share: float) -> None:
        """Send joints to their goals."""
        for name, goal in goals.items():
            self.joints[name].order(goal, share)

    def drive(self, speeds: Iterable[float], shares: Iterable[float] = (1.0, 1.0, 1.0)) -> None:
        """Walk with these speeds until told otherwise; ``shares`` of its greatest speeds are what its steps allow."""
        self.goal = None
        self.asked = list(speeds)
        self.step_shares = list(shares)

    def walk_to(self, x: float, y: float, turn: float) -> None:
        """Walk to a place, seen from here."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        self.step_shares = [1.0, 1.0, 1.0]
        self.goal = self.x + x * cos - y * sin, self.y + x * sin + y * cos, self.heading + turn

    def put_on_feet(self) -> None:
        """Somebody has put it there: it stands, and is stiff."""
        goals = posture("Stand")
        for joint in self.joints.values():
            joint.angle = joint.command = goals[joint.name]
            joint.stiffness = 1.0
        self.standing, self.fallen = True, False

    def hold_joints(self) -> None:
        """Each joint stays where it is."""
        for joint in self.joints.values():
            joint.hold()

    def slack(self) -> None:
        """Switch all motors off at once."""
        for joint in self.joints.values():
            joint.stiffness = 0.0
