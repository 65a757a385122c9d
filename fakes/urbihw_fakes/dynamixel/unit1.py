"""A protocol 1.0 unit: execution of instructions.

Choices where the sheet is silent: a write is done whole or not at all; a refused write, one byte of a 16-bit value and
a write to a locked EEPROM are range errors; the answer to a changed ID or speed still has the old one; a request with
a wrong checksum is answered by the rules of the instruction it claims to be.
"""

from __future__ import annotations

from collections.abc import Iterable

from urbihw_fakes.dynamixel import packet1
from urbihw_fakes.dynamixel.framer import BROADCAST, Request
from urbihw_fakes.dynamixel.registers import Refusal, Register, Write
from urbihw_fakes.dynamixel.unit import Unit, near
from urbihw_fakes.errors import UnknownRequest


class Unit1(Unit):
    """A unit of protocol 1.0.

    The table must name `id`, `baud`, `return_delay`, `status_level` and `registered`, and may name `lock`.
    """

    protocol = 1
    answers_bulk_read = False  # AX firmware does not (SDK issues 40, 46; unconfirmed); MX does

    def __init__(self, unit: int, rows: Iterable[Register]) -> None:
        super().__init__(unit, rows)
        self._locks = "lock" in self.registers.by_name

    @property
    def baud(self) -> int:
        """2 000 000 / (register + 1) bits per second."""
        return 2_000_000 // (self.registers.get("baud") + 1)

    def set_baud(self, baud: int) -> None:
        value = round(2_000_000 / baud) - 1
        if not 0 <= value <= 254 or not near(2_000_000 / (value + 1), baud):
            raise UnknownRequest(f"speed {baud}: a protocol 1.0 unit has no setting near it")
        self.registers.put("baud", value)

    def state_errors(self) -> int:
        """Error bits that last: voltage, heat, overload, goal outside the limits."""
        return 0

    def noticed(self, errors: int) -> None:
        """Handle the error bits of an answer; a model may raise its alarm."""

    def execute(self, request: Request, now: float) -> bytes:
        unit = self.id
        self.tick(now)
        if request.intact:
            error, data = self._carry_out(request, now)
        else:
            error, data = packet1.ERR_CHECKSUM, b""
        # The time is the same, but the write may have changed the state.
        error |= self.state_errors()
        self.noticed(error)
        if request.unit == BROADCAST and request.code != packet1.PING:
            return b""
        if self.registers.get("status_level") < _level_needed(request.code):
            return b""
        return packet1.status(unit, error, data)

    def _carry_out(self, request: Request, now: float) -> tuple[int, bytes]:
        code, params = request.code, request.params
        if code == packet1.PING:
            return 0, b""
        if code == packet1.READ and len(params) == 2:
            return self.answer_read(params[0], params[1], now)
        if code == packet1.WRITE and len(params) >= 2:
            return self._refused(self.perform(params[0], params[1:], now)), b""
        if code == packet1.REG_WRITE and len(params) >= 2:
            return self._register(params[0], params[1:]), b""
        if code == packet1.ACTION:
            return self._execute_action(), b""
        if code == packet1.RESET:
            # Recent firmware ignores a RESET of the whole bus.
            if request.unit != BROADCAST:
                self.factory_reset()
            return 0, b""
        return packet1.ERR_INSTRUCTION, b""

    def report(self, address: int, count: int, now: float) -> bytes:
        error, data = self.answer_read(address, count, now)
        error |= self.state_errors()
        self.noticed(error)
        return packet1.status(self.id, error, data) if self.registers.get("status_level") >= 1 else b""

    def answer_read(self, address: int, count: int, now: float) -> tuple[int, bytes]:
        """READ: error bits and data."""
        data = self.fetch(address, count, now)
        return (packet1.ERR_RANGE, b"") if isinstance(data, Refusal) else (0, data)

    def examine(self, address: int, data: bytes) -> Write | Refusal:
        """As in `Unit`; a locked EEPROM refuses."""
        write = super().examine(address, data)
        if (
            self._locks
            and isinstance(write, Write)
            and self.registers.get("lock")
            and any(register.eeprom for register, _ in write.values)
        ):
            return Refusal.ACCESS
        return write

    def _refused(self, refusal: Refusal | None) -> int:
        return packet1.ERR_RANGE if refusal is not None else 0

    def _register(self, address: int, data: bytes) -> int:
        write = self.examine(address, data)
        if isinstance(write, Refusal):
            return self._refused(write)
        self.pending = write
        self.registers.put("registered", 1)
        return 0

    def _execute_action(self) -> int:
        if self.pending is None:
            return packet1.ERR_INSTRUCTION
        write, self.pending = self.pending, None
        self.registers.put("registered", 0)
        self.apply(write)
        return 0

    def factory_reset(self) -> None:
        """Restore the factory values of the EEPROM, with ID and speed, then restart."""
        self.registers.reset()
        self.moved()
        self.pending = None
        self.boot()


def _level_needed(code: int) -> int:
    """Return the lowest status return level at which an instruction is answered."""
    if code == packet1.PING:
        return 0
    return 1 if code in (packet1.READ, packet1.BULK_READ) else 2
