"""Devices that live in other processes, as the server sees them.

A remote is an ordinary client.  It says in urbiscript what it has (``external object X``, ``external function (2) X.f
from X``, ``external var X.v from X``, ``external event (1) X.e from X``), and is told on its connection, as lists on
the channel ``__ExternalMessage__``, what is wanted of it.  Here are the verbs behind these words; ``connection`` is the
remote of one lobby.  Source: remote UObject protocol.

Any client may say these words, so each is checked: names and objects of another connection or of the server are not to
be had.  What is open to all stays so: watching a variable, hearing of an event, writing, calling, and ``destroy`` of
what a remote has, which the protocol gives to everybody.
"""

from __future__ import annotations

import secrets
from datetime import datetime
from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.code import make_primitive
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.object import Obj, Plain
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.slot import meta_of, peek_meta
from urbihw.kernel.runtime.values import String
from urbihw.kernel.runtime.world import World
from urbihw.kernel.uobject.binarymode import binary_mode
from urbihw.kernel.uobject.connection import Connection, RemoteClone, RemoteFunction
from urbihw.kernel.uobject.registry import Registry, registry_of
from urbihw.kernel.uobject.remote import Code
from urbihw.kernel.uobject.rtp import SECRET_SIZE
from urbihw.kernel.uobject.uvar import UVar, hook

UOBJECT = Table("UObject")
UVAR = Table("UVar")
OBJECT = Table("Object")
LOBBY = Table("Lobby")

VERSION = (2, 3, 0, 0)
"""The version of the language served, as ``PackageInfo`` tells it to remotes."""
LONGEST_NAME = 255
"""Characters of the longest name of an object, variable, function or event."""
MOST_ARGUMENTS = 64
"""How many arguments a function or an event of a remote takes at most."""
SHORTEST_TOKEN = 16
"""Characters of the shortest token: who guesses the token of a remote takes its place."""


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


# ---------------------------------------------------------------- external ...


def declare(world: World, kind: str, path: str, arity: float | None, source: str | None) -> Any:
    """``external kind (arity) path from source``; an error that names no routine is that of the ``kind``."""
    try:
        if len(path) > LONGEST_NAME:
            raise errors.primitive(f"a name has at most {LONGEST_NAME} characters, not {len(path)}")
        if arity is not None and arity not in range(MOST_ARGUMENTS + 1):
            raise errors.primitive(f"takes 0 to {MOST_ARGUMENTS} arguments, not {world.text(arity)}")
        if kind == "object":
            _object(world, path)
        elif kind == "var":
            _var(world, path)
        elif kind == "function":
            _function(world, path, int(arity or 0))
        else:
            _event(world, path, int(arity or 0))
    except errors.Raised as error:
        error.routine = error.routine or kind
        raise
    return world.void


def _object(world: World, name: str) -> None:
    """Declare an object.  Of a name that is taken the client is told, and nothing else happens: remotes of the original
    go on then with what they declare, and expect the errors of that (remote UObject protocol, section 3)."""
    registry, connection = registry_of(world), connection_of(world)
    if name in connection.objects:
        return
    known = registry.left.get((connection.token, name))
    whose = _whose(world, connection, name, known)
    if whose:
        connection.lobby.output.line(f"!!! object: {name} belongs to {whose}, nothing is declared", "error")
        return
    lobby = connection.lobby
    if name not in lobby.slots:
        raise errors.lookup_failed(name)
    made = lobby.slots[name]
    if not isinstance(made, Plain):
        raise errors.primitive(f"{name} was not made by class")
    face = world.proto(world.uobject_proto) if known is None else known
    connection.take(name, face)
    world.ops.remove_slot(lobby, name)
    if known is None:
        face.slots.update(made.slots)  # the name may stand for an object of somebody else, which stays as it is
        registry.count_name(name)
    else:
        del registry.left[connection.token, name]
    registry.add(name, face)
    face.slots["isRemote"] = world.true
    face.slots["lobby"] = lobby
    face.slots["clone"] = RemoteClone(world, connection, name, face)
    face.slots.setdefault("load", 1.0)
    world.flush()


def _whose(world: World, connection: Connection, name: str, known: Obj | None) -> str:
    """To whom a name belongs, in words; "" if this connection may have it.  ``known`` is what it had by this name."""
    owner = registry_of(world).connection_with(name)
    if owner is not None:
        return "" if owner is connection else str(owner.name)
    holder = world.global_.find(name)
    return "" if holder is None or holder.slots[name] is known else "this server"


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
    if old is not None and not (isinstance(old, RemoteFunction) and old.replaceable()):
        raise errors.redefinition(slot)
    connection.claim(holder, path)
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
        old = hook(world, holder, slot)
    connection_of(world).watch(old, path)


