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
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.object import Obj, Plain
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.slot import peek_meta
from urbihw.kernel.runtime.world import World
from urbihw.kernel.uobject.registry import Registry, registry_of
from urbihw.kernel.uobject.uvar import UVar, hook
from urbihw.kernel.uremote import rtp_control
from urbihw.kernel.uremote.binarymode import binary_mode
from urbihw.kernel.uremote.connection import Connection, RemoteClone, RemoteFunction, connection_of

UOBJECT = Table("UObject")
UVAR = Table("UVar")
OBJECT = Table("Object")
LOBBY = Table("Lobby")

VERSION = (2, 6, 0, 13)
"""The version that ``PackageInfo`` tells remotes: the first one to which they speak frames (remote UObject protocol,
sections 1 and 2).  The version of the language is ``System.version``."""
LONGEST_NAME = 255
"""Characters of the longest name of an object, variable, function or event."""
MOST_ARGUMENTS = 64
"""How many arguments a function or an event of a remote takes at most."""
SHORTEST_TOKEN = 16
"""Characters of the shortest token: who guesses the token of a remote takes its place."""


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
    connection.add_object(name, face)
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
    if name == rtp_control.CLASS:
        connection.decline_rtp()


def _whose(world: World, connection: Connection, name: str, known: Obj | None) -> str:
    """To whom a name belongs, in words; "" if this connection may have it.  ``known`` is what it had by this name."""
    owner = registry_of(world).connection_with(name)
    if owner is not None:
        return "" if owner is connection else str(owner.name)
    holder = world.global_.find(name)
    there = known if holder is None else holder.slots[name]
    return "" if there is known or there is registry_of(world).replaceable.get(name) else "this server"


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
    world.ops.put(holder, slot, RemoteFunction(world, connection, holder, path, arity))
    if slot == "init":
        connection.arrived(path.rpartition(".")[0])


def _var(world: World, path: str) -> None:
    """Declare a variable.  If it cannot be one the client is told, and nothing else happens: what the remote declares
    in the same breath, such as the ``init`` for which somebody waits, counts."""
    holder, slot = _holder(world, path, "var")
    connection = connection_of(world)
    old = holder.slots.get(slot)
    if not isinstance(old, UVar):
        meta = peek_meta(holder, slot)
        if meta is not None and meta.accessor is not None:
            return
        try:
            if not _may_be_hooked(world, holder, slot):
                raise errors.primitive(f"{path} belongs to the library and is no variable of a device")
            old = hook(world, holder, slot)
        except errors.Raised as error:
            connection.lobby.output.line(f"!!! var: {error.message}", "error")
            return
    connection.watch(old, path)


def _may_be_hooked(world: World, holder: Obj, slot: str) -> bool:
    """Whether a slot may become a variable: of a device, of what a program made, or in Global if it is not the
    library's."""
    if not world.record.is_shared(holder) or world.is_a(holder, world.uobject_proto):
        return True
    return holder is world.global_ and not world.record.has(holder, slot)


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
        connection.release(name, slot, found, max(0, count))


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


@UVAR.primitive("uvalueSerialize")
def serialize(world: World, this: UVar) -> Any:
    """The value that outsiders read; an error if there is none yet."""
    value = this.read(this)
    if value is world.void:
        raise errors.unexpected_void()
    return value


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


def install(world: World, registry: Registry) -> None:
    """The verbs of remotes; the time and the version that they ask for."""
    UOBJECT.install(world, world.uobject_proto)
    UVAR.install(world, world.uvar_proto)
    OBJECT.install(world, world.object)
    LOBBY.install(world, world.lobby_proto)
    world.external = lambda *words: declare(world, *words)
    rtp_control.install(world, registry)

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
    world.flush()
