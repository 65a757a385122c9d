"""The object that stands for a whole robot: what the daemon opens, asks and closes.  A platform derives from it.

The daemon makes one with ``host.create``, calls ``open``, waits for the answer, and only then lets clients in.  From
then on a robot that goes away is the robot's own business: it says so in its slots and events and comes back by itself.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from urbihw.kernel.uobject.errors import DeviceError
from urbihw.kernel.uobject.uobject import UObject


@dataclass(frozen=True)
class RobotSettings:
    """How to reach a robot and how to treat it.

    Attributes:
        url: of its bus (see ``urbihw.buses``).
        rate: how often its devices are read and written, in Hz.
        dead_man: seconds without a sign of life from the kernel after which the robot is stopped; 0 for never.
        torque_off_on_stop: stopping also switches the motors off; a robot that stands then falls.
        options: what else the platform knows, by name.
        keep_motion: what a client set in motion goes on when its connection ends.
        resume: a movement goes on when the device or the link that it lost comes back; else it ends.
        limits: what each device may be asked for: the table ``[limits]`` of the settings.
        control: path of the control socket of the bus worker; "" for none.
    """

    url: str
    rate: float = 100.0
    dead_man: float = 1.5
    torque_off_on_stop: bool = False
    options: Mapping[str, Any] = field(default_factory=dict)
    keep_motion: bool = False
    resume: bool = True
    limits: Mapping[str, Any] = field(default_factory=dict)
    control: str = ""


Opened = Callable[[DeviceError | None], None]


class Robot(UObject):
    """Base of the robots."""

    classes: ClassVar[tuple[type[UObject], ...]] = ()
    """The device classes to register with it, so that the platform's urbiscript library finds them."""

    def open(self, settings: RobotSettings, opened: Opened) -> None:
        """Begin to find the robot, and return at once.

        ``opened(None)`` is called once, in the kernel's thread, when its devices are slots with values;
        ``opened(error)`` when that cannot be.  Nothing moves.  Raises BadConfig for settings without sense.
        """
        raise NotImplementedError

    def configure(self, settings: RobotSettings) -> None:
        """Take new settings while running; the url counts from the next ``open`` on."""
        raise NotImplementedError

    def close(self) -> None:
        """Stop the effectors and let go of the robot; within a second, and twice is fine."""
        raise NotImplementedError

    def abandon(self) -> None:
        """From any thread, when the process is about to end without ``close``: see to it that the effectors stop."""

    def stop(self) -> None:
        """Stop the effectors now; what is begun afterwards moves them again."""
        raise NotImplementedError

    def status(self) -> str:
        """A few words for the service manager, such as ``18 servos, 1 sensor, 98 Hz``."""
        raise NotImplementedError

    def alive(self) -> bool:
        """Whether what drives the robot still works, be the robot there or not; if not, the daemon is started anew."""
        return True
