"""Server: a listening socket that accepts TCP connections.

Source: manual, specs/server.  Received data is handled as for a Socket (``network``).
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
from urbihw.kernel.stdlib.socket_channel import SocketListener, SocketStream
from urbihw.kernel.stdlib.support import check_descriptors
from urbihw.kernel.value import Value

SERVER = Table("Server")
SERVICE = Table("IoService")
"""The functions of IoService that make Servers; ``io_service`` has the others."""
TABLES = [SERVER, SERVICE]

NOTES = {
    "Server": "A listening socket that accepts TCP connections.",
    "Server.connection": "The event that is emitted with the Socket of each new connection.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


class ServerObject(Obj):
    """An urbiscript Server, with its listening socket."""

    __slots__ = ("held", "listener", "service", "sockets")

    def __init__(self, world: World, protos: list[Obj], service: ServiceObject | None = None) -> None:
        super().__init__(world, protos)
        self.service = service
        self.listener: SocketListener | None = None
        self.held: HeldSocket | None = None
        self.sockets: list[SocketObject] = []

    def clone(self) -> ServerObject:
        """A Server of the same service that does not listen."""
        return ServerObject(self.world, [self], self.service)

    def io(self) -> ServiceObject:
        """The IoService of this Server."""
        if self.service is None:
            raise errors.primitive("server without IoService")
        return self.service

    def listen(self, listener: SocketListener, held: HeldSocket) -> None:
        """Accept connections for a lobby; a former listening socket of this Server is closed."""
        self.stop()
        service, scheduler = self.io(), self.world.scheduler

        def accepted(stream: SocketStream) -> None:
            scheduler.post(lambda: service.queue_event(held.owner, lambda: welcome(stream)))

        def welcome(stream: SocketStream) -> None:
            listener.count_accepted()
            self._welcome(stream, held)

        self.listener, self.held = listener, held
        held.set_channel(listener)
        listener.start(accepted)

    def stop(self) -> None:
        """Stop listening for connections."""
        if self.listener is not None and self.held is not None:
            self.listener.close()
            self.held.release()

    def _welcome(self, stream: SocketStream, held: HeldSocket) -> None:
        try:
            check_descriptors()
            own = held.for_accepted()
        except errors.Raised:
            stream.close()
            return
        proto = self.world.classes["Socket"]
        made = SocketObject(self.world, [proto], self.service)
        made.events()
        made.set_connection(stream, own)
        self.sockets = [socket for socket in self.sockets if socket.channel is not None] + [made]
        event = self.slots.get("connection")
        if isinstance(event, Event):
            event.emit([made])
        self.world.scheduler.yield_()  # the handlers install those of the new socket before any data is received
        if made.channel is not None:
            made.channel.start()

    def listening(self) -> SocketListener:
        """The listening socket.  Raises an error if there is none."""
        if self.listener is None or not self.listener.is_open:
            raise errors.primitive("server not listening")
        return self.listener


CLASSES = {"Server": ServerObject}


@SERVER.primitive("init")
def init_server(world: World, this: ServerObject) -> None:
    """Make a Server that does not listen."""
    world.ops.put_slot(this, "connection", Event(world, [world.event_proto]))


@SERVER.primitive("listen")
def listen(world: World, this: ServerObject, host: str, port: Value) -> None:
    """Listen on a port (0: any free port) of one of this machine's addresses."""
    number = port_number(world, port, 2)
    this.io()
    held = HeldSocket.of_job(world)
    this.listen(held.open(lambda: SocketListener(pipes_of(world).poller, host, number)), held)


@SERVER.primitive("host")
def server_host(world: World, this: ServerObject) -> str:
    """The address.  Raises an error if this Server does not listen."""
    return str(this.listening().host)


@SERVER.primitive("port")
def server_port(world: World, this: ServerObject) -> float:
    """The port.  Raises an error if this Server does not listen."""
    return float(this.listening().port)


@SERVER.primitive("sockets")
def sockets(world: World, this: ServerObject) -> Value:
    """The Sockets of the open connections."""
    return world.new_list([socket for socket in this.sockets if socket.channel is not None])


@SERVER.primitive("getIoService")
def server_service(world: World, this: ServerObject) -> Value:
    """The IoService of this Server."""
    return this.io()


@SERVICE.primitive("makeServer")
def make_server(world: World, this: ServiceObject) -> Value:
    """A new Server of this service."""
    made = ServerObject(world, [world.classes["Server"]], this)
    init_server(world, made)
    return made


def install(world: World, programs: Any) -> None:
    """Make the Servers of the default service."""
    world.classes["Server"].service = world.classes["Socket"].service
