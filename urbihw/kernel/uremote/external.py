"""Devices in other processes, as the server sees them.

A remote is an ordinary client.  It declares its objects in urbiscript (``external object X``, ``external function (2)
X.f from X``, ``external var X.v from X``, ``external event (1) X.e from X``), and receives requests on its connection,
as lists on the channel ``__ExternalMessage__``.  This module implements these declarations and the functions that
remotes call; ``connection`` is the remote of one lobby.  Source: remote UObject protocol.

Any client may use these functions, so each is checked: a client cannot take names and objects of another connection or
of the server.  Operations that the protocol allows to all clients remain open: subscribing to a variable or an event,
writing, calling, and ``destroy`` of a remote's object.
"""

from __future__ import annotations

import math
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
from urbihw.kernel.uremote.connection import MAX_DECLARED, RemoteClone, RemoteConnection, RemoteFunction, connection_of
from urbihw.kernel.uremote.subscriptions import RemoteSettings

UOBJECT = Table("UObject")
UVAR = Table("UVar")
OBJECT = Table("Object")
LOBBY = Table("Lobby")

VERSION = (2, 6, 0, 13)
"""The version in ``PackageInfo`` for remotes: the first version to which they send frames (remote UObject protocol,
sections 1 and 2).  The version of the language is ``System.version``."""
MAX_NAME_LENGTH = 255
"""Maximum length, in characters, of the name of an object, variable, function or event."""
UNSET = {"rangemin": -math.inf, "rangemax": math.inf, "speedmin": 0.0, "speedmax": math.inf, "delta": 0.0}
"""What the properties of a variable do that are not set."""
MAX_ARGUMENTS = 64
"""Maximum number of arguments of a function or an event of a remote."""
MIN_TOKEN_LENGTH = 16
"""Minimum length, in characters, of a token: a client that guesses the token of a remote could replace it."""


# ---------------------------------------------------------------- external ...


def declare(world: World, kind: str, path: str, arity: float | None, source: str | None) -> Any:
    """``external kind (arity) path from source``.  An error without a routine names the ``kind``."""
    try:
        if len(path) > MAX_NAME_LENGTH:
            raise errors.primitive(f"a name has at most {MAX_NAME_LENGTH} characters, not {len(path)}")
        if arity is not None and arity not in range(MAX_ARGUMENTS + 1):
            raise errors.primitive(f"takes 0 to {MAX_ARGUMENTS} arguments, not {world.text(arity)}")
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
    """Declare an object.  If the name is taken, the client gets an error message and nothing else happens: remotes of
    the original then continue with their declarations and expect errors for those (remote UObject protocol, section 3),
    of which only the first is reported.
    """
    registry, connection = registry_of(world), connection_of(world)
    if name in connection.objects:
        return
    known = registry.orphaned_objects.get((connection.token, name))
    owner = _owner_of(world, connection, name, known)
    if owner:
        connection.lobby.output.line(f"!!! object: {name} belongs to {owner}, nothing is declared", "error")
        if len(connection.refused) < MAX_DECLARED:
            connection.refused.add(name)
        return
    connection.refused.discard(name)
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
        face.slots.update(made.slots)  # the name may belong to another's object, which remains unchanged
        registry.count_name(name)
    else:
        del registry.orphaned_objects[connection.token, name]
    registry.add(name, face)
    face.slots["isRemote"] = world.true
    face.slots["lobby"] = lobby
    face.slots["clone"] = RemoteClone(world, connection, name, face)
    face.slots.setdefault("load", 1.0)
    world.flush()
    if name == rtp_control.CLASS:
        connection.decline_rtp()


def _owner_of(world: World, connection: RemoteConnection, name: str, known: Obj | None) -> str:
    """The owner of a name, in words; "" if this connection may use it.  ``known`` is its present value for this
    connection.
    """
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
        raise _redefined(connection, path.rpartition(".")[0], slot)
    connection.claim(holder, path)
    world.ops.put_slot(holder, slot, RemoteFunction(world, connection, holder, path, arity))
    if slot == "init":
        connection.arrived(path.rpartition(".")[0])


def _redefined(connection: RemoteConnection, name: str, slot: str) -> errors.Raised:
    """The error for a function that exists; for an object that was refused before, the client knows the reason."""
    error = errors.redefinition(slot)
    if name not in connection.refused:
        return error
    if not connection.told_of_refusal:
        connection.told_of_refusal = True
        return error
    return errors.ToldBefore(error.kind, error.message, None, **error.slots)


def _var(world: World, path: str) -> None:
    """Declare a variable.  If that is impossible, the client gets an error message and nothing else happens: the other
    declarations of the same message, such as an ``init`` for which a job waits, remain valid."""
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
    """Whether a slot may become a variable: a slot of a device or of a program's object, or of Global if it is not the
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
        world.ops.put_slot(holder, slot, found)
    if not isinstance(found, Event):
        raise errors.primitive(f"{path} is no event")
    connection.listen(found, f"{path}__{arity}", arity)


# ---------------------------------------------------------------- what remotes call


@UOBJECT.primitive("funCall")
def fun_call(world: World, this: Any, ticket: str, value: Any = None) -> float:
    """A remote's answer to a call; an Exception is raised in the calling job."""
    connection_of(world).answer(ticket, world.void if value is None else value)
    return 1.0


