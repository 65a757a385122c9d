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
}
"""What urbiscript has instead of names that other languages have."""
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
    return _of_arity(lobby, stack.routine) if error.kind == "Arity" and error.routine == "" else ""


def _of_lookup(lobby: Lobby, error: errors.LookupFailed, stack: Stack, statement: Statement | None) -> str:
    name: str = error.slots["name"]
    if statement is not None and len(statement.text) <= MAX_LENGTH:
        if _source(statement, stack.location).startswith("'"):
            return f'a String stands between double quotes: "{name}"'
        binding = re.search(rf"\b(catch|for)\b\W*\(\s*{re.escape(name)}\s*(=?)", statement.text)
        if binding:
            rest = "" if binding[1] == "catch" else " = 0; ..." if binding[2] else " in list"
            return f"the variable is declared in the parentheses: {binding[1]} (var {name}{rest})"
    if error.target is not lobby and name in lobby.slots:
        return f"{name} is a variable of your connection, which other objects do not see: use var Global.{name}"
    if name in INSTEAD:
        return INSTEAD[name]
    if error.target is lobby and stack.routine == "updateSlot":
        return f"a new variable is declared with var: var {name} = ..."
    return ""


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


def _of_arity(lobby: Lobby, routine: str | None) -> str:
    if routine == "print":
        return _PRINT
    holder = lobby.find(routine) if routine else None
    value: Any = holder.slots[routine] if holder is not None and routine else None
    if isinstance(value, Obj) and not isinstance(value, Executable) and "type" in value.slots:
        return f"an object of this kind is made by new: {routine}.new(...)"
    return ""
