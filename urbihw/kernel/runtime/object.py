"""Objects: slots, prototypes, and the order in which slots are looked up.

An object owns a dict of its local slots, name to value.  What is inherited is found through a *cache* kept by each
object that serves as a prototype: name to the ancestor that holds it (see ``lookup``).  A slot that is more than a
value (constant, watched, with properties, with an owner) has a ``SlotMeta`` beside it in ``meta``; objects without any
such slot have ``meta`` None, which is all that a plain write tests.

Floats are Python floats and are no ``Obj``: their prototype is ``World.float_proto``, and the rare slots hung on one
particular number live in ``World.float_slots``, keyed by identity.

Python operators are defined on ``Obj`` by sending the urbiscript operator, so that generated code can say ``a + b``
and CPython's own dispatch finds the right thing for numbers and for objects alike.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.backtrace import running_call
from urbihw.kernel.runtime.lookup import NOWHERE

if TYPE_CHECKING:
    from urbihw.kernel.runtime.slot import SlotMeta
    from urbihw.kernel.runtime.world import World


class Obj:
    """Any urbiscript object but a float."""

    __slots__ = ("__weakref__", "cache", "meta", "number", "protos", "slots", "world")
    runs = False
    """Whether a message that finds such a value in a slot calls it."""
    bounces = False
    """Whether an assignment to a slot it does not have goes to its members (a Group)."""
    heirs_alike = False
    """Whether only what is a Finalizable too may have it as a prototype."""
    of_connection = False
    """Whether it belongs to one connection, and not to the library that all share."""

    def __init__(self, world: World, protos: list[Obj]) -> None:
        self.world = world
        self.protos: list[Any] = protos
        self.slots: dict[str, Any] = {}
        self.cache: dict[str, Obj] | None = None
        self.meta: dict[str, SlotMeta] | None = None
        self.number = 0

    # ---------------------------------------------------------------- lookup

    def find(self, name: str) -> Obj | None:
        """The object that holds the slot ``name``, looking depth first from here, or None."""
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
        """What answers for a slot that was not found: raises ``lookup failed``."""
        raise errors.lookup_failed(name, self)

    def distribute(self, value: Any, action: Callable[[Any, Any], Any]) -> Any:
        """Call ``action(member, share)`` for all members; only for what ``bounces``.

        The shares are the members of ``value`` if it is a Group of as many, else each has all of it.
        """
        raise NotImplementedError

    # ---------------------------------------------------------------- structure

    def set_protos(self, protos: list[Any]) -> None:
        """Change the prototypes; raises an error if that would take from others what is owed to all."""
        if not self.heirs_alike and any(isinstance(proto, Obj) and proto.heirs_alike for proto in protos):
            raise errors.unfinalizable()
        before, known = self.protos, self.cache is not None
        self.protos = protos
        if known:
            self.world.flush()
        lost = self.world.record.lost()
        if lost:
            self.protos = before
            self.world.flush()
            raise errors.owed(lost)

    def clone(self) -> Obj:
        """A fresh object whose only prototype is this one; a value class copies its value."""
        return Plain(self.world, [self])

    # ---------------------------------------------------------------- Python's operators

    def _send1(self, name: str, other: Any) -> Any:
        return self.world.send1(self, name, other)

    def __add__(self, other: Any) -> Any:
        return self._send1("+", other)

    def __sub__(self, other: Any) -> Any:
        return self._send1("-", other)

    def __mul__(self, other: Any) -> Any:
        return self._send1("*", other)

    def __truediv__(self, other: Any) -> Any:
        return self._send1("/", other)

    def __iadd__(self, other: Any) -> Any:
        return self._send1("+=", other)

    def __isub__(self, other: Any) -> Any:
        return self._send1("-=", other)

    def __imul__(self, other: Any) -> Any:
        return self._send1("*=", other)

    def __itruediv__(self, other: Any) -> Any:
        return self._send1("/=", other)

    def __lt__(self, other: Any) -> Any:
        return self._compare("<", ">", other)

    def __le__(self, other: Any) -> Any:
        return self._compare("<=", ">=", other)

    def __gt__(self, other: Any) -> Any:
        return self._compare(">", "<", other)

    def __ge__(self, other: Any) -> Any:
        return self._compare(">=", "<=", other)

    def _compare(self, name: str, mirrored: str, other: Any) -> Any:
        """Python turns ``1 < x`` into ``x > 1`` when x is no number: then the program wanted a number here."""
        if other.__class__ is float and running_call() == mirrored:
            self._not_a_float(mirrored)
        return self._send1(name, other)

    def __neg__(self) -> Any:
        return self.world.send(self, "-")

    def __pos__(self) -> Any:
        return self.world.send(self, "+")

    def _not_a_float(self, operator: str) -> Any:
        raise self.world.type_error(1, self, "Float", operator)

    def __radd__(self, left: Any) -> Any:
        return self._not_a_float("+")

    def __rsub__(self, left: Any) -> Any:
        return self._not_a_float("-")

    def __rmul__(self, left: Any) -> Any:
        return self._not_a_float("*")

    def __rtruediv__(self, left: Any) -> Any:
        return self._not_a_float("/")

    def __bool__(self) -> bool:
        return True


class Plain(Obj):
    """An object that is nothing but its slots.

    The classes of values are its siblings and not its children: Python asks a child's operators first.
    """

    __slots__ = ()


class Void(Obj):
    """The one absence of a value: answers ``isVoid`` and little else, and may not be used where a value is needed."""

    __slots__ = ()

    def fallback_slot(self, name: str) -> Any:
        """Any other message is an error."""
        raise errors.unexpected_void()

    def _send1(self, name: str, other: Any) -> Any:
        raise errors.unexpected_void()

    def __neg__(self) -> Any:
        raise errors.unexpected_void()

    def __pos__(self) -> Any:
        raise errors.unexpected_void()

    def _not_a_float(self, operator: str) -> Any:
        raise errors.unexpected_void()

    def __bool__(self) -> bool:
        raise errors.unexpected_void()


class Truth(Obj):
    """``true`` and ``false``: not Python's bools, which are ints."""

    __slots__ = ("value",)

    def __init__(self, world: World, protos: list[Obj], value: bool) -> None:
        super().__init__(world, protos)
        self.value = value

    def __bool__(self) -> bool:
        return self.value


class Nil(Obj):
    """``nil``."""

    __slots__ = ()

    def __bool__(self) -> bool:
        return False
