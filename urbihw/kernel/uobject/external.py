"""Devices that live in other processes, as the server sees them.

A remote is an ordinary client.  It says in urbiscript what it has (``external object X``, ``external function (2) X.f
from X``, ``external var X.v from X``, ``external event (1) X.e from X``), and is told on its connection, as lists on
the channel ``__ExternalMessage__``, what is wanted of it.  Here are the verbs behind these words; ``connection`` is the
remote of one lobby.  Source: remote UObject protocol.
"""

from __future__ import annotations

from datetime import datetime
from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.code import make_primitive
from urbihw.kernel.runtime.event import Emission, Event
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.slot import meta_of, peek_meta
from urbihw.kernel.runtime.values import String
from urbihw.kernel.runtime.world import World
from urbihw.kernel.uobject.binarymode import binary_mode
from urbihw.kernel.uobject.connection import Connection, RemoteClone, RemoteFunction
from urbihw.kernel.uobject.registry import Registry, registry_of
from urbihw.kernel.uobject.remote import Code
from urbihw.kernel.uobject.rtp import SECRET_SIZE
from urbihw.kernel.uobject.uvar import UVar

UOBJECT = Table("UObject")
UVAR = Table("UVar")
OBJECT = Table("Object")
LOBBY = Table("Lobby")

VERSION = (2, 3, 0, 0)
"""The version of the language served, as ``PackageInfo`` tells it to remotes."""


def connection_of(world: World, lobby: Any = None) -> Connection:
    """The remote behind a lobby, that of the running job if none is given; made if need be."""
    registry = registry_of(world)
    found = world.scheduler.running().context if lobby is None else lobby
    if found is None or not hasattr(found, "intake"):
        raise errors.primitive("only a connection may have objects in another process")
    known = registry.connections.get(found)
    if known is None:
        known = registry.connections[found] = Connection(registry, found)
    assert isinstance(known, Connection)
    return known


# ---------------------------------------------------------------- external ...


def declare(world: World, kind: str, path: str, arity: float | None, source: str | None) -> Any:
    """``external kind (arity) path from source``."""
    if kind == "object":
        _object(world, path)
    elif kind == "var":
        _var(world, path)
    elif kind == "function":
        _function(world, path, int(arity or 0))
    else:
        _event(world, path, int(arity or 0))
    return world.void


def _object(world: World, name: str) -> None:
    registry, connection = registry_of(world), connection_of(world)
    if name in registry.holder.slots:
        return
    lobby = connection.lobby
    if name not in lobby.slots:
        raise errors.Raised("Lookup", f"lookup failed: {name}", "object", name=name)
    made = lobby.slots[name]
    world.ops.remove_slot(lobby, name)
    known = registry.left.pop(name, None)
    face = made if known is None else known
    assert isinstance(face, Obj)
    if known is None:
        face.set_protos([world.uobject_proto])
        registry.count_name(name)
    registry.add(name, face)
    face.slots["isRemote"] = world.true
    face.slots["lobby"] = lobby
    face.slots["clone"] = RemoteClone(world, connection, name, face)
    face.slots.setdefault("load", 1.0)
    connection.objects[name] = face
    world.flush()


def _holder(world: World, path: str, kind: str) -> tuple[Obj, str]:
    """The object and the slot of ``a.b.slot``."""
    owner, _, slot = path.rpartition(".")
    try:
        return world.as_obj(registry_of(world).object(owner)), slot
    except errors.Raised as error:
        raise errors.Raised("Lookup", error.message, kind, name=owner) from None


def _function(world: World, path: str, arity: int) -> None:
    holder, slot = _holder(world, path, "function")
    connection = connection_of(world)
    old = holder.slots.get(slot)
    if old is not None and not (isinstance(old, RemoteFunction) and old.replaceable(connection)):
        raise errors.Raised("Redefinition", f"slot redefinition: {slot}", "function", name=slot)
    world.ops.put(holder, slot, RemoteFunction(world, connection, path, arity))
    if slot == "init":
        connection.arrived(path.rpartition(".")[0])


