"""Objects: slots, prototypes, and the order in which slots are looked up.

An object owns a dict of its local slots, name to value.  What is inherited is found through a *cache* kept by each
object that serves as a prototype: name to the ancestor that holds it (see ``lookup``).  A slot that is more than a
value (constant, watched, with properties or an accessor) has a ``SlotMeta`` in ``meta``; objects without such a slot
have ``meta`` None, so that a plain write needs only that one test.

Floats are Python floats and are no ``Obj``: their prototype is ``World.float_proto``.  The rare slots of a single
number are in ``World.float_slots``, by identity.

Python operators are defined on ``Obj`` by sending the urbiscript operator, so that generated code can use ``a + b`` for
numbers and objects, and CPython dispatches it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.backtrace import running_call
from urbihw.kernel.runtime.lookup import NOWHERE
from urbihw.kernel.value import Value

if TYPE_CHECKING:
    from urbihw.kernel.runtime.slot import SlotMeta
    from urbihw.kernel.runtime.world import World


class Obj:
    """Any urbiscript object except a Float."""

    __slots__ = ("__weakref__", "cache", "meta", "number", "protos", "slots", "world")
    runs = False
    """Whether a message that finds this object in a slot calls it."""
    assigns_to_members = False
    """Whether an assignment to a slot that the object does not have goes to its members (a Group)."""
    requires_finalizable_heirs = False
    """Whether only Finalizable objects may have this object as a prototype."""
    is_per_connection = False
    """Whether the object belongs to one connection, and not to the shared library."""
    describes_heirs = False
    """Whether what it says of a slot, such as the unit, holds for the slots of that name of its heirs, too."""

    def __init__(self, world: World, protos: list[Obj]) -> None:
        self.world = world
        self.protos: list[Any] = protos
        self.slots: dict[str, Any] = {}
        self.cache: dict[str, Obj] | None = None
        self.meta: dict[str, SlotMeta] | None = None
        self.number = 0

    # ---------------------------------------------------------------- lookup

    def find(self, name: str) -> Obj | None:
        """The object that holds the slot ``name`` (this object or an ancestor, depth first), or None."""
        if name in self.slots:
            return self
        protos = self.protos
        if not protos:
            return None
        world = self.world
        first = protos[0] if protos[0].__class__ is not float else world.peek_obj(protos[0])
        found: Obj | None = None if first.cache is None else first.cache.get(name)
        if found is None or (found is not NOWHERE and name not in found.slots):
            found = world.lookups.search(first, name)
        if found is NOWHERE and len(protos) > 1:
            found = None if self.cache is None else self.cache.get(name)
            if found is None or (found is not NOWHERE and name not in found.slots):
                found = world.lookups.search(self, name)
        return None if found is NOWHERE else found

    def fallback_slot(self, name: str) -> Any:
        """The value of a slot that was not found: raises ``lookup failed``."""
        raise errors.lookup_failed(name, self)

    def distribute(self, value: Value, action: Callable[[Any, Any], Any]) -> Value:
        """Call ``action(member, share)`` for all members; only if ``assigns_to_members``.

        The shares are the members of ``value`` if it is a Group of the same size; else each share is ``value``.
        """
        raise NotImplementedError

    # ---------------------------------------------------------------- structure

    def set_protos(self, protos: list[Value]) -> None:
        """Change the prototypes; raises an error if that would hide a protected slot."""
        if not self.requires_finalizable_heirs and any(
            isinstance(proto, Obj) and proto.requires_finalizable_heirs for proto in protos
        ):
            raise errors.unfinalizable()
        before, known = self.protos, self.cache is not None
        self.protos = protos
        if known:
            self.world.flush()
        lost = self.world.record.lost()
        if lost:
            self.protos = before
            self.world.flush()
            raise errors.protected_slot(lost)

    def clone(self) -> Obj:
        """A new object whose only prototype is this one; a value class copies its value."""
        made = object.__new__(Plain)  # a call of the class would go through C and back, see ``values``
        made.world = self.world
        made.protos = [self]
        made.slots = {}
        made.cache = made.meta = None
        made.number = 0
        return made

    # ---------------------------------------------------------------- Python's operators

    def _send1(self, name: str, other: Value) -> Any:
        return self.world.send1(self, name, other)

    def __add__(self, other: Value) -> Any:
        return self._send1("+", other)

    def __sub__(self, other: Value) -> Any:
        return self._send1("-", other)

    def __mul__(self, other: Value) -> Any:
        return self._send1("*", other)

    def __truediv__(self, other: Value) -> Any:
        return self._send1("/", other)

    def __iadd__(self, other: Value) -> Any:
        return self._send1("+=", other)

    def __isub__(self, other: Value) -> Any:
        return self._send1("-=", other)

    def __imul__(self, other: Value) -> Any:
        return self._send1("*=", other)

    def __itruediv__(self, other: Value) -> Any:
        return self._send1("/=", other)

    def __lt__(self, other: Value) -> Any:
        return self._compare("<", ">", other)

    def __le__(self, other: Value) -> Any:
        return self._compare("<=", ">=", other)

    def __gt__(self, other: Value) -> Any:
        return self._compare(">", "<", other)

    def __ge__(self, other: Value) -> Any:
        return self._compare(">=", "<=", other)

    def _compare(self, name: str, mirrored: str, other: Value) -> Any:
        """Compare.  Python turns ``1 < x`` into ``x > 1`` when x is no number; the error then is that of ``1 < x``."""
        if other.__class__ is float and running_call() == mirrored:
            return self.after_number(other, mirrored)
        return self._send1(name, other)

    def __neg__(self) -> Any:
        return self.world.send(self, "-")

    def __pos__(self) -> Any:
        return self.world.send(self, "+")

    def after_number(self, left: Value, operator: str) -> Any:
        """``left operator this`` for a number ``left``; raises the type error of the number's operator."""
        raise self.world.type_error(1, self, "Float", operator)

    def __radd__(self, left: Value) -> Any:
        return self.after_number(left, "+")

    def __rsub__(self, left: Value) -> Any:
        return self.after_number(left, "-")

    def __rmul__(self, left: Value) -> Any:
        return self.after_number(left, "*")

    def __rtruediv__(self, left: Value) -> Any:
        return self.after_number(left, "/")

    def default_truth(self) -> bool:
        """Whether the object counts as true, unless a program defines ``asBool`` for it."""
        return True

    def __bool__(self) -> bool:
        world = self.world
        return world.truth_of(self) if world.truth_redefined else self.default_truth()


