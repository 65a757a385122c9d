"""Executable, Code and Primitive: functions as values."""

from __future__ import annotations

from urbihw.kernel import errors
from urbihw.kernel.compiler import print_node
from urbihw.kernel.runtime.code import Code, Executable
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import CallMessage
from urbihw.kernel.runtime.world import World
from urbihw.kernel.value import Value

EXECUTABLE = Table("Executable")
CODE = Table("Code")
PRIMITIVE = Table("Primitive")
TABLES = (EXECUTABLE, CODE, PRIMITIVE)
PROTOS = {"Code": ("Comparable", "Executable")}

NOTES = {
    "Executable": "A value that can be called.",
    "Code": "A function or closure written in urbiscript.",
    "Primitive": "A built-in function.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


@EXECUTABLE.primitive("asExecutable")
def as_executable(world: World, this: Value) -> Value:
    """Returns this value itself."""
    return this


def _with_target(args: list[Value]) -> list[Value]:
    if not args:
        raise errors.primitive("argument list must begin with `this'", "apply")
    return args


def _apply(world: World, this: Executable, args: list[Value]) -> Value:
    target, *rest = _with_target(args)
    return world.invoke(this, target, tuple(rest), "apply")


@CODE.primitive("apply")
def apply_code(
    world: World, this: Code, args: list, message: CallMessage | None = None  # type: ignore[type-arg]
) -> Value:
    """Call the function with the first member of the list as ``this`` and the others as arguments; ``message`` is its
    ``call`` (manual, release notes of 2.0 RC 2)."""
    if message is None or this.strict:
        return _apply(world, this, args)
    target, *rest = _with_target(args)
    return this.call_with(message, target, tuple(rest))


@PRIMITIVE.primitive("apply")
def apply_primitive(world: World, this: Executable, args: list) -> Value:  # type: ignore[type-arg]
    """Call the function with the first member of the list as ``this`` and the others as arguments."""
    return _apply(world, this, args)


@PRIMITIVE.primitive("asPrimitive")
def as_primitive(world: World, this: Value) -> Value:
    """Returns this value itself."""
    return this


def body_text(code: Code) -> str:
    """The body of a function, without its braces."""
    body = code.info.node.body.body
    return "" if body is None else print_node(body)


@CODE.primitive("asString")
def as_string(world: World, this: Value) -> str:
    """The source of the function, as the server formats it."""
    return print_node(this.info.node) if isinstance(this, Code) else "Code"


@CODE.primitive("bodyString")
def body_string(world: World, this: Code) -> str:
    """The source of the function's body, without braces."""
    return body_text(this)


@CODE.primitive("==")
def equal(world: World, this: Value, that: Value) -> bool:
    """Whether both have the same source and the same captured variables."""
    if this is that or not (isinstance(this, Code) and isinstance(that, Code)):
        return this is that
    if print_node(this.info.node) != print_node(that.info.node):
        return False
    return _captured(this) == _captured(that)


def _captured(code: Code) -> dict[str, int]:
    """The environment of a function: captured variables by identity, ``this`` by value because it is no variable."""
    names = code.fn.__code__.co_freevars
    cells = code.fn.__closure__ or ()
    found: dict[str, int] = {}
    for name, cell in zip(names, cells, strict=True):
        found[name] = id(cell.cell_contents) if name.startswith("this") else id(cell)
    return found
