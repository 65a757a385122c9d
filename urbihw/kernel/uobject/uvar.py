"""A variable with an owner: the content of a slot that a device has hooked (manual, sections 3.5 to 3.9, 20.69).

urbiscript reads and writes the slot like a plain value.  An *owned* variable holds two values: the ``target``, last
written by urbiscript, and the ``sensed`` value, last reported by the device.  Non-owners write the target and read the
sensed value; for the owner, ``value`` reads the target and writes the sensed value.

A write calls the ``notify_change`` callbacks at once, in the writing job: the owner's callbacks when a non-owner wrote,
the others' when the value for non-owners changed.  An owner refuses a value by raising ValueError: the assignment then
fails with its message, and the target keeps its value.  Any other callback that raises is removed and reported, so that
one faulty device cannot break every assignment (unless ``remove_throwing`` is off).  Conditions (``at (motor.val >
0)``) and ``->changed`` follow the value for non-owners.

The owner may use the variable from any thread: a call from another thread than the kernel's is executed in the kernel's
thread, and the caller waits for it.
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
        """The last value written by a non-owner, as a Python value."""
        return from_urbi(self._target)

    @property
    def sensed(self) -> Any:
        """The value for non-owners, as a Python value."""
        return from_urbi(self._sensed)

    @property
    def value(self) -> Any:
        """The owner's view: the target of an owned variable, else the value."""
        return from_urbi(self._target if self.owned else self._sensed)

    @value.setter
    def value(self, value: Any) -> None:
        self.sense(value)

    def sense(self, value: Any, stamp: float | None = None) -> None:
        """Report a value as the owner.  ``stamp`` is the time of its measurement in seconds of the kernel's clock; None
        stands for now.

        Callbacks, conditions and ``->changed`` run only if the value differs from the last one.
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
        self._set_sensed(value)

    def learn(self, value: Any, stamp: float, changed: bool = True) -> None:
        """Store a value that the server has sent for a variable of another owner; ``changed`` tells whether it is a
        change.

        Callbacks and conditions see each change with its own value, however many have come in one packet.
        """
        self._learned = learned = (value, stamp)
        self._hold(learned)
        if changed and (self._change or self._watched()):
            self.world.call_soon(lambda: self._tell(learned))

    def _hold(self, learned: tuple[Any, float]) -> None:
        self._sensed, self.stamp = learned
        self._target = self._sensed

    def _tell(self, change: tuple[Any, float]) -> None:
        """Run the callbacks and conditions for a change.  If another value was learned since, they see that of the
        change, and the variable gets the last one back behind them.
        """
        late = change is not self._learned
        if late:
            self._hold(change)
        try:
            self._sensed_changed()
        finally:
            if late:
                self._hold(self._learned)

    def receive(self, value: Any, stamp: float, writer: Subscriber | None) -> None:
        """Store an urbiscript value reported by a connection.  Unlike ``sense``, equal values count too; the value is
        not sent back.

        The properties of a variable that is not owned act on the value as on a write; if they change it, the connection
        gets the resulting value.
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
            self._set_sensed(value)
        finally:
            self.writer = before

    def _set_sensed(self, value: Any) -> None:
        self._sensed = value
        if not self.owned:
            self._target = value
        if self.mirror is not None:
            self.mirror.sensed(self)
        if self.subscribers:
            self._notify(value)
        if self._change or self._watched():
            self.world.call_soon(self._sensed_changed)
        elif self.bypass:
            self._forget_binary()

    def current(self, owner: bool) -> Any:
        """The urbiscript value; for the owner of an owned variable, the target."""
        return self._target if owner and self.owned else self._sensed

    def get(self) -> Any:
        """The value that urbiscript reads here, as a Python value.  Use it to read a variable of another device."""
        return registry_of(self.world).call(lambda: from_urbi(self.read(self)))

    def set(self, value: Any) -> None:
        """Assign as urbiscript does.  Use it to write a variable of another device."""

        def assign() -> None:
            if self.mirror is not None:
                self.mirror.assigned(self, to_urbi(self.world, value))
            else:
                self.world.call_soon(lambda: self.write(self, to_urbi(self.world, value)) and None)

        registry_of(self.world).call(assign)

    def age(self) -> float:
        """Seconds since the measurement of the value: since ``dated()`` if the owner sets it, else since the last
        change.
        """
        stamp = self.stamp if self.dated is None else self.dated()
        return self.world.scheduler.clock.now() - stamp

    def own(self) -> None:
        """Make the variable hold both a target and a sensed value from now on (UOwned)."""
        self.owned = True

    def protect(self) -> None:
        """Refuse all writes but the owner's from now on."""
        if self.writable:
            self.writable = False
            self.notify_change(_refuse, owner=True)

    def set_bypass(self, on: bool = True) -> None:
        """Zero-copy mode: binaries written by the owner are not copied and the owner may change them afterwards.  They
        can be read only from within ``notify_change`` callbacks; at other times the variable is nil."""
        self.bypass = on

    def use_rtp(self, on: bool = True) -> None:
        """Allow or forbid RTP for the values of a device in another process.  By default, binary values use RTP if the
        module ``urbi/rtp`` is loaded."""
        self.set_property("rtp", on)
        self.rtp = on

    def get_property(self, name: str) -> Any:
        """A property of the slot, such as ``rangemin``, as a Python value; None if it is not set."""
        return from_urbi((self._meta.properties or {}).get(name))

    def property_names(self) -> list[str]:
        """The names of the properties that are set."""
        return list(self._meta.properties or ())

    def set_property(self, name: str, value: Any) -> None:
        """Set a property of the slot: ``rangemin``, ``rangemax``, ``speedmin``, ``speedmax``, ``delta``, ``blend``, or
        one of any other name."""
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
        """Call ``callback()`` or ``callback(x)`` after each write: for the owner, after writes by others; else when the
        value changed.

        ``x`` is this variable; with an annotation of another type than UVar, ``x`` is its value.  The result can be
        passed to ``unnotify``.
        """
        made = Callback(self.world, callback, owner)
        if owner:
            self._owner_change += (made,)
        else:
            self._change += (made,)
        return made

    def notify_access(self, callback: Handler) -> Callback:
        """Call ``callback()`` or ``callback(x)`` before each read of the value."""
        made = Callback(self.world, callback)
        self._access += (made,)
        return made

    def unnotify(self, callback: Callback | Handler | None = None) -> None:
        """Remove a callback; without an argument, remove all."""
        self._keep(lambda kept: callback is not None and not kept.is_(callback))

    def unnotify_where(self, unwanted: Callable[[Handler], bool]) -> None:
        """Remove the callbacks whose handlers satisfy ``unwanted``."""
        self._keep(lambda kept: not unwanted(kept.handler))


def hook(world: World, holder: Obj, name: str) -> UVar:
    """The variable of a slot; a slot with a plain value, or a missing one, is hooked.

    Raises an urbiscript error for a constant, and for a function because it could not be called any more.
    """
    known = holder.slots.get(name)
    if isinstance(known, UVar):
        return known
    check_hookable(holder, name)
    return UVar(world, holder, name, value=known)


def check_hookable(holder: Obj, name: str) -> None:
    """Raise the error for a slot that cannot hold a variable (see ``hook``)."""
    owner = holder.find(name)
    if owner is not None and isinstance(owner.slots[name], Executable) and not isinstance(owner.slots[name], UVar):
        # A slot that is read by a function and written like a variable is a variable for its users.
        inherited = peek_meta(owner, name)
        if inherited is None or inherited.accessor is None:
            raise errors.primitive(f"{name} is a function, not a variable")
    meta = peek_meta(holder, name)
    if meta is not None and meta.constant:
        raise errors.constness()


def _refuse() -> None:
    raise ValueError("this slot can only be read")
