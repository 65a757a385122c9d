"""A protocol 2.0 unit: execution of instructions.

Choices where the sheet is silent: a write is done whole or not at all; reserved bytes between two registers read as 0
and refuse writes (access error); a request with a wrong CRC is answered with error 3 by the rules of the instruction it
claims to be; a secondary ID is obeyed in single instructions and never answered. Not covered: CONTROL TABLE BACKUP
(0x20), answered as an unknown instruction.
"""

from __future__ import annotations

from collections.abc import Iterable

from urbihw_fakes.dynamixel import packet2
from urbihw_fakes.dynamixel.framer import BROADCAST, Request
from urbihw_fakes.dynamixel.registers import Refusal, Register
from urbihw_fakes.dynamixel.unit import Unit, near
from urbihw_fakes.errors import UnknownRequest

BAUDS = (9600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000)
NO_SECONDARY = 253  # a secondary ID from here on is disabled
CLEAR_MULTI_TURN = bytes.fromhex("01 44 58 4C 22")
FIRMWARE_CLEAR = 42  # first firmware with CLEAR, and to ignore a full factory reset of the whole bus

ERRORS = {
    Refusal.ADDRESS: packet2.ERR_ACCESS,
    Refusal.ACCESS: packet2.ERR_ACCESS,
    Refusal.LENGTH: packet2.ERR_LENGTH,
    Refusal.RANGE: packet2.ERR_RANGE,
    Refusal.LIMIT: packet2.ERR_LIMIT,
}


class Unit2(Unit):
    """A unit of protocol 2.0.

    The table must name `model`, `firmware`, `id`, `secondary_id`, `baud`, `return_delay`, `status_level`,
    `registered` and `hardware_error`.
    """

    protocol = 2
    fast_reads = True  # FAST forms: X430/X540 firmware 45, X330 firmware 46

    def __init__(self, unit: int, rows: Iterable[Register]) -> None:
        super().__init__(unit, rows)
        self.last_heard = 0.0

    @property
    def baud(self) -> int:
        """Line speed in bits per second, from the register."""
        return BAUDS[self.registers.get("baud")]

    def set_baud(self, baud: int) -> None:
        for value, speed in enumerate(BAUDS):
            if near(speed, baud):
                self.registers.put("baud", value)
                return
        raise UnknownRequest(f"speed {baud}: a protocol 2.0 unit has no setting near it; there are {BAUDS}")

    @property
    def ids(self) -> tuple[int, ...]:
        """The ID, and the secondary ID if enabled."""
        second = self.registers.get("secondary_id")
        return (self.id,) if second >= NO_SECONDARY or second == self.id else (self.id, second)

    @property
    def status_level(self) -> int:
        """0: only PING is answered, 1: reads too, 2: everything."""
        return self.registers.get("status_level")

    def alert(self) -> int:
        """The alert bit of the error byte: set while the hardware error register is not zero."""
        return packet2.ALERT if self.registers.get("hardware_error") else 0

    def execute(self, request: Request, now: float) -> bytes:
        unit = self.id
        level = self.status_level
        self.tick(now)
        if request.intact:
            self.last_heard = now
            error, data = self._carry_out(request, now)
        else:
            error, data = packet2.ERR_CRC, b""
        if request.unit not in (unit, BROADCAST) or (request.unit == BROADCAST and request.code != packet2.PING):
            return b""
        if level < _level_needed(request.code):
            return b""
        return packet2.status(unit, error | self.alert(), data)

    def _carry_out(self, request: Request, now: float) -> tuple[int, bytes]:
        code, params = request.code, request.params
        if code == packet2.PING:
            model = self.registers.get("model").to_bytes(2, "little")
            return 0, model + bytes((self.registers.get("firmware"),))
        if code == packet2.READ and len(params) == 4:
            return self.answer_read(params[0] | params[1] << 8, params[2] | params[3] << 8, now)
        if code == packet2.WRITE and len(params) >= 3:
            return self._error(self.perform(params[0] | params[1] << 8, params[2:], now)), b""
        if code == packet2.REG_WRITE and len(params) >= 3:
            return self._register(params[0] | params[1] << 8, params[2:]), b""
        if code == packet2.ACTION:
            return self._execute_action(), b""
        if code == packet2.FACTORY_RESET and len(params) == 1:
            return self._factory_reset(params[0], request.unit == BROADCAST), b""
        if code == packet2.REBOOT:
            self.boot()
            return 0, b""
        if code == packet2.CLEAR and self.registers.get("firmware") >= FIRMWARE_CLEAR:
            done = params == CLEAR_MULTI_TURN and self.clear_turns()
            return (0 if done else packet2.ERR_RESULT), b""
        return packet2.ERR_INSTRUCTION, b""

    def report(self, address: int, count: int, now: float) -> bytes:
        error, data = self.answer_read(address, count, now)
        return packet2.status(self.id, error | self.alert(), data) if self.status_level >= 1 else b""

    def answer_read(self, address: int, count: int, now: float) -> tuple[int, bytes]:
        """READ: error number (without the alert bit) and data."""
        self.last_heard = now
        data = self.fetch(address, count, now)
        return (ERRORS[data], b"") if isinstance(data, Refusal) else (0, data)

    def obey(self, address: int, data: bytes, now: float) -> None:
        """Execute its part of a group write, which restarts the bus watchdog."""
        self.tick(now)
        self.last_heard = now
        self.perform(address, data, now)

    def clear_turns(self) -> bool:
        """CLEAR: reduce the position to one turn; return False if that is not possible now."""
        return False

    def _error(self, refusal: Refusal | None) -> int:
        return 0 if refusal is None else ERRORS[refusal]

    def _register(self, address: int, data: bytes) -> int:
        write = self.examine(address, data)
        if isinstance(write, Refusal):
            return self._error(write)
        self.pending = write
        self.registers.put("registered", 1)
        return 0

    def _execute_action(self) -> int:
        if self.pending is None:
            return packet2.ERR_INSTRUCTION
        write, self.pending = self.pending, None
        self.registers.put("registered", 0)
        self.apply(write)
        return 0

    def _factory_reset(self, extent: int, broadcast: bool) -> int:
        keeps = {0xFF: (), 0x01: ("id",), 0x02: ("id", "baud")}
        if extent not in keeps:
            return packet2.ERR_RANGE
        if extent == 0xFF and broadcast and self.registers.get("firmware") >= FIRMWARE_CLEAR:
            return packet2.ERR_RESULT
        self.registers.reset(keep=keeps[extent])
        self.moved()
        self.pending = None
        self.boot()
        return 0


def _level_needed(code: int) -> int:
    """Return the lowest status return level at which an instruction is answered."""
    if code == packet2.PING:
        return 0
    return 1 if code == packet2.READ else 2
