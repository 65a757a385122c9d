"""Reading, calling, writing and declaring slots: the hot half of the runtime.

The verbs are closures over one world (``SlotOps``), so that a slot read is one Python call and a few dict look-ups.
``method`` finds the executable that a name means for a target; ``send0`` is a message without arguments; ``own_method``
and ``own_send0`` do the same for ``this``, where the target is not written; ``update_slot`` is ``target.name = value``
with copy on write; ``set_slot`` declares.
"""

from __future__ import annotations

from collections.abc import Callable
from math import fmod
from types import FunctionType
from typing import TYPE_CHECKING, Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.code import Code0, Code1, Code2, Executable, Getter, Primitive
from urbihw.kernel.runtime.object import Obj, Plain
from urbihw.kernel.runtime.slot import peek_meta
from urbihw.kernel.runtime.values import Container, List
from urbihw.kernel.runtime.watch import notify
from urbihw.kernel.value import Value

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

OPERATORS = frozenset(("+", "-", "*", "/", "%", "<", "<=", ">", ">=", "==", "!=", "++", "--", "!", "<<", "+="))
"""The operators that are not sent as messages to numbers, strings and lists, unless a program redefines one of them
there."""
LOGICAL = frozenset(("!", "&&", "||"))
"""The operators that compiled code does not send as messages, unless a program redefines one anywhere."""

SLOT_HOOKS = frozenset(("setSlot", "createSlot", "updateSlot"))
"""The messages that a declaration or an assignment of a slot stands for; they are sent only to objects whose program
has a function of this name."""

STRICT_NAMES = frozenset(("[]", "[]=", "new"))
"""Names that everybody uses and that a few functions of the library, which are lazy, have too.  Calls by such a name
are compiled for strict functions."""

CACHE_MISS = (KeyError, TypeError, IndexError, AttributeError)
"""The errors of reading the cache of the first prototype when there is no answer: no entry, no cache, no prototype, or
a number as prototype."""


BinaryVerb = Callable[[Any, Any], Any]
Find = Callable[[Any, str], Any]
"""Takes a target and a name, and returns the value that the name means for the target."""


def make_finders(world: World, ops: SlotOps) -> tuple[Find, Find, Find]:
    """``get_slot``; ``found``, which uses the ``fallback`` where there is no slot; and ``missed``, which does the same
    where the cache is known to have no answer.
    """
    recorder = world.recorder
    float_proto = world.float_proto

    def get_slot(target: Value, name: str) -> Value:
        """The value of a slot, not called; raises ``lookup failed``."""
        obj = world.peek_obj(target) if target.__class__ is float else target
        slots = obj.slots
        if name not in slots:
            holder = obj.find(name)
            if holder is None:
                if recorder.active is not None:
                    recorder.read(target, name)
                    recorder.called()  # a ``fallback``, if anything
                return obj.fallback_slot(name)
            slots = holder.slots
            if recorder.active is not None:
                ops.record(target, holder, name, slots[name])
        elif recorder.active is not None:
            ops.record(target, obj, name, slots[name])
        return slots[name]

    def found(target: Value, name: str) -> Value:
        """The value that a message finds: a slot of the target, an inherited slot, or the ``fallback``."""
        if recorder.active is None and target.__class__ is not float:
            try:
                return target.slots[name] if name in target.slots else target.protos[0].cache[name].slots[name]
            except CACHE_MISS:
                pass
        return missed(target, name)

    def missed(target: Value, name: str) -> Value:
        if target.__class__ is float and recorder.active is None and not world.float_slots:
            slots = float_proto.slots
            if name in slots:
                return slots[name]
        try:
            return get_slot(target, name)
        except errors.Raised:
            return ops.fallback(target, name)

    return get_slot, found, missed


def make_messages(world: World, missed: Find) -> tuple[Find, Find]:
    """``method`` and ``send0``, the verbs of generated code; the usual cases need no further Python call."""
    recorder = world.recorder

    def method(target: Value, name: str) -> Value:
        """The value of ``target.name`` as an executable, with ``strict`` and ``c0`` to ``cn``."""
        if recorder.active is None:
            try:
                slots = target.slots
                value = slots[name] if name in slots else target.protos[0].cache[name].slots[name]
            except CACHE_MISS:
                value = missed(target, name)
        else:
            value = missed(target, name)
        kind = value.__class__
        if kind is Code1 or kind is Code2 or kind is not float and value.runs:
            return value
        return Getter(world, value)

    def send0(target: Value, name: str) -> Value:
        """``target.name`` without arguments: the value, or the result of calling it."""
        if recorder.active is None:
            try:
                slots = target.slots
                value = slots[name] if name in slots else target.protos[0].cache[name].slots[name]
            except CACHE_MISS:
                value = missed(target, name)
        else:
            value = missed(target, name)
        kind = value.__class__
        if kind is Code0:
            fn = value.fn
            return fn(target)
        if kind is Plain or kind is float or not value.runs:
            return value
        if value.strict:
            return value.c0(target)
        return value.call_lazy(world.call_message(value, target, (), name))

    return method, send0


