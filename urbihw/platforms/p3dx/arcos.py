"""The base of robots that speak ARCOS: commands by name and packets on request, for urbiscript."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from urbihw.buses import messages as m
from urbihw.buses.errors import BadValue
from urbihw.kernel.uobject import function
from urbihw.platforms.arrival import LINK_DOWN
from urbihw.platforms.base import WiredRobot
from urbihw.platforms.p3dx.commands import DRIVING, GAINS, RAMPS, encode
from urbihw.platforms.p3dx.packets import REQUESTS


class ArcosRobot(WiredRobot):
    """A robot whose wire is driven by ``driver``."""

    family = "urbihw.platforms.p3dx.driver:ArcosDriver"
    robot_name = "p3dx"
    model_name = "Pioneer"

    def init(self) -> None:
        """Called by ``new``; nothing happens before ``open``."""
        super().init()
        self._packets: dict[str, Mapping[str, Any]] = {}

    def check_link(self) -> None:
        """Raises ValueError while the link is down."""
        if not self.arrival.is_up():
            raise ValueError(LINK_DOWN)

    def warn_on_failure(self, what: str) -> Callable[[m.Reply], None]:
        """Return a handler of a reply that logs its error, and warns the client that writes now."""
        origin = self.motion.origin()
        return lambda reply: None if reply.ok else self.guard.warn_writer(origin, "%s: %s", what, reply.error)

    def store_packet(self, device: str, values: Mapping[str, Any]) -> None:
        """Store the values of a packet that was requested."""
        self._packets[device] = values

    @function("command")
    def command_by_name(self, name: str, value: Any) -> None:
        """Send a command of ARCOS by name, with nil, a number, or a list of bytes; commands that drive are refused."""
        if isinstance(value, list):
            try:
                value = bytes(int(byte) for byte in value)
            except ValueError:
                raise ValueError("the bytes of a command are numbers from 0 to 255") from None
        value = int(value) if isinstance(value, float) else value
        _check_command(name, value)
        if name in RAMPS:
            raise ValueError(f"{name} cannot be sent like this; use the slots acceleration and deceleration")
        if name in GAINS:
            raise ValueError(f"{name} cannot be sent like this: the brakes need it; set it with the maker's program")
        self.command(name, value)

    def command(self, name: str, value: int | bytes | None) -> None:
        """Send a command of ARCOS.  Raises ValueError for an invalid one, or one that drives."""
        _check_command(name, value)
        if name in DRIVING:
            raise ValueError(f"{name} cannot be sent like this; use the slots that drive the robot")
        self.check_link()
        self.channel.write("command", name, value, self.warn_on_failure(name))

    @function
    def watch(self, device: str) -> None:
        """Let the robot send the packets of a device from now on: encoder, io, gyro, joystick, gripper, battery."""
        self._watch(device, 0.0)

    @function
    def unwatch(self, device: str) -> None:
        """No more packets of a device."""
        self._watch(device, None)
        self._packets.pop(device, None)

    def _watch(self, device: str, period: float | None) -> None:
        if device not in REQUESTS:
            raise ValueError(f"there is no {device!r} to watch; there are: {', '.join(sorted(REQUESTS))}")
        self.worker.send(m.Watch(device, (), period))

    @function
    def values(self, device: str) -> dict[str, Any]:
        """What the last packet of a watched device said, by name; nothing if none came yet."""
        return {name: list(value) if isinstance(value, bytes) else value
                for name, value in self._packets.get(device, {}).items()}  # fmt: skip


def _check_command(name: str, value: int | bytes | None) -> None:
    """Raise ValueError for a command or an argument that ARCOS has not."""
    try:
        encode(name, value)
    except BadValue as error:
        raise ValueError(str(error)) from error
