"""Values that own a Python value: strings, lists, tuples, dictionaries, derived floats, lazies, call messages."""

from __future__ import annotations

from collections.abc import Callable
from sys import getrefcount
from typing import TYPE_CHECKING, Any, Final

from urbihw.kernel import errors
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.watch import notify

if TYPE_CHECKING:
    from urbihw.kernel.runtime.code import Executable
    from urbihw.kernel.runtime.world import World


MOST_CHARACTERS: Final = 64 * 1024 * 1024
"""How long a String may become, and how much is read of a file at once: a few that double would take all memory."""
MOST_MEMBERS: Final = 10_000_000
"""How long a List may be that is made at once, as by ``+``; one that grows by single members has no bound."""


def too_long(what: str, most: int) -> errors.Raised:
    """What is thrown instead of making something so large."""
    return errors.bad_number("BadNumber", f"expected a result of at most {most} {what}")


class Container(Obj):
    """An object whose content conditions may watch."""

    __slots__ = ()

    def touch(self) -> None:
        """The content changed: tell the conditions that read it.  Call after every mutation."""
        if self.meta is not None:
            meta = self.meta.get("")
            if meta is not None:
                notify(meta)


class String(Container):
    """A mutable string; ``s`` holds one character per byte."""

    __slots__ = ("s",)

    def __init__(self, world: World, protos: list[Obj], s: str) -> None:
        """Raises BadNumber for one that is too long."""
        if len(s) > MOST_CHARACTERS:
            raise too_long("characters", MOST_CHARACTERS)
        self.world = world
        self.protos = protos
        self.slots = {}
        self.cache = None
        self.meta = None
        self.number = 0
        self.s = s

    def __add__(self, other: Any) -> Any:
        if other.__class__ is String and self.protos is other.protos is self.world.quick_strings:
            return String(self.world, self.protos, self.s + other.s)
        return self._send1("+", other)

    def __iadd__(self, other: Any) -> Any:
        if other.__class__ is String and self.protos is other.protos is self.world.quick_strings:
            if getrefcount(self) == ALONE_ADDING and not self.slots and self.meta is None and self is not other:
                return self.grow(other.s)
            return String(self.world, self.protos, self.s + other.s)
        return self._send1("+=", other)

    def grow(self, text: str) -> String:
        """Append in place, for one that nobody but a local variable holds: then it is as good as a fresh string, and
        adding to it again and again costs what is added and not the whole each time, as with Python's own strings."""
        if len(self.s) + len(text) > MOST_CHARACTERS:
            raise too_long("characters", MOST_CHARACTERS)
        s, self.s = self.s, ""  # CPython appends in place to what one variable alone holds
        s += text
        self.s = s
        return self

    def clone(self) -> String:
        """A fresh string with the same content."""
        return String(self.world, [self], self.s)

    def __bool__(self) -> bool:
        return bool(self.s)


class _Counted(String):
    """Tells how many references there are to a string that one local variable holds, seen from an operator."""

    __slots__ = ("count",)

    def __init__(self) -> None:
        self.count = 0

    def __iadd__(self, other: Any) -> Any:
        self.count = getrefcount(self)
        return self


def _counted_adding() -> int:
    counted = _Counted()
    counted += None
    return counted.count


ALONE_ADDING: Final = _counted_adding()
"""The references to a string within ``+=`` when one local variable holds it: fewer there cannot be."""


class List(Container):
    """A list; ``l`` holds the values."""

    __slots__ = ("l",)

    def __init__(self, world: World, protos: list[Obj], values: list[Any]) -> None:
        super().__init__(world, protos)
        self.l = values

    def clone(self) -> List:
        """A fresh list with the same members."""
        return List(self.world, [self], list(self.l))

    def __bool__(self) -> bool:
        return bool(self.l)