def with_own_code(function: Find) -> Find:
    """The same function with its own copy of the code.

    CPython specializes the instructions of a code object for the classes of the operands, and is slow again where these
    alternate.  The target of a message mostly has another class than ``this``.
    """
    assert isinstance(function, FunctionType)
    code = function.__code__.replace()
    return FunctionType(code, function.__globals__, function.__name__, None, function.__closure__)


def make_senders(world: World, found: Find) -> tuple[Callable[..., Any], Callable[[Any, str, Any], Any]]:
    """``send`` and ``send1``, messages from native code."""

    def send(target: Value, name: str, *args: Value) -> Value:
        """``target.name(args)`` with evaluated arguments, from native code."""
        return world.invoke(found(target, name), target, args, name)

    def send1(target: Value, name: str, argument: Value) -> Value:
        """``target.name(argument)`` with an evaluated argument: the usual operator."""
        value: Any = found(target, name)
        if value.__class__ is not float and value.runs and value.strict:
            return value.c1(target, argument)
        return world.invoke(value, target, (argument,), name)

    return send, send1


def make_operators(
    world: World, send1: Callable[[Any, str, Any], Any]
) -> tuple[BinaryVerb, BinaryVerb, BinaryVerb, BinaryVerb]:
    """``equal``, ``unequal``, ``push`` and ``remainder``, the operators of generated code that Python's operators
    cannot replace.
    """

    def equal(a: Value, b: Value) -> Any:
        """``a == b``: a Python bool for numbers, the result of ``'=='`` for others."""
        if a.__class__ is float and b.__class__ is float:
            return a == b
        if b is world.void:
            raise errors.unexpected_void()
        return send1(a, "==", b)

    def unequal(a: Value, b: Value) -> Any:
        """``a != b``."""
        if a.__class__ is float and b.__class__ is float:
            return a != b
        if b is world.void:
            raise errors.unexpected_void()
        return send1(a, "!=", b)

    def push(a: Value, b: Value) -> Any:
        """``a << b``."""
        if a.__class__ is List and a.protos is world.quick_lists:
            a.l.append(b)
            if a.meta is not None:
                a.touch()
            return a
        return send1(a, "<<", b)

    def remainder(a: Value, b: Value) -> Any:
        """``a % b``, of the sign of ``a``."""
        if a.__class__ is float and b.__class__ is float and b and a - a == 0 and not world.generic_floats:
            return fmod(a, b)
        return send1(a, "%", b)

    return equal, unequal, push, remainder


def make_update(world: World, ops: SlotOps) -> Callable[[Any, str, Any], Any]:
    """``update_slot``, the verb of ``target.name = value``."""
    void, protected, hooked = world.void, world.record.protected, ops.hooked

    def updates_plainly(target: Any) -> bool:
        """Whether the ``updateSlot`` of a target is that of Object, as far as the caches tell."""
        try:
            return "updateSlot" not in target.slots and target.protos[0].cache["updateSlot"] is world.object
        except CACHE_MISS:
            return False

    def update_slot(target: Value, name: str, value: Value) -> Value:
        """``target.name = value``; a local slot that is only a value is written at once, and the first write to a plain
        object copies the inherited slot.
        """
        if value is not void and target.__class__ is not float and target.meta is None and (
            "updateSlot" not in hooked or updates_plainly(target)
        ):
            slots = target.slots
            if name in slots:
                slots[name] = value
                return value
            if target.__class__ is Plain and target.cache is None and (value.__class__ is float or not value.runs):
                try:
                    holder = target.protos[0].cache[name]
                except CACHE_MISS:
                    pass
                else:
                    if holder.meta is None and name in holder.slots and name not in protected and name != "asBool":
                        slots[name] = value
                        return value
        return ops.update_other(target, name, value)

    return update_slot


