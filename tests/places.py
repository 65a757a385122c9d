"""The two places in which devices run: plugged into the server, or in a process of their own.  Here both are in one
process and share a simulated clock, and the link between them is a pair of byte strings."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from urbihw.kernel import Kernel
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.uobject import Host, UObject
from urbihw.kernel.uremote.bridge import Bridge


class Plugged:
    """Devices in the server."""

    def __init__(self) -> None:
        self.clock = SimClock()
        self.server = Kernel(self.clock)
        self.devices = self.server
        self.lobby = self.server.open_lobby()

    @property
    def host(self) -> Host:
        """What devices are registered with."""
        return self.devices.host

    def register(self, *kinds: type[UObject]) -> None:
        """Make classes known."""
        for kind in kinds:
            self.host.register(kind)
        self.settle()

    def say(self, text: str, until: float | None = None) -> list[str]:
        """What a user is answered, without time stamps; the clock then stands at ``until`` if that is given."""
        self.lobby.feed(text.encode("latin-1"))
        self.settle(until)
        return [line.partition("] ")[2] for line in self.lobby.output.take_bytes().decode("latin-1").splitlines()]

    def settle(self, until: float | None = None) -> None:
        """Run until everybody waits, or until a time."""
        while True:
            deadlines = [self.server.run()]
            if not self.move():
                deadlines += [kernel.run() for kernel in self.others()]
                if not self.move():
                    wake = min((one for one in deadlines if one is not None), default=None)
                    if wake is None or wake > (self.clock.now() if until is None else until):
                        break
                    self.clock.idle(wake)
        if until is not None:
            self.clock.idle(until)

    def others(self) -> list[Kernel]:
        """The kernels beside the server's."""
        return []

    def move(self) -> bool:
        """Carry bytes; whether there were any."""
        return False


class Remote(Plugged):
    """Devices beside the server: one that knows ``binary`` mode, or is ``old`` and knows no words of ours."""

    def __init__(self, binary: bool = True, old: bool = False) -> None:
        super().__init__()
        self.old = old
        self.devices = Kernel(self.clock)
        slots = self.server.world.uobject_proto.slots
        if not binary:
            del self.server.world.lobby_proto.slots["binaryMode"]
        if old:
            for word in ("exactNumbers", "rejoin", "arity"):
                del slots[word]
            del self.server.world.uvar_proto.slots["own"], self.server.world.uvar_proto.slots["protect"]
        self.server.world.flush()
        self.server.world.record.take_snapshot()
        self.bridge = Bridge(self.devices.host, "test_1", self._sent.extend)
        self.connection: Any = None

    @property
    def _sent(self) -> list[bytes | memoryview]:
        self.__dict__.setdefault("sent", [])
        sent: list[bytes | memoryview] = self.__dict__["sent"]
        return sent

    def register(self, *kinds: type[UObject]) -> None:
        """Make classes known, and join."""
        for kind in kinds:
            self.host.register(kind)
        self.join()

    def join(self) -> None:
        """Connect to the server."""
        self.connection = self.server.open_lobby("127.0.0.1")
        self.bridge.connected()
        self.settle()

    def leave(self) -> None:
        """Lose the connection."""
        self.connection.close()
        self.connection = None
        self._sent.clear()
        self.bridge.lost()
        self.settle()

    def others(self) -> list[Kernel]:
        """The kernel of the devices."""
        return [self.devices]

    def move(self) -> bool:
        """Carry bytes both ways, cut into odd pieces."""
        if self.connection is None:
            return False
        there = b"".join(self._sent)
        self._sent.clear()
        back = self.connection.output.take_bytes()
        for at in range(0, len(there), 4099):
            self.connection.feed(there[at : at + 4099])
        for at in range(0, len(back), 4099):
            self.bridge.receive(back[at : at + 4099])
        return bool(there or back)


PLACES: dict[str, Callable[[], Plugged]] = {
    "plugged": Plugged,
    "remote": Remote,
    "remote in text mode": lambda: Remote(binary=False),
}
