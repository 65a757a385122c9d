"""Frozen dataclasses that cost a start little: ``@frozen`` for ``@dataclass(frozen=True)``.

A program of urbihw makes about 150 such classes when it starts.  ``dataclasses`` compiles five to eight methods for
each of them, which was a sixth of the processor time of the start; here they share all but ``__init__``.  They are
dataclasses for ``fields``, ``replace``, ``asdict`` and ``match``.  They are frozen for the type checker only: an
assignment to a field is an error of ``make types``, not of the running program.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from operator import attrgetter
from typing import Any, TypeVar, dataclass_transform, overload

T = TypeVar("T")


@overload
def frozen(kind: type[T]) -> type[T]: ...


@overload
def frozen(*, slots: bool = True, eq: bool = True) -> Callable[[type[T]], type[T]]: ...


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def frozen(kind: Any = None, *, slots: bool = True, eq: bool = True) -> Any:
    """Make a class a dataclass whose objects do not change after they are made.

    Objects of one class are equal, and have one hash, if their fields are; fields with ``compare=False`` do not count.
    With ``eq=False`` each object is equal to itself only.  Without ``slots`` objects have a ``__dict__``, as
    ``cached_property`` needs, and may be referred to weakly.  What the body of the class defines itself is kept.
    """

    def make(kind: type) -> type:
        own = vars(kind)
        made: type[Any] = dataclass(slots=slots, eq=False, repr=False)(kind)
        methods: dict[str, Any] = {"__repr__": _shown}
        if eq:
            methods |= _comparison([each.name for each in fields(made) if each.compare])
        for name, method in methods.items():
            if own.get(name) is None:  # a class with an __eq__ of its own has a __hash__ of None
                setattr(made, name, method)
        return made

    return make if kind is None else make(kind)


def _comparison(names: list[str]) -> dict[str, Any]:
    # A single value would be compared by itself, and a tuple compares as dataclasses do: nan is equal to itself.
    content = attrgetter(*names, *names[:1]) if names else _nothing

    def equal(self: object, other: object) -> bool:
        return content(self) == content(other) if other.__class__ is self.__class__ else NotImplemented

    def hashed(self: object) -> int:
        return hash(content(self))

    return {"__eq__": equal, "__hash__": hashed}


def _nothing(_value: object) -> tuple[()]:
    return ()


def _shown(self: Any) -> str:
    content = ", ".join(f"{each.name}={getattr(self, each.name)!r}" for each in fields(self) if each.repr)
    return f"{type(self).__qualname__}({content})"
