"""What the devices of a simulated robot see of it; ``surface_of`` finds it for ``Servo.new("name")``."""

from __future__ import annotations

from typing import Any, Protocol, cast

from urbihw.kernel.uobject import Motion, UObject
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.webots.options import WebotsOptions
from urbihw.platforms.webots.simulator import SimulatedWorld

SLOT = "webots"
"""The slot of Global with the robot."""


class Shown(Protocol):
    """A device that shows samples."""

    def show(self, value: Any, stamp: float) -> None:
        """Show a sample; the stamp is of the kernel's clock."""
        ...

    def mark_stale(self) -> None:
        """The simulation is gone."""
        ...


class Surface(Protocol):
    """The object ``webots``.

    Attributes:
        channel, motion: to the worker, and who may move.
        options: of the settings.
    """

    channel: DeviceChannel
    motion: Motion
    options: WebotsOptions

    @property
    def world(self) -> SimulatedWorld:
        """What is in the world.  Raises ValueError before the simulation is there."""
        ...

    def add_motor(self, name: str, motor: Any) -> None:
        """Sample a motor, and limit it."""
        ...

    def stop_motor(self, name: str, reason: str) -> None:
        """Stop a motor; its movements end."""
        ...

    def add_device(self, name: str, device: Shown, period: float) -> None:
        """Sample a device or a node (``driver.NODES``) every ``period`` s, 0: with each step."""
        ...

    def switch(self, name: str, on: bool) -> None:
        """Sample a device, or do not: all objects of it are switched."""
        ...

    def is_taken(self, name: str) -> bool:
        """Whether there is an object of a device."""
        ...

    def write(self, device: str, item: str, value: Any) -> None:
        """Write to a device that moves nothing; a failure is logged."""
        ...

    def next_label(self) -> int:
        """Return the number of a new label."""
        ...

    def ask(self, verb: str, value: Any = None) -> None:
        """Send another request to the simulation."""
        ...


def surface_of(device: UObject) -> Surface:
    """Return the robot of a device.  Raises ValueError where there is none."""
    found = device.host.device(SLOT)
    if found is None:
        raise ValueError("there is no simulated robot")
    return cast(Surface, found)
