"""The objects of the drive: what CiA 301 asks of a node, and CiA 402 of one with the profile modes of position,
velocity and torque, and with homing.

Not covered: cyclic modes, units other than increments, storing parameters.
"""

from __future__ import annotations

from canopen import objectdictionary as od

DEVICE_TYPE = 0x00020192  # a servo drive, profile 402
MODES = 0x2D  # profile position, profile velocity, profile torque, homing
INCREMENTS = 4096
"""Increments of the encoder in one turn of the motor."""
RATED_TORQUE = 1270
"""Rated torque of the motor, mN m; target and actual torque are in thousandths of it."""

_U8, _U16, _U32 = od.UNSIGNED8, od.UNSIGNED16, od.UNSIGNED32
_I8, _I16, _I32 = od.INTEGER8, od.INTEGER16, od.INTEGER32

VARIABLES = (
    (0x1000, "Device type", _U32, "ro", DEVICE_TYPE),
    (0x1001, "Error register", _U8, "ro", 0),
    (0x1008, "Manufacturer device name", od.VISIBLE_STRING, "ro", "Fake Servo 4096"),
    (0x1017, "Producer heartbeat time", _U16, "rw", 0),
    (0x6007, "Abort connection option code", _I16, "rw", 1),
    (0x603F, "Error code", _U16, "ro", 0),
    (0x6040, "Controlword", _U16, "rw", 0),
    (0x6041, "Statusword", _U16, "ro", 0),
    (0x605A, "Quick stop option code", _I16, "rw", 2),
    (0x6060, "Modes of operation", _I8, "rw", 0),
    (0x6061, "Modes of operation display", _I8, "ro", 0),
    (0x6064, "Position actual value", _I32, "ro", 0),
    (0x606C, "Velocity actual value", _I32, "ro", 0),
    (0x6071, "Target torque", _I16, "rw", 0),
    (0x6072, "Max torque", _U16, "rw", 1000),
    (0x6076, "Motor rated torque", _U32, "ro", RATED_TORQUE),
    (0x6077, "Torque actual value", _I16, "ro", 0),
    (0x607A, "Target position", _I32, "rw", 0),
    (0x607C, "Home offset", _I32, "rw", 0),
    (0x607F, "Max profile velocity", _U32, "rw", 20 * INCREMENTS),
    (0x6081, "Profile velocity", _U32, "rw", 2 * INCREMENTS),
    (0x6083, "Profile acceleration", _U32, "rw", 20 * INCREMENTS),
    (0x6085, "Quick stop deceleration", _U32, "rw", 100 * INCREMENTS),
    (0x6098, "Homing method", _I8, "rw", 0),
    (0x609A, "Homing acceleration", _U32, "rw", 20 * INCREMENTS),
    (0x60FF, "Target velocity", _I32, "rw", 0),
    (0x6502, "Supported drive modes", _U32, "ro", MODES),
)
"""(index, name, type, access, value)"""
RECORDS = (
    (0x1016, "Consumer heartbeat time", ((1, "Master", _U32, 0),)),
    (0x1018, "Identity", ((1, "Vendor", _U32, 0x4242), (2, "Product", _U32, 402))),
    (0x607D, "Software position limit", ((1, "Min", _I32, -100 * INCREMENTS), (2, "Max", _I32, 100 * INCREMENTS))),
    (0x6099, "Homing speeds", ((1, "Switch", _U32, INCREMENTS), (2, "Zero", _U32, INCREMENTS // 8))),
    (0x608F, "Position encoder resolution", ((1, "Increments", _U32, INCREMENTS), (2, "Revolutions", _U32, 1))),
)
_READ_ONLY = {0x1018, 0x608F}
_PDOS = 4


def dictionary(node: int) -> od.ObjectDictionary:
    """The dictionary of a drive with this number."""
    made = od.ObjectDictionary()  # type: ignore[no-untyped-call]
    made.node_id = node
    for index, name, kind, access, value in VARIABLES:
        made.add_object(_variable(name, index, 0, kind, value, access))
    for index, name, members in RECORDS:
        access = "ro" if index in _READ_ONLY else "rw"
        made.add_object(_record(name, index, members, access))
    for number in range(_PDOS):
        # The identifiers are those of the predefined connection set; 1 << 31 is "not in use".
        for base, mapping, first in ((0x1400, 0x1600, 0x200), (0x1800, 0x1A00, 0x180)):
            identifier = (first + 0x100 * number + node) | 1 << 31
            settings = ((1, "COB-ID", _U32, identifier), (2, "Type", _U8, 255), (5, "Event timer", _U16, 0))
            made.add_object(_record(f"PDO {base + number:04X}", base + number, settings, "rw"))
            entries = tuple((entry, f"Entry {entry}", _U32, 0) for entry in range(1, 9))
            made.add_object(_record(f"PDO {mapping + number:04X}", mapping + number, entries, "rw", count=0))
    return made


def _variable(name: str, index: int, sub: int, kind: int, value: int | str, access: str) -> od.ODVariable:
    made = od.ODVariable(name, index, sub)
    made.data_type = kind
    made.access_type = access
    made.default = value  # type: ignore[assignment]
    return made


def _record(
    name: str, index: int, members: tuple[tuple[int, str, int, int], ...], access: str, count: int | None = None
) -> od.ODRecord:
    made = od.ODRecord(name, index)
    most = max(sub for sub, *_ in members) if count is None else count
    made.add_member(_variable("Entries", index, 0, _U8, most, "rw" if count is not None else "ro"))
    for sub, title, kind, value in members:
        made.add_member(_variable(title, index, sub, kind, value, access))
    return made