def _event(world: World, path: str, arity: int) -> None:
    owner, _, slot = path.rpartition(".")
    connection = connection_of(world)
    try:
        holder = world.as_obj(registry_of(world).object(owner))
    except errors.Raised:
        return
    found = holder.slots.get(slot)
    if found is None:
        connection.claim(holder, path)
        found = Event(world, [world.event_proto])
        world.ops.put(holder, slot, found)
    if not isinstance(found, Event):
        raise errors.primitive(f"{path} is no event")
    connection.listen(found, f"{path}__{arity}", arity)


# ---------------------------------------------------------------- what remotes call


@UOBJECT.primitive("funCall")
def fun_call(world: World, this: Any, ticket: str, value: Any = None) -> float:
    """A remote's answer to a call; an Exception is raised where the call was made."""
    connection_of(world).answer(ticket, world.void if value is None else value)
    return 1.0


@UOBJECT.primitive("unnotify")
def unnotify(world: World, this: Any, name: str, slot: str, count: int) -> None:
    """A remote does not want to hear of a variable any more: so many of its ``external var`` are taken back."""
    connection = connection_of(world)
    try:
        holder = world.as_obj(registry_of(world).object(name))
    except errors.Raised:
        return
    found = holder.slots.get(slot)
    if isinstance(found, UVar):
        connection.unwatch(found, max(0, count))


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
    """A remote comes back: if the server still holds its former connection, known by the same token, it is closed.

    The token is a secret of the remote.
    """
    registry, mine = registry_of(world), connection_of(world)
    if len(token) < SHORTEST_TOKEN:
        raise errors.primitive(f"a token has at least {SHORTEST_TOKEN} characters")
    for other in list(registry.connections.values()):
        if other is not mine and secrets.compare_digest(other.token.encode(), token.encode()):
            other.lobby.quit()
            other.close()
    mine.token = token


@UOBJECT.primitive("rtpOpen")
def rtp_open(world: World, this: Any, secret: str, port: int, source: int) -> list[Any]:
    """Agree on RTP with a remote that receives at ``port`` and calls its source ``source``; the address, the port and
    the source of this server."""
    try:
        key = bytes.fromhex(secret)
    except ValueError:
        key = b""
    if len(key) != SECRET_SIZE or not 0 < port < 65536 or not 0 <= source < 1 << 32:
        raise errors.primitive(f"expected {SECRET_SIZE} bytes in hexadecimal digits, a port and a number of 32 bits")
    link = connection_of(world).open_rtp(key, port, source, registry_of(world).open_port)
    return [link.address, float(link.port), float(link.source)]


@UOBJECT.primitive("arity")
def set_arity(world: World, this: Any, path: str, least: int, most: int) -> None:
    """A function of a remote takes from ``least`` to ``most`` arguments (-1: any number)."""
    holder, slot = _holder(world, path, "arity")
    found = holder.slots.get(slot)
    if isinstance(found, RemoteFunction):
        connection_of(world).claim(holder, path)
        found.least, found.most = least, most


@UVAR.primitive("update_timed")
def update_timed(world: World, this: UVar, value: Any, stamp: float) -> None:
    """A remote reports a value, taken so many microseconds after the server's ``timeReference``."""
    connection_of(world).update(this, value, stamp)


@UVAR.primitive("own")
def own(world: World, this: UVar) -> None:
    """The remote that says so owns this variable: it is told what others want, and they read what it reports."""
    connection = connection_of(world)
    connection.claim(this.holder, this.full_name)
    connection.watch(this, this.full_name, owner=True)
    this.own()


@UVAR.primitive("protect")
def protect(world: World, this: UVar) -> None:
    """Only the remote writes this variable; others are refused."""
    connection_of(world).claim(this.holder, this.full_name)
    this.protect()


@OBJECT.primitive("uvalueSerialize")
def uvalue_serialize(world: World, this: Any) -> Any:
    """This."""
    return this


@LOBBY.primitive("binaryMode")
def binary_mode_(world: World, this: Any, on: Any, tag: str) -> None:
    """What follows on this connection is no urbiscript but frames; answers ``true`` on the channel ``tag``."""
    connection = connection_of(world)
    if this is not connection.lobby:
        raise errors.primitive("only a connection itself may change its mode")
    binary_mode(world, connection, bool(on), tag)


def destroy(world: World, this: Any) -> None:
    """``destroy`` of an object of a remote."""
    registry = registry_of(world)
    name = this.slots.get("__uobjectName") if isinstance(this, Obj) else None
    if not isinstance(name, String):
        return
    owner = registry.owners.get(this)
    if owner is None:
        registry.remove(name.s, this)
        return
    owner.destroy(next(known for known, face in owner.objects.items() if face is this))


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

    def gone(lobby: Any) -> None:
        connection = registry.connections.get(lobby)
        if connection is not None:
            connection.close()

    world.client_gone.append(gone)
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
