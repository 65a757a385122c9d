"""One remote, as the server sees it: its objects, the calls it owes answers to, the variables it wants to hear of."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.binary import BinaryObject
from urbihw.kernel.runtime.code import Executable
from urbihw.kernel.runtime.event import Emission, Event
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.values import String
from urbihw.kernel.sched.job import Job
from urbihw.kernel.uobject.external_text import message
from urbihw.kernel.uobject.frames import SlotName, Update
from urbihw.kernel.uobject.remote import CHANNEL, Code
from urbihw.kernel.uobject.rtplink import OpenPort, RtpLink
from urbihw.kernel.uobject.uvalue import from_urbi, to_urbi
from urbihw.kernel.uobject.uvar import UVar

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World
    from urbihw.kernel.uobject.registry import Registry

DISCONNECTED = "Remote disconnected"


class _Watch:
    """How often a remote said that it wants to hear of a variable, and under which name."""

    __slots__ = ("count", "name")

    def __init__(self, name: str) -> None:
        self.name = name
        self.count = 0


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
        self._pending: dict[str, _Call] = {}
        self._newborn: dict[str, Job] = {}
        self._watches: dict[UVar, _Watch] = {}
        self._ears: dict[str, tuple[Event, _Ear]] = {}
        self._rtp: RtpLink | None = None

    # ---------------------------------------------------------------- saying

    def send(self, code: Code, *values: Any) -> None:
        """One message."""
        if self.open:
            now, members = self.world.scheduler.now, [float(code), *values]
            direct = code == Code.CALL and not self.exact
            for part in message(self.world, now, CHANNEL, self.exact, members, direct):
                self.lobby.output.write(part)

    def say(self, channel: str, value: Any) -> None:
        """A value on a channel, as remotes read it."""
        for part in message(self.world, self.world.scheduler.now, channel, self.exact, value):
            self.lobby.output.write(part)

    # ---------------------------------------------------------------- calls

    def call(self, path: str, args: tuple[Any, ...]) -> Any:
        """Call a function of the remote while the running job waits; its value, or raises what it raised."""
        if not self.open:
            raise errors.primitive(DISCONNECTED)
        world = self.world
        ticket = f"_{next(self._tickets)}"
        pending = self._pending[ticket] = _Call(world.scheduler.running())
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
        world = self.world
        name = self.registry.fresh_name()
        self._newborn[name] = world.scheduler.running()
        self.send(Code.NEW, world.string(name), world.string(kind))
        try:
            while name in self._newborn:
                world.scheduler.suspend(None)
        finally:
            self._newborn.pop(name, None)
        made = self.objects.get(name)
        if made is None:
            raise errors.primitive(DISCONNECTED)
        made.set_protos([face])
        return made

    def arrived(self, name: str) -> None:
        """The remote has announced the ``init`` of an object."""
        job = self._newborn.pop(name, None)
        if job is not None:
            self.world.scheduler.wake(job)

    def destroy(self, name: str) -> None:
        """An object is to end: the remote is told, and nobody finds it any more."""
        face = self.objects.pop(name)
        self.send(Code.DELETE, self.world.string(name))
        self.registry.remove(name, face)
        for var in [value for value in face.slots.values() if isinstance(value, UVar)]:
            self.unwatch(var, None)

    # ---------------------------------------------------------------- variables and events

    def watch(self, var: UVar, name: str, owner: bool = False) -> None:
        """The remote wants to hear of a variable, once more."""
        watch = self._watches.get(var)
        if watch is None:
            watch = self._watches[var] = _Watch(name)
        if var.subscribers is None:
            var.subscribers = {}
        if owner:
            var.subscribers[self] = True
        else:
            watch.count += 1
            var.subscribers.setdefault(self, False)

    def unwatch(self, var: UVar, count: int | None) -> None:
        """Take back some of that, or all."""
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
        """The remote reports a value, which does not come back, or writes the variable of a device of the server."""
        mine = var.holder in self.objects.values()
        if var.effector is not None and not mine:
            var.write(var.holder, value)
            return
        var.receive(value, self._seconds(stamp), self if mine else None)

    def _seconds(self, stamp: float) -> float:
        """Microseconds since the server's ``timeReference``, or since it began, whichever is nearer to now."""
        now, seconds = self.world.scheduler.clock.now(), stamp / 1e6
        other = seconds - self.registry.midnight
        return seconds if abs(seconds - now) <= abs(other - now) else other

    def open_rtp(self, secret: bytes, port: int, open_port: OpenPort) -> int:
        """Values may travel by RTP from now on; the port of this side.  Raises ``primitive`` if that cannot be."""
        peer = self.lobby.slots.get("remoteIP")
        if not isinstance(peer, String):
            raise errors.primitive("this connection has no address")
        if self._rtp is not None:
            self._rtp.close()
        try:
            self._rtp = RtpLink(peer.s, secret, self.world.scheduler.post, self._heard, open_port)
        except OSError as error:
            raise errors.primitive(f"no port for RTP: {error.strerror}") from error
        self._rtp.to(port)
        return self._rtp.port

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
        """The remote wants to hear of emissions with so many arguments; asked twice is once."""
        if name not in self._ears:
            ear = _Ear(self, name, arity)
            self._ears[name] = (event, ear)
            event.subscriptions[ear] = None

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
            self.registry.left[name] = face
        for event, ear in self._ears.values():
            event.subscriptions.pop(ear, None)
        for var in list(self._watches):
            self.unwatch(var, None)
        for call in self._pending.values():
            call.value, call.failed = self.world.void, True
            if call.waits:
                self.world.scheduler.wake(call.job)
        waiting, self._newborn = list(self._newborn.values()), {}
        for job in waiting:
            self.world.scheduler.wake(job)
        self.objects.clear()
        self._ears.clear()


class _Call:
    """A call that waits for its answer."""

    __slots__ = ("failed", "job", "value", "waits")

    def __init__(self, job: Job) -> None:
        self.job = job
        self.value: Any = None
        self.failed = False
        self.waits = True


class _Ear:
    """Tells a remote of the emissions of an event with a certain number of arguments."""

    __slots__ = ("_arity", "_connection", "_name")

    def __init__(self, connection: Connection, name: str, arity: int) -> None:
        self._connection = connection
        self._name = name
        self._arity = arity

    def offer(self, emission: Emission) -> None:
        """An emission begins."""
        if len(emission.payload) == self._arity:
            emission.matches.append((self, True))
            self._say(Code.EVENT, emission)

    def ended(self, emission: Emission, match: Any) -> None:
        """It is over."""
        self._say(Code.EVENT_END, emission)

    def _say(self, code: Code, emission: Emission) -> None:
        self._connection.send(code, self._connection.world.string(self._name), *emission.payload)


class RemoteFunction(Executable):
    """A function of a remote, as it stands in a slot."""

    __slots__ = ("_connection", "_path", "least", "most")

    def __init__(self, world: World, connection: Connection, path: str, arity: int) -> None:
        super().__init__(world, [world.primitive_proto])
        self._connection = connection
        self._path = path
        self.least = self.most = arity

    def replaceable(self, by: Connection) -> bool:
        """Whether a connection may put another function in the place of this one: its own, or that of one who left."""
        return not self._connection.open

    def call(self, this: Any, args: tuple[Any, ...]) -> Any:
        """Call it; the number of arguments is checked here, as a remote may die of a wrong one."""
        if len(args) < self.least or (0 <= self.most < len(args)):
            raise errors.arity(len(args), self.least, self.most)
        return self._connection.call(self._path, args)


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