def _var(world: World, path: str) -> None:
    holder, slot = _holder(world, path, "var")
    old = holder.slots.get(slot)
    if not isinstance(old, UVar):
        meta = peek_meta(holder, slot)
        if meta is not None and meta.accessor is not None:
            return
        old = UVar(world, holder, slot, value=old)
    connection_of(world).watch(old, path)


def _event(world: World, path: str, arity: int) -> None:
    owner, _, slot = path.rpartition(".")
    connection = connection_of(world)
    try:
        holder = world.as_obj(registry_of(world).object(owner))
    except errors.Raised:
        return
    found = holder.slots.get(slot)
    if not isinstance(found, Event):
        found = Event(world, [world.event_proto])
        world.ops.put(holder, slot, found)
    connection.listen(found, f"{path}__{arity}", arity)


# ---------------------------------------------------------------- what remotes call


@UOBJECT.primitive("funCall")
def fun_call(world: World, this: Any, ticket: str, value: Any = None) -> float:
    """A remote's answer to a call; an Exception is raised where the call was made."""
    connection_of(world).answer(ticket, world.void if value is None else value)
    return 1.0


@UOBJECT.primitive("unnotify")
def unnotify(world: World, this: Any, name: str, slot: str, count: float) -> None:
    """A remote does not want to hear of a variable any more: so many of its ``external var`` are taken back."""
    connection = connection_of(world)
    try:
        holder = world.as_obj(registry_of(world).object(name))
    except errors.Raised:
        return
    found = holder.slots.get(slot)
    if isinstance(found, UVar):
        connection.unwatch(found, int(count))


@UOBJECT.primitive("syncGet")
def sync_get(world: World, this: Any, text: str, tag: str) -> None:
    """Evaluate a text and print its value on the channel ``tag``; or, behind ``!!!``, what went wrong."""
    connection = connection_of(world)
    try:
        value = connection.lobby.programs.evaluate(text, connection.lobby)
        if value is world.void:
            raise errors.Raised("UnexpectedVoid", "unexpected void", "syncGet")
    except errors.UrbiError as error:
        connection.lobby.output.line(f"!!! {world.describe(error)[0]}", tag)
        return
    connection.say(tag, value)


@UOBJECT.primitive("exactNumbers")
def exact_numbers(world: World, this: Any, on: Any) -> None:
    """Whether this connection is sent numbers with all digits; six, as the original sends, otherwise."""
    connection_of(world).exact = bool(on)


@UOBJECT.primitive("rejoin")
def rejoin(world: World, this: Any, token: str) -> None:
    """A remote comes back: if the server still holds its former connection, known by the same token, it is closed."""
    registry, mine = registry_of(world), connection_of(world)
    for other in list(registry.connections.values()):
        if other is not mine and other.token == token:
            other.lobby.quit()
            other.close()
    mine.token = token


@UOBJECT.primitive("rtpOpen")
def rtp_open(world: World, this: Any, secret: str, port: float) -> float:
    """Agree on RTP with a remote that receives at ``port``; the port at which this server does."""
    try:
        key = bytes.fromhex(secret)
    except ValueError:
        key = b""
    if len(key) != SECRET_SIZE or not 0 < port < 65536:
        raise errors.primitive(f"expected {SECRET_SIZE} bytes in hexadecimal digits and a port")
    return float(connection_of(world).open_rtp(key, int(port), registry_of(world).open_port))


@UOBJECT.primitive("arity")
def set_arity(world: World, this: Any, path: str, least: float, most: float) -> None:
    """A function of a remote takes from ``least`` to ``most`` arguments (-1: any number)."""
    holder, slot = _holder(world, path, "arity")
    found = holder.slots.get(slot)
    if isinstance(found, RemoteFunction):
        found.least, found.most = int(least), int(most)


@UVAR.primitive("update_timed")
def update_timed(world: World, this: UVar, value: Any, stamp: float) -> None:
    """A remote reports a value, taken so many microseconds after the server's ``timeReference``."""
    connection_of(world).update(this, value, stamp)


