"""Exception, its kinds, and Traceable.

The kernel's own errors are built by ``World`` from ``errors.Raised``; the constructors here are those of the manual,
for programs that make exceptions themselves.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.float import integer
from urbihw.kernel.stdlib.support import field
from urbihw.kernel.value import Value

ROOT = Table("Exception")
TABLES = [ROOT]
PROTOS: dict[str, tuple[str, ...]] = {"Exception": ("Object", "Traceable")}

NOTES = {
    "Exception": "An error that is thrown; the kinds of errors are its slots.",
    "Traceable": "An object that contains the call stack of its creation.",
    "Traceable.hideSystemFiles": "Whether backtraces omit the functions of the library; initially true.",
    "Exception.backtrace": "The call stack at the throw, as StackFrames.",
    "Exception.location": "The Location of the throw.",
    "Exception.message": "The error message.",
    "Exception.routine": "The name of the function that failed, void if it is unknown.",
    "Traceable.backtrace": "The call stack, as StackFrames.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


def _kind(name: str, parent: str = "") -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The constructor of a kind of Exception that derives from Exception or from ``parent``."""
    table = Table(f"Exception.{name}")
    TABLES.append(table)
    PROTOS[table.proto] = (f"Exception.{parent}" if parent else "Exception",)
    return table.primitive("init")


@ROOT.primitive("init")
def init(world: World, this: Obj, message: Value) -> None:
    """Make an exception with this message."""
    this.slots["message"] = message


@ROOT.primitive("asString")
def as_string(world: World, this: Value) -> str:
    """``place: routine: message``; the place is known once it has been thrown."""
    if this is world.exception_proto or "message" not in world.as_obj(this).slots:
        return _full_name(world, this, world.type_name(this))
    return world.located_exception_text(this)


@ROOT.primitive("asPrintable")
def as_printable(world: World, this: Value) -> str:
    """``Exception.Kind `asString'``."""
    name = _full_name(world, this, world.type_name(this))
    if this is world.exception_proto or "message" not in world.as_obj(this).slots:
        return name
    return f"{name} `{world.text(this)}'"


def _full_name(world: World, this: Value, name: str) -> str:
    known = world.exception_proto.slots.get(name)
    return f"Exception.{name}" if known is not None and world.is_a(this, known) else name


def _fill(world: World, this: Obj, message: str, **slots: Any) -> None:
    this.slots["message"] = world.string(message)
    this.slots.update({name: value for name, value in slots.items() if value is not None})


def _article(name: str) -> str:
    return f"an {name}" if name[:1] in "AEIOU" else f"a {name}"


@_kind("Type")
def init_type(world: World, this: Obj, effective: Any, expected: Value) -> None:
    """Error: a value has another type than ``expected``."""
    wanted = _article(world.type_name(expected))
    _fill(world, this, f"unexpected {world.printable(effective)}, expected {wanted}", effective=effective,
          expected=expected)


@_kind("ArgumentType", "Type")
def init_argument_type(world: World, this: Obj, routine: Any, index: float, effective: Any, expected: Value) -> None:
    """Error: argument number ``index`` of a routine has another type than ``expected``."""
    wanted = _article(world.type_name(expected))
    text = f"unexpected {world.printable(effective)} for argument {world.text(index)}, expected {wanted}"
    _fill(world, this, text, routine=routine, index=index, effective=effective, expected=expected)


@_kind("Arity")
def init_arity(world: World, this: Obj, routine: Any, effective: Any, least: Value, most: Value = None) -> None:
    """Error: a routine got ``effective`` arguments instead of ``least`` to ``most``."""
    greatest = None if most is None else integer(world, most, 4, "new")
    text = errors.arity(integer(world, effective, 2, "new"), integer(world, least, 3, "new"), greatest).message
    _fill(world, this, text, routine=routine, effective=effective, min=least, max=most)


@_kind("BadNumber")
def init_bad_number(world: World, this: Obj, routine: Any, form: Any, effective: Any) -> None:
    """Error: a routine got an invalid number; ``form`` is a format of the message that includes the number."""
    text = world.text(world.send(form, "%", effective))
    _fill(world, this, text, routine=routine, effective=effective)


