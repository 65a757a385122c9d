"""A Nao in MuJoCo: the commands and stiffnesses of its joints move a model, and its sensors feel what happens to it.

At the start it crouches with slack joints, as a real one does after it was switched on.  It stands because its feet
carry it, and falls when it is pushed hard, or when its legs go slack while it stands.  It cannot get up by itself: on
the floor, a posture bends its joints where it lies, and somebody has to put it on its feet (``stand``).

Choices: all joints arrive at a posture together, and it tips over from ``TIPPING`` on.  The fingers are not in the
model.  See ``glide`` for walking: x, y and heading are what walking believes, ``place`` is where the robot is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from urbihw_fakes.bodies.simulation import Simulation
from urbihw_nao_fakes.body import Body, Feeling, PostureMotion, posture
from urbihw_nao_fakes.glide import Glide
from urbihw_nao_fakes.nao_joints import COUPLED, COUPLED_TO, PERIOD, STEP, DrivenJoint, Motors, driven
from urbihw_nao_fakes.nao_senses import BUMPERS, Senses

LONGEST_GAP = 10.0
"""s; a longer pause of the caller is no time for the body."""
SHORTEST_WAY = 1.2
"""s that the way to a posture takes at least."""
PUSH_TIME = 0.1
"""s that a push lasts."""
TIPPING, FALLEN, UPRIGHT = math.radians(35), math.radians(60), math.radians(30)
"""Leans of the torso: from which it cannot come back, beyond which it lies, below which it is on its feet again."""
SONAR_PERIOD = 0.1
"""s between two echoes."""
SOLES = ("right_sole", "left_sole")
_LIES = 0.7


class LeggedBody(Body):
    """A Nao in a world; ``world`` as in ``simulation``.  Raises UnknownRequest.

    Attributes:
        simulation: its world.
    """

    def __init__(self, world: str) -> None:
        super().__init__()
        self.simulation = Simulation("nao", world, STEP)
        self._torso = self.simulation.body("torso")
        self._start = self.simulation.pose(self._torso)
        self._driven: dict[str, DrivenJoint] = {}
        for name, joint in self.joints.items():
            if not name.endswith("Hand"):
                self.joints[name] = self._driven[name] = driven(joint)
        self._motors = Motors(self.simulation, list(self._driven.values()))
        self._senses = Senses(self.simulation)
        self._glide = Glide(self.simulation, "torso", SOLES)
        self._felt: Feeling | None = None
        self._push = (0.0, 0.0)
        self._push_left = 0.0
        self._echo_at = 0.0
        self._bumped = dict.fromkeys(BUMPERS, 0.0)
        self.put(*self._start)

    # ---------------------------------------------------------------- time

    def advance(self, now: float) -> None:
        """As in ``Body``, in equal steps."""
        if self._now is None or now - self._now > LONGEST_GAP:
            self._now = now
        while self._now + PERIOD <= now + 1e-9:
            self._now += PERIOD
            for act in self.on_step:
                act(self._now)
            self._step(PERIOD)

    def due(self) -> float | None:
        """When it wants to move on: it falls also without a request."""
        return None if self._now is None else self._now + PERIOD

    def _move(self, dt: float) -> None:
        right, left = self.joints[COUPLED], self.joints[COUPLED_TO]
        right.command, right.stiffness, right.share = left.command, left.stiffness, left.share
        for joint in self.joints.values():
            joint.advance(dt)
        self._glide.push(self.walk if any(self.walk) and self._grounded() else None)
        if self._push_left > 0.0:
            self._push_left -= dt
            self.simulation.data.xfrc_applied[self._torso][:2] += self._push
        self._motors.run()
        self._felt = None
        self._judge()
        self._touch()

    def _grounded(self) -> bool:
        return any(sum(weights) > 0.0 for weights in self.feeling.weights.values())

    def _judge(self) -> None:
        """Whether it stands, tips over, has fallen, or was picked up."""
        tilt = self.tilt
        if self.fallen:
            self.fallen = tilt > UPRIGHT
        elif tilt > FALLEN:
            self._fall()
        elif self.standing and not self.legs_stiff:
            self._give_up_standing()
        elif self.standing and tilt > TIPPING:
            self._give_up_standing()
            self.on_tip()

    def _touch(self) -> None:
        pressed = self._senses.bumpers()
        for name, value in pressed.items():
            if value != self._bumped[name]:
                self.touched[name] = value
        self._bumped = pressed
        if self.simulation.time >= self._echo_at:
            self._echo_at = self.simulation.time + SONAR_PERIOD
            self.sonars[:] = self._senses.listen()

    # ---------------------------------------------------------------- what it feels, and where it is

    @property
    def feeling(self) -> Feeling:
        """What its sensors feel."""
        if self._felt is None:
            self._felt = self._senses.feel()
        return self._felt

    @property
    def posture_name(self) -> str:
        """As in ``Body``, with the side on which it lies."""
        if not self.fallen:
            return super().posture_name
        ahead, left, _ = (float(value) for value in self.simulation.data.xmat[self._torso][6:])
        if abs(ahead) > _LIES:
            return "LyingBack" if ahead > 0 else "LyingBelly"
        return "LyingRight" if left > 0 else "LyingLeft"

    @property
    def height(self) -> float:
        """How high its torso is: m."""
        return float(self.simulation.data.xpos[self._torso][2])

    @property
    def tilt(self) -> float:
        """How far its torso leans from upright: rad."""
        return self.simulation.tilt(self._torso)

    @property
    def place(self) -> tuple[float, float, float]:
        """Where it is, and where it faces: m, m, rad."""
        return self.simulation.pose(self._torso)

    # ---------------------------------------------------------------- its orders, and what is done to it

    def put(self, x: float, y: float, heading: float) -> None:
        """Somebody puts it on its feet there: m, m, rad; its joints stay as they are."""
        data, (_, root) = self.simulation.data, self.simulation.joint("torso")
        self._motors.place()
        data.qvel[root : root + 6] = 0.0
        self.simulation.put_on_feet("torso", SOLES, (x, y, heading))
        self.fallen, self._push_left, self._felt = False, 0.0, None
        self.sonars[:] = self._senses.listen()

    def stand(self) -> None:
        """Somebody puts it on its feet where it started; slack joints are bent as for standing."""
        goals = posture("Stand")
        for name, joint in self._driven.items():
            if not joint.driven:
                joint.place(goals[name])
        self.put(*self._start)
        self.standing = self.legs_stiff

    def put_on_feet(self) -> None:
        """As in ``Body``, where it is now."""
        super().put_on_feet()
        for joint in self._driven.values():
            joint.place(joint.command)
        self.put(*self.place)

    def push(self, forward: float, left: float) -> None:
        """Push its chest for ``PUSH_TIME``; N, ahead and to the left of it."""
        _, _, heading = self.place
        cos, sin = math.cos(heading), math.sin(heading)
        self._push = (forward * cos - left * sin, forward * sin + left * cos)
        self._push_left = PUSH_TIME

    def go_to_posture(self, name: str, share: float) -> PostureMotion:
        """As in ``Body``; on the floor it bends its joints where it lies."""
        lies = self.fallen
        way = super().go_to_posture(name, share)
        self.fallen, self.standing = lies, self.standing and not lies
        return way

    def _order(self, goals: Mapping[str, float], share: float) -> None:
        """Send joints to their goals so that all arrive together."""
        super()._order(goals, 1.0)
        joints = [self.joints[name] for name in goals]
        ways = {joint.name: abs(joint.command - joint.angle) / joint.fastest for joint in joints}
        seconds = max(SHORTEST_WAY, max(ways.values()) / max(share, 0.01))
        for joint in joints:
            joint.share = min(1.0, ways[joint.name] / seconds)


def describe(body: LeggedBody) -> str:
    """Where it is and what it does, in a line."""
    x, y, heading = body.place
    return (f"{x:.3f} {y:.3f} {math.degrees(heading):.1f}, torso {body.height:.3f} m high, "
            f"leans {math.degrees(body.tilt):.0f} degrees, {body.doing}")  # fmt: skip
