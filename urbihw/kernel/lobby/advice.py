"""Advice to beginners behind uncaught errors: the correct form of a frequent mistake.

The advice is a line behind the report of the error.  It is left out where answers must be those of the original
(``Programs.quiet``).  ``urbihw.kernel.syntax.advice`` has that for syntax errors.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Final

from urbihw.kernel import errors
from urbihw.kernel.runtime.backtrace import Stack, stack_of
from urbihw.kernel.runtime.code import Executable
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.trajectory import ATTRIBUTES
from urbihw.kernel.syntax.location import Location
from urbihw.kernel.syntax.reader import Statement

if TYPE_CHECKING:
    from urbihw.kernel.lobby.lobby import Lobby

_NIL = "no value at all is nil"
_SIZE = "the number of members is x.size"
_ADD = "a value is added to a list by <<, as in list << 3"
_PRINT = "a value is printed by echo(x)"
_TEXT = "the text of a value is x.asString"
_LEAVE = "quit; ends the connection, shutdown; the server"
_WAIT = "sleep(1s) waits"
INSTEAD: Final = {
    "self": "the object itself is called this",
    **dict.fromkeys(("NULL", "None", "undefined"), _NIL),
    **dict.fromkeys(("length", "len", "count"), _SIZE),
    **dict.fromkeys(("push", "add", "push_back"), _ADD),
    "pop": "the last member of a list is removed by removeBack",
    **dict.fromkeys(("printf", "println", "puts"), _PRINT),
    **dict.fromkeys(("str", "toString"), _TEXT),
    "forEach": "a function is called with each member by list.each(f)",
    **dict.fromkeys(("substr", "substring", "slice"), "a part of a String is s[begin, end]"),
    "charAt": "a character of a String is s[0]",
    **dict.fromkeys(("upper", "toUpperCase", "toupper"), "capital letters are made by toUpper"),
    **dict.fromkeys(("lower", "toLowerCase", "tolower"), "small letters are made by toLower"),
    **dict.fromkeys(("toInt", "toFloat", "toNumber", "parseInt", "parseFloat", "atoi"), "a number is made by asFloat"),
    **dict.fromkeys(("contains", "includes", "indexOf"), "a member is found by in: 3 in list"),
    **dict.fromkeys(("rand", "randint"), "a random integer below 100 is 100.random"),
    "PI": "the constant is called pi",
    "console": _PRINT,
    "help": 'x.localSlotNames; lists the slots of x, System.documentation(x, "size"); describes one',
    **dict.fromkeys(("exit", "bye", "logout"), _LEAVE),
    **dict.fromkeys(("wait", "delay"), _WAIT),
    **dict.fromkeys(("Serial", "out", "log"), _PRINT),
    "lambda": "a function is written like this: function (x) { x + 1 }",
    "Number": "a number is made by asFloat",
    "range": "the numbers from 0 to 9 are 10: for (var i : 10) echo(i)",
    "sorted": "a sorted list is list.sort",
    "sum": "a sum is list.foldl('+', 0)",
    "open": 'the text of a file is File.new("name").content',
    "setTimeout": "what is done later is { sleep(1s); f },",
    "waitUntil": "waituntil (c) waits, in small letters",
    **dict.fromkeys(("on", "addEventListener"), "what is done at an event is at (e?) { ... }"),
    **dict.fromkeys(("ls", "dir"), 'the names of the files are Directory.new(".").content'),
    "cd": "a folder is changed by Directory.setCurrent; programs are loaded by load(\"name.u\")",
}
"""What urbiscript has instead of names that other languages have."""
_GOAL: Final = "a joint goes where its slot val is set: val = 90deg time:2s"
_DRIVE: Final = "a base drives by robot.go(0.5) so many metres, robot.turn(90deg), robot.xSpeed = 0.2"
OF_ROBOT: Final = {
    "on": ("load", "a motor is switched on by load = 1"),
    "off": ("load", "a motor is switched off by load = 0"),
    **dict.fromkeys(("position", "pos", "value", "move", "moveTo", "write", "set", "goTo"), ("val", _GOAL)),
    **dict.fromkeys(("forward", "backward", "back", "left", "right", "move", "drive"), ("go", _DRIVE)),
}
"""What a part of a robot has instead, for names that it lacks: the slot that it must have for that, and the advice."""
MAX_LENGTH: Final = 10_000
"""Maximum length of a statement that is searched, in characters."""


def advice(lobby: Lobby, error: BaseException, statement: Statement | None) -> str:
    """The advice for an uncaught error; empty if there is none.

    ``statement`` is the statement that failed, None if it is not known.
    """
    if not isinstance(error, errors.Raised):
        return ""
    stack = stack_of(error, lobby.world.hide_system)
    if isinstance(error, errors.LookupFailed):
        return _of_lookup(lobby, error, stack, statement)
    if error.kind == "Arity" and error.routine == "":
        return _of_arity(lobby, stack.routine, statement)
    if error.message.startswith("unknown trajectory attribute"):
        return f"the attributes of a movement are {', '.join(ATTRIBUTES)}"
    return ""


def of_hiding(lobby: Lobby) -> str:
    """The advice for a statement that has just made a variable, if that hides an object of the robot; else empty."""
    name = next(reversed(lobby.slots))
    if not _hides(lobby, name):
        return ""
    slot = f"write to one of its slots, such as {name}.val; " if _has_value(lobby, name) else ""
    return f'this hides {name} from your connection: {slot}removeLocalSlot("{name}"); brings it back'


def _hides(lobby: Lobby, name: str) -> bool:
    """Whether a variable of the connection hides an object of the robot."""
    hidden: Any = lobby.world.global_.slots.get(name)
    return isinstance(hidden, Obj) and _is_of_robot(lobby, hidden)


def _is_of_robot(lobby: Lobby, value: Obj) -> bool:
    """Whether this is a device, a group of devices, or a part of the robot's tree."""
    world = lobby.world
    kinds = (world.uobject_proto, world.classes.get("Group"), world.global_.slots.get("Component"))
    return any(kind is not None and value is not kind and world.is_a(value, kind) for kind in kinds)