class Plain(Obj):
    """An object without a value of its own.

    The classes of values do not derive from it, because Python would call the operators of a derived class first.
    """

    __slots__ = ()


class Void(Obj):
    """The absence of a value: it answers ``isVoid`` and few other messages, and is an error where a value is needed."""

    __slots__ = ()

    def fallback_slot(self, name: str) -> Any:
        """Any other message is an error."""
        raise errors.unexpected_void()

    def _send1(self, name: str, other: Value) -> Any:
        raise errors.unexpected_void()

    def __neg__(self) -> Any:
        raise errors.unexpected_void()

    def __pos__(self) -> Any:
        raise errors.unexpected_void()

    def after_number(self, left: Value, operator: str) -> Any:
        """Void is no operand."""
        raise errors.unexpected_void()

    def default_truth(self) -> bool:
        """Void is neither true nor false."""
        raise errors.unexpected_void()

    __bool__ = default_truth


class Truth(Obj):
    """``true`` and ``false``: not Python's bools, which are ints."""

    __slots__ = ("value",)

    def __init__(self, world: World, protos: list[Obj], value: bool) -> None:
        super().__init__(world, protos)
        self.value = value

    def default_truth(self) -> bool:
        """The truth value itself; conditions do not call ``asBool`` of true and false."""
        return self.value

    __bool__ = default_truth


class Nil(Obj):
    """``nil``."""

    __slots__ = ()

    def default_truth(self) -> bool:
        """nil counts as false; conditions do not call its ``asBool``."""
        return False

    __bool__ = default_truth
