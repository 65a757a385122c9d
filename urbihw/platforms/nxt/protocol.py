"""Telegrams of the NXT: bytes only.

    request   type opcode ...                 type 00 direct or 01 system; + 80: no reply requested
    reply     02   opcode status ...          status 00 is fine; at most 64 bytes in both directions

Little-endian.  Source: the brick's published firmware (dlech/nxt-firmware, c_comm.c and c_cmd.c) and nxt-python's
nxt/telegram.py, which agree; vectors in ``fakes/urbihw_fakes/captures/nxt.hex``.
"""

from __future__ import annotations

import struct
from typing import Final

from urbihw.buses.errors import BadFrame, BadValue, BusError
from urbihw.frozen import frozen

LONGEST: Final = 64
OUTPUTS: Final = ("A", "B", "C")
INPUTS: Final = (1, 2, 3, 4)
ALL_OUTPUTS: Final = 0xFF

# Sensor types and modes (firmware: c_input.iom).
SWITCH, LIGHT_ACTIVE, LIGHT_INACTIVE, SOUND_DB, SOUND_DBA, LOWSPEED_9V, COLOUR = 1, 5, 6, 7, 8, 11, 13
RAW, BOOLEAN, PERCENT = 0x00, 0x20, 0x80

_MOTOR_ON = 0x01
_IDLE = 0x00
PENDING: Final = 0x20
NOT_READY: Final = 0xE0

BOOT: Final = 0x97
"""Erases the firmware: never sent."""
SYSTEM_OPCODES: Final = frozenset(
    (0x80, 0x81, 0x82, 0x83, 0x84, 0x85, 0x86, 0x87, 0x88, 0x89, 0x8B, 0x8C, 0x90, 0x91, 0x92, 0x94, 0x95)
    + (0x98, 0x9B, 0xA0, 0xA1, 0xA2, 0xA4)
)
"""Opcodes with a defined reply: the firmware answers unknown opcodes with garbage."""

START_PROGRAM: Final = b"\x00"
"""The opcode of STARTPROGRAM."""
MOVING_OPCODES: Final = frozenset((START_PROGRAM, b"\x02", b"\x03", b"\x04"))
"""Direct commands that start a motion or a sound: STARTPROGRAM, PLAYSOUNDFILE, PLAYTONE, SETOUTPUTSTATE."""

MEANINGS: Final = {
    0x20: "still busy",
    0x40: "the mailbox is empty",
    0x81: "no more file handles",
    0x82: "no space left",
    0x83: "no more files",
    0x85: "end of the file",
    0x86: "not a linear file",
    0x87: "no such file",
    0x88: "the handle is closed already",
    0x89: "no linear space left",
    0x8B: "the file is in use",
    0x8E: "the file is full",
    0x8F: "there is such a file already",
    0x90: "no such module",
    0x91: "out of bounds",
    0x92: "no name for a file",
    0x93: "no such handle",
    0x94: "Bluetooth is busy",
    0xBD: "the request failed",
    0xBE: "unknown command",
    0xBF: "the packet makes no sense",
    0xC0: "a value is out of range",
    0xDD: "no sensor answers on the I2C bus",
    0xDE: "no room for more data",
    0xDF: "no such channel",
    0xE0: "the channel is not set up, or busy",
    0xEC: "no program is running",
    0xED: "wrong size",
    0xEE: "no such mailbox",
    0xF0: "no such port",
    0xFB: "out of memory",
    0xFF: "bad arguments",
}


class BrickRefused(BusError):
    """The brick answered with a status other than 0: ``code``."""

    def __init__(self, code: int) -> None:
        super().__init__(f"the brick refused: {MEANINGS.get(code, 'an error without a name')} (status 0x{code:02x})")
        self.code = code


@frozen
class OutputState:
    """The state of a motor: its command, and its counters in degrees."""

    port: int
    power: int
    mode: int
    regulation: int
    turn_ratio: int
    run_state: int
    limit: int
    tacho: int
    block: int
    rotation: int


