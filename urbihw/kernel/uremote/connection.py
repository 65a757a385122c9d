"""One remote, as the server sees it: its objects, the calls it owes answers to, the variables it wants to hear of.

What a remote declares is its own: no other connection may change the functions of its objects, or own or report their
variables (``claim``).  Names stay with the connection as long as it lasts, even of objects that were destroyed.  What
waits for a remote is bounded, as it may never answer.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.binary import BinaryObject
from urbihw.kernel.runtime.code import Executable
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.sched.job import Job
from urbihw.kernel.uobject.registry import registry_of
from urbihw.kernel.uobject.uvalue import from_urbi, to_urbi
from urbihw.kernel.uobject.uvar import UVar
from urbihw.kernel.uremote.external_text import message
from urbihw.kernel.uremote.frames import SlotName, Update
from urbihw.kernel.uremote.remote import CHANNEL, Code
from urbihw.kernel.uremote.rtplink import OpenPort, RtpLink
from urbihw.kernel.uremote.subscriptions import EventSubscription, PendingCall, VariableSubscription

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World
    from urbihw.kernel.uobject.registry import Registry

DISCONNECTED = "Remote disconnected"
LOAD = "load"

MOST_DECLARED = 10_000
"""How many objects one remote may have; how many variables, and how many events, it may watch."""
MOST_CALLS = 1_000
"""How many calls, and how many instances that are to be made, may wait for one remote."""


class Connection:
    """The remote behind a lobby.  ``token`` tells its connections apart from those of others, if it has one."""

    def __init__(self, registry: Registry, lobby: Any) -> None:
        self.registry = registry
        self.world = registry.world
        self.lobby = lobby
        self.objects: dict[str, Obj] = {}
        self.exact = False
        self.open = True
        self.token = ""
        self.binary = False
        self._tickets = registry.tickets
        self._pending: dict[str, PendingCall] = {}
        self._newborn: dict[str, Job | None] = {}
        self._ended: dict[str, None] = {}
        self._watches: dict[UVar, VariableSubscription] = {}
        self._event_subscriptions: dict[str, tuple[Event, EventSubscription]] = {}
        self._rtp: RtpLink | None = None
        self.rtp_declined = False

    # ---------------------------------------------------------------- belonging

    @property
    def name(self) -> str:
        """How errors and the log call it: its lobby, and the address of the client."""
        peer = self.lobby.peer
        return str(self.lobby.tag.tag.name) + (f" ({peer})" if peer else "")

    def has_name(self, name: str) -> bool:
        """Whether a name belongs to this remote: of an object that it has, is asked to make, or had."""
        return name in self.objects or name in self._newborn or name in self._ended

    def add_object(self, name: str, face: Obj) -> None:
        """An object is this remote's from now on; raises an urbiscript error for one too many."""
        if len(self.objects) >= MOST_DECLARED:
            raise errors.primitive(f"this connection has {MOST_DECLARED} objects already")
        self.objects[name] = face
        self.registry.owners[face] = self
        self._ended.pop(name, None)

    def claim(self, target: Obj, name: str) -> None:
        """Raise the error that says whose ``target`` is, unless it is this remote's; ``name`` is what is wanted."""
        owner = self.registry.owners.get(target)
        if owner is not self:
            whose = "this server" if owner is None else owner.name
            raise errors.primitive(f"{name} belongs to {whose}, not to this connection")

    # ---------------------------------------------------------------- saying

    def send(self, code: Code, *values: Any) -> None:
        """One message."""
        if self.open:
            now, members = self.world.scheduler.now, [float(code), *values]
            direct = code == Code.CALL and not self.exact
            self.lobby.output.write(message(self.world, now, CHANNEL, self.exact, members, direct))

    def say(self, channel: str, value: Any) -> None:
        """A value on a channel, as remotes read it."""
        self.lobby.output.write(message(self.world, self.world.scheduler.now, channel, self.exact, value))

    # ---------------------------------------------------------------- calls

    def call(self, path: str, args: tuple[Any, ...]) -> Any:
        """Call a function of the remote while the running job waits; its value, or raises what it raised."""
        if not self.open:
            raise errors.primitive(DISCONNECTED)
        if len(self._pending) >= MOST_CALLS:
            raise errors.primitive(f"{MOST_CALLS} calls wait for an answer of {self.name} already")
        world = self.world
        ticket = f"_{next(self._tickets)}"
        pending = self._pending[ticket] = PendingCall(world.scheduler.running())
        self.send(Code.CALL, world.string(f"{path}__{len(args)}"), world.string(ticket), *args)
        try:
            while pending.value is None:
                world.scheduler.suspend(None)
        finally:
            self._pending.pop(ticket, None)
            pending.waits = False
        if pending.failed:
            raise errors.primitive(DISCONNECTED)
        if isinstance(pending.value, Obj) and world.is_a(pending.value, world.exception_proto):
            raise errors.primitive(world.text(world.send(pending.value, "message")))
        return pending.value

    def answer(self, ticket: str, value: Any) -> None:
        """The remote answers a call; raises for a ticket that nobody waits for."""
        pending = self._pending.pop(ticket, None)
        if pending is None:
            raise errors.primitive(f"missing key: {ticket}")
        pending.value = value
        if pending.waits:
            self.world.scheduler.wake(pending.job)

    # ---------------------------------------------------------------- instances

    def make(self, kind: str, face: Obj) -> Obj:
        """A new instance of a class of the remote, once the remote has announced its ``init``."""
        if not self.open:
            raise errors.primitive(DISCONNECTED)
        if self.registry.owners.get(face) is not self:
            raise errors.lookup_failed(kind)
        if len(self._newborn) >= MOST_CALLS:
            raise errors.primitive(f"{MOST_CALLS} instances wait to be made by {self.name} already")
        world = self.world
        name = self.registry.fresh_name()
        self._newborn[name] = world.scheduler.running()
        self.send(Code.NEW, world.string(name), world.string(kind))
        try:
            while name in self._newborn:
                world.scheduler.suspend(None)
        except BaseException:
            if name in self._newborn:
                self._newborn[name] = None
            raise
        made: Obj | None = self.objects.get(name)
        if made is None:
            raise errors.primitive(DISCONNECTED)
        made.set_protos([face])
        return made

    def arrived(self, name: str) -> None:
        """The remote has announced the ``init`` of an object; one for which nobody waits any more is ended."""
        if name not in self._newborn:
            return
        job = self._newborn.pop(name)
        if job is not None:
            self.world.scheduler.wake(job)
        elif name in self.objects:
            self.destroy(name)

    def destroy(self, name: str) -> None:
        """An object is to end: the remote is told, and nobody finds it any more."""
        self.send(Code.DELETE, self.world.string(name))
        self.retire(name)

    def retire(self, name: str) -> None:
        """An object has ended: nobody finds it any more, and no frame leaves for it.

        A remote aborts when it is to call a function of an object that it does not have.  Who holds a reference to the
        object has an empty shell.
        """
        face = self.objects.pop(name)
        self.registry.owners.pop(face, None)
        self._ended[name] = None
        if len(self._ended) > MOST_DECLARED:
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
        """The remote wants to hear of a variable, once more; raises an urbiscript error for one too many."""
        watch = self._watches.get(var)
        if watch is None:
            if len(self._watches) >= MOST_DECLARED:
                raise errors.primitive(f"this connection watches {MOST_DECLARED} variables already")
            watch = self._watches[var] = VariableSubscription(name)
        if var.subscribers is None:
            var.subscribers = {}
        if owner:
            var.subscribers[self] = True
        else:
            watch.count += 1
            var.subscribers.setdefault(self, False)

    def release(self, name: str, slot: str, var: UVar, count: int) -> None:
        """The remote takes back so many of its declarations of ``name.slot``.

        ``load`` is a member of every object of the C++ SDK: when it goes, the object has ended there.
        """
        self.unwatch(var, count)
        if slot == LOAD and var not in self._watches and name in self.objects:
            self.retire(name)

    def unwatch(self, var: UVar, count: int | None) -> None:
        """Do not tell of a variable any more if so many of the declarations were all; None stands for all."""
        watch = self._watches.get(var)
        if watch is None:
            return
        watch.count -= watch.count if count is None else count
        if watch.count <= 0:
            del self._watches[var]
            if var.subscribers is not None:
                var.subscribers.pop(self, None)

    def changed(self, var: UVar, value: Any) -> None:
        """A variable that the remote watches has a value."""
        if value is self.world.nil or value is self.world.void:
            return
        watch = self._watches.get(var)
        if watch is None:
            return
        if self._rtp is None or not self._by_rtp(watch.name, var, value):
            self.send(Code.CHANGED, self.world.string(watch.name), value, var.stamp)

    def update(self, var: UVar, value: Any, stamp: float) -> None:
        """The remote reports a value, which does not come back; or writes another's variable, as anybody may.

        Raises an urbiscript error for a variable that is constant.
        """
        if var.constant:
            raise errors.constness()
        if self.registry.owners.get(var.holder) is self:
            var.receive(value, self._seconds(stamp), self)
        else:
            var.write(var.holder, value)

    def _seconds(self, stamp: float) -> float:
        """Microseconds since the server's ``timeReference``, or since it began, whichever is nearer to now."""
        now, seconds = self.world.scheduler.clock.now(), stamp / 1e6
        other = seconds - self.registry.midnight
        return seconds if abs(seconds - now) <= abs(other - now) else other

    def open_rtp(self, secret: bytes, port: int, source: int, open_port: OpenPort) -> RtpLink:
        """Values may travel by RTP from now on; this end of it.  Raises ``primitive`` if that cannot be.

        ``port`` and ``source`` are those of the remote; its address is that of the connection.
        """
        if not self.lobby.peer:
            raise errors.primitive("this connection has no address")
        if self._rtp is not None:
            self._rtp.close()
        try:
            self._rtp = RtpLink(self.lobby.peer, secret, self.world.scheduler.post, self._heard, open_port)
        except OSError as error:
            raise errors.primitive(f"no port for RTP: {error.strerror}") from error
        self._rtp.to(port, source)
        return self._rtp

    def decline_rtp(self) -> None:
        """Tell the remote not to use RTP; once is enough."""
        if not self.rtp_declined:
            self.rtp_declined = True
            self.send(Code.NO_RTP)

    def _by_rtp(self, name: str, var: UVar, value: Any) -> bool:
        wanted = isinstance(value, BinaryObject) if var.rtp is None else var.rtp
        if self._rtp is None or not wanted:
            return False
        update = Update(name, from_urbi(value), int(var.stamp * 1e6))
        return self._rtp.send(update, self.world.scheduler.clock.now())

    def _heard(self, update: Update) -> None:
        """A value came by RTP."""
        path, _, slot = update.name.rpartition(".")
        face = self.objects.get(path)
        var = None if face is None else face.slots.get(slot)
        if isinstance(var, UVar) and not isinstance(update.value, SlotName):
            found = var
            self.world.soon(lambda: self.update(found, to_urbi(self.world, update.value), update.stamp))

    def listen(self, event: Event, name: str, arity: int) -> None:
        """The remote wants to hear of emissions with so many arguments; asked twice is once.

        Raises an urbiscript error for one event too many.
        """
        if name not in self._event_subscriptions:
            if len(self._event_subscriptions) >= MOST_DECLARED:
                raise errors.primitive(f"this connection hears of {MOST_DECLARED} events already")
            subscription = EventSubscription(self, name, arity)
            self._event_subscriptions[name] = (event, subscription)
            event.subscriptions[subscription] = None

    # ---------------------------------------------------------------- end

    def close(self) -> None:
        """The connection is gone: so are its objects; who waits for an answer is told."""
        if not self.open:
            return
        self.open = False
        self.registry.connections.pop(self.lobby, None)
        if self._rtp is not None:
            self._rtp.close()
        for name, face in self.objects.items():
            self.registry.remove(name, face)
            self.registry.owners.pop(face, None)
            self.registry.left[self.token, name] = face
        for event, subscription in self._event_subscriptions.values():
            event.subscriptions.pop(subscription, None)
        for var in list(self._watches):
            self.unwatch(var, None)
        for call in self._pending.values():
            call.value, call.failed = self.world.void, True
            if call.waits:
                self.world.scheduler.wake(call.job)
        waiting, self._newborn = list(self._newborn.values()), {}
        for job in waiting:
            if job is not None:
                self.world.scheduler.wake(job)
        self.objects.clear()
        self._event_subscriptions.clear()


