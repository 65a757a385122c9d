"""ALMotion: joints, stiffness, hands and walking."""

from __future__ import annotations

from typing import Any

from urbihw_nao_fakes.body import FASTEST, STIFF, Body, Joint
from urbihw_nao_fakes.services import Failed, Later, as_list, finite, method
from urbihw_nao_fakes.wholebody import WholeBody

CHAINS = {"Head": ("Head",), "LArm": ("LS", "LE", "LW", "LHand"), "RArm": ("RS", "RE", "RW", "RHand"),
          "LLeg": ("LHip", "LK", "LA"), "RLeg": ("RHip", "RK", "RA")}  # fmt: skip
STEPS = {"MaxStepX": 0.04, "MaxStepY": 0.14, "MaxStepTheta": 0.349}
"""The longest steps without a configuration, m and rad."""
FREQUENCY = "MaxStepFrequency"
OTHERS = ("StepHeight", "TorsoWx", "TorsoWy")
WHOLE_BODY = ("Body", "Joints", "JointActuators", "Actuators")
TORQUE = 1.5
"""What `getLimits` says of each joint, Nm."""
MODEL = [["Model Type", "Head Version", "Body Version"], ["naoH25", "VERSION_50", "VERSION_50"]]


def gait_shares(config: Any) -> tuple[float, ...]:
    """The shares of its greatest speeds with which the robot walks by foot-step parameters.  Raises Failed."""
    steps, frequency = dict(STEPS), 1.0
    for name, value in config or ():
        plain = name.removeprefix("Left").removeprefix("Right")
        if plain in STEPS:
            # Both feet must come as far.
            steps[plain] = min(steps[plain], float(value)) if plain != name else float(value)
        elif plain == FREQUENCY:
            frequency = min(1.0, float(value))
        elif plain not in OTHERS:
            raise Failed(f"ALMotion: {name} is no parameter of steps")
    return tuple(frequency * steps[name] / most for name, most in STEPS.items())


def _last(value: Any) -> float:
    """The last number of a list, however deep."""
    while isinstance(value, list | tuple):
        value = value[-1]
    return finite(value)


