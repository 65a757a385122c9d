"""The object that represents a whole robot: the daemon opens it, asks for its status and closes it.  A platform derives
its robot from this class.

The daemon makes it with ``host.create``, calls ``open``, waits for the answer, and only then accepts clients.  From
then on the robot itself handles a connection that is lost or was never there: it reports the loss in its slots and
events and connects by itself.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from typing import Any, ClassVar

from urbihw.frozen import frozen
from urbihw.kernel.uobject.errors import DeviceError
from urbihw.kernel.uobject.uobject import UObject


@frozen(slots=False)
class RobotSettings:
    """How to reach a robot and how to operate it.

    Attributes:
        url: of its bus (see ``urbihw.buses``).
        rate: rate at which its devices are read and written, in Hz.
        dead_man: seconds without a heartbeat of the kernel after which the robot is stopped; 0 for never.
        torque_off_on_stop: whether a stop also switches the motors off; a standing robot then falls.
        options: further options of the platform, by name.
        keep_motion: whether the movements of a client continue when its connection ends.
        resume: whether a movement continues when a lost device or link comes back; otherwise it ends.
        limits: limits of the commands to each device: the table ``[limits]`` of the settings.
        devices: the expected devices by name: the table ``[devices]`` of the settings.
        control: path of the control socket of the bus worker; "" for none.
        memory: path of the file of the devices that the last run has found; "" for none.
        motions: path of the folder of recorded motions and poses; "" for none.
        realtime: whether the bus worker takes real-time scheduling, where the system allows it.
    """

    url: str
    rate: float = 100.0
    dead_man: float = 1.5
    torque_off_on_stop: bool = False
    options: Mapping[str, Any] = field(default_factory=dict)
    keep_motion: bool = False
    resume: bool = True
    limits: Mapping[str, Any] = field(default_factory=dict)
    devices: Mapping[str, Any] = field(default_factory=dict)
    control: str = ""
    memory: str = ""
    motions: str = ""
    realtime: bool = False


Opened = Callable[[DeviceError | None], None]


class PlatformRobot(UObject):
    """Base of the robots."""

    classes: ClassVar[tuple[type[UObject], ...]] = ()
    """The device classes that are registered with the robot, so that the platform's urbiscript library finds them."""

    @property
    def tree_begun(self) -> bool:
        """Whether the slots of the robot are made, or being made (of an absent robot: if the last run knew them)."""
        return True

    def open(self, settings: RobotSettings, opened: Opened) -> None:
        """Start the search for the robot, and return at once.

        ``opened`` is called in the kernel's thread: once with NotReady when the robot is absent (it is searched until
        it is there), and once with None when the devices are slots with values; with another error when the settings
        do not fit.  Nothing moves.  Raises BadConfig for invalid settings.
        """
        raise NotImplementedError

    def await_programs(self) -> None:
        """Called before ``open`` if programs of the user follow: a simulation stands still until they begin, so that
        the same program runs alike twice.  Others do nothing."""

    def begin_programs(self) -> None:
        """The first program of the user has begun."""

    def configure(self, settings: RobotSettings) -> None:
        """Apply new settings while running; a new url takes effect at the next ``open``."""
        raise NotImplementedError

    def close(self) -> None:
        """Stop the effectors and release the robot, within one second; a second call has no effect."""
        raise NotImplementedError

    def abandon(self) -> None:
        """From any thread, when the process ends without ``close``: make sure that the effectors stop."""

    def stop(self) -> None:
        """Stop the effectors now; commands given afterwards move them again."""
        raise NotImplementedError

    def waits_for(self) -> str:
        """Why the robot has not been found yet since ``open``, in one line; "" when it has been."""
        return ""

    def status(self) -> str:
        """The status in a few words for the service manager, such as ``18 servos, 1 sensor, 98 Hz``."""
        raise NotImplementedError

    def alive(self) -> bool:
        """Whether the driver of the robot still works, with or without a connected robot; if not, the daemon is
        restarted.
        """
        return True


def not_ended(file: str) -> str:
    """Return the reason why a start waits for an urbiscript file, in one line that says what to do."""
    return f"{file} has not ended: put what lasts, such as a loop or `every`, into detach({{...}})"
