"""The base of all Dynamixel units: identity, power, control table, pinned values."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from urbihw_fakes.dynamixel.framer import Request
from urbihw_fakes.dynamixel.registers import Refusal, Register, RegisterFile, Write

BAUD_TOLERANCE = 0.03  # "an error under 3 % is fine"
STEP = 0.002  # seconds of one step of the physics


def near(baud: float, other: float) -> bool:
    """Return whether two speeds are close enough for communication."""
    return abs(baud - other) <= BAUD_TOLERANCE * other


def no_callback() -> None:
    """Do nothing: the unit is on no bus."""


class Unit:
    """One device on the bus.

    `unit1` and `unit2` define what a protocol does with a request; a model extends `advance` (its physics), fills
    `sensors` (physics -> read-only registers) and extends `written` (what a write sets off). It is not thread safe:
    while the bus is served, only the serving thread may call it.
    """

    protocol = 0

    def __init__(self, unit: int, rows: Iterable[Register]) -> None:
        self.registers = RegisterFile(rows)
        self.registers.put("id", unit)
        self.powered = True
        self.moved: Callable[[], None] = no_callback  # set by the bus; called when the IDs of the unit change
        self.sensors: dict[str, Callable[[], int]] = {}  # read-only registers and how to compute them
        self._pinned: dict[str, int] = {}
        self._sensed: dict[tuple[int, int], tuple[str, ...]] = {}  # bytes read -> sensors behind them, as found
        self._now: float | None = None
        self.pending: Write | None = None

    # --- identity -----------------------------------------------------------------------------------------------

    @property
    def id(self) -> int:
        """The ID of its answers."""
        return self.registers.get("id")

    @property
    def ids(self) -> tuple[int, ...]:
        """All IDs it accepts."""
        return (self.id,)

    @property
    def baud(self) -> int:
        """Line speed in bits per second."""
        raise NotImplementedError

    def set_baud(self, baud: int) -> None:
        """Set the speed register.

        Raises:
            UnknownRequest: no setting is within 3 % of `baud`.
        """
        raise NotImplementedError

    @property
    def return_delay(self) -> float:
        """Seconds between the end of a request and the start of the answer: register value times 2 us."""
        return self.registers.get("return_delay") * 2e-6

    def accepts_baud(self, baud: int | None) -> bool:
        """Return whether the unit can decode an adapter's data at `baud` (None: any speed)."""
        return baud is None or near(self.baud, baud)

    # --- time and power -----------------------------------------------------------------------------------------

    def tick(self, now: float) -> None:
        """Advance the physics to `now` (seconds); an earlier time has no effect."""
        if self._now is None:
            self._now = now
        elapsed = now - self._now
        if elapsed > 0.0:
            self.advance(elapsed)
            self._now = now

    def power_off(self, now: float) -> None:
        """Switch it off: the RAM is lost, a motor has no torque."""
        self.tick(now)
        self.powered = False
        self.pending = None
        self.boot()

    def power_on(self, now: float) -> None:
        """Switch it on: it starts with its power-on values."""
        self.tick(now)
        self.powered = True
        self.boot()

    def boot(self) -> None:
        """Set the RAM to its power-on values."""
        self.registers.reset(eeprom=False)

    @property
    def now(self) -> float:
        """The time of the last `tick`; 0 before the first."""
        return self._now or 0.0

    # --- by hand ------------------------------------------------------------------------------------------------

    def pin_register(self, name: str, value: int) -> None:
        """Pin a register that the model would compute (raw value), until `unpin_register`.

        Raises:
            UnknownRequest: no such register, or the value does not fit.
        """
        self.registers.put(name, value)
        self._pinned[name] = value

    def unpin_register(self, name: str | None = None) -> None:
        """Unpin one register, or all: the model computes them again."""
        if name is None:
            self._pinned.clear()
        else:
            self._pinned.pop(name, None)

    # --- what a model defines -----------------------------------------------------------------------------------

    def advance(self, elapsed: float) -> None:
        """Advance the model by `elapsed` seconds."""

    def written(self, register: Register, value: int, before: int) -> None:
        """Handle a write of a register by the host; `before` is the old value."""

    def after_read(self, address: int, count: int) -> None:
        """Handle a read of these bytes by the host."""

    def put(self, name: str, value: int) -> None:
        """Set a computed register unless it is pinned."""
        if name not in self._pinned:
            self.registers.put(name, value)

    # --- what a protocol defines --------------------------------------------------------------------------------

    def execute(self, request: Request, now: float) -> bytes:
        """Execute a request; return the status packet, or nothing if none is sent."""
        raise NotImplementedError

    def report(self, address: int, count: int, now: float) -> bytes:
        """Return its status packet in a group read, or nothing."""
        raise NotImplementedError

    def obey(self, address: int, data: bytes, now: float) -> None:
        """Execute its part of a group write, without an answer."""
        self.perform(address, data, now)

    def perform(self, address: int, data: bytes, now: float) -> Refusal | None:
        """Write `data` at `address`; return the refusal, or None."""
        self.tick(now)
        write = self.examine(address, data)
        if isinstance(write, Refusal):
            return write
        self.apply(write)
        return None

    def examine(self, address: int, data: bytes) -> Write | Refusal:
        """Check a write, by the table and the state of the unit."""
        return self.registers.check(address, data)

    def apply(self, write: Write) -> None:
        """Execute a checked write, then call `written` for each register."""
        before = [self.registers.get(register.name) for register, _ in write.values]
        for register, value in write.values:
            self.registers.put(register.name, value)
            if register.name in ("id", "secondary_id"):
                self.moved()
        for (register, value), old in zip(write.values, before, strict=True):
            self.written(register, value, old)

    def sense(self, address: int = 0, count: int = 0xFFFF) -> None:
        """Update the sensor registers in this range from the physics."""
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
