"""The system commands, one function each, as in `direct` (firmware: c_comm.c, cCommInterprete).

The maps of the firmware's modules are not modelled: a search for modules finds none.  BOOT gets no answer.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Final

from urbihw_fakes.nxt import codes
from urbihw_fakes.nxt.direct import Command, name_at, name_bytes

if TYPE_CHECKING:
    from urbihw_fakes.nxt.brick import Brick

PROTOCOL = (124, 1)  # minor, major
FIRMWARE = (29, 1)
LONGEST_READ = 58
LONGEST_WRITE = 61


def open_read(brick: Brick, telegram: bytes) -> bytes:
    """80: handle and size."""
    return struct.pack("<BBI", *brick.files.open_read(name_at(telegram, 2)))


def open_write(brick: Brick, telegram: bytes) -> bytes:
    """Opcodes 81 and 89: open a file for writing; returns its handle."""
    (size,) = struct.unpack_from("<I", telegram, 22)
    return bytes(brick.files.open_write(name_at(telegram, 2), size))


def open_write_data(brick: Brick, telegram: bytes) -> bytes:
    """8b: handle; names that are stored linearly are refused."""
    (size,) = struct.unpack_from("<I", telegram, 22)
    return bytes(brick.files.open_write(name_at(telegram, 2), size, data=True))


def open_append(brick: Brick, telegram: bytes) -> bytes:
    """8c: handle and room."""
    return struct.pack("<BBI", *brick.files.open_append(name_at(telegram, 2)))


def read(brick: Brick, telegram: bytes) -> bytes:
    """82: exactly the requested number of bytes."""
    number, count = struct.unpack_from("<BH", telegram, 2)
    status, data = brick.files.read(number, min(count, LONGEST_READ))
    return struct.pack("<BBH", status, number, len(data)) + data


def write(brick: Brick, telegram: bytes) -> bytes:
    """83: the number of bytes written."""
    status, written = brick.files.write(telegram[2], telegram[3:])
    return struct.pack("<BBH", status, telegram[2], written)


def close(brick: Brick, telegram: bytes) -> bytes:
    """Opcode 84: close a handle."""
    return bytes([brick.files.close(telegram[2]), telegram[2]])


def delete(brick: Brick, telegram: bytes) -> bytes:
    """Opcode 85: delete a file."""
    name = name_at(telegram, 2)
    return bytes([brick.files.delete(name)]) + name_bytes(name)


def _found(status: int, number: int, name: str, size: int) -> bytes:
    return struct.pack("<BB20sI", status, number, name_bytes(name), size)


def find_first(brick: Brick, telegram: bytes) -> bytes:
    """86: handle, name, size."""
    return _found(*brick.files.find_first(name_at(telegram, 2)))


def find_next(brick: Brick, telegram: bytes) -> bytes:
    """Opcode 87: find the next file."""
    return _found(*brick.files.find_next(telegram[2]))


def firmware_version(brick: Brick, telegram: bytes) -> bytes:
    """88: protocol and firmware."""
    return bytes([codes.OK, *PROTOCOL, *FIRMWARE])


def find_module(brick: Brick, telegram: bytes) -> bytes:
    """Opcodes 90 and 91: find a module; there is none."""
    return bytes([codes.MODULE_NOT_FOUND]).ljust(32, b"\0")


def close_module(brick: Brick, telegram: bytes) -> bytes:
    """Opcode 92: close a module's handle."""
    return bytes([codes.ILLEGAL_HANDLE, telegram[2]])


def read_map(brick: Brick, telegram: bytes) -> bytes:
    """94, 95: no such module."""
    (module,) = struct.unpack_from("<I", telegram, 2)
    return struct.pack("<BIH", codes.MODULE_NOT_FOUND, module, 0)


def set_brick_name(brick: Brick, telegram: bytes) -> bytes:
    """98: 15 characters.  The firmware does not look at the length; nxt-python sends 17 bytes, without a final zero."""
    brick.name = telegram[2:17].split(b"\0")[0].decode("latin-1")
    return bytes([codes.OK])


def device_info(brick: Brick, telegram: bytes) -> bytes:
    """9b: name, address, signal, free flash."""
    name = name_bytes(brick.name, 16)[:15]
    return struct.pack("<B15s7sII", codes.OK, name, bytes.fromhex(brick.address), 0, brick.files.free)


def delete_user_flash(brick: Brick, telegram: bytes) -> bytes:
    """Opcode a0: remove all files."""
    brick.files.clear()
    return bytes([codes.OK])


def poll_length(brick: Brick, telegram: bytes) -> bytes:
    """a1: no data is available."""
    return bytes([codes.OK, telegram[2], 0])


def poll(brick: Brick, telegram: bytes) -> bytes:
    """Opcode a2: read from a poll buffer."""
    return bytes([codes.OK, telegram[2], 0])


def bluetooth_factory_reset(brick: Brick, telegram: bytes) -> bytes:
    """Opcode a4: reset the settings of Bluetooth."""
    brick.name = "NXT"
    return bytes([codes.OK])


# opcode -> (function, minimum length of the telegram, whether it only reads)
COMMANDS: Final[dict[int, tuple[Command, int, bool]]] = {
    0x80: (open_read, 22, True),
    0x81: (open_write, 26, True),
    0x82: (read, 5, True),
    0x83: (write, 3, False),
    0x84: (close, 3, False),
    0x85: (delete, 22, False),
    0x86: (find_first, 22, True),
    0x87: (find_next, 3, True),
    0x88: (firmware_version, 2, True),
    0x89: (open_write, 26, True),
    0x8B: (open_write_data, 26, True),
    0x8C: (open_append, 22, True),
    0x90: (find_module, 22, True),
    0x91: (find_module, 3, True),
    0x92: (close_module, 3, False),
    0x94: (read_map, 10, True),
    0x95: (read_map, 10, False),
    0x98: (set_brick_name, 2, False),
    0x9B: (device_info, 2, True),
    0xA0: (delete_user_flash, 2, False),
    0xA1: (poll_length, 3, True),
    0xA2: (poll, 4, True),
    0xA4: (bluetooth_factory_reset, 2, False),
}
