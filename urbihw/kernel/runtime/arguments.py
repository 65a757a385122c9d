"""The checks of arguments, made from the annotated types of a native function's parameters.

========================  ==============================================================
``float``                 a Float
``int``                   a Float of integral value
``str``                   a String, given as a Python str
``bool``                  anything, given as its truth
``list``                  a List, given as its Python list
``Value``, ``object``     anything, as it is
``ValueOrText``           the same, but a literal is a Python str; for the first argument only
a class of the runtime    an object of that class, as it is
========================  ==============================================================

A wrong argument raises ``unexpected VALUE for argument N, expected a TYPE``.  The built-ins of the library use these
checks only; ``uobject.convert`` adds further types for device code.
"""

from __future__ import annotations

import builtins
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.values import FloatObject, List, String
from urbihw.kernel.value import Value, ValueOrText

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

Check = Callable[[Any, int | None], Any]
"""Takes an urbiscript value and the number of the argument (None for the target), and returns what the function
gets."""


class ArgumentChecks:
    """The checks of one world: ``of(type)``."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._known: dict[Any, Check | None] = {
            Any: None, object: None, float: self.to_float, int: self.to_int, str: self.to_str, bool: self.to_bool,
            list: self.to_list, ValueOrText: None,
        }  # fmt: skip

    def of(self, wanted: Any) -> Check | None:
        """The check for a type; None if anything will do."""
        if wanted not in self._known:
            self._known[wanted] = self._instance_of(wanted)
        return self._known[wanted]

    def _instance_of(self, wanted: type) -> Check:
        type_error = self._world.type_error
        name = wanted.__name__.removesuffix("Object")

        def check(value: Value, index: int | None) -> Value:
            if isinstance(value, wanted):
                return value
            raise type_error(index, value, name)

        return check

    def to_float(self, value: Value, index: int | None) -> float:
        """A Float as a Python float."""
        if value.__class__ is float:
            found: float = value
        elif isinstance(value, FloatObject):
            found = value.value
        else:
            raise self._world.type_error(index, value, "Float")
        return found

    def to_int(self, value: Value, index: int | None) -> int:
        """A Float of integral value as a Python int."""
        number = self.to_float(value, index)
        if not number.is_integer():
            raise errors.bad_number("BadInteger", f"expected integer, got {self._world.text(value)}", value)
        return int(number)

    def to_str(self, value: Value, index: int | None) -> str:
        """A String as a Python str; a literal may be one already (``Executable.takes_text``)."""
        if isinstance(value, String):
            return value.s
        if value.__class__ is str:
            literal: str = value
            return literal
        raise self._world.type_error(index, value, "String")

    def to_list(self, value: Value, index: int | None) -> list[Any]:
        """The Python list of a List."""
        if not isinstance(value, List):
            raise self._world.type_error(index, value, "List")
        return value.l

    def to_bool(self, value: Value, index: int | None) -> bool:
        """The truth of anything."""
        return bool(value)


def annotated_type(function: Callable[..., Any], name: str) -> Any:
    """The annotated type of a parameter, ``object`` if there is none; X for ``X | None`` and ``X[...]``.

    It is read off the text of the annotation, since resolving all annotations would double the start time of the
    library.  Raises NameError for a class that the module of the function does not have.
    """
    note = function.__annotations__.get(name, object)
    if not isinstance(note, str):
        return note
    known = note.removesuffix(" | None").partition("[")[0]
    if known in function.__globals__:
        return function.__globals__[known]
    if hasattr(builtins, known):
        return getattr(builtins, known)
    raise NameError(f"{function.__module__}.{function.__qualname__}: no class {known} for {name}")
