"""A control table with its rules: sizes, access, ranges, EEPROM.

`RegisterFile` checks writes and returns the reason of a refusal, which
`unit1` and `unit2` encode. All numbers are little endian; a value of several bytes can only be written whole.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

from urbihw_fakes.errors import UnknownRequest


class Refusal(Enum):
    """The reason why a read or write is refused."""

    ADDRESS = "outside the table"
    ACCESS = "not writable"
    LENGTH = "only a part of a value"
    RANGE = "outside the range of the register"
    LIMIT = "outside a limit that was set"


@dataclass(frozen=True, slots=True)
class Register:
    """One row of a control table; `low` and `high` are the inclusive range of written values."""

    name: str
    address: int
    size: int
    default: int = 0
    low: int | None = None
    high: int | None = None
    writable: bool = True
    eeprom: bool = False
    signed: bool = False

    @property
    def bounds(self) -> tuple[int, int]:
        """The range of values: as given, else that of the size."""
        bits = 8 * self.size
        lowest, highest = (-(1 << bits - 1), (1 << bits - 1) - 1) if self.signed else (0, (1 << bits) - 1)
        return (lowest if self.low is None else self.low, highest if self.high is None else self.high)


@dataclass(frozen=True, slots=True)
class Write:
    """A write that the table allows: the new values of whole registers, in order of address."""

    values: tuple[tuple[Register, int], ...]


class RegisterFile:
    """The memory behind one control table.

    Reading bytes between two registers gives zeros, as the reserved rows of the data sheets do.
    """

    def __init__(self, rows: Iterable[Register]) -> None:
        self.rows = tuple(rows)
        self.by_name = {row.name: row for row in self.rows}
        self.size = max(row.address + row.size for row in self.rows)
        # The same values twice: as numbers for the model, which reads them often, and as bytes for the bus.
        self._values = dict.fromkeys(self.by_name, 0)
        self._memory = bytearray(self.size)
        self._at = {row.address: row for row in self.rows}
        self._covered = {row.address + i for row in self.rows for i in range(row.size)}
        self.reset()

    def reset(self, *, eeprom: bool = True, keep: Iterable[str] = ()) -> None:
        """Restore the defaults of the RAM, and of the EEPROM if `eeprom`; `keep` names exceptions."""
        kept = set(keep)
        for row in self.rows:
            if row.name not in kept and (eeprom or not row.eeprom):
                self.put(row.name, row.default)

    def get(self, name: str) -> int:
        """The value of a register."""
        try:
            return self._values[name]
        except KeyError:
            raise UnknownRequest(f"register {name!r}: not in this control table") from None

    def put(self, name: str, value: int) -> None:
        """Set a register from the model, without the checks of a write.

        Raises:
            UnknownRequest: no such register, or the value does not fit in its bytes.
        """
        if self.get(name) == value:
            return
        row = self.by_name[name]
        try:
            self._memory[row.address : row.address + row.size] = value.to_bytes(row.size, "little", signed=row.signed)
        except OverflowError as error:
            raise UnknownRequest(f"register {name!r}: {value} does not fit in {row.size} byte(s)") from error
        self._values[name] = value

    def read(self, address: int, count: int) -> bytes | Refusal:
        """`count` bytes from `address` on."""
        end = address + count
        if end > self.size or count < 1:
            return Refusal.ADDRESS
        return bytes(self._memory[address:end])

    def check(self, address: int, data: bytes) -> Write | Refusal:
        """Return the effect of a write of `data` at `address`, without executing it."""
        end = address + len(data)
        if end > self.size or not data:
            return Refusal.ADDRESS
        values: list[tuple[Register, int]] = []
        while address < end:
            row = self._at.get(address)
            if row is None:
                return Refusal.LENGTH if address in self._covered else Refusal.ACCESS
            if not row.writable:
                return Refusal.ACCESS
            if address + row.size > end:
                return Refusal.LENGTH
            value = int.from_bytes(data[-(end - address) :][: row.size], "little", signed=row.signed)
            low, high = row.bounds
            if not low <= value <= high:
                return Refusal.RANGE
            values.append((row, value))
            address += row.size
        return Write(tuple(values))
