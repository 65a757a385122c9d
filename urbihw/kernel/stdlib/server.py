"""Server: what accepts connections.

Source: manual, specs/server.  What comes is handled as for a Socket (``network``).
"""

from __future__ import annotations

from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.held_socket import HeldSocket
from urbihw.kernel.stdlib.io_service import ServiceObject
from urbihw.kernel.stdlib.network import SocketObject, port_number
from urbihw.kernel.stdlib.pipe import pipes_of
from urbihw.kernel.stdlib.support import check_descriptors
from urbihw.kernel.stdlib.wire import Listener, Stream

SERVER = Table("Server")
SERVICE = Table("IoService")
"""What an IoService makes; the rest of it is in ``io_service``."""
TABLES = [SERVER, SERVICE]

NOTES = {
    "Server": "What accepts TCP connections.",
    "Server.connection": "The event emitted with the Socket of each new connection.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


class ServerObject(Obj):
    """An urbiscript Server."""

    __slots__ = ("held", "listener", "service", "sockets")

    def __init__(self, world: World, protos: list[Obj], service: ServiceObject | None = None) -> None:
        super().__init__(world, protos)
        self.service = service
        self.listener: Listener | None = None
        self.held: HeldSocket | None = None
        self.sockets: list[SocketObject] = []

    def clone(self) -> ServerObject:
        """A server that does not listen, of the same service."""
        return ServerObject(self.world, [self], self.service)

    def io(self) -> ServiceObject:
        """The service of this server."""
        if self.service is None:
            raise errors.primitive("server without IoService")
        return self.service

    def listen(self, listener: Listener, held: HeldSocket) -> None:
        """Accept who connects, on account of a lobby, and nobody any more where this server did before."""
        self.stop()
        service, scheduler = self.io(), self.world.scheduler

        def accepted(stream: Stream) -> None:
            scheduler.post(lambda: service.happened(held.owner, lambda: welcome(stream)))

        def welcome(stream: Stream) -> None:
            listener.welcomed()
            self._welcome(stream, held)

        self.listener, self.held = listener, held
        held.hold(listener)
        listener.start(accepted)

    def stop(self) -> None:
        """Listen no more."""
        if self.listener is not None and self.held is not None:
            self.listener.close()
            self.held.release()

    def _welcome(self, stream: Stream, held: HeldSocket) -> None:
        try:
            check_descriptors()
            own = held.further()
        except errors.Raised:
            stream.close()
            return
        proto = self.world.classes["Socket"]
        made = SocketObject(self.world, [proto], self.service)
        made.events()
        made.adopt(stream, own)
        self.sockets = [socket for socket in self.sockets if socket.wire is not None] + [made]
        event = self.slots.get("connection")
        if isinstance(event, Event):
            event.emit([made])
        self.world.scheduler.yield_()  # the handlers set up theirs before anything is received
        if made.wire is not None:
            made.wire.start()

    def listening(self) -> Listener:
        """The listening socket; raises when there is none."""
        if self.listener is None or not self.listener.is_open:
            raise errors.primitive("server not listening")
        return self.listener


CLASSES = {"Server": ServerObject}


@SERVER.primitive("init")
def init_server(world: World, this: ServerObject) -> None:
    """A server that does not listen."""
    world.ops.put(this, "connection", Event(world, [world.event_proto]))


@SERVER.primitive("listen")
def listen(world: World, this: ServerObject, host: str, port: Any) -> None:
    """Wait for connections to a port (0: any that is free) of this machine, under one of its addresses."""
    number = port_number(world, port, 2)
    this.io()
    held = HeldSocket.of_job(world)
    this.listen(held.open(lambda: Listener(pipes_of(world).poller, host, number)), held)


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
    return this.io()


@SERVICE.primitive("makeServer")
def make_server(world: World, this: ServiceObject) -> Any:
    """A new Server of this service."""
    made = ServerObject(world, [world.classes["Server"]], this)
    init_server(world, made)
    return made


def install(world: World, programs: Any) -> None:
    """Servers use the service of sockets."""
    world.classes["Server"].service = world.classes["Socket"].service
