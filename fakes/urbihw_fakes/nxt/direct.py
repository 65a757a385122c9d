"""The direct commands, one function each (firmware: c_cmd.c).

A function gets the telegram and returns the reply from its status on.  Offsets in telegrams count from the type byte.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from urbihw_fakes.nxt import codes

if TYPE_CHECKING:
    from urbihw_fakes.nxt.brick import Brick

Command = Callable[["Brick", bytes], bytes]

ALL_MOTORS = 0xFF
LONGEST_MESSAGE = 59
MAILBOXES = 20
MAILBOX_DEPTH = 5


def name_at(telegram: bytes, offset: int) -> str:
    """A file name of 20 bytes, zero padded."""
    return telegram[offset : offset + 20].split(b"\0")[0].decode("latin-1")


def name_bytes(name: str, size: int = 20) -> bytes:
    """Return a file name, zero padded to `size` bytes."""
    return name.encode("latin-1", "replace")[: size - 1].ljust(size, b"\0")


def _status(code: int) -> bytes:
    return bytes([code])


def start_program(brick: Brick, telegram: bytes) -> bytes:
    """00: run a file; status c0 if there is none."""
    known = brick.files.find(name_at(telegram, 2))
    if known is None or not known.lower().endswith(".rxe"):
        return _status(codes.OUT_OF_RANGE)
    brick.start_program(known)
    return _status(codes.OK)


def stop_program(brick: Brick, telegram: bytes) -> bytes:
    """Opcode 01: stop the program that runs."""
    if not brick.program:
        return _status(codes.NO_PROGRAM)
    brick.start_program("")
    return _status(codes.OK)


def play_sound_file(brick: Brick, telegram: bytes) -> bytes:
    """02: once, or endlessly."""
    if brick.files.find(name_at(telegram, 3)) is None:
        return _status(codes.OUT_OF_RANGE)
    brick.sound.play_file(name_at(telegram, 3), bool(telegram[2]), brick.now)
    return _status(codes.OK)


def play_tone(brick: Brick, telegram: bytes) -> bytes:
    """03: Hz and ms."""
    frequency, milliseconds = struct.unpack_from("<HH", telegram, 2)
    brick.sound.play_tone(frequency, milliseconds, brick.now)
    return _status(codes.OK)


def set_output_state(brick: Brick, telegram: bytes) -> bytes:
    """04: one motor, or with port ff all."""
    port, power, mode, regulation, ratio, state, limit = struct.unpack_from("<BbBBbBI", telegram, 2)
    motors = brick.motors if port == ALL_MOTORS else brick.motors[port : port + 1]
    for motor in motors:
        motor.set_output(power, mode, regulation, ratio, state, limit)
    return _status(codes.OK if motors else codes.OUT_OF_RANGE)


def set_input_mode(brick: Brick, telegram: bytes) -> bytes:
    """05: type and mode of an input."""
    port, kind, mode = telegram[2:5]
    if port >= len(brick.inputs):
        return _status(codes.OUT_OF_RANGE)
    brick.inputs[port].set_type(kind, mode, brick.now)
    brick.channels[port].configure(kind, brick.now)
    return _status(codes.OK)


def get_output_state(brick: Brick, telegram: bytes) -> bytes:
    """06: the command of a motor, and its counters; full length also for a bad port."""
    port = telegram[2]
    if port >= len(brick.motors):
        return _status(codes.OUT_OF_RANGE).ljust(23, b"\0")
    motor = brick.motors[port]
    head = (codes.OK, port, motor.power, motor.mode, motor.regulation, motor.turn_ratio, motor.run_state)
    counts = (motor.limit, motor.tacho, motor.block, motor.rotation)
    return struct.pack("<BBbBBbBIiii", *head, *counts)


def get_input_values(brick: Brick, telegram: bytes) -> bytes:
    """07: the same for an input."""
    port = telegram[2]
    if port >= len(brick.inputs):
        return _status(codes.OUT_OF_RANGE).ljust(14, b"\0")
    inlet = brick.inputs[port]
    valid, raw, normalised, scaled = inlet.values(brick.now)
    head = (codes.OK, port, valid, 0, inlet.kind, inlet.mode)
    return struct.pack("<BBBBBBHHhh", *head, raw, normalised, scaled, normalised)


def reset_scaled(brick: Brick, telegram: bytes) -> bytes:
    """08: restart the counting modes."""
    if telegram[2] >= len(brick.inputs):
        return _status(codes.OUT_OF_RANGE)
    brick.inputs[telegram[2]].reset_scaled()
    return _status(codes.OK)


def message_write(brick: Brick, telegram: bytes) -> bytes:
    """09: put a text into a mailbox of the running program; a full one drops its oldest."""
    inbox, size = telegram[2], telegram[3]
    text = telegram[4:]
    if inbox >= MAILBOXES:
        return _status(codes.BAD_MAILBOX)
    if size != len(text) or not 1 <= size <= LONGEST_MESSAGE or text[-1]:
        return _status(codes.ILLEGAL_SIZE)
    if not brick.program:
        return _status(codes.NO_PROGRAM)
    queue = brick.mailboxes.setdefault(inbox, [])
    queue.append(text)
    del queue[:-MAILBOX_DEPTH]
    return _status(codes.OK)


def message_read(brick: Brick, telegram: bytes) -> bytes:
    """13: remove or read the oldest text."""
    remote, local, remove = telegram[2:5]
    queue = brick.mailboxes.get(remote, [])
    text, status = b"", codes.OK
    if remote >= MAILBOXES:
        status = codes.BAD_MAILBOX
    elif not brick.program:
        status = codes.NO_PROGRAM
    elif not queue:
        status = codes.MAILBOX_EMPTY
    else:
        text = queue.pop(0) if remove else queue[0]
    return bytes([status, local, len(text)]) + text.ljust(LONGEST_MESSAGE, b"\0")


def reset_motor_position(brick: Brick, telegram: bytes) -> bytes:
    """Opcode 0a: reset the position of a motor."""
    port, relative = telegram[2:4]
    if port >= len(brick.motors):
        return _status(codes.OUT_OF_RANGE)
    brick.motors[port].reset_position(bool(relative))
    return _status(codes.OK)


def get_battery_level(brick: Brick, telegram: bytes) -> bytes:
    """Opcode 0b: the voltage of the battery in mV."""
    return struct.pack("<BH", codes.OK, brick.millivolts)


def stop_sound(brick: Brick, telegram: bytes) -> bytes:
    """Opcode 0c: end the sound that plays."""
    brick.sound.stop()
    return _status(codes.OK)


def keep_alive(brick: Brick, telegram: bytes) -> bytes:
    """0d: restart the sleep timer; returns its limit in ms."""
    brick.stay_awake()
    return struct.pack("<BI", codes.OK, brick.sleep_limit)


def ls_get_status(brick: Brick, telegram: bytes) -> bytes:
    """0e: bytes ready on the I2C bus of a port."""
    port = telegram[2]
    if port >= len(brick.channels):
        return _status(codes.OUT_OF_RANGE)
    return bytes(brick.channels[port].status(brick.now))


def ls_write(brick: Brick, telegram: bytes) -> bytes:
    """0f: begin a transfer."""
    port, size, count = telegram[2:5]
    if port >= len(brick.channels):
        return _status(codes.OUT_OF_RANGE)
    data = telegram[5:]
    if size != len(data):
        return _status(codes.ILLEGAL_SIZE)
    return _status(brick.channels[port].write(brick.inputs[port].plugged, data, count, brick.now))


def ls_read(brick: Brick, telegram: bytes) -> bytes:
    """10: the received bytes, padded to 16."""
    port = telegram[2]
    if port >= len(brick.channels):
        return _status(codes.OUT_OF_RANGE)
    status, data = brick.channels[port].read(brick.now)
    return bytes([status, len(data)]) + data.ljust(16, b"\0")


def get_program_name(brick: Brick, telegram: bytes) -> bytes:
    """Opcode 11: the program that runs."""
    return _status(codes.OK if brick.program else codes.NO_PROGRAM) + name_bytes(brick.program)


# opcode -> (function, minimum length of the telegram, whether it only reads)
COMMANDS: Final[dict[int, tuple[Command, int, bool]]] = {
    0x00: (start_program, 22, False),
    0x01: (stop_program, 2, False),
    0x02: (play_sound_file, 23, False),
    0x03: (play_tone, 6, False),
    0x04: (set_output_state, 12, False),
    0x05: (set_input_mode, 5, False),
    0x06: (get_output_state, 3, True),
    0x07: (get_input_values, 3, True),
    0x08: (reset_scaled, 3, False),
    0x09: (message_write, 4, False),
    0x0A: (reset_motor_position, 4, False),
    0x0B: (get_battery_level, 2, True),
    0x0C: (stop_sound, 2, False),
    0x0D: (keep_alive, 2, False),
    0x0E: (ls_get_status, 3, True),
    0x0F: (ls_write, 5, False),
    0x10: (ls_read, 3, True),
    0x11: (get_program_name, 2, True),
    0x13: (message_read, 5, True),
}
