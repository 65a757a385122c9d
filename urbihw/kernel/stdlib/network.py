"""Socket: TCP and serial connections.

Source: manual, specs/socket, specs/ioservice.  A thread (see ``socket_channel``) reports events by ``scheduler.post``;
an IoService queues them until it is polled.  The default IoService handles them at once.
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
from urbihw.kernel.sched.waiting import Completion
from urbihw.kernel.stdlib.held_socket import HeldSocket
from urbihw.kernel.stdlib.io_service import Action, ServiceObject
from urbihw.kernel.stdlib.pipe import pipes_of
from urbihw.kernel.stdlib.socket_channel import SocketChannel, SocketStream, connect_to, serial_stream
from urbihw.kernel.stdlib.support import field
from urbihw.kernel.value import Value

SOCKET = Table("Socket")
SERVICE = Table("IoService")
"""The functions of IoService that make Sockets; ``io_service`` has the others."""
TABLES = [SOCKET, SERVICE]

NOTES = {
    "Socket": "A TCP or serial connection, with events for its changes of state and for received data.",
    "Socket.pollInterval": (
        "If 0, the events of the default IoService wait for a poll; with any other number of seconds "
        "they are handled at once."
    ),
    "Socket.connected": "The event that is emitted when the connection is established.",
    "Socket.disconnected": "The event that is emitted when the connection has ended.",
    "Socket.error": "The event that is emitted with a message at an error; disconnected is emitted too.",
    "Socket.received": "The event that is emitted with the received bytes as a String.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


class SocketObject(Obj):
    """An urbiscript Socket, with its connection."""

    __slots__ = ("held", "service", "channel")

    def __init__(self, world: World, protos: list[Obj], service: ServiceObject | None = None) -> None:
        super().__init__(world, protos)
        self.service = service
        self.channel: SocketChannel | None = None
        self.held: HeldSocket | None = None

    def clone(self) -> SocketObject:
        """An unconnected Socket of the same service."""
        return SocketObject(self.world, [self], self.service)

    def events(self) -> None:
        """Make the events of this Socket."""
        for name in ("connected", "disconnected", "error", "received"):
            self.world.ops.put_slot(self, name, Event(self.world, [self.world.event_proto]))

    def emit_event(self, name: str, *payload: Value) -> list[Job]:
        """Emit one of the events; returns the jobs that handle it.  No effect if the slot is not an Event any more."""
        event = self.slots.get(name)
        if isinstance(event, Event):
            return event.emit([*payload]).jobs
        if event is not None:
            self.world.send(event, "emit", *payload)
        return []

    def set_connection(self, stream: SocketStream, held: HeldSocket) -> None:
        """Connect this Socket to a stream that is held by a lobby."""
        service = self.io()
        scheduler = self.world.scheduler

        def news() -> None:
            scheduler.post(lambda: service.queue_event(held.owner, report_news))

        def report_news() -> None:
            data = channel.take_received()
            if data:
                if channel.has_received:  # the handlers of other sockets first
                    service.queue_event(held.owner, report_news)
                self._received(channel, data)
            elif channel.over:
                held.release()
                self._closed(channel)

        channel = self.channel = SocketChannel(pipes_of(self.world).poller, stream, news)
        self.held = held
        held.set_channel(channel)

    def _received(self, channel: SocketChannel, data: bytes) -> None:
        """Handle received bytes.  They count as handled when the event handlers have ended; above a limit of unhandled
        bytes, no more are read.
        """
        left = 1

        def over(_: Value = None) -> None:
            nonlocal left
            left -= 1
            if not left:
                channel.count_handled(len(data))

        try:
            for job in self.emit_event("received", self.world.from_python(data)):
                left += 1
                job.when_ended(over)
        finally:
            over()

    def _closed(self, channel: SocketChannel) -> None:
        if self.channel is channel:
            self.channel = None
            if channel.message:
                self.emit_event("error", self.world.string(channel.message))
            self.emit_event("disconnected")

    def io(self) -> ServiceObject:
        """The IoService of this Socket."""
        if self.service is None:
            raise errors.primitive("socket without IoService")
        return self.service

    def connection(self) -> SocketChannel:
        """The connection.  Raises an error if there is none."""
        if self.channel is None:
            raise errors.primitive("socket not connected")
        return self.channel

    def send(self, data: str, sent: Action | None = None) -> None:
        """Queue bytes for sending.  ``sent()`` is then called from any thread, whether the transmission succeeded or
        not.
        """
        channel, held = self.connection(), self.held
        if held is not None:
            held.check_unsent()
        channel.send(data.encode("latin-1", "replace"), sent)


CLASSES = {"Socket": SocketObject}


def port_number(world: World, value: Value, index: int) -> int | str:
    """The port in an argument: a number, or the name of a service.  Raises Exception.Primitive."""
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
    """Make an unconnected Socket."""
    this.events()


@SOCKET.primitive("connect")
def connect(world: World, this: SocketObject, host: str, port: Value) -> None:
    """Connect to a port (a number, or the name of a service) of a host.  Raises an error if it cannot be reached."""
    number = port_number(world, port, 2)
    held = HeldSocket.of_job(world)
    _begin(this, held, held.open(lambda: connect_to(host, number, held.attempt)))


@SOCKET.primitive("connectSerial")
def connect_serial(world: World, this: SocketObject, device: str, baud: int) -> None:
    """Connect to a serial port at a rate in bits per second.  Raises an error if it cannot be opened."""
    held = HeldSocket.of_job(world)
    _begin(this, held, held.open(lambda: serial_stream(device, baud)))


def _begin(this: SocketObject, held: HeldSocket, stream: SocketStream) -> None:
    if this.channel is not None:
        this.channel.close()
    this.set_connection(stream, held)
    channel = this.connection()
    try:
        this.emit_event("connected")
    finally:
        channel.start()


@SOCKET.primitive("disconnect")
def disconnect(world: World, this: SocketObject) -> None:
    """Close the connection after all data is sent."""
    if this.channel is not None:
        this.channel.close()


@SOCKET.primitive("write")
def write(world: World, this: SocketObject, data: str) -> None:
    """Send bytes without waiting for the end of the transmission."""
    this.send(data)


@SOCKET.primitive("syncWrite")
def sync_write(world: World, this: SocketObject, data: str) -> None:
    """Send bytes and wait for the end of the transmission."""
    scheduler = world.scheduler
    gone: Completion[None] = Completion(scheduler)
    this.send(data, lambda: scheduler.post(lambda: gone.complete(None)))
    gone.wait()


@SOCKET.primitive("isConnected")
def is_connected(world: World, this: SocketObject) -> bool:
    """Whether the Socket is connected."""
    return this.channel is not None


@SOCKET.primitive("host")
def host(world: World, this: SocketObject) -> str:
    """The address of the remote end."""
    return this.connection().stream.remote[0]


@SOCKET.primitive("port")
def port(world: World, this: SocketObject) -> float:
    """The port of the remote end."""
    return float(this.connection().stream.remote[1])


@SOCKET.primitive("localHost")
def local_host(world: World, this: SocketObject) -> str:
    """The address of the local end."""
    return this.connection().stream.local[0]


@SOCKET.primitive("localPort")
def local_port(world: World, this: SocketObject) -> float:
    """The port of the local end."""
    return float(this.connection().stream.local[1])


@SOCKET.primitive("getIoService")
def socket_service(world: World, this: SocketObject) -> Value:
    """The IoService of this Socket."""
    return this.io()


@SOCKET.primitive("poll")
def socket_poll(world: World, this: SocketObject) -> None:
    """Call ``getIoService.poll``."""
    if not this.io().automatic:
        this.io().poll()


# ---------------------------------------------------------------- IoService


@SERVICE.primitive("makeSocket")
def make_socket(world: World, this: ServiceObject) -> Value:
    """A new Socket of this service."""
    made = SocketObject(world, [world.classes["Socket"]], this)
    made.events()
    return made


def automatic_service(world: World) -> ServiceObject:
    """The default service: it handles events without a poll, in a job of the lobby that they belong to."""
    found = world.classes["Socket"].service
    assert isinstance(found, ServiceObject)
    return found


def install(world: World, programs: Any) -> None:
    """Make the default service, which needs no polling, and the Sockets that use it."""
    service = ServiceObject(world, [world.classes["IoService"]], True)
    world.classes["Socket"].service = service
    interval = [0.01]

    def write_interval(this: Value, value: Value) -> None:
        interval[0] = world.as_float(value, 1, "pollInterval")
        service.set_automatic(interval[0] != 0)

    field(world, world.classes["Socket"], "pollInterval", lambda this: interval[0] + 0.0, write_interval)