class ProtoList(List):
    """The prototypes of a value as a list: whoever changes the list changes the prototypes."""

    __slots__ = ("_known", "_members", "owner")

    def __init__(self, world: World, protos: list[Obj], owner: Any) -> None:
        self.owner = owner
        self._known: list[Any] | None = None
        super().__init__(world, protos, [])
        self.meta = {}  # so that every change is told of by touch

    @property
    def l(self) -> list[Any]:  # noqa: E743
        """The prototypes at present."""
        now = self.world.protos_of(self.owner)
        if now is not self._known:
            self._known, self._members = now, list(now)
        return self._members

    @l.setter
    def l(self, members: list[Any]) -> None:  # noqa: E743
        self._members = members

    def touch(self) -> None:
        """The members were changed: they become the prototypes.  Raises the errors of ``Obj.set_protos``."""
        owner = self.world.as_obj(self.owner)
        self._known = None
        owner.set_protos(list(self._members))
        self._known = owner.protos
        super().touch()


class Tuple(Container):
    """A tuple; ``l`` holds the values."""

    __slots__ = ("l",)

    def __init__(self, world: World, protos: list[Obj], values: list[Any]) -> None:
        super().__init__(world, protos)
        self.l = values

    def clone(self) -> Tuple:
        """A fresh tuple with the same members."""
        return Tuple(self.world, [self], list(self.l))


class Dictionary(Container):
    """A dictionary from strings to values; ``d`` holds it, iteration is in the order of the keys."""

    __slots__ = ("d",)

    def __init__(self, world: World, protos: list[Obj], values: dict[str, Any]) -> None:
        super().__init__(world, protos)
        self.d = values

    def clone(self) -> Dictionary:
        """A fresh dictionary with the same content."""
        return Dictionary(self.world, [self], dict(self.d))

    def __bool__(self) -> bool:
        return bool(self.d)


class FloatObject(Obj):
    """A number that is an object: Float itself (worth 0) and what derives from it; ``value`` is the number."""

    __slots__ = ("value",)

    def __init__(self, world: World, protos: list[Any], value: float) -> None:
        super().__init__(world, protos)
        self.value = value

    def clone(self) -> FloatObject:
        """A fresh object of the same worth."""
        return FloatObject(self.world, [self], self.value)

    def __bool__(self) -> bool:
        return bool(self.value)

    def _compare(self, name: str, mirrored: str, other: Any) -> Any:
        return self.world.send(self, name, other)

    def __radd__(self, left: Any) -> Any:
        return left + self.value

    def __rsub__(self, left: Any) -> Any:
        return left - self.value

    def __rmul__(self, left: Any) -> Any:
        return left * self.value

    def __rtruediv__(self, left: Any) -> Any:
        return left / self.value


class Lazy(Obj):
    """A value not yet computed: ``thunk`` computes it, ``node`` is its syntax (None if native code made it)."""

    __slots__ = ("cached", "code", "keep", "node", "thunk")

    def __init__(self, world: World, thunk: Callable[[], Any], node: Any, code: Executable | None = None) -> None:
        super().__init__(world, [world.lazy_proto])
        self.thunk = thunk
        self.node = node
        self.code = code
        self.cached: Any = None
        self.keep = False

    def force(self) -> Any:
        """Compute the value, each time anew unless it is to be kept."""
        if self.keep:
            if self.cached is None:
                self.cached = self.thunk()
            return self.cached
        return self.thunk()

    def memoize(self) -> None:
        """Compute the value once at most from now on."""
        self.keep = True


class CallMessage(Obj):
    """How a function was called: who, on what, by which name, with which unevaluated arguments."""

    __slots__ = ("args", "code", "message", "sender", "target")
    FIELDS = ("code", "target", "message", "sender", "args")

    def __init__(
        self, world: World, code: Any, target: Any, message: str, sender: Any, args: list[Lazy]
    ) -> None:
        super().__init__(world, [world.call_message_proto])
        self.code = code
        self.target = target
        self.message = message
        self.sender = sender
        self.args = args

    def find(self, name: str) -> Obj | None:
        """The holder of a slot; what is known of the call becomes slots when somebody asks for one of them."""
        if name in self.FIELDS and name not in self.slots:
            world = self.world
            values = (self.code, self.target, world.string(self.message), self.sender, world.new_list([*self.args]))
            for field, value in zip(self.FIELDS, values, strict=True):
                self.slots.setdefault(field, value)
        return super().find(name)

    def eval_at(self, index: int) -> Any:
        """Evaluate the argument at ``index``; it may be void."""
        if not 0 <= index < len(self.args):
            raise errors.primitive(f"invalid index: {index}", "evalArgAt")
        return self.args[index].force()