@frozen
class InputValues:
    """The values of a sensor; ``valid`` is false for a while after its type was set."""

    port: int
    valid: bool
    calibrated: bool
    kind: int
    mode: int
    raw: int
    normalised: int
    scaled: int
    calibrated_value: int


@frozen
class BrickVersion:
    """Numbers as (major, minor)."""

    protocol: tuple[int, int]
    firmware: tuple[int, int]


@frozen
class BrickInfo:
    """The identification of a brick; ``free`` is the free space of its flash in bytes."""

    name: str
    address: str
    free: int


# ---------------------------------------------------------------- requests


def battery() -> bytes:
    """The telegram GETBATTERYLEVEL: asks for the voltage."""
    return b"\x00\x0b"


def keep_alive(reply: bool) -> bytes:
    """KEEPALIVE: restart the sleep timer."""
    return b"\x00\x0d" if reply else b"\x80\x0d"


def firmware_version() -> bytes:
    """The telegram GET FIRMWARE VERSION."""
    return b"\x01\x88"


def device_info() -> bytes:
    """The telegram GET DEVICE INFO: name and address."""
    return b"\x01\x9b"


def run(port: int, power: int, limit: int = 0) -> bytes:
    """SETOUTPUTSTATE: turn with ``power`` -100..100, regulated; 0 holds.  ``limit`` in degrees, 0 for none.

    No reply.  Port 0xff is all motors.
    """
    return struct.pack("<BBBbBBbBI", 0x80, 0x04, port, power, 0x07, 0x01, 0, 0x20, limit)


def coast(port: int) -> bytes:
    """SETOUTPUTSTATE: switch the motor off.  No reply."""
    return struct.pack("<BBBbBBbBI", 0x80, 0x04, port, 0, 0, 0, 0, 0, 0)


def replied(telegram: bytes) -> bytes:
    """Return the same telegram with a request for a reply."""
    return bytes([telegram[0] & 0x7F]) + telegram[1:]


def output_state(port: int) -> bytes:
    """The telegram GETOUTPUTSTATE: asks for the state of a motor."""
    return bytes((0x00, 0x06, port))


def reset_rotation(port: int) -> bytes:
    """RESETMOTORPOSITION of the rotation count."""
    return bytes((0x00, 0x0A, port, 0))


def input_mode(port: int, kind: int, mode: int) -> bytes:
    """The telegram SETINPUTMODE: type and mode of a sensor."""
    return bytes((0x00, 0x05, port, kind, mode))


def input_values(port: int) -> bytes:
    """The telegram GETINPUTVALUES: asks for the values of a sensor."""
    return bytes((0x00, 0x07, port))


def tone(frequency: int, milliseconds: int) -> bytes:
    """The telegram PLAYTONE, without a reply."""
    return struct.pack("<BBHH", 0x80, 0x03, frequency, milliseconds)


def stop_program() -> bytes:
    """STOPPROGRAM: end the program that runs on the brick, if one does.  No reply."""
    return b"\x80\x01"


def stop_sound() -> bytes:
    """The telegram STOPSOUNDPLAYBACK, without a reply."""
    return b"\x80\x0c"


def ls_status(port: int) -> bytes:
    """LSGETSTATUS: how many bytes are ready on the I2C bus of a port."""
    return bytes((0x00, 0x0E, port))


def ls_write(port: int, data: bytes, count: int) -> bytes:
    """LSWRITE: write ``data`` (the first byte is the address), then read ``count`` bytes; at most 16 each."""
    if not 0 < len(data) <= 16 or not 0 <= count <= 16:
        raise BadValue("the I2C bus of the brick takes 1 to 16 bytes and gives at most 16")
    return bytes((0x00, 0x0F, port, len(data), count)) + data


def ls_read(port: int) -> bytes:
    """The telegram LSREAD: asks for what an I2C sensor has sent."""
    return bytes((0x00, 0x10, port))


