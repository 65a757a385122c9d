"""Socket: connections.

Source: manual, specs/socket, specs/ioservice.  A thread (see ``wire``) tells what happens by ``scheduler.post``; an
IoService keeps it until it is polled, except the default one, which handles it at once.
"""

from __future__ import annotations

from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import String
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.job import Job
from urbihw.kernel.stdlib.held_socket import HeldSocket
from urbihw.kernel.stdlib.io_service import Action, ServiceObject
from urbihw.kernel.stdlib.pipe import pipes_of
from urbihw.kernel.stdlib.support import field
from urbihw.kernel.stdlib.wire import Stream, Wire, dial, serial_stream

SOCKET = Table("Socket")
SERVICE = Table("IoService")
"""What an IoService makes; the rest of it is in ``io_service``."""
TABLES = [SOCKET, SERVICE]

NOTES = {
    "Socket": "A connection by TCP or a serial port, whose events tell what happens.",
    "Socket.pollInterval": (
        "0 if events of the default IoService shall wait until somebody polls; with any other number of seconds "
        "they are handled as they come."
    ),
    "Socket.connected": "The event emitted when the connection is there.",
    "Socket.disconnected": "The event emitted when the connection is gone.",
    "Socket.error": "The event emitted with a message when something fails; disconnected is emitted too.",
    "Socket.received": "The event emitted with a String when bytes came.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


class SocketObject(Obj):
    """An urbiscript Socket."""

    __slots__ = ("held", "service", "wire")

    def __init__(self, world: World, protos: list[Obj], service: ServiceObject | None = None) -> None:
        super().__init__(world, protos)
        self.service = service
        self.wire: Wire | None = None
        self.held: HeldSocket | None = None

    def clone(self) -> SocketObject:
        """A socket that is not connected, of the same service."""
        return SocketObject(self.world, [self], self.service)

    def events(self) -> None:
        """Give this socket events of its own."""
        for name in ("connected", "disconnected", "error", "received"):
            self.world.ops.put(self, name, Event(self.world, [self.world.event_proto]))

    def tell(self, name: str, *payload: Any) -> list[Job]:
        """Emit one of the events; the jobs that handle it, if it is still an Event."""
        event = self.slots.get(name)
        if isinstance(event, Event):
            return event.emit([*payload]).jobs
        if event is not None:
            self.world.send(event, "emit", *payload)
        return []

    def adopt(self, stream: Stream, held: HeldSocket) -> None:
        """This socket is connected, and held by a lobby."""
        service = self.io()
        scheduler = self.world.scheduler

        def news() -> None:
            scheduler.post(lambda: service.happened(held.owner, look))

        def look() -> None:
            data = wire.take()
            if data:
                if wire.waiting:  # the others first
                    service.happened(held.owner, look)
                self._received(wire, data)
            elif wire.over:
                held.release()
                self._closed(wire)

        wire = self.wire = Wire(pipes_of(self.world).poller, stream, news)
        self.held = held
        held.hold(wire)

    def _received(self, wire: Wire, data: bytes) -> None:
        """Bytes came.  They are handled when the handlers are over; as long as too many are not, no more is read."""
        left = 1

        def over(_: Any = None) -> None:
            nonlocal left
            left -= 1
            if not left:
                wire.handled(len(data))

        try:
            for job in self.tell("received", self.world.from_python(data)):
                left += 1
                job.when_ended(over)
        finally:
            over()

    def _closed(self, wire: Wire) -> None:
        if self.wire is wire:
            self.wire = None
            if wire.message:
                self.tell("error", self.world.string(wire.message))
            self.tell("disconnected")

    def io(self) -> ServiceObject:
        """The service of this socket."""
        if self.service is None:
            raise errors.primitive("socket without IoService")
        return self.service

    def connection(self) -> Wire:
        """The connection; raises when there is none."""
        if self.wire is None:
            raise errors.primitive("socket not connected")
        return self.wire

    def send(self, data: str, sent: Action | None = None) -> None:
        """Write when its turn comes; ``sent()`` is called from any thread then, whatever became of it."""
        wire, held = self.connection(), self.held
        if held is not None:
            held.check_unsent()
        wire.send(data.encode("latin-1", "replace"), sent)


CLASSES = {"Socket": SocketObject}


def port_number(world: World, value: Any, index: int) -> int | str:
    """The port that an argument says: a number, or the name of a service; raises Exception.Primitive."""
    if isinstance(value, String):
        if value.s.isdigit():
            return port_number(world, float(value.s), index)
        return value.s
    number = world.as_float(value, index, "")
    if not number.is_integer() or not 0 <= number < 65536:
        raise errors.primitive(f"invalid port: {world.text(value)}")
    return int(number)


# ---------------------------------------------------------------- Socket


@SOCKET.primitive("init")
def init_socket(world: World, this: SocketObject) -> None:
    """A socket that is not connected."""
    this.events()


@SOCKET.primitive("connect")
def connect(world: World, this: SocketObject, host: str, port: Any) -> None:
    """Connect to a port (a number, or the name of a service) of a host; an error if it cannot be reached."""
    number = port_number(world, port, 2)
    held = HeldSocket.of_job(world)
    _begin(this, held, held.open(lambda: dial(host, number, held.trial)))


@SOCKET.primitive("connectSerial")
def connect_serial(world: World, this: SocketObject, device: str, baud: int) -> None:
    """Connect to a serial port at a number of bits a second; an error if it cannot be opened."""
    held = HeldSocket.of_job(world)
    _begin(this, held, held.open(lambda: serial_stream(device, baud)))


def _begin(this: SocketObject, held: HeldSocket, stream: Stream) -> None:
    if this.wire is not None:
        this.wire.close()
    this.adopt(stream, held)
    wire = this.connection()
    try:
        this.tell("connected")
    finally:
        wire.start()


@SOCKET.primitive("disconnect")
def disconnect(world: World, this: SocketObject) -> None:
    """Close the connection when all is sent."""
    if this.wire is not None:
        this.wire.close()


@SOCKET.primitive("write")
def write(world: World, this: SocketObject, data: str) -> None:
    """Send bytes; does not wait until they are gone."""
    this.send(data)


@SOCKET.primitive("syncWrite")
def sync_write(world: World, this: SocketObject, data: str) -> None:
    """Send bytes and wait until they are gone."""
    scheduler = world.scheduler
    job, gone = scheduler.running(), [False]

    def sent() -> None:
        gone[0] = True
        scheduler.post(lambda: scheduler.wake(job))

    this.send(data, sent)
    while not gone[0]:
        scheduler.suspend(None)


@SOCKET.primitive("isConnected")
def is_connected(world: World, this: SocketObject) -> bool:
    """Whether there is a connection."""
    return this.wire is not None


@SOCKET.primitive("host")
def host(world: World, this: SocketObject) -> str:
    """The address of the other side."""
    return this.connection().stream.remote[0]


@SOCKET.primitive("port")
def port(world: World, this: SocketObject) -> float:
    """The port of the other side."""
    return float(this.connection().stream.remote[1])


@SOCKET.primitive("localHost")
def local_host(world: World, this: SocketObject) -> str:
    """The address of this side."""
    return this.connection().stream.local[0]


@SOCKET.primitive("localPort")
def local_port(world: World, this: SocketObject) -> float:
    """The port of this side."""
    return float(this.connection().stream.local[1])


@SOCKET.primitive("getIoService")
def socket_service(world: World, this: SocketObject) -> Any:
    """The IoService of this socket."""
    return this.io()


@SOCKET.primitive("poll")
def socket_poll(world: World, this: SocketObject) -> None:
    """``getIoService.poll``."""
    if not this.io().automatic:
        this.io().poll()


# ---------------------------------------------------------------- IoService


@SERVICE.primitive("makeSocket")
def make_socket(world: World, this: ServiceObject) -> Any:
    """A new Socket of this service."""
    made = SocketObject(world, [world.classes["Socket"]], this)
    made.events()
    return made


def install(world: World, programs: Any) -> None:
    """The service that needs no polling, and the sockets that use it."""
    service = ServiceObject(world, [world.classes["IoService"]], True)
    world.classes["Socket"].service = service
    interval = [0.01]

    def write_interval(this: Any, value: Any) -> None:
        interval[0] = world.as_float(value, 1, "pollInterval")
        service.look_after_itself(interval[0] != 0)

    field(world, world.classes["Socket"], "pollInterval", lambda this: interval[0] + 0.0, write_interval)
