"""A hooked slot as urbiscript and the kernel see it: reads, writes and notifications.  ``uvar`` has the device's
side.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

from urbihw.kernel import errors
from urbihw.kernel.runtime.backtrace import failed_in_program
from urbihw.kernel.runtime.binary import BinaryObject
from urbihw.kernel.runtime.blend import Blender, blender_of
from urbihw.kernel.runtime.code import Executable
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.slot import SlotMeta, meta_of, peek_meta
from urbihw.kernel.runtime.watch import notify
from urbihw.kernel.uobject.callback import Callback
from urbihw.kernel.uobject.registry import registry_of
from urbihw.kernel.uobject.uvalue import to_urbi
from urbihw.kernel.value import Value

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World
    from urbihw.kernel.uobject.uvar import UVar

log = logging.getLogger("urbihw.uobject")


class Subscriber(Protocol):
    """A connection that is notified of the changes of a variable."""

    def changed(self, var: UVar, value: Value) -> None:
        """Called when the variable has a new urbiscript value."""
        ...


class WriteGuard(Protocol):
    """A check before each write: it accepts the write or raises an urbiscript error with the reason."""

    def admit(self, wanted: Any, value: Value) -> None:
        """Check a write.  ``wanted`` is the assigned value, ``value`` what the range of the slot leaves of it."""
        ...

    @property
    def since(self) -> int:
        """The lowest ``Job.era`` of a statement that may write."""
        ...

    def check_end(self) -> None:
        """Raise an error if the device of a trajectory that has written its target cannot be reached."""
        ...


class Mirror(Protocol):
    """The server-side counterpart of a variable whose device runs in another process."""

    def sensed(self, var: UVar) -> None:
        """The owner reported a value."""
        ...

    def assigned(self, var: UVar, value: Value) -> None:
        """Code in this process assigns the variable and is not its owner: the server must execute the assignment."""
        ...

    def property_set(self, var: UVar, name: str) -> None:
        """A property was set."""
        ...


class Hooked(Executable):
    """One hooked variable.  It is stored in the slot ``name`` of ``holder`` and in the slots to which it was copied."""

    __slots__ = (
        "_access",
        "_change",
        "_homes",
        "_learned",
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

    def __init__(self, world: World, holder: Obj, name: str, *, owned: bool = False, value: Value = None) -> None:
        super().__init__(world, [world.uvar_proto])
        registry = registry_of(world)
        self.name = name
        self.owned = owned
        self._sensed: Any = to_urbi(world, value)
        self._target: Any = self._sensed
        self.stamp = world.scheduler.clock.now()
        self._learned: tuple[Any, float] = (self._sensed, self.stamp)
        """The last value that the server has sent for a variable of another owner, and its time."""
        self.dated: Callable[[], float] | None = None
        self.thread = registry.thread
        self.hooked = registry.hook_changed
        self.bypass = False
        self.rtp: bool | None = None
        self.writable = True
        self.effector: WriteGuard | None = None
        """The check before each write, if the variable moves an effector; else None."""
        self.remove_throwing = registry.remove_throwing
        self.mirror: Mirror | None = None
        self.writer: Subscriber | None = None
        self.subscribers: dict[Subscriber, bool] | None = None
        self._homes: list[tuple[Obj, str]] = []
        self._owner_change: tuple[Callback, ...] = ()
        self._change: tuple[Callback, ...] = ()
        self._access: tuple[Callback, ...] = ()
        self._meta: SlotMeta = meta_of(holder, name)
        self.add_slot(holder, name)

    def add_slot(self, holder: Obj, name: str) -> None:
        """Store this variable in one more slot, with the same properties."""
        meta = meta_of(holder, name)
        meta.accessor = self
        if self._homes:
            first = meta_of(*self._homes[0])
            if first.properties is None:
                first.properties = {}
            meta.properties = first.properties
        self._homes.append((holder, name))
        self.world.ops.put_slot(holder, name, self)

    @property
    def holder(self) -> Obj:
        """The object that contains the variable's first slot."""
        return self._homes[0][0]

    @property
    def has_subscribers(self) -> bool:
        """Whether the variable has a subscriber: a device, a connection, a condition or a handler of ``->changed``."""
        if self._change or self.subscribers:
            return True
        metas = (peek_meta(holder, name) for holder, name in self._homes)
        return any(meta and (meta.watchers or (meta.changed and meta.changed.subscriptions)) for meta in metas)

    @property
    def constant(self) -> bool:
        """Whether the property ``constant`` prevents writes."""
        return self._meta.constant

    @property
    def full_name(self) -> str:
        """The full name, ``object.slot``: the unique name of the object, and the name of the slot."""
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

    def call(self, this: Value, args: tuple[Value, ...]) -> Value:
        """Called when urbiscript reads the slot."""
        if args:
            raise errors.arity(len(args), 0)
        return self.read(this)

    def c0(self, this: Value) -> Value:
        """Called when urbiscript reads the slot without arguments."""
        if self._access:
            self._run(self._access)
        return self._sensed

    def peek(self) -> Value:
        """The value for readers, as it is."""
        return self._sensed

    def read(self, target: Value) -> Value:
        """The value for readers other than the owner: the sensed value, after the access callbacks had a chance to
        refresh it.
        """
        if self._access:
            self._run(self._access)
        return self._sensed

    def refresh(self) -> None:
        """Run the access callbacks, as before a read."""
        self._run(self._access)

    def write(self, target: Value, value: Value) -> Value:
        """Write the slot as a non-owner: the value is limited to ``rangemin`` and ``rangemax``, blended, and becomes
        the target.
        """
        wanted = value
        if self._meta.properties is not None:
            value = self._limited(value)
            if value is not wanted:
                self._explain_limit(wanted, value)
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

    def assign(self, value: Value) -> None:
        """Write a non-owner's value without limits and blending."""
        before, self._target = self._target, value
        if self.owned:
            if self._owner_change:
                self._notify_owner(before)
            if self.subscribers:
                self._notify(value, owners=True)
            return
        seen, self._sensed = self._sensed, value
        self.stamp = self.world.scheduler.clock.now()
        if self._owner_change:
            try:
                self._notify_owner(before)
            except errors.ThrownError:
                self._sensed = seen
                raise
        if self.subscribers:
            self._notify(value)
        if self._change:
            self._run(self._change)
        self._announce()

    def blender(self) -> Blender | None:
        """The blender of concurrent movements of this variable; None if there is none."""
        found = blender_of(self.world, self._meta, lambda value: self.assign(self._limited(value)))
        if found is not None and self.effector is not None:
            guard = self.effector
            found.guard(lambda value: guard.admit(value, self._limited(value)), lambda: guard.since)
        return found

    def check_end(self) -> None:
        """A trajectory of this variable is over.  Raises an error if its device cannot be reached."""
        if self.effector is not None:
            self.effector.check_end()

    def _notify_owner(self, before: Value) -> None:
        """Run the owner's callbacks.  If one raises ValueError, the value is restored and the error goes to the
        writer.
        """
        for callback in self._owner_change:
            try:
                callback.run(self)
            except Exception as error:
                self._refused(callback, error, before)

    def _owner_failed(self, failed: Callback, error: Exception, before: Value) -> None:
        """Handle the exception of one of the owner's callbacks, and run the remaining ones."""
        behind = self._owner_change[self._owner_change.index(failed) + 1 :] if failed in self._owner_change else ()
        self._refused(failed, error, before)
        for callback in behind:
            try:
                callback.run(self)
            except Exception as other:
                self._refused(callback, other, before)

    def _refused(self, callback: Callback, error: Exception, before: Value) -> None:
        if isinstance(error, ValueError):
            self._target = before
            raise errors.primitive(str(error), self.name) from error
        if isinstance(error, errors.MovementRefused):
            self._target = before
            raise error
        self._failed(callback, error)

    def _limited(self, value: Value) -> Value:
        properties = self._meta.properties
        if value.__class__ is not float or not properties:
            return value
        least, most = properties.get("rangemin"), properties.get("rangemax")
        if least.__class__ is float and value < least:
            return least
        if most.__class__ is float and value > most:
            return most
        return value

    def _explain_limit(self, wanted: Any, value: Any) -> None:
        """Advise a client that has probably written degrees: once, since a program may write again and again.

        Degrees have few decimals; ``500deg`` has many, in rad.
        """
        unit = (self._meta.properties or {}).get("unit")
        job = self.world.scheduler.current
        is_degrees = getattr(unit, "s", "") == "rad" and abs(wanted) > math.tau and wanted == round(wanted, 1)
        if is_degrees and job is not None and job.context is not None:
            text = f"{wanted:g} is in rad, and was limited to {value:g}: write {wanted:g}deg for degrees"
            job.context.advise_once("degrees", text)

    # ---------------------------------------------------------------- telling

    def _sensed_changed(self) -> None:
        self._run(self._change)
        self._announce()
        if self.bypass:
            self._forget_binary()

    def _forget_binary(self) -> None:
        if isinstance(self._sensed, BinaryObject):
            self._sensed = self.world.nil

    def _notify(self, value: Value, owners: bool = False) -> None:
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
                notify(meta, self._sensed)

    def _run(self, callbacks: tuple[Callback, ...]) -> None:
        for callback in callbacks:
            try:
                callback.run(self)
            except Exception as error:
                self._failed(callback, error)

    def _failed(self, callback: Callback, error: Exception) -> None:
        """Report the exception of a callback, to the client whose function it is or else in the log, and remove the
        callback unless ``remove_throwing`` is off.
        """
        if self.remove_throwing:
            self._keep(lambda kept: kept is not callback)
        end = "removed because it failed" if self.remove_throwing else "failed"
        what = f"callback on {self.name} {end}"
        if not callback.tell(error, what):
            of_program = isinstance(error, errors.ThrownError) or failed_in_program(error)
            log.error("%s: %s", what, "; ".join(self.world.describe(error)) if of_program else repr(error))

    def _keep(self, wanted: Callable[[Callback], bool]) -> None:
        self._owner_change = tuple(filter(wanted, self._owner_change))
        self._change = tuple(filter(wanted, self._change))
        self._access = tuple(filter(wanted, self._access))
