"""ALMotion and ALRobotPosture."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from urbihw_fakes.nao.body import POSTURES, Body, Joint
from urbihw_fakes.nao.services import Failed, Later, Service, as_list

CHAINS = {"Head": ("Head",), "LArm": ("LS", "LE", "LW", "LHand"), "RArm": ("RS", "RE", "RW", "RHand"),
          "LLeg": ("LHip", "LK", "LA"), "RLeg": ("RHip", "RK", "RA")}  # fmt: skip


class Motion:
    """Both services over a body."""

    def __init__(self, body: Body) -> None:
        self.body = body
        self.fall_manager = True
        self.calls: dict[str, int] = {}
        self.service = Service("ALMotion")
        self.posture = Service("ALRobotPosture")
        self._add_joints()
        self._add_walking()
        self._add_posture()

    def _add(self, returns: str, name: str, takes: str, run: Callable[..., Any]) -> None:
        def counted(*arguments: Any) -> Any:
            self.calls[name] = self.calls.get(name, 0) + 1
            return run(*arguments)

        self.service.add(returns, name, takes, counted)

    # ---------------------------------------------------------------- joints

    def named(self, names: Any) -> list[Joint]:
        """The joints of a name, a chain, or several."""
        found: list[Joint] = []
        for name in as_list(names):
            if name in ("Body", "Joints", "JointActuators", "Actuators"):
                found += self.body.joints.values()
            elif name in CHAINS:
                found += [joint for each, joint in self.body.joints.items() if each.startswith(CHAINS[name])]
            elif name in self.body.joints:
                found.append(self.body.joints[name])
            else:
                raise Failed(f"ALMotion: {name} is not a recognized joint name\n\n    at motion.cpp:42")
        return found

    def _pairs(self, names: Any, values: Any) -> list[tuple[Joint, float]]:
        joints, numbers = self.named(names), [float(each) for each in as_list(values)]
        if len(numbers) == 1:
            numbers *= len(joints)
        if len(joints) != len(numbers):
            raise Failed(f"ALMotion: {len(joints)} joints and {len(numbers)} values")
        return list(zip(joints, numbers, strict=True))

    def _add_joints(self) -> None:
        def set_angles(names: Any, angles: Any, share: float) -> None:
            for joint, angle in self._pairs(names, angles):
                joint.order(angle, share)

        def change_angles(names: Any, changes: Any, share: float) -> None:
            for joint, change in self._pairs(names, changes):
                joint.order(joint.angle + change, share)

        def get_angles(names: Any, sensors: bool) -> list[float]:
            return [joint.angle if sensors else joint.command for joint in self.named(names)]

        def stiffen(names: Any, values: Any) -> None:
            for joint, value in self._pairs(names, values):
                joint.stiffness = min(max(value, 0.0), 1.0)

        def interpolate(names: Any, angles: Any, share: float) -> Later:
            set_angles(names, angles, share)
            pairs = self._pairs(names, angles)
            return Later(lambda: all(abs(one.angle - one.command) < 0.01 or one.stiffness < 0.05 for one, _ in pairs))

        def hand(place: float) -> Callable[[str], Later]:
            def move(name: str) -> Later:
                (joint,) = self.named(name)
                joint.stiffness = 1.0
                joint.order(place, 1.0)

                def there() -> bool:
                    if abs(joint.angle - joint.command) > 0.01:
                        return False
                    joint.stiffness = 0.0
                    return True

                return Later(there)

            return move

        self._add("v", "setAngles", "(mmf)", set_angles)
        self._add("v", "changeAngles", "(mmf)", change_angles)
        self._add("[f]", "getAngles", "(mb)", get_angles)
        self._add("v", "setStiffnesses", "(mm)", stiffen)
        self._add("[f]", "getStiffnesses", "(m)", lambda names: [joint.stiffness for joint in self.named(names)])
        self._add("v", "angleInterpolationWithSpeed", "(mmf)", interpolate)
        self._add("v", "openHand", "(s)", hand(1.0))
        self._add("v", "closeHand", "(s)", hand(0.0))
        self._add("[s]", "getBodyNames", "(s)", lambda name: [joint.name for joint in self.named(name)])
        self._add("m", "getLimits", "(s)", lambda name: [
            [joint.low, joint.high, joint.fastest, 1.5] for joint in self.named(name)
        ])  # fmt: skip
        self._add("m", "getRobotConfig", "()", lambda: [
            ["Model Type", "Head Version", "Body Version"], ["naoH25", "VERSION_50", "VERSION_50"],
        ])  # fmt: skip

    # ---------------------------------------------------------------- walking

    def _ready(self) -> None:
        if not self.body.ready_to_walk():
            raise Failed("ALMotion: the robot cannot walk: it has fallen, or its legs have no stiffness")

    def _add_walking(self) -> None:
        body = self.body

        def go_to(x: float, y: float, turn: float, *_: Any) -> Later:
            self._ready()
            body.walk_to(x, y, turn)
            return Later(lambda: body.goal is None and not body.walking)

        def go(x: float, y: float, turn: float, *_: Any) -> None:
            self._ready()
            body.drive((x, y, turn))

        def stop() -> None:
            body.drive((0.0, 0.0, 0.0))

        def kill() -> None:
            stop()
            for joint in body.joints.values():
                joint.command = joint.angle

        def wake_up() -> Later:
            return Later(body.take_posture("Stand", 1.0))

        def rest() -> Later:
            stop()
            body.standing = False
            there = body.take_posture("Crouch", 1.0)

            def done() -> bool:
                if not there():
                    return False
                body.slack()
                return True

            return Later(done)

        def manage_falls(on: bool) -> None:
            self.fall_manager = on

        for name in ("moveTo", "walkTo"):
            self._add("v", name, "(fff)", go_to)
        self._add("v", "moveTo", "(ffff)", go_to)
        self._add("v", "moveTo", "(fffm)", go_to)
        self._add("v", "move", "(fff)", go)
        self._add("v", "move", "(fffm)", go)
        self._add("v", "stopMove", "()", stop)
        self._add("v", "killMove", "()", stop)
        self._add("v", "killAll", "()", kill)
        self._add("v", "moveInit", "()", self._ready)
        self._add("b", "moveIsActive", "()", lambda: body.walking)
        self._add("v", "waitUntilMoveIsFinished", "()", lambda: Later(lambda: not body.walking))
        self._add("[f]", "getRobotPosition", "(b)", lambda sensors: [body.x, body.y, body.heading])
        self._add("[f]", "getRobotVelocity", "()", lambda: list(body.walk))
        self._add("v", "wakeUp", "()", wake_up)
        self._add("v", "rest", "()", rest)
        self._add("b", "robotIsWakeUp", "()", lambda: body.legs_stiff)
        self._add("v", "setFallManagerEnabled", "(b)", manage_falls)
        self._add("b", "getFallManagerEnabled", "()", lambda: self.fall_manager)

    # ---------------------------------------------------------------- postures

    def _add_posture(self) -> None:
        body = self.body

        def take(name: str, share: float) -> Later:
            if name not in POSTURES:
                raise Failed(f"ALRobotPosture: no posture {name}")
            return Later(body.take_posture(name, share), True)

        def stop() -> None:
            for joint in body.joints.values():
                joint.command = joint.angle

        def name_of() -> str:
            return "LyingBack" if body.fallen else "Stand" if body.standing else "Crouch"

        self.posture.add("b", "goToPosture", "(sf)", take)
        self.posture.add("v", "stopMove", "()", stop)
        self.posture.add("s", "getPosture", "()", name_of)
        self.posture.add("[s]", "getPostureList", "()", lambda: list(POSTURES))