@UOBJECT.primitive("unnotify")
def unnotify(world: World, this: Any, name: str, slot: str, count: int) -> None:
    """Remove a remote's subscription to a variable: ``count`` of its ``external var`` declarations."""
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
    """Evaluate a text and print its value on the channel ``tag``; an error is printed after ``!!!``."""
    connection = connection_of(world)
    try:
        value = connection.lobby.programs.evaluate(text, connection.lobby)
        if value is world.void:
            value = _unset_property(world, text)
    except errors.ThrownError as error:
        connection.lobby.output.line(f"!!! {world.describe(error)[0]}", tag)
        return
    connection.send_on_channel(tag, value)


def _unset_property(world: World, text: str) -> Any:
    """The value by which an unset property acts, for ``X.v->rangemin``; an error for other texts.

    The C++ SDK reads properties as numbers, and an error there ends the function that asks.
    """
    name = text.rpartition("->")[2].strip()
    if name == "blend":
        return world.string("normal")
    if "->" not in text or name not in UNSET:
        raise errors.Raised("UnexpectedVoid", "unexpected void", "syncGet")
    return UNSET[name]


@UOBJECT.primitive("exactNumbers")
def exact_numbers(world: World, this: Any, on: Any) -> None:
    """Select whether names of devices are sent to this connection without quotes, as remotes of this implementation
    read them.  The word is older than that: numbers have all their digits for all.
    """
    connection_of(world).bare_names = bool(on)


@UOBJECT.primitive("rejoin")
def rejoin(world: World, this: Any, token: str) -> None:
    """Announce a remote that reconnects: a former connection with the same token is closed.

    The token is a secret of the remote.
    """
    registry, mine = registry_of(world), connection_of(world)
    if len(token) < MIN_TOKEN_LENGTH:
        raise errors.primitive(f"a token has at least {MIN_TOKEN_LENGTH} characters")
    for other in list(registry.connections.values()):
        if other is not mine and secrets.compare_digest(other.token.encode(), token.encode()):
            other.lobby.quit()
            other.close()
    mine.token = token


@UOBJECT.primitive("arity")
def set_arity(world: World, this: Any, path: str, least: int, most: int) -> None:
    """Set the number of arguments of a remote's function: ``least`` to ``most`` (-1: no limit)."""
    holder, slot = _holder(world, path, "arity")
    found = holder.slots.get(slot)
    if isinstance(found, RemoteFunction):
        connection_of(world).claim(holder, path)
        found.least, found.most = least, most


@UVAR.primitive("update_timed")
def update_timed(world: World, this: UVar, value: Any, stamp: float) -> None:
    """Report a value of a remote, measured ``stamp`` microseconds after the server's ``timeReference``."""
    connection_of(world).update(this, value, stamp)


@UVAR.primitive("own")
def own(world: World, this: UVar) -> None:
    """Make the calling remote the owner of this variable: it receives the targets, others read its sensed values."""
    connection = connection_of(world)
    connection.claim(this.holder, this.full_name)
    connection.watch(this, this.full_name, owner=True)
    this.own()


@UVAR.primitive("protect")
def protect(world: World, this: UVar) -> None:
    """Refuse writes to this variable from all but the remote."""
    connection_of(world).claim(this.holder, this.full_name)
    this.protect()


@UVAR.primitive("uvalueSerialize")
def serialize(world: World, this: UVar) -> Any:
    """The value for readers other than the owner.  Raises an error if there is none yet."""
    value = this.read(this)
    if value is world.void:
        raise errors.unexpected_void()
    return value


@OBJECT.primitive("uvalueSerialize")
def uvalue_serialize(world: World, this: Any) -> Any:
    """Returns this value itself."""
    return this


@LOBBY.primitive("binaryMode")
def binary_mode_(world: World, this: Any, on: Any, tag: str) -> None:
    """Switch this connection to frames instead of urbiscript; the answer ``true`` is printed on the channel ``tag``."""
    connection = connection_of(world)
    if this is not connection.lobby:
        raise errors.primitive("only a connection itself may change its mode")
    binary_mode(world, connection, bool(on), tag)


def install(world: World, registry: Registry) -> None:
    """Install the functions that remotes call, and the time reference and version that they read."""
    UOBJECT.install(world, world.uobject_proto)
    UVAR.install(world, world.uvar_proto)
    OBJECT.install(world, world.object)
    LOBBY.install(world, world.lobby_proto)
    rtp_control.install(world, registry)

    def gone(lobby: Any) -> None:
        connection = registry.connections.get(lobby)
        if connection is not None:
            connection.close()

    world.client_gone.append(gone)
    system = world.global_.slots["System"]
    _time_reference(world, system)
    _components(world, system.slots["PackageInfo"])


def _time_reference(world: World, system: Obj) -> None:
    """Set ``System.timeReference``: midnight of the day on which the server started.

    The C++ remotes keep microseconds in 32 bits, so their time stamps are usable only relative to a midnight.
    """
    now = datetime.now()
    midnight = now.replace(hour=0, minute=0, second=0, microsecond=0)
    world.install_part(RemoteSettings((now - midnight).total_seconds() - world.scheduler.clock.now()))
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