def outputs_of(telegram: bytes) -> frozenset[str]:
    """Return the motors that a telegram starts: those of SETOUTPUTSTATE, all for STARTPROGRAM."""
    if telegram[1:2] == b"\x00" and not telegram[0] & 1:
        return frozenset(OUTPUTS)
    if telegram[1:2] != b"\x04" or telegram[0] & 1 or len(telegram) < 3:
        return frozenset()
    return frozenset(OUTPUTS[telegram[2] : telegram[2] + 1] if telegram[2] < len(OUTPUTS) else OUTPUTS)


def raw(body: bytes, reply: bool) -> bytes:
    """Return the telegram with this body after its type byte.  Raises BadValue for a forbidden one."""
    if not 1 <= len(body) < LONGEST:
        raise BadValue(f"a command has 1 to {LONGEST - 1} bytes, not {len(body)}")
    opcode = body[0]
    if opcode == BOOT:
        raise BadValue("command 0x97 erases the firmware of the brick; it is not sent")
    if opcode >= 0x80 and opcode not in SYSTEM_OPCODES:
        raise BadValue(f"0x{opcode:02x} is no system command of the brick")
    return bytes([(0x01 if opcode >= 0x80 else 0x00) | (0x00 if reply else 0x80)]) + body


# ---------------------------------------------------------------- replies


def body(reply: bytes, size: int) -> bytes:
    """Return the data after the status of a reply, ``size`` bytes or more.  Raises BadFrame, BrickRefused."""
    if len(reply) < 3 or reply[0] != 0x02:
        raise BadFrame(f"no reply of a brick: {reply.hex(' ') or 'nothing'}")
    if reply[2]:
        raise BrickRefused(reply[2])
    if len(reply) < 3 + size:
        raise BadFrame(f"the reply to command 0x{reply[1]:02x} is {len(reply)} bytes long instead of {3 + size}")
    return reply[3:]


def parse_battery(reply: bytes) -> int:
    """Return the voltage of the battery in mV."""
    return int.from_bytes(body(reply, 2)[:2], "little")


def parse_sleep_limit(reply: bytes) -> int:
    """Return the sleep limit in ms; 0 for never."""
    return int.from_bytes(body(reply, 4)[:4], "little")


def parse_version(reply: bytes) -> BrickVersion:
    """Parse the reply to GET FIRMWARE VERSION."""
    protocol_minor, protocol_major, minor, major = body(reply, 4)[:4]
    return BrickVersion((protocol_major, protocol_minor), (major, minor))


def parse_device_info(reply: bytes) -> BrickInfo:
    """Parse the reply to GET DEVICE INFO."""
    data = body(reply, 30)
    name = data[:15].split(b"\0")[0].decode("latin-1")
    return BrickInfo(name, data[15:21].hex(":").upper(), int.from_bytes(data[26:30], "little"))


def parse_output_state(reply: bytes) -> OutputState:
    """Parse the reply to GETOUTPUTSTATE."""
    return OutputState(*struct.unpack_from("<BbBBbBIiii", body(reply, 22)))


def parse_output_runs(reply: bytes) -> bool:
    """Return whether the motor in a reply to GETOUTPUTSTATE runs."""
    state = parse_output_state(reply)
    return state.power != 0 and is_on(state.mode) and state.run_state != _IDLE


def is_on(mode: int) -> bool:
    """Return whether a motor in this mode runs or holds; otherwise it is off, as after power-on."""
    return bool(mode & _MOTOR_ON)


def parse_input_values(reply: bytes) -> InputValues:
    """Parse the reply to GETINPUTVALUES."""
    port, valid, calibrated, *rest = struct.unpack_from("<BBBBBHHhh", body(reply, 13))
    return InputValues(port, bool(valid), bool(calibrated), *rest)


def parse_ls_status(reply: bytes) -> int:
    """Return the number of bytes that are ready."""
    return body(reply, 1)[0]


def parse_ls_read(reply: bytes) -> bytes:
    """Return the bytes that were read."""
    data = body(reply, 17)
    return data[1 : 1 + min(data[0], 16)]
