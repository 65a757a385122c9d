"""The memory of a Feetech servo: byte order, sign-magnitude numbers, and an EEPROM behind a lock.

A write of an EEPROM register always works at once, but is kept without power only while the lock register is 0. There
is no error for a write that is not executed. Choices where the sheet is silent: a read-only register and a value
outside the range of its register keep the old value, the other registers of the same write are written; bytes between
the registers read as 0.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

from urbihw_fakes.dynamixel.registers import Refusal, Register, RegisterFile, Write
from urbihw_fakes.errors import UnknownRequest
from urbihw_fakes.feetech.tables import Row

SIZE = 256


def encode(row: Row, value: int, order: Literal["little", "big"]) -> bytes:
    """Return the bytes of a value. Raises UnknownRequest when it does not fit."""
    magnitude = abs(value) if row.sign is not None else value
    limit = 8 * row.size if row.sign is None else row.sign
    if not 0 <= magnitude < 1 << limit:
        raise UnknownRequest(f"register {row.name!r}: {value} does not fit in it")
    raw = magnitude | (1 << limit if value < 0 else 0)
    return raw.to_bytes(row.size, order)


def decode(row: Row, data: bytes, order: Literal["little", "big"]) -> int:
    """Return the value of bytes."""
    raw = int.from_bytes(data, order)
    if row.sign is None:
        return raw
    magnitude = raw & (1 << row.sign) - 1
    return -magnitude if raw >> row.sign & 1 else magnitude


class Memory(RegisterFile):
    """The registers of one servo; `kept` is what its EEPROM holds without power."""

    def __init__(self, rows: Iterable[Row], order: Literal["little", "big"]) -> None:
        self.order = order
        self.kept: dict[str, int] = {}
        rows = tuple(rows)
        self._rows = {row.address: row for row in rows}
        super().__init__(rows)
        self._memory = bytearray(SIZE)
        self.size = SIZE
        for row in rows:
            self.kept[row.name] = row.default
            self._store(row, row.default)

    def put(self, name: str, value: int) -> None:
        """Set a register from the model; one of the EEPROM is kept."""
        row = self.row(name)
        self._store(row, value)
        self.kept[name] = value

    def take(self, row: Row, value: int) -> None:
        """Set a register as the host does: the EEPROM keeps it only while it is not locked."""
        self._store(row, value)
        if not self._values["lock"]:
            self.kept[row.name] = value

    def boot(self) -> None:
        """Set the RAM to its defaults and the EEPROM to what it has kept."""
        for row in self._rows.values():
            self._store(row, self.kept[row.name] if row.eeprom else row.default)

    def check(self, address: int, data: bytes) -> Write | Refusal:
        """Return the registers that a write changes, with their values; never a refusal (see the head of this file)."""
        end = address + len(data)
        memory = bytearray(self._memory)
        memory[address:end] = data
        values: list[tuple[Register, int]] = []
        for row in self._rows.values():
            if row.address < end and row.address + row.size > address and row.writable:
                value = decode(row, bytes(memory[row.address : row.address + row.size]), self.order)
                low, high = row.bounds
                if low <= value <= high:
                    values.append((row, value))
        return Write(tuple(values))

    def row(self, name: str) -> Row:
        """Return a register by name. Raises UnknownRequest."""
        for row in self._rows.values():
            if row.name == name:
                return row
        raise UnknownRequest(f"register {name!r}: not in this memory table")

    def _store(self, row: Row, value: int) -> None:
        self._memory[row.address : row.address + row.size] = encode(row, value, self.order)
        self._values[row.name] = value
