"""A hooked slot as urbiscript and the kernel see it: reading, writing, and who is told (see ``uvar``)."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

from urbihw.kernel import errors
from urbihw.kernel.runtime.binary import BinaryObject
from urbihw.kernel.runtime.blend import Blender, blender_of
from urbihw.kernel.runtime.code import Executable
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.slot import SlotMeta, meta_of, peek_meta
from urbihw.kernel.runtime.watch import notify
from urbihw.kernel.uobject.callback import Callback
from urbihw.kernel.uobject.registry import registry_of
from urbihw.kernel.uobject.uvalue import to_urbi

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World
    from urbihw.kernel.uobject.uvar import UVar

log = logging.getLogger("urbihw.uobject")


class Subscriber(Protocol):
    """A connection that wants to hear of a variable."""

    def changed(self, var: UVar, value: Any) -> None:
        """The variable has this urbiscript value now."""
        ...


class Guard(Protocol):
    """What lets a write through, or raises an error that says why not."""

    def admit(self, wanted: Any, value: Any) -> None:
        """Somebody assigns ``wanted``, of which the range leaves ``value``."""
        ...

    @property
    def since(self) -> int:
        """``Job.epoch`` of the oldest statement that may write."""
        ...


class Mirror(Protocol):
    """The server's side of a variable of a process of its own."""

    def sensed(self, var: UVar) -> None:
        """The owner reported a value."""
        ...

    def assigned(self, var: UVar, value: Any) -> None:
        """Somebody in this process assigns the variable as an outsider: the server is to do it."""
        ...

    def property_set(self, var: UVar, name: str) -> None:
        """A property was set."""
        ...


