"""The state machine of CiA 402 and the objects of a drive, as tables; no input and output.

    fault -> (reset) -> switch on disabled -> ready -> switched on -> enabled        power on the motor in the last only
    enabled -> quick stop -> switch on disabled

Source: CiA 402-2 as canopen 2.4 (`profiles/p402.py`) and makers' manuals quote it.
"""

from __future__ import annotations

from typing import Any, Final

from canopen import objectdictionary as od

SERVO = 402
"""Low half of the device type (0x1000) of a drive after this profile."""
DISABLED, READY, SWITCHED_ON, ENABLED, QUICK_STOP, REACTION, FAULT, NOT_READY = (
    "switch on disabled",
    "ready to switch on",
    "switched on",
    "operation enabled",
    "quick stop active",
    "fault reaction active",
    "fault",
    "not ready to switch on",
)
_STATES: Final = (
    (0x4F, 0x00, NOT_READY),
    (0x4F, 0x40, DISABLED),
    (0x6F, 0x21, READY),
    (0x6F, 0x23, SWITCHED_ON),
    (0x6F, 0x27, ENABLED),
    (0x6F, 0x07, QUICK_STOP),
    (0x4F, 0x0F, REACTION),
    (0x4F, 0x08, FAULT),
)
"""(mask, value, state) of status words."""
_TO_ENABLED: Final = {DISABLED: 0x0006, READY: 0x0007, SWITCHED_ON: 0x000F, ENABLED: 0x000F, QUICK_STOP: 0x0000}
_TO_OFF: Final = {ENABLED: 0x0006, SWITCHED_ON: 0x0006, QUICK_STOP: 0x0000}
"""State -> control word that leads on."""
QUICK, RESET = 0x0002, 0x0080
HALT, NEW_POINT, AT_ONCE = 0x0100, 0x0010, 0x0020
POINT_TAKEN = 0x1000
START_HOMING, REACHED, HOME_FOUND, HOMING_ERROR = 0x0010, 0x0400, 0x1000, 0x2000
"""Homing mode: bit 4 of the control word; bits 10, 12 and 13 of the status word."""

POSITION, VELOCITY, TORQUE, HOMING = 1, 3, 4, 6
MODES: Final = {POSITION: "position", VELOCITY: "velocity", TORQUE: "torque", HOMING: "homing"}
CAN_TURN, CAN_PUSH, CAN_HOME = 0x04, 0x08, 0x20
"""Bits of the supported drive modes (0x6502): profile velocity, profile torque, homing."""

CONTROL, STATUS, MODE, MODE_SHOWN = 0x6040, 0x6041, 0x6060, 0x6061
PLACE, SPEED, TARGET_PLACE, TARGET_SPEED = 0x6064, 0x606C, 0x607A, 0x60FF
ERROR, SUPPORTED, CONNECTION_LOST = 0x603F, 0x6502, 0x6007
TARGET_TORQUE, TORQUE_SHOWN, RATED_TORQUE, HOMING_METHOD = 0x6071, 0x6077, 0x6076, 0x6098
HEARTBEAT, WATCHED = 0x1017, 0x1016
PROFILE_SPEED = 0x6081

_VARIABLES: Final = (
    (0x1000, od.UNSIGNED32),
    (0x1001, od.UNSIGNED8),
    (0x1008, od.VISIBLE_STRING),
    (HEARTBEAT, od.UNSIGNED16),
    (CONNECTION_LOST, od.INTEGER16),
    (ERROR, od.UNSIGNED16),
    (CONTROL, od.UNSIGNED16),
    (STATUS, od.UNSIGNED16),
    (MODE, od.INTEGER8),
    (MODE_SHOWN, od.INTEGER8),
    (PLACE, od.INTEGER32),
    (SPEED, od.INTEGER32),
    (TARGET_TORQUE, od.INTEGER16),
    (RATED_TORQUE, od.UNSIGNED32),
    (TORQUE_SHOWN, od.INTEGER16),
    (TARGET_PLACE, od.INTEGER32),
    (0x607C, od.INTEGER32),
    (0x607F, od.UNSIGNED32),
    (PROFILE_SPEED, od.UNSIGNED32),
    (0x6083, od.UNSIGNED32),
    (0x6085, od.UNSIGNED32),
    (HOMING_METHOD, od.INTEGER8),
    (0x609A, od.UNSIGNED32),
    (TARGET_SPEED, od.INTEGER32),
    (SUPPORTED, od.UNSIGNED32),
)
_RECORDS: Final = (
    (WATCHED, od.UNSIGNED32),
    (0x607D, od.INTEGER32),
    (0x608F, od.UNSIGNED32),
    (0x6099, od.UNSIGNED32),
)
"""Records whose members 1 and 2 are of this type."""
_PDO_SETTINGS: Final = ((1, od.UNSIGNED32), (2, od.UNSIGNED8), (5, od.UNSIGNED16))
RECEIVED: Final = {1: (CONTROL, MODE), 2: (TARGET_SPEED,), 3: (TARGET_PLACE,)}
"""Number of the drive's receive PDO -> what it holds; with these our words reach it."""
SENT: Final = {1: (STATUS, MODE_SHOWN), 2: (PLACE, SPEED)}
RECEIVED_TORQUE: Final = {4: (TARGET_TORQUE,)}
SENT_TORQUE: Final = {3: (TORQUE_SHOWN,)}
"""As the two above, for drives with the torque mode."""


def state_of(status: int) -> str:
    """The state that a status word tells."""
    return next((name for mask, value, name in _STATES if status & mask == value), NOT_READY)


def control_towards(enabled: bool, state: str) -> int | None:
    """The control word that leads from a state towards power on or off; None where none does."""
    return (_TO_ENABLED if enabled else _TO_OFF).get(state)


def dictionary() -> od.ObjectDictionary:
    """What any drive after the profile has, as far as it is used here."""
    made = od.ObjectDictionary()  # type: ignore[no-untyped-call]
    for index, kind in _VARIABLES:
        made.add_object(_variable(index, 0, kind))
    for index, kind in _RECORDS:
        made.add_object(_record(index, ((1, kind), (2, kind))))
    for base, mapping in ((0x1400, 0x1600), (0x1800, 0x1A00)):
        for number in range(4):
            made.add_object(_record(base + number, _PDO_SETTINGS))
            made.add_object(_record(mapping + number, tuple((sub, od.UNSIGNED32) for sub in range(1, 9))))
    return made


def _variable(index: int, sub: int, kind: int) -> od.ODVariable:
    made: Any = od.ODVariable(f"{index:04X}:{sub}", index, sub)
    made.data_type = kind
    made.access_type = "rw"
    found: od.ODVariable = made
    return found


def _record(index: int, members: tuple[tuple[int, int], ...]) -> od.ODRecord:
    made = od.ODRecord(f"{index:04X}", index)
    made.add_member(_variable(index, 0, od.UNSIGNED8))
    for sub, kind in members:
        made.add_member(_variable(index, sub, kind))
    return made
