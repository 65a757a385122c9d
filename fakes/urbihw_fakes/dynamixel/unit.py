"""What all Dynamixel units share: identity, power, a control table, values held by hand."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from urbihw_fakes.dynamixel.framer import Request
from urbihw_fakes.dynamixel.registers import Refusal, Register, RegisterFile, Write

BAUD_TOLERANCE = 0.03  # "an error under 3 % is fine"


def near(baud: float, other: float) -> bool:
    """True when two speeds are close enough to understand each other."""
    return abs(baud - other) <= BAUD_TOLERANCE * other


def nobody() -> None:
    """A unit that hangs on no bus has nobody to tell."""


class Unit:
    """One device on the bus.

    `unit1` and `unit2` define what a protocol does with a request; a model extends `advance` (its physics), fills
    `sensors` (physics -> read-only registers) and extends `written` (what a write sets off). It is not thread safe:
    while the bus is served, whoever serves it is the only one to call it.
    """

    protocol = 0

    def __init__(self, unit: int, rows: Iterable[Register]) -> None:
        self.registers = RegisterFile(rows)
        self.registers.put("id", unit)
        self.powered = True
        self.moved: Callable[[], None] = nobody  # the bus sets it; called when it listens to other numbers
        self.sensors: dict[str, Callable[[], int]] = {}  # read-only registers and how to compute them
        self._held: dict[str, int] = {}
        self._sensed: dict[tuple[int, int], tuple[str, ...]] = {}  # bytes read -> sensors behind them, as found
        self._now: float | None = None
        self.pending: Write | None = None

    # --- identity -----------------------------------------------------------------------------------------------

    @property
    def id(self) -> int:
        """The number it answers to."""
        return self.registers.get("id")

    @property
    def ids(self) -> tuple[int, ...]:
        """All numbers it listens to."""
        return (self.id,)

    @property
    def baud(self) -> int:
        """Bits per second that it listens at."""
        raise NotImplementedError

    def set_baud(self, baud: int) -> None:
        """Set the speed register by hand.

        Raises:
            UnknownRequest: no setting is within 3 % of `baud`.
        """
        raise NotImplementedError

    @property
    def return_delay(self) -> float:
        """Seconds between the end of a request and the start of the answer: register value times 2 us."""
        return self.registers.get("return_delay") * 2e-6

    def hears(self, baud: int | None) -> bool:
        """True when it can understand an adapter that talks at `baud` (None: any speed)."""
        return baud is None or near(self.baud, baud)

    # --- time and power -----------------------------------------------------------------------------------------

    def tick(self, now: float) -> None:
        """Bring the physics to `now` (seconds); going back in time does nothing."""
        if self._now is None:
            self._now = now
        elapsed = now - self._now
        if elapsed > 0.0:
            self.advance(elapsed)
            self._now = now

    def power_off(self, now: float) -> None:
        """Cut its power: everything in RAM is gone, a motor goes limp."""
        self.tick(now)
        self.powered = False
        self.pending = None
        self.boot()

    def power_on(self, now: float) -> None:
        """Give it power: it starts as after `power_off`."""
        self.tick(now)
        self.powered = True
        self.boot()

    def boot(self) -> None:
        """Bring the RAM to its power-on values."""
        self.registers.reset(eeprom=False)

    @property
    def now(self) -> float:
        """The time it has been brought to; 0 before the first `tick`."""
        return self._now or 0.0

    # --- by hand ------------------------------------------------------------------------------------------------

    def hold(self, name: str, value: int) -> None:
        """Pin a register that the model would compute (raw value), until `release`.

        Raises:
            UnknownRequest: no such register, or the value does not fit.
        """
        self.registers.put(name, value)
        self._held[name] = value

    def release(self, name: str | None = None) -> None:
        """Give one pinned register, or all of them, back to the model."""
        if name is None:
            self._held.clear()
        else:
            self._held.pop(name, None)

    # --- what a model defines -----------------------------------------------------------------------------------

    def advance(self, elapsed: float) -> None:
        """Let `elapsed` seconds go by."""

    def written(self, register: Register, value: int, before: int) -> None:
        """A register was written by the host; `before` is the value it had."""

    def after_read(self, address: int, count: int) -> None:
        """The host has read these bytes."""

    def put(self, name: str, value: int) -> None:
        """Set a computed register unless it is held by hand."""
        if name not in self._held:
            self.registers.put(name, value)

    # --- what a protocol defines --------------------------------------------------------------------------------

    def execute(self, request: Request, now: float) -> bytes:
        """Carry out a request; return the status packet, or nothing when there is none to send."""
        raise NotImplementedError

    def report(self, address: int, count: int, now: float) -> bytes:
        """Its place in a group read: a status packet, or nothing."""
        raise NotImplementedError

    def obey(self, address: int, data: bytes, now: float) -> None:
        """Its place in a group write: done without an answer."""
        self.perform(address, data, now)

    def perform(self, address: int, data: bytes, now: float) -> Refusal | None:
        """Write `data` at `address` now; return why not, or None when it is done."""
        self.tick(now)
        write = self.examine(address, data)
        if isinstance(write, Refusal):
            return write
        self.apply(write)
        return None

    def examine(self, address: int, data: bytes) -> Write | Refusal:
        """What a write would do, by the rules of the table and of the state the unit is in."""
        return self.registers.check(address, data)

    def apply(self, write: Write) -> None:
        """Carry out an allowed write, then tell the model, register by register."""
        before = [self.registers.get(register.name) for register, _ in write.values]
        for register, value in write.values:
            self.registers.put(register.name, value)
            if register.name in ("id", "secondary_id"):
                self.moved()
        for (register, value), old in zip(write.values, before, strict=True):
            self.written(register, value, old)

    def sense(self, address: int = 0, count: int = 0xFFFF) -> None:
        """Let the sensors behind these bytes write what the physics say now."""
        names = self._sensed.get((address, count))
        if names is None:
            rows = (self.registers.by_name[name] for name in self.sensors)
            names = tuple(r.name for r in rows if r.address < address + count and r.address + r.size > address)
            self._sensed[(address, count)] = names
        for name in names:
            self.put(name, self.sensors[name]())

    def fetch(self, address: int, count: int, now: float) -> bytes | Refusal:
        """Read `count` bytes from `address` on, fresh at `now`."""
        self.tick(now)
        self.sense(address, count)
        data = self.registers.read(address, count)
        if not isinstance(data, Refusal):
            self.after_read(address, count)
        return data
