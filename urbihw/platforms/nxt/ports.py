"""The owners of ports: a device claims a port, moves to another, and releases it; errors name the owner."""

from __future__ import annotations

import math
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
        """Make a device the owner of a port.  Raises ValueError, naming the present owner."""
        owner = self._owners.get(port, device)
        if owner is not device:
            raise ValueError(f"port {port} is taken by {name_of(owner)}; free that first, or choose another port")
        self._owners[port] = device

    def release(self, port: Any) -> None:
        """Remove the owner of a port."""
        self._owners.pop(port, None)


class Brick(WiredRobot):
    """The part of the robot that devices use."""

    ports: Ports
    gauges: list[Gauge]
    measured: tuple[Mapping[str, Any], float] | None = None
    """What was measured in the brick itself last, and when; None before the first time."""
    volts: tuple[float, float]
    """The voltages of an empty and of a full battery."""

    def end_path(self, device: PortDevice) -> None:
        """End a path that drives this device, because a program is about to move it."""


class Gauge(UObject):
    """A device that shows a value measured in the brick itself."""

    def read(self, values: Mapping[str, Any], stamp: float) -> None:
        """Show the new values of the brick."""
        raise NotImplementedError


def brick_of(device: UObject) -> Brick:
    """Return the robot of a device.  Raises ValueError if there is none."""
    robot = device.host.device(SLOT)
    if not isinstance(robot, Brick):
        raise ValueError("there is no NXT here: start urbihw with --platform nxt")
    return robot


def name_of(device: UObject) -> str:
    """Return the name of a device in urbiscript: the first slot of Global that holds it, or its class."""
    return device.host.name_of(device) or f"another {device.urbi_class()}"


class PortDevice(UObject):
    """A motor or a sensor on a port.

    A write of ``port`` moves the device to another port.  ``stale`` is true until the first reading, and while the link
    is down.
    """

    known_ports: ClassVar[tuple[Any, ...]] = ()
    items: ClassVar[tuple[str, ...]] = ()
    """The items to read."""
    pace: ClassVar[float] = 0.0
    """Seconds between readings."""

    port = variable()
    stale = reading(True)

    def claim_first_port(self, port: Any) -> None:
        """Claim the first port; called by ``init``."""
        self.brick = brick_of(self)
        self.place: Any = None
        self.seen = self.host.now()
        self._move_to_port(port)
        self.port.sense(float(port) if isinstance(port, int) else port)
        self.notify_change(self.port, self._port_written)

    @function
    def free(self) -> None:
        """Release the port, so that another device can be made on it; this device is out of use."""
        self._release_port()
        self.stale.sense(True)

    @function
    def age(self) -> float:
        """Seconds since the device was last read."""
        return max(0.0, self.host.now() - self.seen)

    # ---------------------------------------------------------------- what a class adds

    def set_up_port(self) -> None:
        """Set up the port: called on a new port, and when the link is back; override."""

    def leave_port(self) -> None:
        """Stop the device before it leaves its port; override."""

    def show_values(self, values: Mapping[str, Any], stamp: float) -> bool:
        """Show the values; return False if they are not valid yet."""
        raise NotImplementedError

    # ---------------------------------------------------------------- what the robot calls

    def read(self, values: Mapping[str, Any], stamp: float) -> None:
        """Show the new values of the device."""
        if self.show_values(values, stamp):
            self.seen = stamp
            self.stale.sense(False)

    def link_changed(self, up: bool) -> None:
        """The link went down, or is up again."""
        if up:
            self.set_up_port()
        else:
            self.stale.sense(True)

    def stopped(self) -> None:
        """The robot has stopped; override to update slots."""

    # ---------------------------------------------------------------- ports

    def set_target(self, item: str, value: Any, origin: Origin | None = None, scale: float = math.inf) -> None:
        """Set a target of the port, if the device has a port."""
        if self.place is not None:
            self.brick.channel.set_target(self.place, item, value, origin, scale)

    def _port_written(self) -> None:
        value = self.port.value
        self._move_to_port(int(value) if isinstance(value, float) and value.is_integer() else value)

    def _move_to_port(self, port: Any) -> None:
        if port not in self.known_ports:
            known = ", ".join(f'"{each}"' if isinstance(each, str) else str(each) for each in self.known_ports)
            raise ValueError(f"a {self.urbi_class()} goes on one of the ports {known}, not on {port!r}")
        if port == self.place:
            return
        self.brick.ports.claim(port, self)
        self._release_port()
        self.place = port
        self.stale.sense(True)
        self.set_up_port()
        self.brick.channel.watch(port, self.items, self.pace)

    def _release_port(self) -> None:
        if self.place is None:
            return
        self.leave_port()
        self.brick.channel.watch(self.place, self.items, None)
        self.brick.ports.release(self.place)
        self.place = None