def _has_value(lobby: Lobby, name: str) -> bool:
    hidden: Any = lobby.world.global_.slots[name]
    return hidden.find("val") is not None


def _of_lookup(lobby: Lobby, error: errors.LookupFailed, stack: Stack, statement: Statement | None) -> str:
    name: str = error.slots["name"]
    text = statement.text if statement is not None and len(statement.text) <= MAX_LENGTH else ""
    if statement is not None and text:
        if _source(statement, stack.location).startswith("'"):
            return f'a String stands between double quotes: "{name}"'
        binding = re.search(rf"\b(catch|for)(?:each)?\b\W*\(\s*{re.escape(name)}\s*(=?)", text)
        if binding:
            rest = "" if binding[1] == "catch" else " = 0; ..." if binding[2] else " in list"
            return f"the variable is declared in the parentheses: {binding[1]} (var {name}{rest})"
        if name in ("has", "each") and (counted := re.search(r"\bfor(?:each)?\b\W*\(\s*(\w+)\s+in\b", text)):
            return f"the variable is declared in the parentheses: for (var {counted[1]} in list)"
        if hiding := _hiding(lobby, error.target, text):
            return f'{hiding} is a variable of your connection, which hides the device: removeLocalSlot("{hiding}");'
        if name == "has" and re.search(r"\bin\s*[\d.]", text):
            return "a movement takes its time by an attribute: x.val = 90deg time:2s"
        if name == "[]=" and error.target is not lobby:
            return "the members of it are not replaced, but their slots written: motors[6].val = 1"
    if error.target is not lobby and name in lobby.slots:
        return f"{name} is a variable of your connection, which other objects do not see: use var Global.{name}"
    if isinstance(error.target, Obj) and _is_of_robot(lobby, error.target):
        return _of_slots(lobby, error.target, name, text)
    if name in INSTEAD:
        return INSTEAD[name]
    if error.target is lobby and stack.routine == "updateSlot":
        return f"a new variable is declared with var: var {name} = ..."
    return _of_parts(lobby, name, text) if error.target is lobby else ""


def _hiding(lobby: Lobby, target: Any, text: str) -> str:
    """The variable of the connection whose value lacks a slot, if it hides an object of the robot."""
    # A number has another object each time that it needs one.
    number = lobby.world.is_a(target, lobby.world.float_proto)
    holding = (name for name, value in lobby.slots.items() if value is target or number and value.__class__ is float)
    found = (name for name in holding if re.search(rf"\b{re.escape(name)}\b", text))
    return next((name for name in found if _hides(lobby, name)), "")


def _of_parts(lobby: Lobby, name: str, text: str) -> str:
    """Where to find the name of a part of the robot, or of a class."""
    if re.search(rf"\b{re.escape(name)}\s*\(", text) and name[:1].isupper():
        return f"there is no class {name}: class {name} {{ ... }} makes one, {name}.new(...) an object of it"
    if "robot" in lobby.world.global_.slots and re.search(rf"\b{re.escape(name)}\s*(\.|\[|->)", text):
        return "robot.flatDump; lists the parts of the robot"
    return ""


def _of_slots(lobby: Lobby, target: Obj, name: str, text: str) -> str:
    """What a part of the robot has instead of a slot that it lacks, or how to see its slots, by the name that its user
    has typed if it has several."""
    needed, told = OF_ROBOT.get(name, ("", ""))
    if needed and target.find(needed) is not None:
        return told
    known = lobby.world.global_.slots
    names = [name for name, value in known.items() if value is target and not name[:1].isupper()]
    own = next((name for name in names if re.search(rf"\b{re.escape(name)}\b", text)), names[0] if names else "")
    if own == "robot":
        return "robot.localSlotNames; lists its slots, robot.flatDump; its parts"
    return f"{own}.localSlotNames; lists its slots" if own else ""


def _source(statement: Statement, location: Location | None) -> str:
    """The text at a location from there to the end of its line; empty if it is not in the statement."""
    if location is None or location.begin.file != statement.base.file:
        return ""
    lines = statement.text.split("\n")
    below = location.begin.line - statement.base.line
    if not 0 <= below < len(lines):
        return ""
    column = location.begin.column - (statement.base.column if below == 0 else 1)
    return lines[below][column:] if column >= 0 else ""


def _of_arity(lobby: Lobby, routine: str | None, statement: Statement | None) -> str:
    if routine == "print":
        return _PRINT
    text = statement.text if statement is not None and len(statement.text) <= MAX_LENGTH else ""
    called = re.search(rf"\b(\w+)\.{re.escape(routine or '')}\s*\(", text) if routine else None
    if called and _hides(lobby, called[1]):
        return f"a slot is written by =: {called[1]}.{routine} = 1"
    if routine and _hides(lobby, routine):
        return f"brackets choose a member: {routine}[1]"
    holder = lobby.find(routine) if routine else None
    value: Any = holder.slots[routine] if holder is not None and routine else None
    if isinstance(value, Obj) and not isinstance(value, Executable) and "type" in value.slots:
        return f"an object of this kind is made by new: {routine}.new(...)"
    return ""
