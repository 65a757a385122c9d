"""A variable with an owner: what stands in a slot on which a device hooked itself (manual, sections 3.5 to 3.9, 20.69).

urbiscript reads and writes the slot as if the value itself stood there.  An *owned* variable holds two values: the
``target``, what urbiscript last wrote, and the ``sensed`` value, what the device last reported.  Outsiders write the
target and read the sensed value; the owner's ``value`` is the other way round.

Writing runs the ``notify_change`` callbacks at once, in the job that wrote: the owner's when an outsider wrote, the
others' when the value that outsiders read changed.  An owner refuses a value by raising ValueError: the assignment then
fails with its words, and the target stays what it was.  Any other callback that raises is removed and reported, so that
one bad device cannot break every assignment.  Conditions (``at (motor.val > 0)``) and ``->changed`` follow the value
that outsiders read.
"""

from __future__ import annotations

import inspect
import logging
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.code import Executable
from urbihw.kernel.runtime.convert import to_python
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.slot import meta_of, peek_meta

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

log = logging.getLogger("urbihw.uobject")

Callback = Callable[..., Any]


class UVar(Executable):
    """One hooked variable; lives in the slot ``name`` of ``holder`` (and of others it was copied to)."""

    __slots__ = (
        "_access",
        "_change",
        "_homes",
        "_owner_change",
        "_sensed",
        "_target",
        "dated",
        "name",
        "owned",
        "stamp",
    )

    def __init__(self, world: World, holder: Obj, name: str, *, owned: bool = False, value: Any = None) -> None:
        super().__init__(world, [world.uvar_proto])
        self.name = name
        self.owned = owned
        self._sensed: Any = world.from_python(value)
        self._target: Any = self._sensed
        self.stamp = world.scheduler.clock.now()
        self.dated: Callable[[], float] | None = None
        self._homes: list[tuple[Obj, str]] = []
        self._owner_change: list[Callback] = []
        self._change: list[Callback] = []
        self._access: list[Callback] = []
        self.put(holder, name)

    def put(self, holder: Obj, name: str) -> None:
        """Stand in one more slot."""
        self._homes.append((holder, name))
        meta_of(holder, name).accessor = self
        self.world.ops.put(holder, name, self)

    # ---------------------------------------------------------------- the urbiscript side

    def call(self, this: Any, args: tuple[Any, ...]) -> Any:
        """The slot is read."""
        if args:
            raise errors.arity(len(args), 0)
        return self.read(this)

    def read(self, target: Any) -> Any:
        """What outsiders read: the sensed value, after the access callbacks had a chance to refresh it."""
        if self._access:
            self._run(self._access)
        return self._sensed

    def write(self, target: Any, value: Any) -> Any:
        """An outsider assigns the slot: the value within ``rangemin`` and ``rangemax`` becomes the target."""
        value = self._clamped(value)
        before, self._target = self._target, value
        if self.owned:
            self._tell_owner(before)
            return value
        seen, self._sensed = self._sensed, value
        self.stamp = self.world.scheduler.clock.now()
        try:
            self._tell_owner(before)
        except errors.UrbiError:
            self._sensed = seen
            raise
        self._run(self._change)
        self._announce()
        return value

    def _tell_owner(self, before: Any) -> None:
        """Run the owner's callbacks; a value that it refuses (ValueError) is taken back and the writer told."""
        try:
            self._run(self._owner_change, refusable=True)
        except ValueError as refusal:
            self._target = before
            raise errors.primitive(str(refusal), self.name) from refusal

    def _clamped(self, value: Any) -> Any:
        if value.__class__ is not float:
            return value
        holder, name = self._homes[0]
        meta = peek_meta(holder, name)
        if meta is None or not meta.properties:
            return value
        least, most = meta.properties.get("rangemin"), meta.properties.get("rangemax")
        if least.__class__ is float and value < least:
            return least
        if most.__class__ is float and value > most:
            return most
        return value

    # ---------------------------------------------------------------- the owner's side

    @property
    def target(self) -> Any:
        """What outsiders last wrote, as a Python value."""
        return to_python(self._target)

    @property
    def sensed(self) -> Any:
        """What outsiders read, as a Python value."""
        return to_python(self._sensed)

    @property
    def value(self) -> Any:
        """The owner's view: of an owned variable the target, else the value."""
        return to_python(self._target if self.owned else self._sensed)

    @value.setter
    def value(self, value: Any) -> None:
        self.sense(value)

    def sense(self, value: Any, stamp: float | None = None) -> None:
        """The owner reports a value, taken at ``stamp`` (seconds of the kernel's clock; now, if None).

        Callbacks, conditions and ``->changed`` run only if it differs from the last one.
        """
        self.stamp = self.world.scheduler.clock.now() if stamp is None else stamp
        if value.__class__ is not float:
            value = self.world.from_python(value)
        old = self._sensed
        if value is old or (value.__class__ is float and old.__class__ is float and value == old):
            return
        self._sensed = value
        if not self.owned:
            self._target = value
        if self._change or self._watched():
            self.world.soon(self._sensed_changed)

    def age(self) -> float:
        """Seconds since the value was taken: since ``dated()`` if the owner says so, else since it last changed."""
        stamp = self.stamp if self.dated is None else self.dated()
        return self.world.scheduler.clock.now() - stamp

    def set_property(self, name: str, value: Any) -> None:
        """Set a property of the slot, such as ``rangemin``."""
        holder, slot = self._homes[0]
        meta = meta_of(holder, slot)
        if meta.properties is None:
            meta.properties = {}
        meta.properties[name] = self.world.from_python(value)

    # ---------------------------------------------------------------- notification

    def notify_change(self, callback: Callback, *, owner: bool = False) -> None:
        """Call ``callback()`` or ``callback(uvar)`` after each write: by outsiders for the owner, else of the value."""
        (self._owner_change if owner else self._change).append(_adapted(callback))

    def notify_access(self, callback: Callback) -> None:
        """Call ``callback()`` or ``callback(uvar)`` before the value is read."""
        self._access.append(_adapted(callback))

    def unnotify(self) -> None:
        """Forget all callbacks."""
        for callbacks in (self._owner_change, self._change, self._access):
            callbacks.clear()

    def _sensed_changed(self) -> None:
        self._run(self._change)
        self._announce()

    def _watched(self) -> bool:
        for holder, name in self._homes:
            meta = peek_meta(holder, name)
            if meta is not None and (meta.changed is not None or meta.watchers):
                return True
        return False

    def _announce(self) -> None:
        for holder, name in self._homes:
            self.world.ops.announce(holder, name)

    def _run(self, callbacks: list[Callback], *, refusable: bool = False) -> None:
        for callback in list(callbacks):
            try:
                callback(self)
            except Exception as error:
                if refusable and isinstance(error, ValueError):
                    raise
                callbacks.remove(callback)
                reason = "; ".join(self.world.describe(error)) if isinstance(error, errors.UrbiError) else repr(error)
                log.error("callback on %s removed because it failed: %s", self.name, reason)


def _adapted(callback: Callback) -> Callback:
    """A callback that takes the UVar, whether the given one does or not."""
    try:
        wanted = len(inspect.signature(callback).parameters)
    except (TypeError, ValueError):
        wanted = 0
    return callback if wanted else lambda _: callback()