class Hooked(Executable):
    """One hooked variable; lives in the slot ``name`` of ``holder`` (and of others it was copied to)."""

    __slots__ = (
        "_access",
        "_change",
        "_homes",
        "_meta",
        "_owner_change",
        "_sensed",
        "_target",
        "bypass",
        "dated",
        "effector",
        "hooked",
        "mirror",
        "name",
        "owned",
        "remove_throwing",
        "rtp",
        "stamp",
        "subscribers",
        "thread",
        "writable",
        "writer",
    )

    def __init__(self, world: World, holder: Obj, name: str, *, owned: bool = False, value: Any = None) -> None:
        super().__init__(world, [world.uvar_proto])
        registry = registry_of(world)
        self.name = name
        self.owned = owned
        self._sensed: Any = to_urbi(world, value)
        self._target: Any = self._sensed
        self.stamp = world.scheduler.clock.now()
        self.dated: Callable[[], float] | None = None
        self.thread = registry.thread
        self.hooked = registry.hook_changed
        self.bypass = False
        self.rtp: bool | None = None
        self.writable = True
        self.effector: Guard | None = None
        """Asked before each write, if the variable moves something."""
        self.remove_throwing = True
        self.mirror: Mirror | None = None
        self.writer: Subscriber | None = None
        self.subscribers: dict[Subscriber, bool] | None = None
        self._homes: list[tuple[Obj, str]] = []
        self._owner_change: tuple[Callback, ...] = ()
        self._change: tuple[Callback, ...] = ()
        self._access: tuple[Callback, ...] = ()
        self._meta: SlotMeta = meta_of(holder, name)
        self.put(holder, name)

    def put(self, holder: Obj, name: str) -> None:
        """Stand in one more slot."""
        self._homes.append((holder, name))
        meta_of(holder, name).accessor = self
        self.world.ops.put(holder, name, self)

    def drop(self) -> None:
        """Stand in no slot any more, and tell nobody of anything: the value stays where the variable was."""
        for holder, name in self._homes:
            meta = peek_meta(holder, name)
            if meta is not None and meta.accessor is self:
                meta.accessor = None
                holder.slots[name] = self._sensed
        self.subscribers = self.mirror = None
        self._forget()

    @property
    def holder(self) -> Obj:
        """The object whose slot it is in the first place."""
        return self._homes[0][0]

    @property
    def constant(self) -> bool:
        """Whether the property ``constant`` keeps everybody from writing."""
        return self._meta.constant

    @property
    def full_name(self) -> str:
        """``object.slot``: the unique name of the object, and the slot."""
        holder, name = self._homes[0]
        unique = holder.slots.get("__uobjectName")
        return f"{self.world.text(unique) if unique is not None else self._name_of(holder)}.{name}"

    def _name_of(self, holder: Obj) -> str:
        world = self.world
        for slot, value in world.global_.slots.items():
            if value is holder:
                return slot
        return "Global" if holder is world.global_ else f"obj_{world.uid(holder)}"

    # ---------------------------------------------------------------- the urbiscript side

    def call(self, this: Any, args: tuple[Any, ...]) -> Any:
        """The slot is read."""
        if args:
            raise errors.arity(len(args), 0)
        return self.read(this)

    def c0(self, this: Any) -> Any:
        """The slot is read."""
        if self._access:
            self._run(self._access)
        return self._sensed

    def read(self, target: Any) -> Any:
        """What outsiders read: the sensed value, after the access callbacks had a chance to refresh it."""
        if self._access:
            self._run(self._access)
        return self._sensed

    def refresh(self) -> None:
        """Run the access callbacks, as if somebody read the variable."""
        self._run(self._access)

    def write(self, target: Any, value: Any) -> Any:
        """An outsider assigns the slot: the value within ``rangemin`` and ``rangemax``, blended, becomes the target."""
        wanted = value
        if self._meta.properties is not None:
            value = self._limited(value)
        if self.effector is not None:
            self.effector.admit(wanted, value)
        if self._meta.properties is not None:
            blender = self.blender()
            if blender is not None:
                blender.assign(value)
                return value
        if self.owned and not self.subscribers:
            before, self._target = self._target, value
            try:
                for callback in self._owner_change:
                    callback.run(self)
            except Exception as error:
                self._owner_failed(callback, error, before)
            return value
        self.assign(value)
        return value

    def assign(self, value: Any) -> None:
        """A value of an outsider, as it is."""
        before, self._target = self._target, value
        if self.owned:
            if self._owner_change:
                self._tell_owner(before)
            if self.subscribers:
                self._tell(value, owners=True)
            return
        seen, self._sensed = self._sensed, value
        self.stamp = self.world.scheduler.clock.now()
        if self._owner_change:
            try:
                self._tell_owner(before)
            except errors.UrbiError:
                self._sensed = seen
                raise
        if self.subscribers:
            self._tell(value)
        if self._change:
            self._run(self._change)
        self._announce()

    def blender(self) -> Blender | None:
        """What blends movements of this variable, None if nothing does."""
        found = blender_of(self.world, self._meta, lambda value: self.assign(self._limited(value)))
        if found is not None and self.effector is not None:
            guard = self.effector
            found.guard(lambda value: guard.admit(value, self._limited(value)), lambda: guard.since)
        return found

    def _tell_owner(self, before: Any) -> None:
        """Run the owner's callbacks; a value that it refuses (ValueError) is taken back and the writer told."""
        for callback in self._owner_change:
            try:
                callback.run(self)
            except Exception as error:
                self._refused(callback, error, before)

    def _owner_failed(self, failed: Callback, error: Exception, before: Any) -> None:
        """One of the owner's callbacks raised: see to that, and run those behind it."""
        behind = self._owner_change[self._owner_change.index(failed) + 1 :] if failed in self._owner_change else ()
        self._refused(failed, error, before)
        for callback in behind:
            try:
                callback.run(self)
            except Exception as other:
                self._refused(callback, other, before)

    def _refused(self, callback: Callback, error: Exception, before: Any) -> None:
        if isinstance(error, ValueError):
            self._target = before
            raise errors.primitive(str(error), self.name) from error
        if isinstance(error, errors.Refused):
            self._target = before
            raise error
        self._failed(callback, error)

    def _limited(self, value: Any) -> Any:
        properties = self._meta.properties
        if value.__class__ is not float or not properties:
            return value
        least, most = properties.get("rangemin"), properties.get("rangemax")
        if least.__class__ is float and value < least:
            return least
        if most.__class__ is float and value > most:
            return most
        return value

    # ---------------------------------------------------------------- telling

    def _sensed_changed(self) -> None:
        self._run(self._change)
        self._announce()
        if self.bypass:
            self._forget_binary()

    def _forget_binary(self) -> None:
        if isinstance(self._sensed, BinaryObject):
            self._sensed = self.world.nil

    def _tell(self, value: Any, owners: bool = False) -> None:
        assert self.subscribers is not None
        me: Any = self
        for subscriber, owns in list(self.subscribers.items()):
            if subscriber is not self.writer and (not self.owned or owns is owners):
                subscriber.changed(me, value)

    def _watched(self) -> bool:
        for holder, name in self._homes:
            meta = peek_meta(holder, name)
            if meta is not None and (meta.changed is not None or meta.watchers):
                return True
        return False

    def _announce(self) -> None:
        for holder, name in self._homes:
            meta = peek_meta(holder, name)
            if meta is not None:
                if meta.changed is not None and self.hooked:
                    self.world.send(meta.changed, "emit")
                notify(meta)

    def _run(self, callbacks: tuple[Callback, ...]) -> None:
        for callback in callbacks:
            try:
                callback.run(self)
            except Exception as error:
                self._failed(callback, error)

    def _failed(self, callback: Callback, error: Exception) -> None:
        """A callback raised: it is reported, and removed unless that is not wanted."""
        if self.remove_throwing:
            self._keep(lambda kept: kept is not callback)
        reason = "; ".join(self.world.describe(error)) if isinstance(error, errors.UrbiError) else repr(error)
        end = "removed because it failed" if self.remove_throwing else "failed"
        log.error("callback on %s %s: %s", self.name, end, reason)

    def _forget(self) -> None:
        self._keep(lambda kept: False)

    def _keep(self, wanted: Callable[[Callback], bool]) -> None:
        self._owner_change = tuple(filter(wanted, self._owner_change))
        self._change = tuple(filter(wanted, self._change))
        self._access = tuple(filter(wanted, self._access))
