"""The arm: which servo is which joint, where the horns sit, and where the end stops are.

An arm as it comes from the bench: ids and speed are set, nothing is calibrated, so each joint has its middle at some
other reading of the servo. The ranges of motion are those of the printed parts (LeRobot's so101 description, joint
limits), rounded.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from urbihw_fakes.feetech.bus import FeetechBus
from urbihw_fakes.feetech.servo import FeetechServo


@dataclass(frozen=True, slots=True)
class Joint:
    """One joint.

    Attributes:
        id: of its servo.
        middle: reading of the uncalibrated servo in the middle of the range.
        low, high: end stops, in steps from the middle; None for a joint that turns freely.
    """

    id: int
    middle: int
    low: int | None
    high: int | None


JOINTS: Final = {
    "shoulder_pan": Joint(1, 2010, -1250, 1250),
    "shoulder_lift": Joint(2, 1870, -1130, 1130),
    "elbow_flex": Joint(3, 2230, -1100, 1100),
    "wrist_flex": Joint(4, 2120, -1080, 1080),
    "wrist_roll": Joint(5, 1960, None, None),
    "gripper": Joint(6, 2300, -730, 730),
}


class So101(FeetechBus):
    """One arm, torque off, each joint in its middle; `calibrated`: 2048 is the middle of each servo."""

    def __init__(self, *, calibrated: bool = False) -> None:
        super().__init__([_servo(joint, calibrated) for joint in JOINTS.values()])

    def joint(self, name: str) -> FeetechServo:
        """The servo of a joint by its name."""
        return self.servo(JOINTS[name].id)

    def bend(self, name: str) -> float:
        """How far a joint is from its middle, in steps: what one would measure at the arm."""
        return self.joint(name).motor.angle - JOINTS[name].middle

    def hold(self, name: str, steps: float) -> None:
        """Turn a joint by hand to so many steps from its middle."""
        servo = self.joint(name)
        servo.motor.turn(JOINTS[name].middle + steps - servo.motor.angle)


def _servo(joint: Joint, calibrated: bool) -> FeetechServo:
    servo = FeetechServo("STS3215", joint.id, position=joint.middle)
    if joint.low is not None and joint.high is not None:
        servo.motor.stops = (joint.middle + joint.low, joint.middle + joint.high)
    if calibrated:
        servo.registers.put("offset", joint.middle - 2048)
        if joint.low is not None and joint.high is not None:
            servo.registers.put("min_angle", 2048 + joint.low)
            servo.registers.put("max_angle", 2048 + joint.high)
        servo.boot()
    return servo