class RemoteFunction(Executable):
    """A function of a remote, as it stands in a slot; takes from ``least`` to ``most`` arguments (-1: any number)."""

    __slots__ = ("_holder", "_path", "connection", "least", "most")

    def __init__(self, world: World, connection: Connection, holder: Obj, path: str, arity: int) -> None:
        super().__init__(world, [world.primitive_proto])
        self.connection = connection
        self._holder = holder
        self._path = path
        self.least = self.most = arity

    def replaceable(self) -> bool:
        """Whether another function may be put in the place of this one: its connection is gone."""
        return not self.connection.open

    def call(self, this: Any, args: tuple[Any, ...]) -> Any:
        """Call it; the number of arguments is checked here, as a remote may die of a wrong one, or of an object that it
        does not have any more."""
        connection = self.connection
        if connection.open and connection.registry.owners.get(self._holder) is not connection:
            raise errors.lookup_failed(self._path.rpartition(".")[2])
        if len(args) < self.least or (0 <= self.most < len(args)):
            raise errors.arity(len(args), self.least, self.most)
        return connection.call(self._path, args)


class RemoteClone(Executable):
    """``clone`` of a class of a remote: makes an instance there."""

    __slots__ = ("_connection", "_face", "_kind")

    def __init__(self, world: World, connection: Connection, kind: str, face: Obj) -> None:
        super().__init__(world, [world.primitive_proto])
        self._connection = connection
        self._kind = kind
        self._face = face

    def call(self, this: Any, args: tuple[Any, ...]) -> Any:
        """A fresh instance."""
        if args:
            raise errors.arity(len(args), 0)
        return self._connection.make(self._kind, self._face)


def connection_of(world: World) -> Connection:
    """The remote behind the lobby of the running job; made if need be."""
    registry = registry_of(world)
    found = world.scheduler.running().context
    if found is None or found.output.root is not found.output:
        raise errors.primitive("only a connection may have objects in another process")
    if not found.in_command:
        raise errors.primitive("this connection is closed on its side")
    known = registry.connections.get(found)
    if known is None:
        known = registry.connections[found] = Connection(registry, found)
    assert isinstance(known, Connection)
    return known
