"""One remote as the server sees it: its objects, the calls that wait for its answers, its subscribed variables and
events.

The objects that a remote declares belong to it: no other connection may change their functions, or own or report their
variables (``claim``).  Names belong to the connection until its end, even names of destroyed objects.  All queues for a
remote are bounded, because it may never answer.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.binary import BinaryObject
from urbihw.kernel.runtime.code import Executable
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.sched.waiting import Completion
from urbihw.kernel.uobject.registry import registry_of
from urbihw.kernel.uobject.uvalue import from_urbi, to_urbi
from urbihw.kernel.uobject.uvar import UVar
from urbihw.kernel.uremote.external_text import message
from urbihw.kernel.uremote.frames import SlotName, Update
from urbihw.kernel.uremote.remote import CHANNEL, MessageCode
from urbihw.kernel.uremote.rtplink import RtpLink
from urbihw.kernel.uremote.subscriptions import EventSubscription, RemoteSettings, VariableSubscription

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World
    from urbihw.kernel.uobject.registry import Registry

DISCONNECTED = "Remote disconnected"
LOAD = "load"

MAX_DECLARED = 10_000
"""Maximum number of objects of one remote; also the maximum of its subscribed variables, and of its subscribed
events.
"""
MAX_CALLS = 1_000
"""Maximum number of calls, and of requested instances, that wait for one remote."""


class RemoteConnection:
    """The remote that uses a lobby.  ``token`` identifies the remote across its connections, if it has one."""

    def __init__(self, registry: Registry, lobby: Any) -> None:
        self.registry = registry
        self.world = registry.world
        self.lobby = lobby
        self.objects: dict[str, Obj] = {}
        self.bare_names = False
        self.open = True
        self.token = ""
        self.binary = False
        self._tickets = registry.tickets
        self._pending: dict[str, Completion[Any]] = {}
        self._newborn: dict[str, Completion[None]] = {}
        self._ended: dict[str, None] = {}
        self.refused: set[str] = set()
        """Names of objects that it declared although they belong to others."""
        self.told_of_refusal = False
        """Whether it has been told that a function of such an object is not declared."""
        self._watches: dict[UVar, VariableSubscription] = {}
        self._event_subscriptions: dict[str, tuple[Event, EventSubscription]] = {}
        self._rtp: RtpLink | None = None
        self.rtp_declined = False

    # ---------------------------------------------------------------- belonging

    @property
    def name(self) -> str:
        """The name in errors and in the log: the lobby, and the address of the client."""
        peer = self.lobby.peer
        return str(self.lobby.tag.tag.name) + (f" ({peer})" if peer else "")

    def has_name(self, name: str) -> bool:
        """Whether a name belongs to this remote: the name of an existing, requested or destroyed object."""
        return name in self.objects or name in self._newborn or name in self._ended

    def add_object(self, name: str, face: Obj) -> None:
        """Register an object of this remote.  Raises an urbiscript error above the limit."""
        if len(self.objects) >= MAX_DECLARED:
            raise errors.primitive(f"this connection has {MAX_DECLARED} objects already")
        self.objects[name] = face
        self.registry.owners[face] = self
        if self.lobby.ordered is None:
            self.lobby.ordered = self.world.scheduler.era
        self._ended.pop(name, None)

    def claim(self, target: Obj, name: str) -> None:
        """Raise an error that names the owner of ``target``, unless it is this remote; ``name`` is the requested
        name.
        """
        owner = self.registry.owners.get(target)
        if owner is not self:
            owner = "this server" if owner is None else owner.name
            raise errors.primitive(f"{name} belongs to {owner}, not to this connection")

    # ---------------------------------------------------------------- saying

    def send(self, code: MessageCode, *values: Any) -> None:
        """Send one message to the remote."""
        if self.open:
            now, members = self.world.scheduler.now, [float(code), *values]
            direct = code == MessageCode.CALL and not self.bare_names
            self.lobby.output.write(message(self.world, now, CHANNEL, self.bare_names, members, direct))

    def send_on_channel(self, channel: str, value: Any) -> None:
        """Send a value on a channel, in the remotes' format."""
        self.lobby.output.write(message(self.world, self.world.scheduler.now, channel, self.bare_names, value))

    def _take_order(self) -> None:
        """The running job wants something of a device of the remote: that is an order, if the job was ordered."""
        job = self.world.scheduler.current
        if job is not None and job.context is not self.lobby:
            self.lobby.ordered = max(self.lobby.ordered or 0, job.ordered)

    # ---------------------------------------------------------------- calls

    def call(self, path: str, args: tuple[Any, ...]) -> Any:
        """Call a function of the remote while the running job waits; returns its value or raises its error."""
        if not self.open:
            raise errors.primitive(DISCONNECTED)
        if len(self._pending) >= MAX_CALLS:
            raise errors.primitive(f"{MAX_CALLS} calls wait for an answer of {self.name} already")
        self._take_order()
        world = self.world
        ticket = f"_{next(self._tickets)}"
        answer: Completion[Any] = Completion(world.scheduler)
        self._pending[ticket] = answer
        self.send(MessageCode.CALL, world.string(f"{path}__{len(args)}"), world.string(ticket), *args)
        try:
            value = answer.wait()
        finally:
            self._pending.pop(ticket, None)
        if isinstance(value, Obj) and world.is_a(value, world.exception_proto):
            raise errors.primitive(world.text(world.send(value, "message")))
        return value

    def answer(self, ticket: str, value: Any) -> None:
        """Store the remote's answer to a call.  Raises an error for an unknown ticket."""
        pending = self._pending.pop(ticket, None)
        if pending is None:
            raise errors.primitive(f"missing key: {ticket}")
        pending.complete(value)

    # ---------------------------------------------------------------- instances

    def make(self, kind: str, face: Obj) -> Obj:
        """Make an instance of a class of the remote: wait until the remote has announced its ``init``."""
        if not self.open:
            raise errors.primitive(DISCONNECTED)
        if self.registry.owners.get(face) is not self:
            raise errors.lookup_failed(kind)
        if len(self._newborn) >= MAX_CALLS:
            raise errors.primitive(f"{MAX_CALLS} instances wait to be made by {self.name} already")
        world = self.world
        name = self.registry.fresh_name()
        announced: Completion[None] = Completion(world.scheduler)
        self._newborn[name] = announced
        self.send(MessageCode.NEW, world.string(name), world.string(kind))
        announced.wait()
        made: Obj | None = self.objects.get(name)
        if made is None:
            raise errors.primitive(DISCONNECTED)
        made.set_protos([face])
        return made

    def arrived(self, name: str) -> None:
        """The remote has announced the ``init`` of an object; an object that was not requested, or not any more, is
        destroyed.
        """
        if name not in self._newborn:
            return
        announced = self._newborn.pop(name)
        if announced.job is not None:
            announced.complete(None)
        elif name in self.objects:
            self.destroy(name)

    def destroy(self, name: str) -> None:
        """Destroy an object: notify the remote, and remove the object."""
        self.send(MessageCode.DELETE, self.world.string(name))
        self.retire(name)

    def retire(self, name: str) -> None:
        """Remove an object that has ended; no frame is sent for it any more.

        A remote aborts at a call of a function of an object that it does not have.  References to the object remain as
        references to an empty object.
        """
        face = self.objects.pop(name)
        self.registry.owners.pop(face, None)
        self._ended[name] = None
        if len(self._ended) > MAX_DECLARED:
            del self._ended[next(iter(self._ended))]
        self.registry.remove(name, face)
        for slot in [slot for slot, value in face.slots.items() if isinstance(value, RemoteFunction)]:
            self.world.ops.remove_slot(face, slot)
        prefix = f"{name}."
        for var in [var for var, watch in self._watches.items() if watch.name.startswith(prefix)]:
            self.unwatch(var, None)
        for heard in [one for one in self._event_subscriptions if one.startswith(prefix)]:
            event, subscription = self._event_subscriptions.pop(heard)
            event.subscriptions.pop(subscription, None)

    # ---------------------------------------------------------------- variables and events

    def watch(self, var: UVar, name: str, owner: bool = False) -> None:
        """Add a subscription of the remote to a variable.  Raises an urbiscript error above the limit."""
        watch = self._watches.get(var)
        if watch is None:
            if len(self._watches) >= MAX_DECLARED:
                raise errors.primitive(f"this connection watches {MAX_DECLARED} variables already")
            watch = self._watches[var] = VariableSubscription(name)
        if var.subscribers is None:
            var.subscribers = {}
        if owner:
            var.subscribers[self] = True
        else:
            watch.count += 1
            var.subscribers.setdefault(self, False)

    def release(self, name: str, slot: str, var: UVar, count: int) -> None:
        """Remove ``count`` of the remote's declarations of ``name.slot``.

        ``load`` is a member of every object of the C++ SDK: its removal means that the object has ended there.
        """
        self.unwatch(var, count)
        if slot == LOAD and var not in self._watches and name in self.objects:
            self.retire(name)

    def unwatch(self, var: UVar, count: int | None) -> None:
        """Unsubscribe from a variable if ``count`` declarations were all; None stands for all."""
        watch = self._watches.get(var)
        if watch is None:
            return
        watch.count -= watch.count if count is None else count
        if watch.count <= 0:
            del self._watches[var]
            if var.subscribers is not None:
                var.subscribers.pop(self, None)

    def changed(self, var: UVar, value: Any) -> None:
        """Send the new value of a subscribed variable."""
        if value is self.world.nil or value is self.world.void:
            return
        watch = self._watches.get(var)
        if watch is None:
            return
        if self.registry.owners.get(var.holder) is self:
            self._take_order()
        if self._rtp is None or not self._by_rtp(watch.name, var, value):
            self.send(MessageCode.CHANGED, self.world.string(watch.name), value, var.stamp)

    def update(self, var: UVar, value: Any, stamp: float) -> None:
        """Store a value that the remote reports, without sending it back; or a write to another's variable, which is
        open to all.

        Raises an urbiscript error for a constant variable.
        """
        if var.constant:
            raise errors.constness()
        if self.registry.owners.get(var.holder) is self:
            var.receive(value, self._seconds(stamp), self)
        else:
            var.write(var.holder, value)

    def _seconds(self, stamp: float) -> float:
        """Convert microseconds since the server's ``timeReference``, or since its start, to seconds of its clock: the
        result nearer to now.
        """
        now, seconds = self.world.scheduler.clock.now(), stamp / 1e6
        other = seconds - self.world.part(RemoteSettings).midnight
        return seconds if abs(seconds - now) <= abs(other - now) else other

    def open_rtp(self, secret: bytes, port: int, source: int) -> RtpLink:
        """Enable RTP for values, and return this server's end.  Raises ``primitive`` if that is impossible.

        ``port`` and ``source`` are the remote's; its address is that of the connection.
        """
        if not self.lobby.peer:
            raise errors.primitive("this connection has no address")
        if self._rtp is not None:
            self._rtp.close()
        try:
            open_port = self.world.part(RemoteSettings).open_port
            self._rtp = RtpLink(self.lobby.peer, secret, self.world.scheduler.post, self._heard, open_port)
        except OSError as error:
            raise errors.primitive(f"no port for RTP: {error.strerror}") from error
        self._rtp.to(port, source)
        return self._rtp

    def decline_rtp(self) -> None:
        """Tell the remote once not to use RTP."""
        if not self.rtp_declined:
            self.rtp_declined = True
            self.send(MessageCode.NO_RTP)

    def _by_rtp(self, name: str, var: UVar, value: Any) -> bool:
        wanted = isinstance(value, BinaryObject) if var.rtp is None else var.rtp
        if self._rtp is None or not wanted:
            return False
        update = Update(name, from_urbi(value), int(var.stamp * 1e6))
        return self._rtp.send(update, self.world.scheduler.clock.now())

    def _heard(self, update: Update) -> None:
        """Handle a value received by RTP."""
        path, _, slot = update.name.rpartition(".")
        face = self.objects.get(path)
        var = None if face is None else face.slots.get(slot)
        if isinstance(var, UVar) and not isinstance(update.value, SlotName):
            found = var
            self.world.call_soon(lambda: self.update(found, to_urbi(self.world, update.value), update.stamp))

    def listen(self, event: Event, name: str, arity: int) -> None:
        """Subscribe the remote to emissions with ``arity`` arguments; a repeated subscription has no effect.

        Raises an urbiscript error above the limit of events.
        """
        if name not in self._event_subscriptions:
            if len(self._event_subscriptions) >= MAX_DECLARED:
                raise errors.primitive(f"this connection hears of {MAX_DECLARED} events already")
            subscription = EventSubscription(self, name, arity)
            self._event_subscriptions[name] = (event, subscription)
            event.subscriptions[subscription] = None

    # ---------------------------------------------------------------- end

    def close(self) -> None:
        """The connection has ended: remove its objects, and raise an error in the jobs that wait for answers."""
        if not self.open:
            return
        self.open = False
        self.registry.connections.pop(self.lobby, None)
        if self._rtp is not None:
            self._rtp.close()
        for name, face in self.objects.items():
            self.registry.remove(name, face)
            self.registry.owners.pop(face, None)
            self.registry.orphaned_objects[self.token, name] = face
        for event, subscription in self._event_subscriptions.values():
            event.subscriptions.pop(subscription, None)
        for var in list(self._watches):
            self.unwatch(var, None)
        for call in self._pending.values():
            call.fail(errors.primitive(DISCONNECTED))
        waiting, self._newborn = list(self._newborn.values()), {}
        for announced in waiting:
            announced.complete(None)
        self.objects.clear()
        self._event_subscriptions.clear()


