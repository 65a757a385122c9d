"""Executable, Code and Primitive: what can be called, as values."""

from __future__ import annotations

from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.compiler import print_node
from urbihw.kernel.runtime.code import Code, Executable
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World

EXECUTABLE = Table("Executable")
CODE = Table("Code")
PRIMITIVE = Table("Primitive")
TABLES = (EXECUTABLE, CODE, PRIMITIVE)
PROTOS = {"Code": ("Comparable", "Executable")}

NOTES = {
    "Executable": "What can be called.",
    "Code": "Functions and closures written in urbiscript.",
    "Primitive": "Functions that are built in.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


@EXECUTABLE.primitive("asExecutable")
def as_executable(world: World, this: Any) -> Any:
    """This."""
    return this


def _apply(world: World, this: Executable, args: list[Any]) -> Any:
    if not args:
        raise errors.primitive("argument list must begin with `this'", "apply")
    target, *rest = args
    return world.invoke(this, target, tuple(rest), "apply")


@CODE.primitive("apply")
def apply_code(world: World, this: Executable, args: list) -> Any:  # type: ignore[type-arg]
    """Call with the first member of the list as ``this`` and the others as arguments."""
    return _apply(world, this, args)


@PRIMITIVE.primitive("apply")
def apply_primitive(world: World, this: Executable, args: list) -> Any:  # type: ignore[type-arg]
    """Call with the first member of the list as ``this`` and the others as arguments."""
    return _apply(world, this, args)


@PRIMITIVE.primitive("asPrimitive")
def as_primitive(world: World, this: Any) -> Any:
    """This."""
    return this


def body_text(code: Code) -> str:
    """The body of a function, without its braces."""
    body = code.info.node.body.body
    return "" if body is None else print_node(body)


@CODE.primitive("asString")
def as_string(world: World, this: Any) -> str:
    """The source, as the server writes it."""
    return print_node(this.info.node) if isinstance(this, Code) else "Code"


@CODE.primitive("bodyString")
def body_string(world: World, this: Code) -> str:
    """The source of the body, without braces."""
    return body_text(this)


@CODE.primitive("==")
def equal(world: World, this: Any, that: Any) -> bool:
    """Whether both have the same source and the same captured variables."""
    if this is that or not (isinstance(this, Code) and isinstance(that, Code)):
        return this is that
    if print_node(this.info.node) != print_node(that.info.node):
        return False
    return _captured(this) == _captured(that)


def _captured(code: Code) -> dict[str, int]:
    """What a function closed over: variables by identity; ``this``, which is nobody's variable, by value."""
    names = code.fn.__code__.co_freevars
    cells = code.fn.__closure__ or ()
    found: dict[str, int] = {}
    for name, cell in zip(names, cells, strict=True):
        found[name] = id(cell.cell_contents) if name.startswith("this") else id(cell)
    return found