@UVAR.primitive("own")
def own(world: World, this: UVar) -> None:
    """The remote that says so owns this variable: it is told what others want, and they read what it reports."""
    this.own()
    connection_of(world).watch(this, this.full_name, owner=True)


@UVAR.primitive("protect")
def protect(world: World, this: UVar) -> None:
    """Only the remote writes this variable; others are refused."""
    this.protect()


@OBJECT.primitive("uvalueSerialize")
def uvalue_serialize(world: World, this: Any) -> Any:
    """This."""
    return this


@LOBBY.primitive("binaryMode")
def binary_mode_(world: World, this: Any, on: Any, tag: str) -> None:
    """What follows on this connection is no urbiscript but frames; answers ``true`` on the channel ``tag``."""
    binary_mode(world, connection_of(world, this), bool(on), tag)


def destroy(world: World, this: Any) -> None:
    """``destroy`` of an object of a remote."""
    registry = registry_of(world)
    name = this.slots.get("__uobjectName") if isinstance(this, Obj) else None
    if not isinstance(name, String):
        return
    for connection in list(registry.connections.values()):
        if connection.objects.get(name.s) is this:
            connection.destroy(name.s)
            return
    registry.remove(name.s, this)


class RtpSwitch:
    """The slot ``rtp`` of a UVar."""

    def __init__(self, world: World) -> None:
        self._world = world

    def read(self, target: Any) -> Any:
        """Whether values of the variable are to travel by RTP, binary or not."""
        return self._world.boolean(isinstance(target, UVar) and target.rtp)

    def write(self, target: Any, value: Any) -> Any:
        """Somebody switches it: all remotes are told, once."""
        if isinstance(target, UVar):
            changed, target.rtp = bool(target.rtp) != bool(value), bool(value)
            for connection in list(registry_of(self._world).connections.values()):
                if changed:
                    connection.send(Code.RTP, self._world.string(target.full_name), self._world.boolean(target.rtp))
        return value


class _Leaver:
    """Hears of connections that are gone."""

    def __init__(self, registry: Registry) -> None:
        self._registry = registry

    def offer(self, emission: Emission) -> None:
        """A connection is gone."""
        connection = self._registry.connections.get(emission.payload[0])
        if connection is not None:
            connection.close()

    def ended(self, emission: Emission, match: Any) -> None:
        """Nothing lasts here."""


def install(world: World, registry: Registry) -> None:
    """The verbs of remotes; the time and the version that they ask for."""
    UOBJECT.install(world, world.uobject_proto)
    UVAR.install(world, world.uvar_proto)
    OBJECT.install(world, world.object)
    LOBBY.install(world, world.lobby_proto)
    world.external = lambda *words: declare(world, *words)
    switch = RtpSwitch(world)
    world.uvar_proto.slots["rtp"] = make_primitive(world, "rtp", switch.read, 0, 0)
    meta_of(world.uvar_proto, "rtp").accessor = switch
    gone = world.lobby_proto.slots["onDisconnect"]
    assert isinstance(gone, Event)
    gone.subscriptions[_Leaver(registry)] = None
    system = world.global_.slots["System"]
    _time_reference(world, registry, system)
    _components(world, system.slots["PackageInfo"])


def _time_reference(world: World, registry: Registry, system: Obj) -> None:
    """``System.timeReference``: midnight of the day on which the server began.

    The C++ remotes keep the microseconds in 32 bits, so only a midnight gives them stamps that are of use.
    """
    now = datetime.now()
    midnight = now.replace(hour=0, minute=0, second=0, microsecond=0)
    registry.midnight = (now - midnight).total_seconds() - world.scheduler.clock.now()
    made = world.proto()
    values = {"year": now.year, "month": now.month, "day": now.day, "us": 0}
    made.slots.update({name: float(value) for name, value in values.items()})
    system.slots["timeReference"] = made


def _components(world: World, info: Obj) -> None:
    made = world.proto()
    for name, number in zip(("major", "minor", "subMinor", "patch"), VERSION, strict=True):
        made.slots[name] = float(number)
    known = info.slots.get("components")
    if known is None:
        info.slots["components"] = world.dictionary({"Urbi SDK": made})
