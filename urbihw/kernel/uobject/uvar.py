"""A variable with an owner: what stands in a slot on which a device hooked itself (manual, sections 3.5 to 3.9, 20.69).

urbiscript reads and writes the slot as if the value itself stood there.  An *owned* variable holds two values: the
``target``, what urbiscript last wrote, and the ``sensed`` value, what the device last reported.  Outsiders write the
target and read the sensed value; the owner's ``value`` is the other way round.

Writing runs the ``notify_change`` callbacks at once, in the job that wrote: the owner's when an outsider wrote, the
others' when the value that outsiders read changed.  An owner refuses a value by raising ValueError: the assignment then
fails with its words, and the target stays what it was.  Any other callback that raises is removed and reported, so that
one bad device cannot break every assignment (unless ``remove_throwing`` is off).  Conditions (``at (motor.val > 0)``)
and ``->changed`` follow the value that outsiders read.

The owner's side may be used from any thread: from another than the kernel's, each call is done in the kernel's thread
and waited for.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from threading import get_ident
from typing import TYPE_CHECKING, Any, Protocol

from urbihw.kernel import errors
from urbihw.kernel.runtime.binary import BinaryObject
from urbihw.kernel.runtime.blend import Blender, blender_of
from urbihw.kernel.runtime.code import Executable
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.slot import SlotMeta, meta_of, peek_meta
from urbihw.kernel.runtime.watch import notify
from urbihw.kernel.uobject.callback import Callback, Handler
from urbihw.kernel.uobject.registry import registry_of
from urbihw.kernel.uobject.uvalue import from_urbi, to_urbi

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

log = logging.getLogger("urbihw.uobject")


class Subscriber(Protocol):
    """A connection that wants to hear of a variable."""

    def changed(self, var: UVar, value: Any) -> None:
        """The variable has this urbiscript value now."""
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

    def asked(self, var: UVar) -> Any:
        """The value at the server, as an urbiscript value; may park the running job."""
        ...


class UVar(Executable):
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
        if self._meta.properties is not None:
            value = self._limited(value)
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
        return blender_of(self.world, self._meta, lambda value: self.assign(self._limited(value)))

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

    # ---------------------------------------------------------------- the owner's side

    @property
    def target(self) -> Any:
        """What outsiders last wrote, as a Python value."""
        return from_urbi(self._target)

    @property
    def sensed(self) -> Any:
        """What outsiders read, as a Python value."""
        return from_urbi(self._sensed)

    @property
    def value(self) -> Any:
        """The owner's view: of an owned variable the target, else the value."""
        return from_urbi(self._target if self.owned else self._sensed)

    @value.setter
    def value(self, value: Any) -> None:
        self.sense(value)

    def sense(self, value: Any, stamp: float | None = None) -> None:
        """The owner reports a value, taken at ``stamp`` (seconds of the kernel's clock; now, if None).

        Callbacks, conditions and ``->changed`` run only if it differs from the last one.
        """
        if get_ident() != self.thread:
            registry_of(self.world).call(lambda: self.sense(value, stamp))
            return
        self.stamp = self.world.scheduler.clock.now() if stamp is None else stamp
        if value.__class__ is not float:
            value = to_urbi(self.world, value, self.bypass)
        old = self._sensed
        if value is old or (value.__class__ is float and old.__class__ is float and value == old):
            return
        self._take(value)

    def learn(self, value: Any, stamp: float, changed: bool = True) -> None:
        """The server tells the urbiscript value of another's variable, and whether that is a change."""
        self.stamp = stamp
        self._sensed = self._target = value
        if not changed:
            return
        if self._change or self._watched():
            self.world.soon(self._sensed_changed)

    def receive(self, value: Any, stamp: float, writer: Subscriber | None) -> None:
        """A connection reports an urbiscript value: as ``sense``, of equal values too; it does not come back to it."""
        self.stamp = stamp
        before, self.writer = self.writer, writer
        try:
            self._take(value)
        finally:
            self.writer = before

    def _take(self, value: Any) -> None:
        self._sensed = value
        if not self.owned:
            self._target = value
        if self.mirror is not None:
            self.mirror.sensed(self)
        if self.subscribers:
            self._tell(value)
        if self._change or self._watched():
            self.world.soon(self._sensed_changed)
        elif self.bypass:
            self._forget_binary()

    def current(self, owner: bool) -> Any:
        """The urbiscript value: of an owned variable the target, for its owner."""
        return self._target if owner and self.owned else self._sensed

    def get(self) -> Any:
        """What urbiscript reads here, as a Python value: the way to read another's variable."""
        return registry_of(self.world).call(lambda: from_urbi(self.read(self)))

    def set(self, value: Any) -> None:
        """Assign as urbiscript does: the way to write another's variable."""

        def assign() -> None:
            if self.mirror is not None:
                self.mirror.assigned(self, to_urbi(self.world, value))
            else:
                self.world.soon(lambda: self.write(self, to_urbi(self.world, value)) and None)

        registry_of(self.world).call(assign)

    def age(self) -> float:
        """Seconds since the value was taken: since ``dated()`` if the owner says so, else since it last changed."""
        stamp = self.stamp if self.dated is None else self.dated()
        return self.world.scheduler.clock.now() - stamp

    def own(self) -> None:
        """Hold a target and a sensed value from now on (UOwned)."""
        self.owned = True

    def protect(self) -> None:
        """Only the owner writes from now on; others are refused."""
        if self.writable:
            self.writable = False
            self.notify_change(_refuse, owner=True)

    def set_bypass(self, on: bool = True) -> None:
        """Zero-copy mode: binaries written by the owner are not copied, may be changed by him afterwards, and can only
        be read from within ``notify_change`` callbacks; at other times the variable is nil."""
        self.bypass = on

    def use_rtp(self, on: bool = True) -> None:
        """Whether values may travel by RTP if the device runs in another process; otherwise, binary ones do if the
        module ``urbi/rtp`` was loaded."""
        self.set_property("rtp", on)
        self.rtp = on

    def get_property(self, name: str) -> Any:
        """A property of the slot, such as ``rangemin``, as a Python value; None if it was not set."""
        return from_urbi((self._meta.properties or {}).get(name))

    def property_names(self) -> list[str]:
        """The properties that were set."""
        return list(self._meta.properties or ())

    def set_property(self, name: str, value: Any) -> None:
        """Set a property of the slot: ``rangemin``, ``rangemax``, ``speedmin``, ``speedmax``, ``delta``, ``blend``, or
        any other name."""
        if get_ident() != self.thread:
            registry_of(self.world).call(lambda: self.set_property(name, value))
            return
        if self._meta.properties is None:
            self._meta.properties = {}
        self._meta.properties[name] = to_urbi(self.world, value)
        if self.mirror is not None:
            self.mirror.property_set(self, name)

    def sync_value(self) -> Any:
        """The value as it is now at the server; plugged in, that is the value."""
        return self.value if self.mirror is None else from_urbi(self.mirror.asked(self))

    # ---------------------------------------------------------------- notification

    def notify_change(self, callback: Handler, *, owner: bool = False) -> Callback:
        """Call ``callback()`` or ``callback(x)`` after each write: by outsiders for the owner, else of the value.

        ``x`` is this variable, or its value if the annotation says another type than UVar.  What is returned can be
        handed to ``unnotify``.
        """
        made = Callback(self.world, callback, owner)
        if owner:
            self._owner_change += (made,)
        else:
            self._change += (made,)
        return made

    def notify_access(self, callback: Handler) -> Callback:
        """Call ``callback()`` or ``callback(x)`` before the value is read."""
        made = Callback(self.world, callback)
        self._access += (made,)
        return made

    def unnotify(self, callback: Callback | Handler | None = None) -> None:
        """Forget a callback, or all of them."""
        self._keep(lambda kept: callback is not None and not kept.is_(callback))

    def _forget(self) -> None:
        self._keep(lambda kept: False)

    def _keep(self, wanted: Callable[[Callback], bool]) -> None:
        self._owner_change = tuple(filter(wanted, self._owner_change))
        self._change = tuple(filter(wanted, self._change))
        self._access = tuple(filter(wanted, self._access))

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
        for subscriber, owns in list(self.subscribers.items()):
            if subscriber is not self.writer and (not self.owned or owns is owners):
                subscriber.changed(self, value)

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


def _refuse() -> None:
    raise ValueError("this slot can only be read")
