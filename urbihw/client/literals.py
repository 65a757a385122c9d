"""Python values as urbiscript literals, and paths of slots: text out, nothing is ever evaluated here.

============================  ====================================================
Python                        urbiscript
============================  ====================================================
bool, None                    true, false, nil
int, float, numpy's numbers   Float, also nan and inf
str                           String, in UTF-8
bytes, bytearray              String of these bytes
list, tuple, numpy's arrays   List
dict with str as keys         Dictionary
an object of the robot        its path
============================  ====================================================
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from typing import Any, Final

MAX_DEPTH: Final = 20
"""Maximum nesting of lists and dictionaries."""
MAX_PATH_LENGTH: Final = 200
_PATH: Final = re.compile(
    r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*|\[(?:-?\d{1,9}|\"[^\"\\\]]*\"|[A-Za-z_]\w*)\])*", re.ASCII
)
_NAME: Final = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_STEP: Final = re.compile(r'"[^"]*"|\b[A-Za-z_]\w*', re.ASCII)
KEYWORDS: Final = frozenset(
    """
    and and_eq asm assert at auto bitand bitor bool break call case catch char class closure compl const const_cast
    continue default delete do double dynamic_cast else emit enum every explicit export extern external finally float
    for foreach freezeif friend function goto if in inline int internal long loop loopn mutable namespace new not not_eq
    onleave or or_eq private protected public register reinterpret_cast return short signed sizeof static static_cast
    stopif struct switch template this throw timeout try typedef typeid typename union unsigned using var virtual
    volatile waituntil whenever while wchar_t xor xor_eq
    """.split()  # noqa: SIM905 - a list of one word a line is not easier to read
)
"""Words that are no names, unless in quotes: those of the section Keywords of the manual's language chapter."""
SETTLING_PAUSE_S, SETTLING_LOOKS, STANDS = 0.05, 10, 0.002
"""Seconds between two looks at a device behind the end of its trajectory, how often at most, and by how little its
value differs when it has followed, in its unit (rad, m): a servo is some hundredths of a second behind."""
CONSTANTS: Final = ("nil", "void", "true", "false")
_ESCAPED: Final = {
    chr(code): f"\\x{code:02x}" for code in range(256) if not 32 <= code < 127
} | {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\t": "\\t"}  # fmt: skip
_UNSAFE: Final = re.compile(r'[^ !#-\[\]-~]')


def string_literal(text: str | bytes) -> str:
    """A String in quotes, in ASCII."""
    if isinstance(text, bytes):
        return f'"{_UNSAFE.sub(_escaped, text.decode("latin-1"))}"'
    if text.isascii() and text.isprintable() and '"' not in text and "\\" not in text:
        return f'"{text}"'
    try:
        raw = text.encode("utf-8", "surrogateescape")
    except UnicodeEncodeError as error:
        raise ValueError(f"character {error.start + 1} is half of a surrogate pair, which UTF-8 has not") from None
    return f'"{_UNSAFE.sub(_escaped, raw.decode("latin-1"))}"'


def _escaped(match: re.Match[str]) -> str:
    return _ESCAPED[match[0]]


def literal(value: Any, depth: int = 0) -> str:
    """The text of a value.  Raises TypeError for a value that urbiscript has not, ValueError for one that nests too
    deep.
    """
    if depth > MAX_DEPTH:
        raise ValueError(f"the value nests deeper than {MAX_DEPTH}")
    if value is None:
        return "nil"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return number_literal(value)
    if isinstance(value, str | bytes | bytearray | memoryview):
        return string_literal(value if isinstance(value, str) else bytes(value))
    if isinstance(value, Mapping):
        return _dictionary(value, depth)
    if isinstance(value, list | tuple):
        return f"[{', '.join([literal(member, depth + 1) for member in value])}]"
    path = getattr(type(value), "urbiscript_path", None)
    if path is not None:
        return str(path(value))
    if hasattr(value, "tolist"):  # numpy's arrays and numbers
        return literal(value.tolist(), depth + 1)
    raise TypeError(f"urbiscript has no values like a Python {type(value).__name__}")


def number_literal(value: float) -> str:
    """A Float with all digits.  Raises OverflowError for an int that is no float."""
    value = float(value)
    if math.isfinite(value):
        return f"({value!r})" if value < 0 else repr(value)
    return "nan" if math.isnan(value) else "inf" if value > 0 else "(-inf)"


def _dictionary(value: Mapping[Any, Any], depth: int) -> str:
    for key in value:
        if not isinstance(key, str):
            raise TypeError(f"the keys of a Dictionary are strings, not {type(key).__name__}: {key!r}")
    members = [f"{string_literal(key)} => {literal(member, depth + 1)}" for key, member in value.items()]
    return f"[{', '.join(members) or '=>'}]"


def checked_path(path: str) -> str:
    """A path of slots, such as ``motor6.val`` or ``robot.joint[6].val``.  Raises ValueError for any other text, so that
    no path can carry a statement, TypeError for what is no str.
    """
    if not isinstance(path, str):
        raise TypeError(f"the path of a slot is a str such as 'motor6.val', not a Python {type(path).__name__}")
    if len(path) > MAX_PATH_LENGTH or not _PATH.fullmatch(path):
        raise ValueError(f"{path[:MAX_PATH_LENGTH]!r} is no path of a slot, such as motor6.val or robot.joint[6].val")
    return path


def written_path(path: str) -> str:
    """A path as it stands in a statement: keywords in quotes, such as ``robot.'new'``."""
    return _STEP.sub(lambda step: f"'{step[0]}'" if step[0] in KEYWORDS and step[0] != "this" else step[0], path)


def assignment_text(path: str, value: str, modifiers: Mapping[str, Any]) -> str:
    """The assignment of a literal to a slot, with modifiers; it ends when the device has followed.  Raises what
    ``literal`` and ``checked_name`` raise."""
    words = "".join(f" {checked_name(name)}:{literal(each)}" for name, each in modifiers.items())
    slot = written_path(path)
    return (
        f"{slot} = {value}{words} | var _last = inf | var _left = {SETTLING_LOOKS} | "
        f"while (0 < _left && {slot}.isA(Float) && {STANDS} < ({slot} - _last).abs) "
        f"{{ _last = {slot} | _left -= 1 | sleep({SETTLING_PAUSE_S}) }} | nil"
    )


def checked_writes(values: Mapping[str, Any]) -> dict[str, str]:
    """Values to write as literals by the paths of their slots.  Raises ValueError for none of them, and what
    ``checked_path``, ``checked_slot`` and ``literal`` raise."""
    if not values:
        raise ValueError("there is nothing to write: give values by the paths of slots, such as motor6.val")
    return {checked_slot(checked_path(path)): literal(value) for path, value in values.items()}


def call_text(path: str, args: Iterable[Any]) -> str:
    """The call of the function in a slot.  Raises what ``literal`` raises."""
    arguments = ", ".join(map(literal, args))
    return f"{written_path(path)}({arguments})" if arguments else written_path(path)


def property_text(path: str, name: str) -> str:
    """The reading of a property of a slot.  Raises ValueError for the member of a list, which has none."""
    if path.endswith("]"):
        raise ValueError(f"{path} is no slot with a name, so it has no properties")
    return f"{written_path(path)}->{checked_name(name)}"


def members_text(path: str) -> str:
    """The members of a container or a Group, as a List (manual, specs/group: ``each``)."""
    return f"var _members = [] | {path}.each(closure (var _member) {{ _members << _member }}) | _members"


def meaning_text(path: str) -> str:
    """The reading of what the server says about a slot, without unit and range; "" for nothing."""
    holder, _, name = path.rpartition(".")
    said = f"System.documentation({written_path(holder) or 'this'}, {string_literal(name)})"
    return f'if (System.hasSlot("documentation")) {said} else ""'


def checked_slot(path: str) -> str:
    """The path of a slot that can be written.  Raises ValueError for a constant."""
    if path in CONSTANTS:
        raise ValueError(f"{path} is a constant of urbiscript")
    return path


def checked_text(text: str) -> str:
    """The text of a program.  Raises TypeError for what is no str."""
    if not isinstance(text, str):
        raise TypeError(f"a program is a str of urbiscript, not a Python {type(text).__name__}")
    return text


def checked_rate(hz: float) -> float:
    """A number of samples in a second.  Raises ValueError for one below 0, or that is no number."""
    rate = float(hz)
    if not 0 <= rate < math.inf:
        raise ValueError(f"hz: {hz!r} is no rate: samples in a second, or 0 for changes only")
    return rate


def checked_name(name: str) -> str:
    """The name of a tag or a modifier.  Raises ValueError for any other text, also for a keyword; TypeError for what
    is no str.
    """
    if not isinstance(name, str):
        raise TypeError(f"a name of urbiscript is a str, not a Python {type(name).__name__}")
    if name in KEYWORDS or name in CONSTANTS:
        raise ValueError(f"{name!r} is a word of urbiscript, so no tag or modifier can have that name")
    if not _NAME.fullmatch(name):
        raise ValueError(f"{name[:MAX_PATH_LENGTH]!r} is no name of urbiscript: letters, digits and _")
    return name
