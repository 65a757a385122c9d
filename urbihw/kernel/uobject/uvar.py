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

from collections.abc import Callable
from threading import get_ident
from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.code import Executable
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.slot import peek_meta
from urbihw.kernel.runtime.world import World
from urbihw.kernel.uobject.callback import Callback, Handler
from urbihw.kernel.uobject.hooked import Hooked, Mirror, Subscriber
from urbihw.kernel.uobject.registry import registry_of
from urbihw.kernel.uobject.uvalue import from_urbi, to_urbi

__all__ = ["Mirror", "Subscriber", "UVar", "check_hookable", "hook"]


class UVar(Hooked):
    """A hooked variable as its owner and other devices use it."""

    __slots__ = ()

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
        """A connection reports an urbiscript value: as ``sense``, of equal values too; it does not come back to it.

        The properties of a variable that is not owned act on it as on what outsiders write: if another value is kept
        in its place, the connection is told too.
        """
        wanted = value
        if self._meta.properties is not None and not self.owned:
            value = self._limited(value)
            blender = self.blender()
            if blender is not None:
                blender.assign(value)
                return
        self.stamp = stamp
        before, self.writer = self.writer, writer if value is wanted else None
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

    def unnotify_where(self, unwanted: Callable[[Handler], bool]) -> None:
        """Forget the callbacks whose handlers are ``unwanted``."""
        self._keep(lambda kept: not unwanted(kept.handler))


def hook(world: World, holder: Obj, name: str) -> UVar:
    """The variable in a slot, which is hooked if it held a plain value or nothing.

    Raises an urbiscript error for a function, which nobody could call any more, and for a constant.
    """
    known = holder.slots.get(name)
    if isinstance(known, UVar):
        return known
    check_hookable(holder, name)
    return UVar(world, holder, name, value=known)


def check_hookable(holder: Obj, name: str) -> None:
    """Raise the error for a slot in which no variable may be put: see ``hook``."""
    owner = holder.find(name)
    if owner is not None and isinstance(owner.slots[name], Executable) and not isinstance(owner.slots[name], UVar):
        # What is read by a function and written like a variable is one to everybody.
        inherited = peek_meta(owner, name)
        if inherited is None or inherited.accessor is None:
            raise errors.primitive(f"{name} is a function, not a variable")
    meta = peek_meta(holder, name)
    if meta is not None and meta.constant:
        raise errors.constness()


def _refuse() -> None:
    raise ValueError("this slot can only be read")