class Motion(WholeBody):
    """ALMotion of a body; ``fall_manager`` is whether it is on."""

    name = "ALMotion"

    def __init__(self, body: Body) -> None:
        super().__init__(body)
        self.fall_manager = True
        self.abrupt_ends = 0

    # ---------------------------------------------------------------- joints

    def find_joints(self, names: Any) -> list[Joint]:
        """The joints of a name, a chain, or several.  Raises Failed."""
        found: list[Joint] = []
        for name in as_list(names):
            if name in WHOLE_BODY:
                found += self.body.joints.values()
            elif name in CHAINS:
                found += [joint for each, joint in self.body.joints.items() if each.startswith(CHAINS[name])]
            elif name in self.body.joints:
                found.append(self.body.joints[name])
            else:
                raise Failed(f"ALMotion: {name} is not a recognized joint name\n\n    at motion.cpp:42")
        return found

    def _pair(self, names: Any, values: Any) -> list[tuple[Joint, float]]:
        joints, numbers = self.find_joints(names), [finite(each) for each in as_list(values)]
        if len(numbers) == 1:
            numbers *= len(joints)
        if len(joints) != len(numbers):
            raise Failed(f"ALMotion: {len(joints)} joints and {len(numbers)} values")
        return list(zip(joints, numbers, strict=True))

    @method("setAngles", "(mmf)")
    def set_angles(self, names: Any, angles: Any, share: float) -> None:
        """Goals, and the share of the greatest speed."""
        for joint, angle in self._pair(names, angles):
            joint.order(angle, finite(share))

    @method("changeAngles", "(mmf)")
    def change_angles(self, names: Any, changes: Any, share: float) -> None:
        """Goals, seen from where the joints are."""
        for joint, change in self._pair(names, changes):
            joint.order(joint.angle + change, finite(share))

    @method("getAngles", "(mb)", "[f]")
    def get_angles(self, names: Any, sensors: bool) -> list[float]:
        """Measured angles, or the commands."""
        return [joint.angle if sensors else joint.command for joint in self.find_joints(names)]

    @method("setStiffnesses", "(mm)")
    def set_stiffnesses(self, names: Any, values: Any) -> None:
        """Set stiffnesses of joints, 0 to 1."""
        for joint, value in self._pair(names, values):
            joint.stiffness = min(max(value, 0.0), 1.0)

    @method("getStiffnesses", "(m)", "[f]")
    def get_stiffnesses(self, names: Any) -> list[float]:
        """The stiffnesses of joints, 0 to 1."""
        return [joint.stiffness for joint in self.find_joints(names)]

    @method("angleInterpolationWithSpeed", "(mmf)")
    def interpolate_angles(self, names: Any, angles: Any, share: float) -> Later:
        """Goals; the answer comes when all stiff joints are there."""
        self.set_angles(names, angles, share)
        joints = self.find_joints(names)
        return Later(lambda: all(one.arrived or one.stiffness < STIFF for one in joints))

    @method("angleInterpolation", "(mmmb)")
    def interpolate_courses(self, names: Any, angles: Any, times: Any, absolute: bool) -> Later:
        """The last angles of courses, so fast that they are reached in time."""
        joints = self.find_joints(names)
        goals = [_last(each) for each in (as_list(angles) if len(joints) > 1 else [angles])]
        ends = [_last(each) for each in (as_list(times) if len(joints) > 1 else [times])]
        for joint, goal, end in zip(joints, goals, ends, strict=True):
            place = goal if absolute else joint.angle + goal
            joint.order(place, abs(place - joint.angle) / end / joint.fastest)
        return Later(lambda: all(one.arrived or one.stiffness < STIFF for one in joints))

    @method("openHand", "(s)")
    def open_hand(self, name: str) -> Later:
        """The answer comes when it is open and slack."""
        return self._move_hand(name, 1.0)

    @method("closeHand", "(s)")
    def close_hand(self, name: str) -> Later:
        """The answer comes when it is closed and slack."""
        return self._move_hand(name, 0.0)

    def _move_hand(self, name: str, place: float) -> Later:
        (joint,) = self.find_joints(name)
        joint.stiffness = 1.0
        joint.order(place, 1.0)

        def arrived() -> bool:
            if not joint.arrived:
                return False
            joint.stiffness = 0.0
            return True

        return Later(arrived)

    @method("getBodyNames", "(s)", "[s]")
    def get_body_names(self, name: str) -> list[str]:
        """Joints of a chain."""
        return [joint.name for joint in self.find_joints(name)]

    @method("getLimits", "(s)", "m")
    def get_limits(self, name: str) -> list[list[float]]:
        """Least and greatest angle, greatest speed and torque of each joint."""
        return [[joint.low, joint.high, joint.fastest, TORQUE] for joint in self.find_joints(name)]

    @method("getRobotConfig", "()", "m")
    def get_robot_config(self) -> list[list[str]]:
        """Two lists: names and values."""
        return MODEL

    # ---------------------------------------------------------------- walking

    @method("moveTo", "(fff)")
    @method("walkTo", "(fff)")
    @method("moveTo", "(ffff)")
    @method("moveTo", "(fffm)")
    def walk_to(self, x: float, y: float, turn: float, *_: Any) -> Later:
        """Walk to a place seen from here; the answer comes when it stands there."""
        way = finite(x), finite(y), finite(turn)
        self.prepare_walk()
        self.body.walk_to(*way)
        return Later(lambda: self.body.goal is None and not self.body.walking)

    @method("move", "(fff)")
    @method("move", "(fffm)")
    def walk(self, x: float, y: float, turn: float, config: Any = ()) -> None:
        """Walk with these speeds until told otherwise: m/s, m/s, rad/s."""
        shares, speeds = gait_shares(config), (finite(x), finite(y), finite(turn))
        self.prepare_walk()
        self.body.drive(speeds, shares)

    @method("moveToward", "(fff)")
    @method("moveToward", "(fffm)")
    def walk_by_shares(self, x: float, y: float, turn: float, config: Any = ()) -> None:
        """The same with shares of the greatest speeds."""
        self.walk(x * FASTEST[0], y * FASTEST[1], turn * FASTEST[2], config)

    @method("stopMove")
    def stop_walk(self) -> None:
        """Stand still, after the next step."""
        self.body.drive((0.0, 0.0, 0.0))

    @method("killMove")
    def kill_walk(self) -> None:
        """Stop at once, wherever the feet are: a real robot may fall."""
        self.abrupt_ends += self.body.walking
        self.body.drive((0.0, 0.0, 0.0))

    @method("killAll")
    def stop_all(self) -> None:
        """Stop at once, and hold all joints where they are."""
        self.kill_walk()
        self.body.hold_joints()

    @method("moveInit")
    def prepare_walk(self) -> None:
        """Stand as for walking.  Raises Failed."""
        if not self.body.ready_to_walk():
            raise Failed("ALMotion: the robot cannot walk: it has fallen, or its legs have no stiffness")

    @method("moveIsActive", "()", "b")
    def is_walking(self) -> bool:
        """Whether the robot walks at present."""
        return self.body.walking

    @method("waitUntilMoveIsFinished")
    def wait_for_walk(self) -> Later:
        """The answer comes when it stands."""
        return Later(lambda: not self.body.walking)

    @method("getRobotPosition", "(b)", "[f]")
    def get_position(self, sensors: bool) -> list[float]:
        """Where it is: m, m, rad."""
        return [self.body.x, self.body.y, self.body.heading]

    @method("getRobotVelocity", "()", "[f]")
    def get_velocity(self) -> list[float]:
        """How it walks: m/s, m/s, rad/s."""
        return list(self.body.walk)

    # ---------------------------------------------------------------- the whole robot

    @method("wakeUp")
    def wake_up(self) -> Later:
        """Stiffen all motors and stand up."""
        return Later(self.body.go_to_posture("Stand", 1.0).ended)

    @method("rest")
    def rest(self) -> Later:
        """Crouch, and slacken all motors."""
        self.stop_walk()
        self.body.standing = False
        way = self.body.go_to_posture("Crouch", 1.0)

        def rested() -> bool:
            if way.reached():
                self.body.slack()
            return way.ended()

        return Later(rested)

    @method("robotIsWakeUp", "()", "b")
    def is_awake(self) -> bool:
        """Whether the legs are stiff."""
        return self.body.legs_stiff

    @method("setFallManagerEnabled", "(b)")
    def set_fall_manager(self, on: bool) -> None:
        """Switch the fall manager on or off."""
        self.fall_manager = on

    @method("getFallManagerEnabled", "()", "b")
    def get_fall_manager(self) -> bool:
        """Whether it is on."""
        return self.fall_manager