class SlotOps:
    """The slot verbs of one world."""

    def __init__(self, world: World) -> None:
        self.world = world
        self._protected = world.record.protected
        self.hooked: set[str] = set()
        """Those of ``SLOT_HOOKS`` that an object of a program has as a function of its own."""
        self.get_slot, found, missed = make_finders(world, self)
        self.method, self.send0 = make_messages(world, missed)
        self.own_method, self.own_send0 = with_own_code(self.method), with_own_code(self.send0)
        self.send, self.send1 = make_senders(world, found)
        self.equal, self.unequal, self.push, self.remainder = make_operators(world, self.send1)
        self.update_slot = make_update(world, self)

    def fallback(self, target: Value, name: str) -> Value:
        """The answer to a message without a slot: the ``fallback`` slot, if there is one."""
        holder = self.world.peek_obj(target).find("fallback")
        if holder is None or target is self.world.void:
            raise  # called from an except clause: re-raises the look-up error
        return holder.slots["fallback"]

    def record(self, target: Value, holder: Obj, name: str, value: Value) -> None:
        """Record that a condition reads a slot of ``target`` that ``holder`` has, the variables of a function found
        there, and the content of a container.
        """
        recorder = self.world.recorder
        if isinstance(value, Executable):
            inner = value.peek()
            if inner is None:
                recorder.boxes(getattr(value, "fn", None))
                if target.__class__ is not float or not isinstance(value, Primitive):  # arithmetic reads no other place
                    recorder.called()
            value = inner
        number = value.__class__ is float
        if holder is not target:
            recorder.read(holder, name, number)
        recorder.read(target, name, number)
        if isinstance(target, Container):
            recorder.read(target, "")

    # ---------------------------------------------------------------- writing

    def update_other(self, target: Value, name: str, value: Value) -> Value:
        """``target.name = value`` in all but the usual case: an inherited slot, even a constant one, is copied to
        the target first, unless it is protected (module ``record``).

        Returns the value; raises ``lookup failed``, ``cannot modify const slot``, ``unexpected void``.
        """
        if value is self.world.void:
            raise errors.unexpected_void()
        obj = self.world.as_obj(target)
        hook = self.hook(obj, "updateSlot")
        if hook is not None:
            return self.world.invoke(hook, target, (self.world.string(name), value), "updateSlot")
        return self.update_plainly(obj, target, name, value)

    def hook(self, obj: Obj, name: str) -> Executable | None:
        """The function of a program that an object calls for a declaration or an assignment of a slot: its own
        ``setSlot``, ``createSlot`` or ``updateSlot``; None if it has only those of the library.
        """
        holder = obj.find(name) if name in self.hooked else None
        if holder is None or self.world.record.is_shared(holder):
            return None
        found = holder.slots[name]
        return found if isinstance(found, Executable) else None

    def update_plainly(self, obj: Obj, target: Value, name: str, value: Value) -> Value:
        """The library's ``updateSlot``."""
        if name in obj.slots:
            return self._write(obj, obj, name, value)
        if obj.assigns_to_members:
            return obj.distribute(value, lambda member, share: self.update_slot(member, name, share))
        holder = obj.find(name)
        if holder is None:
            return obj.fallback_slot(name)
        meta = peek_meta(holder, name)
        if meta is not None and (meta.accessor is not None or (meta.constant and name in self._protected)):
            return self._write(holder, target, name, value)
        self.put_slot(obj, name, value)
        return value

    def _write(self, holder: Obj, target: Value, name: str, value: Value) -> Value:
        meta = peek_meta(holder, name)
        if meta is None:
            self.put_slot(holder, name, value)
            return value
        if meta.constant:
            raise errors.constness()
        if meta.accessor is not None:
            return meta.accessor.write(target, value)
        holder.slots[name] = value
        self.announce(holder, name)
        return value

    def announce(self, holder: Obj, name: str) -> None:
        """Emit the changed event of a slot that was written, and update the conditions that read it."""
        meta = peek_meta(holder, name)
        if meta is not None:
            if meta.changed is not None:
                self.send(meta.changed, "emit")
            notify(meta, holder.slots.get(name))

    def put_slot(self, obj: Obj, name: str, value: Value) -> None:
        """Create or overwrite a local slot, without the checks and effects of an assignment.

        Raises an error for a protected slot (module ``record``).
        """
        if name in self._protected:
            self.world.record.guard(obj, name)
        if name not in obj.slots and obj.cache is not None:
            self.world.lookups.forget_slot(name)
        obj.slots[name] = value
        if name == "asBool":
            self.world.truth_redefined = True
        if isinstance(value, Executable):
            if name in LOGICAL or not value.strict:
                self.world.lazy_names.add(name)
            if name in OPERATORS:
                self.world.operator_redefined(obj)
            if name in SLOT_HOOKS:
                self.hooked.add(name)
        if obj.meta is not None:
            self.announce(obj, name)

    def set_slot(self, target: Value, name: str, value: Value) -> Value:
        """``var target.name = value``; raises ``slot redefinition``."""
        obj = self.world.as_obj(target)
        if obj is self.world.void:
            raise errors.unexpected_void()
        if name in obj.slots and not self.world.redefinition.is_on():
            raise errors.redefinition(name)
        self.put_slot(obj, name, value)
        return value

    def remove_slot(self, target: Value, name: str) -> None:
        """Remove a local slot if there is one; raises an error for a protected slot (module ``record``)."""
        obj = self.world.as_obj(target)
        if name not in obj.slots:
            return
        if name in self._protected:
            self.world.record.guard_removal(obj, name)
        del obj.slots[name]
        if obj.cache is not None:
            self.world.lookups.forget_slot(name)
        meta = None if obj.meta is None else obj.meta.pop(name, None)
        if meta is not None:
            notify(meta)
