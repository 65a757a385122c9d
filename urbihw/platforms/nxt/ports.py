"""Who owns a port: devices claim one, move to another, and let it go; the error names the owner."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, Final

from urbihw.kernel.uobject import Origin, UObject, function, reading, variable
from urbihw.platforms.base import WiredRobot

SLOT: Final = "nxt"
"""The slot of Global that holds the robot; devices that urbiscript makes belong to it."""


class Ports:
    """The seven ports of a brick and the devices on them."""

    def __init__(self) -> None:
        self._owners: dict[Any, PortDevice] = {}

    def __iter__(self) -> Iterator[PortDevice]:
        return iter(tuple(self._owners.values()))

    def get(self, port: Any) -> PortDevice | None:
        """The device on a port."""
        return self._owners.get(port)

    def claim(self, port: Any, device: PortDevice) -> None:
        """Make a device the owner of a port.  Raises ValueError, naming who has it."""
        owner = self._owners.get(port, device)
        if owner is not device:
            raise ValueError(f"port {port} is taken by {name_of(owner)}; free that first, or choose another port")
        self._owners[port] = device

    def free(self, port: Any) -> None:
        """Nobody owns the port any more."""
        self._owners.pop(port, None)


class Brick(WiredRobot):
    """What devices know of their robot."""

    ports: Ports
    gauges: list[Gauge]
    volts: tuple[float, float]
    """Of an empty and of a full battery."""


class Gauge(UObject):
    """What shows something that is measured in the brick itself."""

    def read(self, values: Mapping[str, Any], stamp: float) -> None:
        """Values have come."""
        raise NotImplementedError


def brick_of(device: UObject) -> Brick:
    """The robot a device belongs to.  Raises ValueError when there is none."""
    face = device.host.world.global_.slots.get(SLOT)
    robot = getattr(face, "python", None)
    if not isinstance(robot, Brick):
        raise ValueError("there is no NXT here: start urbihw with --platform nxt")
    return robot


def name_of(device: UObject) -> str:
    """How urbiscript calls a device: the first slot of Global that holds it, or its class."""
    slots = device.host.world.global_.slots
    return next((name for name, value in slots.items() if value is device.face), f"another {type(device).__name__}")


class PortDevice(UObject):
    """A motor or a sensor on a port.

    ``port`` may be changed: that frees the old one.  ``stale`` is true until the device was read, and while the link is
    down.
    """

    known_ports: ClassVar[tuple[Any, ...]] = ()
    items: ClassVar[tuple[str, ...]] = ()
    """What is read."""
    pace: ClassVar[float] = 0.0
    """Seconds between readings."""

    port = variable()
    stale = reading(True)

    def settle_on(self, port: Any) -> None:
        """Claim the first port; called by ``init``."""
        self.brick = brick_of(self)
        self.place: Any = None
        self.seen = self.host.now()
        self._go_to(port)
        self.port.sense(float(port) if isinstance(port, int) else port)
        self.notify_change(self.port, self._port_written)

    @function
    def free(self) -> None:
        """Let the port go, so that another device can be made on it; this one does nothing any more."""
        self._leave()
        self.stale.sense(True)

    @function
    def age(self) -> float:
        """Seconds since the device was last read."""
        return self.host.now() - self.seen

    # ---------------------------------------------------------------- what a class adds

    def arrived(self) -> None:
        """The device is on a new port, or the link is back; override to set it up."""

    def leaving(self) -> None:
        """The device leaves its port; override to put it to rest."""

    def take(self, values: Mapping[str, Any], stamp: float) -> bool:
        """Take what was read; false if it is not of use yet."""
        raise NotImplementedError

    # ---------------------------------------------------------------- what the robot calls

    def read(self, values: Mapping[str, Any], stamp: float) -> None:
        """Values have come."""
        if self.take(values, stamp):
            self.seen = stamp
            self.stale.sense(False)

    def link_changed(self, up: bool) -> None:
        """The link went down, or is up again."""
        if up:
            self.arrived()
        else:
            self.stale.sense(True)

    def stopped(self) -> None:
        """The robot was brought to a stop; override where a slot has to say so."""

    # ---------------------------------------------------------------- ports

    def aim(self, item: str, value: Any, origin: Origin | None = None) -> None:
        """Set something on the port, if the device has one."""
        if self.place is not None:
            self.brick.wire.aim(self.place, item, value, origin)

    def _port_written(self) -> None:
        value = self.port.value
        self._go_to(int(value) if isinstance(value, float) and value.is_integer() else value)

    def _go_to(self, port: Any) -> None:
        if port not in self.known_ports:
            known = ", ".join(f'"{each}"' if isinstance(each, str) else str(each) for each in self.known_ports)
            raise ValueError(f"a {type(self).__name__} goes on one of the ports {known}, not on {port!r}")
        if port == self.place:
            return
        self.brick.ports.claim(port, self)
        self._leave()
        self.place = port
        self.stale.sense(True)
        self.arrived()
        self.brick.wire.watch(port, self.items, self.pace)

    def _leave(self) -> None:
        if self.place is None:
            return
        self.leaving()
        self.brick.wire.watch(self.place, self.items, None)
        self.brick.ports.free(self.place)
        self.place = None
