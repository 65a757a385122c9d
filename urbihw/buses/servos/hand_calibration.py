"""The calibration of a servo chain by hand: without torque, the joints are moved by the user and observed here.

Steps, each a method: `release` (torque off), `center` (the middle of each joint becomes the middle of the servo's turn,
by its homing offset, where it has one), `observe` (the range), `result` (what goes into the file). Then
`write_calibration` sets the limits of a servo.

Feetech and Dynamixel give the homing offset opposite signs, so the sign is found by trying. A Dynamixel X in position
mode applies at most a quarter of a turn: if the middle cannot be reached, the offset becomes 0, and a message says so.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from urbihw.buses.errors import BadFrame, BadValue, BusTimeout
from urbihw.buses.link import Link
from urbihw.buses.servos.calibration import JointCalibration
from urbihw.buses.servos.device import ServoDevice
from urbihw.buses.servos.item import Mode, ShaftMotion
from urbihw.buses.servos.registers import ServoError, ServoRegisters, write_differences

_POSITION: Final = "present_position"
_OFFSET: Final = "homing_offset"
_CENTERED: Final = 40
"""Counts by which a centred joint may be off: a hand that holds it trembles."""
_LEAST_RANGE: Final = 20
"""Counts that a joint must have been moved to have a range."""


@dataclass
class CalibratedJoint:
    """One joint while it is calibrated, in raw counts.

    Attributes:
        name: of the joint.
        registers: of its servo.
        offset: the homing offset in the servo, 0 if it has none.
        present: the position at the last look.
        low, high: the range so far.
        is_silent: its servo did not answer at the last look.
        reversed: its direction is the reverse of that of the servo.
    """

    name: str
    registers: ServoRegisters
    offset: int = 0
    present: int = 0
    low: int = 0
    high: int = 0
    is_silent: bool = False
    reversed: bool = False

    @property
    def id(self) -> int:
        """The id of its servo."""
        return self.registers.device.id

    @property
    def is_measured(self) -> bool:
        """Whether it has been moved."""
        return self.high - self.low >= _LEAST_RANGE

    @property
    def has_offset(self) -> bool:
        """Whether its servo has a homing offset."""
        return _OFFSET in self.registers.table.items


class HandCalibration:
    """The calibration of the joints of one line; `servos` are their devices by name.

    Attributes:
        joints: in the order of `servos`.

    Raises ServoError for a device without a motor; all methods raise LinkGone, and all but `observe`
    BusTimeout and BadFrame.
    """

    def __init__(self, link: Link, servos: Mapping[str, ServoDevice]) -> None:
        self.joints = [CalibratedJoint(name, ServoRegisters(link, device)) for name, device in servos.items()]
        for joint in self.joints:
            if not joint.registers.table.has_motor or _POSITION not in joint.registers.table.items:
                raise ServoError(f"{joint.name} (id {joint.id}) is no joint: {joint.registers.device.name}")

    def release(self) -> None:
        """Switch the torque of all joints off, and note where they are. Raises ServoError when one keeps it."""
        for joint in self.joints:
            joint.registers.turn_torque_off()
            joint.offset = joint.registers.read_one(_OFFSET) if joint.has_offset else 0
        self.forget_ranges()

    def center(self) -> list[str]:
        """Make the present position of each joint the middle of its servo's turn; return a line for each that cannot.

        A servo without a homing offset stays as it is, without a line. Raises ServoError.
        """
        problems = [_center(joint) for joint in self.joints if joint.has_offset]
        self.forget_ranges()
        return [problem for problem in problems if problem]

    def forget_ranges(self) -> None:
        """Begin to record the ranges anew, from where the joints are."""
        for joint in self.joints:
            joint.present = joint.low = joint.high = joint.registers.read_one(_POSITION)

    def observe(self) -> None:
        """Look where all joints are, and extend their ranges; a servo may be silent while its plug is loose."""
        for joint in self.joints:
            try:
                joint.present = joint.registers.read_one(_POSITION)
            except (BadFrame, BusTimeout):
                joint.is_silent = True
                continue
            joint.is_silent = False
            joint.low, joint.high = min(joint.low, joint.present), max(joint.high, joint.present)

    def result(self) -> dict[str, JointCalibration]:
        """Return the calibration of the joints that have been moved and answer."""
        return {
            joint.name: JointCalibration(joint.id, int(joint.reversed), joint.offset, joint.low, joint.high)
            for joint in self.joints
            if joint.is_measured and not joint.is_silent
        }


def _center(joint: CalibratedJoint) -> str:
    """Center one joint by its homing offset; return why not, "" if it is centred."""
    registers = joint.registers
    item = registers.table.item(_OFFSET)
    middle = (_turn(registers) - 1) // 2
    registers.write(_OFFSET, 0)
    actual = registers.read_one(_POSITION)
    for offset in (middle - actual, actual - middle):
        try:
            registers.write(_OFFSET, min(max(offset, item.low), item.high))
        except (ServoError, BadValue):
            continue
        if abs(registers.read_one(_POSITION) - middle) <= _CENTERED:
            joint.offset = registers.read_one(_OFFSET)
            return ""
    registers.write(_OFFSET, 0)
    joint.offset = 0
    return (
        f"{joint.name}: its middle is {actual - middle:+} counts from that of the servo, more than its homing offset "
        "takes; mount the horn nearer to the middle if it runs out of its range"
    )


def _turn(registers: ServoRegisters) -> int:
    """Return the counts of one turn, from the highest position limit of the model. Raises ServoError without one."""
    limits = next((mode.limits for mode in registers.table.modes if len(mode.limits) == 2), None)
    if limits is None:
        raise ServoError(f"servo {registers.device.id}: {registers.device.name} has no position limits")
    return registers.table.item(limits[1]).high + 1


def position_mode(device: ServoDevice) -> Mode | None:
    """Return the mode of a device if it is one with position limits, else None."""
    mode = device.mode
    return mode if mode is not None and mode.motion is ShaftMotion.POSITION and len(mode.limits) == 2 else None


def register_changes(link: Link, device: ServoDevice, joint: JointCalibration) -> dict[str, tuple[int, int]]:
    """Return what a calibration changes in a servo: item -> (present value, new value).

    These are the homing offset and the position limits, as far as the servo has them in its present mode, within what
    it takes. Raises ServoError, BusTimeout, BadFrame, LinkGone.
    """
    registers = ServoRegisters(link, device)
    wanted = {_OFFSET: joint.homing_offset} if _OFFSET in registers.table.items else {}
    mode = position_mode(device)
    if mode is not None:
        wanted |= {mode.limits[0]: joint.range_min, mode.limits[1]: joint.range_max}
    items = {name: registers.table.item(name) for name in wanted}
    wanted = {name: min(max(raw, items[name].low), items[name].high) for name, raw in wanted.items()}
    found = registers.read(wanted)
    return {name: (found[name], wanted[name]) for name in items if found[name] != wanted[name]}


def write_calibration(link: Link, device: ServoDevice, joint: JointCalibration) -> list[str]:
    """Write what `register_changes` returns, with the torque off; return a line for each item not taken over.

    Raises ServoError, BusTimeout, BadFrame, LinkGone.
    """
    changes = register_changes(link, device, joint)
    return write_differences(ServoRegisters(link, device), changes) if changes else []


def named(servos: Mapping[int, ServoDevice], names: Mapping[str, int]) -> dict[str, ServoDevice]:
    """Return devices by the names of joints; without names, `motor` and the id. Raises ServoError for an absent one."""
    wanted = names or {f"motor{number}": number for number, device in servos.items() if _has_joint(device)}
    missing = [f"{name} (id {number})" for name, number in wanted.items() if number not in servos]
    if missing:
        raise ServoError(f"no servo answers for {', '.join(missing)}: is it plugged in?")
    return {name: servos[number] for name, number in wanted.items()}


def _has_joint(device: ServoDevice) -> bool:
    return device.table is not None and device.table.has_motor