@_kind("BadInteger", "BadNumber")
def init_bad_integer(world: World, this: Obj, routine: Any, form: Any, effective: Any) -> None:
    """Error: a routine got an invalid integer; ``form`` is a format of the message that includes the number."""
    init_bad_number(world, this, routine, form, effective)


@_kind("NegativeNumber", "BadNumber")
def init_negative(world: World, this: Obj, routine: Any, effective: Any) -> None:
    """Error: a routine got a negative number."""
    text = f"expected non-negative number, got {world.printable(effective)}"
    _fill(world, this, text, routine=routine, effective=effective)


@_kind("NonPositiveNumber", "BadNumber")
def init_non_positive(world: World, this: Obj, routine: Any, effective: Any) -> None:
    """Error: a routine got a number that is not positive."""
    text = f"expected positive number, got {world.printable(effective)}"
    _fill(world, this, text, routine=routine, effective=effective)


@_kind("Constness")
def init_constness(world: World, this: Obj, message: Value = None) -> None:
    """Error: a program assigned a constant slot."""
    _fill(world, this, errors.constness().message if message is None else world.text(message))


@_kind("FileNotFound")
def init_file_not_found(world: World, this: Obj, name: Value) -> None:
    """Error: there is no file of this name."""
    _fill(world, this, f"file not found: {world.text(name)}", name=name)


@_kind("ImplicitTagComponent")
def init_implicit_tag(world: World, this: Obj, message: Value = None) -> None:
    """Error: a program used an undeclared tag as a slot of a value that is no tag."""
    _fill(world, this, "invalid component in implicit tag" if message is None else world.text(message))


@_kind("KeyError")
def init_key_error(world: World, this: Obj, key: Value) -> None:
    """Error: a dictionary does not have this key."""
    _fill(world, this, f"missing key: {world.text(key)}", key=key)


@_kind("Lookup")
def init_lookup(world: World, this: Obj, name: Value, *rest: Value) -> None:
    """Error: a slot was not found.  The first argument appears in the message, as in the manual's example."""
    _fill(world, this, f"lookup failed: {world.text(name)}", name=name)


@_kind("MatchFailure")
def init_match_failure(world: World, this: Obj) -> None:
    """Error: a pattern did not match."""
    _fill(world, this, errors.match_failure().message)


@_kind("Primitive")
def init_primitive(world: World, this: Obj, routine: Any, message: Value) -> None:
    """Error: a primitive failed."""
    _fill(world, this, world.text(message), routine=routine)


@_kind("Redefinition")
def init_redefinition(world: World, this: Obj, name: Value) -> None:
    """Error: a program tried to create a slot that exists."""
    _fill(world, this, f"slot redefinition: {world.text(name)}", name=name)


@_kind("Scheduling")
def init_scheduling(world: World, this: Obj, message: Value) -> None:
    """Error: the scheduler cannot continue the job."""
    _fill(world, this, world.text(message))


@_kind("Syntax")
def init_syntax(world: World, this: Obj, loc: Any, message: Value, source: Value) -> None:
    """Error: a syntax error at ``loc`` in a program."""
    _fill(world, this, world.text(message), loc=loc, input=source)


@_kind("UnexpectedVoid")
def init_unexpected_void(world: World, this: Obj) -> None:
    """Error: void was used where a value is required."""
    _fill(world, this, errors.unexpected_void().message)


def install(world: World, programs: Any) -> None:
    """Set the slots common to all exceptions, and the switch of Traceable."""
    root = world.exception_proto.slots
    root.update({"message": world.string(""), "routine": world.void, "location": world.nil})
    root["backtrace"] = world.new_list([])
    traceable: Any = world.global_.slots["Traceable"]

    def write(this: Value, value: Value) -> None:
        world.hide_system = bool(value)

    field(world, traceable, "hideSystemFiles", lambda this: world.boolean(world.hide_system), write)
    traceable.slots["backtrace"] = root["backtrace"]
    lookup: Any = root["Lookup"]
    lookup.slots["fixSpelling"] = world.true
