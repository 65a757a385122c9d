"""Values that own a Python value: strings, lists, tuples, dictionaries, derived floats, lazies, call messages."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from sys import getrefcount
from typing import TYPE_CHECKING, Any, Final

from urbihw.kernel import errors
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.watch import notify
from urbihw.kernel.value import Value

if TYPE_CHECKING:
    from urbihw.kernel.runtime.code import Executable
    from urbihw.kernel.runtime.world import World


MAX_STRING_LENGTH: Final = 64 * 1024 * 1024
"""Maximum length of a String, and of a file that is read at once: repeated doubling would use up the memory."""
MAX_LIST_LENGTH: Final = 10_000_000
"""Maximum length of a List that is made in one operation such as ``+``; a List that grows by single members has no
limit."""


def too_long(what: str, most: int) -> errors.Raised:
    """The error for a value that would be too large."""
    return errors.bad_number("BadNumber", f"expected a result of at most {most} {what}")


class Container(Obj):
    """An object with a content that conditions may watch."""

    __slots__ = ()

    def touch(self) -> None:
        """Update the conditions that have read the content.  Must be called after each change."""
        if self.meta is not None:
            meta = self.meta.get("")
            if meta is not None:
                notify(meta)


class String(Container):
    """A mutable string; ``s`` holds one character per byte."""

    __slots__ = ("s",)

    def __init__(self, world: World, protos: list[Obj], s: str) -> None:
        """Raises BadNumber if the string is too long."""
        if len(s) > MAX_STRING_LENGTH:
            raise too_long("characters", MAX_STRING_LENGTH)
        self.world = world
        self.protos = protos
        self.slots = {}
        self.cache = None
        self.meta = None
        self.number = 0
        self.s = s

    def __add__(self, other: Value) -> Any:
        if other.__class__ is String and self.protos is other.protos is self.world.quick_strings:
            return String(self.world, self.protos, self.s + other.s)
        return self._send1("+", other)

    def __iadd__(self, other: Value) -> Any:
        if other.__class__ is String and self.protos is other.protos is self.world.quick_strings:
            if getrefcount(self) == SOLE_OPERAND_REFS and not self.slots and self.meta is None and self is not other:
                return self.grow(other.s)
            return String(self.world, self.protos, self.s + other.s)
        return self._send1("+=", other)

    def grow(self, text: str) -> String:
        """Append in place, for a string that only a local variable refers to, where the difference to a new string is
        not visible. So repeated appending costs the added text and not the whole text, as with Python's strings.
        """
        if len(self.s) + len(text) > MAX_STRING_LENGTH:
            raise too_long("characters", MAX_STRING_LENGTH)
        s, self.s = self.s, ""  # CPython appends in place to a string with a single reference
        s += text
        self.s = s
        return self

    def clone(self) -> String:
        """A new string with the same content."""
        return String(self.world, [self], self.s)

    def default_truth(self) -> bool:
        """Whether it is not empty."""
        return bool(self.s)


class _Counted(String):
    """Counts the references to a string of one local variable, seen from inside an operator."""

    __slots__ = ("count",)

    def __init__(self) -> None:
        self.count = 0

    def __iadd__(self, other: Value) -> Any:
        self.count = getrefcount(self)
        return self


def _counted_adding() -> int:
    counted = _Counted()
    counted += None
    return counted.count


SOLE_OPERAND_REFS: Final = _counted_adding()
"""The number of references to a string inside ``+=`` when only one local variable refers to it: the minimum."""


class List(Container):
    """A list; ``l`` holds the values."""

    __slots__ = ("l",)

    def __init__(self, world: World, protos: list[Obj], values: list[Value]) -> None:
        super().__init__(world, protos)
        self.l = values

    def clone(self) -> List:
        """A new list with the same members."""
        return List(self.world, [self], list(self.l))

    def default_truth(self) -> bool:
        """Whether it is not empty."""
        return bool(self.l)


texts_in: Final[Callable[[TextList], list[str]]] = List.__dict__["l"].__get__
"""The members of a TextList, as Python texts."""
_set_members: Final = List.__dict__["l"].__set__


class TextList(List):
    """The parts of a String as a list.  It holds Python texts until its members are read, and then becomes a List of
    Strings: words that are only joined again never become objects.
    """

    __slots__ = ()

    @property
    def l(self) -> list[Any]:  # noqa: E743
        """The members, which are made now."""
        made = list(map(self.world.string, texts_in(self)))
        self.l = made
        return made

    @l.setter
    def l(self, members: list[Value]) -> None:  # noqa: E743
        self.__class__ = List  # type: ignore[assignment]
        _set_members(self, members)

    def default_truth(self) -> bool:
        """Whether it is not empty."""
        return bool(texts_in(self))


class ProtoList(List):
    """The prototypes of a value as a list: changing the list changes the prototypes."""

    __slots__ = ("_known", "_members", "owner")

    def __init__(self, world: World, protos: list[Obj], owner: Any) -> None:
        self.owner = owner
        self._known: list[Any] | None = None
        super().__init__(world, protos, [])
        self.meta = {}  # so that every change calls touch

    @property
    def l(self) -> list[Any]:  # noqa: E743
        """The prototypes that the object has at present."""
        now = self.world.protos_of(self.owner)
        if now is not self._known:
            self._known, self._members = now, list(now)
        return self._members

    @l.setter
    def l(self, members: list[Value]) -> None:  # noqa: E743
        self._members = members

    def touch(self) -> None:
        """Make the changed members the prototypes.  Raises the errors of ``Obj.set_protos``."""
        owner = self.world.as_obj(self.owner)
        self._known = None
        owner.set_protos(list(self._members))
        self._known = owner.protos
        super().touch()


class Tuple(Container):
    """A tuple; ``l`` holds the values."""

    __slots__ = ("l",)

    def __init__(self, world: World, protos: list[Obj], values: list[Value]) -> None:
        super().__init__(world, protos)
        self.l = values

    def clone(self) -> Tuple:
        """A new tuple with the same members."""
        return Tuple(self.world, [self], list(self.l))


class Dictionary(Container):
    """A dictionary from strings to values; ``d`` holds it, iteration is in the order of the keys."""

    __slots__ = ("d",)

    def __init__(self, world: World, protos: list[Obj], values: dict[str, Value]) -> None:
        super().__init__(world, protos)
        self.d = values

    def clone(self) -> Dictionary:
        """A new dictionary with the same content."""
        return Dictionary(self.world, [self], dict(self.d))

    def default_truth(self) -> bool:
        """Whether it is not empty."""
        return bool(self.d)


class FloatObject(Obj):
    """A number that is an object: Float itself (with the value 0) and objects that derive from it."""

    __slots__ = ("value",)

    def __init__(self, world: World, protos: list[Value], value: float) -> None:
        super().__init__(world, protos)
        self.value = value

    def clone(self) -> FloatObject:
        """A new object with the same value."""
        return FloatObject(self.world, [self], self.value)

    def default_truth(self) -> bool:
        """Whether it is not zero."""
        return bool(self.value)

    def _compare(self, name: str, mirrored: str, other: Value) -> Any:
        return self.world.send(self, name, other)

    def __radd__(self, left: Value) -> Any:
        return left + self.value

    def __rsub__(self, left: Value) -> Any:
        return left - self.value

    def __rmul__(self, left: Value) -> Any:
        return left * self.value

    def __rtruediv__(self, left: Value) -> Any:
        return left / self.value


class Lazy(Obj):
    """An unevaluated value: ``thunk`` computes it."""

    __slots__ = ("_index", "_nodes", "cached", "code", "keep", "thunk")

    def __init__(
        self,
        world: World,
        thunk: Callable[[], Any],
        nodes: Sequence[Any] = (None,),
        index: int = 0,
        code: Executable | None = None,
    ) -> None:
        """``nodes[index]`` is the syntax, which is looked up when it is needed; None if native code made the value."""
        super().__init__(world, [world.lazy_proto])
        self.thunk = thunk
        self._nodes = nodes
        self._index = index
        self.code = code
        self.cached: Any = None
        self.keep = False

    @property
    def node(self) -> Any:
        """The syntax; None if native code made the value."""
        return self._nodes[self._index]

    def force(self) -> Any:
        """Compute the value, again at each call unless ``memoize`` was called."""
        if self.keep:
            if self.cached is None:
                self.cached = self.thunk()
            return self.cached
        return self.thunk()

    def memoize(self) -> None:
        """From now on, compute the value once at most."""
        self.keep = True


class CallMessage(Obj):
    """A call message: the sender, the target, the name and the unevaluated arguments of a call."""

    __slots__ = ("args", "code", "message", "sender", "target")
    FIELDS = ("code", "target", "message", "sender", "args")

    def __init__(
        self, world: World, code: Value, target: Value, message: str, sender: Value, args: list[Lazy]
    ) -> None:
        super().__init__(world, [world.call_message_proto])
        self.code = code
        self.target = target
        self.message = message
        self.sender = sender
        self.args = args

    def find(self, name: str) -> Obj | None:
        """The holder of a slot; the parts of the message become slots when one of them is looked up."""
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


# ---------------------------------------------------------------- makers of the frequent values
# They do what ``__init__`` does in three quarters of the time: a call of a Python class goes through C and back.


def string_maker(world: World, protos: list[Any]) -> Callable[[str], String]:
    """The function that makes the Strings of a world."""
    new, most = String.__new__, MAX_STRING_LENGTH

    def string(s: str) -> String:
        """A String; characters beyond latin-1 become their UTF-8 bytes."""
        if len(s) > most:
            raise too_long("characters", most)
        made = new(String)
        made.world = world
        made.protos = protos
        made.slots = {}
        made.cache = made.meta = None
        made.number = 0
        made.s = s
        return made

    return string


def list_maker(world: World, protos: list[Any]) -> Callable[[list[Value]], List]:
    """The function that makes the Lists of a world, apart from large ones."""
    new = List.__new__

    def new_list(values: list[Value]) -> List:
        """A List that owns ``values``."""
        made = new(List)
        made.world = world
        made.protos = protos
        made.slots = {}
        made.cache = made.meta = None
        made.number = 0
        made.l = values
        return made

    return new_list
