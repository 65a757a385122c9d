"""Socket and Server: connections.

Source: manual, specs/socket, specs/server, specs/ioservice.  Threads (``wire``) tell what happens by
``scheduler.post``; an IoService keeps it until it is polled, except the default one, which handles it at once.
"""

from __future__ import annotations

import os
import resource
import threading
from collections.abc import Callable
from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import String
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.io_service import Action, ServiceObject
from urbihw.kernel.stdlib.support import field, in_thread
from urbihw.kernel.stdlib.wire import Listener, SerialStream, TcpStream, Wire, dial

SOCKET = Table("Socket")
SERVER = Table("Server")
SERVICE = Table("IoService")
"""What an IoService makes; the rest of it is in ``io_service``."""
TABLES = [SOCKET, SERVER, SERVICE]

NOTES = {
    "Socket": "A connection by TCP or a serial port, whose events tell what happens.",
    "Server": "What accepts TCP connections.",
    "Socket.pollInterval": (
        "0 if events of the default IoService shall wait until somebody polls; with any other number of seconds "
        "they are handled as they come."
    ),
    "Socket.connected": "The event emitted when the connection is there.",
    "Socket.disconnected": "The event emitted when the connection is gone.",
    "Socket.error": "The event emitted with a message when something fails; disconnected is emitted too.",
    "Socket.received": "The event emitted with a String when bytes came.",
    "Server.connection": "The event emitted with the Socket of each new connection.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


class SocketObject(Obj):
    """An urbiscript Socket."""

    __slots__ = ("service", "wire")

    def __init__(self, world: World, protos: list[Obj], service: ServiceObject | None = None) -> None:
        super().__init__(world, protos)
        self.service = service
        self.wire: Wire | None = None

    def clone(self) -> SocketObject:
        """A socket that is not connected, of the same service."""
        return SocketObject(self.world, [self], self.service)

    def events(self) -> None:
        """Give this socket events of its own."""
        for name in ("connected", "disconnected", "error", "received"):
            self.world.ops.put(self, name, Event(self.world, [self.world.event_proto]))

    def tell(self, name: str, *payload: Any) -> None:
        """Emit one of the events."""
        event = self.slots.get(name)
        if event is not None:
            self.world.send(event, "emit", *payload)

    def adopt(self, stream: TcpStream | SerialStream) -> None:
        """This socket is connected."""
        service = self.io()

        def received(data: bytes) -> None:
            service.happened(lambda: self._received(wire, data))

        def closed(message: str) -> None:
            service.happened(lambda: self._closed(wire, message))

        wire = self.wire = Wire(stream, received, closed)

    def _received(self, wire: Wire, data: bytes) -> None:
        wire.taken(len(data))
        self.tell("received", self.world.from_python(data))

    def _closed(self, wire: Wire, message: str) -> None:
        if self.wire is wire:
            self.wire = None
            if message:
                self.tell("error", self.world.string(message))
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


class ServerObject(Obj):
    """An urbiscript Server."""

    __slots__ = ("listener", "service", "sockets")

    def __init__(self, world: World, protos: list[Obj], service: ServiceObject | None = None) -> None:
        super().__init__(world, protos)
        self.service = service
        self.listener: Listener | None = None
        self.sockets: list[SocketObject] = []

    def clone(self) -> ServerObject:
        """A server that does not listen, of the same service."""
        return ServerObject(self.world, [self], self.service)

    def accepted(self, stream: TcpStream) -> None:
        """From the listening thread: somebody connected."""
        if self.service is not None:
            self.service.happened(lambda: self._welcome(stream))

    def _welcome(self, stream: TcpStream) -> None:
        try:
            _check_descriptors()
        except errors.Raised:
            stream.close()
            return
        proto = self.world.classes["Socket"]
        made = SocketObject(self.world, [proto], self.service)
        made.events()
        made.adopt(stream)
        self.sockets = [socket for socket in self.sockets if socket.wire is not None] + [made]
        event = self.slots.get("connection")
        if event is not None:
            self.world.send(event, "emit", made)
        self.world.scheduler.yield_()  # the handlers set up theirs before anything is received
        if made.wire is not None:
            made.wire.start()

    def listening(self) -> Listener:
        """The listening socket; raises when there is none."""
        if self.listener is None:
            raise errors.primitive("server not listening")
        return self.listener


CLASSES = {"Socket": SocketObject, "Server": ServerObject}


def _port(world: World, value: Any, index: int) -> int | str:
    if isinstance(value, String):
        if value.s.isdigit():
            return _port(world, float(value.s), index)
        return value.s
    number = world.as_float(value, index, "")
    if not number.is_integer() or not 0 <= number < 65536:
        raise errors.primitive(f"invalid port: {world.text(value)}")
    return int(number)


def _check_descriptors() -> None:
    """Programs may have half of the descriptors of the process: the rest is for clients and for the robot's worker."""
    most = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    if most != resource.RLIM_INFINITY and len(os.listdir("/proc/self/fd")) > most // 2:
        raise errors.primitive("too many files and connections are open")


def _blocking(world: World, action: Callable[[], Any]) -> Any:
    """What an action gives that may take long: it is done in a thread while the running job waits."""
    try:
        return in_thread(world, action)
    except OSError as problem:
        raise errors.primitive(problem.strerror or str(problem)) from problem
    except UnicodeError as problem:  # the names of hosts have a grammar of their own
        raise errors.primitive("invalid host name") from problem


# ---------------------------------------------------------------- Socket


@SOCKET.primitive("init")
def init_socket(world: World, this: SocketObject) -> None:
    """A socket that is not connected."""
    this.events()


@SOCKET.primitive("connect")
def connect(world: World, this: SocketObject, host: str, port: Any) -> None:
    """Connect to a port (a number, or the name of a service) of a host; an error if it cannot be reached."""
    number = _port(world, port, 2)
    _check_descriptors()
    _begin(this, _blocking(world, lambda: dial(host, number)))


@SOCKET.primitive("connectSerial")
def connect_serial(world: World, this: SocketObject, device: str, baud: int) -> None:
    """Connect to a serial port at a number of bits a second; an error if it cannot be opened."""
    _begin(this, _blocking(world, lambda: SerialStream(device, baud)))


def _begin(this: SocketObject, stream: TcpStream | SerialStream) -> None:
    if this.wire is not None:
        this.wire.close()
    this.adopt(stream)
    this.tell("connected")
    this.connection().start()


@SOCKET.primitive("disconnect")
def disconnect(world: World, this: SocketObject) -> None:
    """Close the connection when all is sent."""
    if this.wire is not None:
        this.wire.close()


@SOCKET.primitive("write")
def write(world: World, this: SocketObject, data: str) -> None:
    """Send bytes; does not wait until they are gone."""
    _send(this.connection(), data)


def _send(wire: Wire, data: str, sent: Action | None = None) -> None:
    try:
        wire.send(data.encode("latin-1", "replace"), sent)
    except OSError as error:
        raise errors.primitive(str(error)) from error


@SOCKET.primitive("syncWrite")
def sync_write(world: World, this: SocketObject, data: str) -> None:
    """Send bytes and wait until they are gone."""
    wire = this.connection()
    gone = threading.Event()
    _send(wire, data, gone.set)
    _blocking(world, gone.wait)


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


# ---------------------------------------------------------------- Server


@SERVER.primitive("init")
def init_server(world: World, this: ServerObject) -> None:
    """A server that does not listen."""
    world.ops.put(this, "connection", Event(world, [world.event_proto]))


@SERVER.primitive("listen")
def listen(world: World, this: ServerObject, host: str, port: Any) -> None:
    """Wait for connections to a port (0: any that is free) of this machine, under one of its addresses."""
    number = _port(world, port, 2)
    _check_descriptors()
    if this.listener is not None:
        this.listener.close()
    this.listener = _blocking(world, lambda: Listener(host, number, this.accepted))


@SERVER.primitive("host")
def server_host(world: World, this: ServerObject) -> str:
    """The address; an error if this server does not listen."""
    return str(this.listening().host)


@SERVER.primitive("port")
def server_port(world: World, this: ServerObject) -> float:
    """The port; an error if this server does not listen."""
    return float(this.listening().port)


@SERVER.primitive("sockets")
def sockets(world: World, this: ServerObject) -> Any:
    """The sockets of the connections that are still there."""
    return world.new_list([socket for socket in this.sockets if socket.wire is not None])


@SERVER.primitive("getIoService")
def server_service(world: World, this: ServerObject) -> Any:
    """The IoService of this server."""
    if this.service is None:
        raise errors.primitive("server without IoService")
    return this.service


# ---------------------------------------------------------------- IoService


@SERVICE.primitive("makeSocket")
def make_socket(world: World, this: ServiceObject) -> Any:
    """A new Socket of this service."""
    made = SocketObject(world, [world.classes["Socket"]], this)
    made.events()
    return made


@SERVICE.primitive("makeServer")
def make_server(world: World, this: ServiceObject) -> Any:
    """A new Server of this service."""
    made = ServerObject(world, [world.classes["Server"]], this)
    init_server(world, made)
    return made


def install(world: World, programs: Any) -> None:
    """The service that needs no polling, and the sockets and servers that use it."""
    service = ServiceObject(world, [world.classes["IoService"]], True)
    for name in ("Socket", "Server"):
        world.classes[name].service = service
    interval = [0.01]

    def write_interval(this: Any, value: Any) -> None:
        interval[0] = world.as_float(value, 1, "pollInterval")
        service.look_after_itself(interval[0] != 0)

    field(world, world.classes["Socket"], "pollInterval", lambda this: interval[0] + 0.0, write_interval)