class RemoteFunction(Executable):
    """A function of a remote, stored in a slot; it accepts ``least`` to ``most`` arguments (-1: no limit)."""

    __slots__ = ("_holder", "_path", "connection", "least", "most")

    def __init__(self, world: World, connection: RemoteConnection, holder: Obj, path: str, arity: int) -> None:
        super().__init__(world, [world.primitive_proto])
        self.connection = connection
        self._holder = holder
        self._path = path
        self.least = self.most = arity

    def replaceable(self) -> bool:
        """Whether another function may replace this one, because its connection has ended."""
        return not self.connection.open

    def call(self, this: Any, args: tuple[Any, ...]) -> Any:
        """Call the function.  The number of arguments and the existence of the object are checked here, because a
        remote may abort if they are wrong."""
        connection = self.connection
        if connection.open and connection.registry.owners.get(self._holder) is not connection:
            raise errors.lookup_failed(self._path.rpartition(".")[2])
        if len(args) < self.least or (0 <= self.most < len(args)):
            raise errors.arity(len(args), self.least, self.most)
        return connection.call(self._path, args)


class RemoteClone(Executable):
    """``clone`` of a class of a remote: the remote makes the instance."""

    __slots__ = ("_connection", "_face", "_kind")

    def __init__(self, world: World, connection: RemoteConnection, kind: str, face: Obj) -> None:
        super().__init__(world, [world.primitive_proto])
        self._connection = connection
        self._kind = kind
        self._face = face

    def call(self, this: Any, args: tuple[Any, ...]) -> Any:
        if args:
            raise errors.arity(len(args), 0)
        return self._connection.make(self._kind, self._face)


def connection_of(world: World) -> RemoteConnection:
    """The remote that uses the running job's lobby; made on demand."""
    registry = registry_of(world)
    found = world.scheduler.running().context
    if found is None or found.output.root is not found.output:
        raise errors.primitive("only a connection may have objects in another process")
    if not found.in_command:
        raise errors.primitive("this connection is closed on its side")
    known = registry.connections.get(found)
    if known is None:
        known = registry.connections[found] = RemoteConnection(registry, found)
    assert isinstance(known, RemoteConnection)
    return known
