"""String: sequences of bytes, shown as latin-1 characters; mutable only by ``[]=``.

Source: manual, specs/string.  The operators compare and index bytes; UTF-8 is not decoded.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial
from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.plain import escaped
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.spelling import slips
from urbihw.kernel.runtime.values import MAX_LIST_LENGTH, MAX_STRING_LENGTH, String, TextList, too_long
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.members import count, members_of, repetitions, strings_of, texts_of
from urbihw.kernel.stdlib.searching import found_separators, replaced
from urbihw.kernel.stdlib.slices import TEXT_SLICE_LENGTH, give_way, in_slices, text_slices
from urbihw.kernel.value import Value, ValueOrText

__breakable__ = True

TABLE = Table("String")
PROTOS = {"String": ("Comparable", "Orderable", "RangeIterable")}

NUMBER = re.compile(r"[-+]?(?:(?:\d++(?:\.\d*+)?|\.\d++)(?:[eE][-+]?\d++)?|inf|nan)\Z")
"""The possessive quantifiers prevent backtracking, so that a text that is no number is rejected in one pass."""
MAX_COMPARED_LENGTH = 10_000
"""Maximum length, in characters, of strings compared by edit distance: the time is proportional to the product of the
lengths.
"""
MAX_SHOWN_LENGTH = 60
"""Maximum number of characters of a string in an error message."""


# ---------------------------------------------------------------- conversions


@TABLE.primitive("asString")
def as_string(world: World, this: String) -> Value:
    """Returns this string itself."""
    return this


@TABLE.primitive("asPrintable")
def as_printable(world: World, this: str) -> str:
    """This string as a literal, with quotes and escapes."""
    return '"' + "".join([escaped(piece)[1:-1] for piece in text_slices(world, this)]) + '"'


@TABLE.primitive("empty")
def empty(world: World, this: str) -> bool:
    """Whether this string is empty."""
    return this == ""


@TABLE.primitive("asBool")
def as_bool(world: World, this: str) -> bool:
    """Whether this string is not empty."""
    return this != ""


@TABLE.primitive("asFloat")
def as_float(world: World, this: str) -> float:
    """This string as a number.  Raises an error if it is not a number."""
    if NUMBER.match(this) is None:
        shown = this if len(this) <= MAX_SHOWN_LENGTH else this[:MAX_SHOWN_LENGTH] + "..."
        raise errors.primitive(f"unable to convert to float: {escaped(shown)}")
    return float(this)


@TABLE.primitive("toAscii")
def to_ascii(world: World, this: str) -> float:
    """The code (0 to 255) of the first character.  Raises an error if the string is empty."""
    if not this:
        raise errors.primitive("unexpected empty string")
    return float(ord(this[0]))


@TABLE.primitive("fromAscii")
def from_ascii(world: World, this: str, code: int) -> str:
    """The string of the one character with this code, 0 to 255."""
    if not 0 <= code <= 255:
        raise errors.bad_number("BadInteger", f"expected integer in range [0, 255], got {code}", code)
    return chr(code)


@TABLE.primitive("toLower")
def to_lower(world: World, this: str) -> str:
    """A copy with the ASCII letters in lower case."""
    return this.encode("latin-1").lower().decode("latin-1")


@TABLE.primitive("toUpper")
def to_upper(world: World, this: str) -> str:
    """A copy with the ASCII letters in upper case."""
    return this.encode("latin-1").upper().decode("latin-1")


# ---------------------------------------------------------------- classes of characters

CLASSES_OF_CHARACTERS = {
    "isAlnum": r"[0-9A-Za-z]*\Z",
    "isAlpha": r"[A-Za-z]*\Z",
    "isCntrl": r"[\x00-\x1f\x7f]*\Z",
    "isDigit": r"[0-9]*\Z",
    "isGraph": r"[!-~]*\Z",
    "isLower": r"[a-z]*\Z",
    "isPrint": r"[ -~]*\Z",
    "isPunct": r"[!-/:-@\[-`{-~]*\Z",
    "isSpace": r"[ \t-\r]*\Z",
    "isUpper": r"[A-Z]*\Z",
    "isXdigit": r"[0-9A-Fa-f]*\Z",
}
"""Manual, specs/string, the table of character classes; each function returns true for the empty string."""


def _add_class(slot: str, pattern: str) -> None:
    compiled = re.compile(pattern)

    def all_are(world: World, this: str) -> bool:
        return all(compiled.match(piece) is not None for piece in text_slices(world, this))

    all_are.__doc__ = f"Whether all characters of this string are of the C class {slot.lower()}."
    TABLE.primitive(slot)(all_are)


for _slot, _pattern in CLASSES_OF_CHARACTERS.items():
    _add_class(_slot, _pattern)


# ---------------------------------------------------------------- parts


@TABLE.raw("size", "length", least=0)
def size(world: World) -> Any:
    """The number of bytes."""

    def run(this: Value) -> float:
        return float(len(_text(world, this)))

    return run


@TABLE.primitive("split")
def split(
    world: World, this: str, sep: ValueOrText | None = None, lim: float = -1.0, keep_sep: bool = False,
    keep_empty: bool | None = None,
) -> Value:
    """Split the string at separators (a String, or a List of Strings; white space by default).  ``lim`` is the maximum
    number of splits, negative for no limit; ``keepSep`` keeps the separators, ``keepEmpty`` keeps empty parts."""
    separators = [" ", "\t", "\n", "\r"] if sep is None else strings_of(world, sep, 1)
    if keep_empty is None:
        keep_empty = sep is not None
    if lim != lim:
        raise errors.bad_number("BadNumber", "expected a number of splits, got nan")
    if "" in separators:
        if len(this) > MAX_LIST_LENGTH:
            raise too_long("members", MAX_LIST_LENGTH)
        return world.new_list([world.string(character) for character in in_slices(world, this)])
    if len(separators) == 1 and lim < 0 and not keep_sep and len(this) <= TEXT_SLICE_LENGTH:
        parts = this.split(separators[0])
        return world.new_texts(parts if keep_empty else [part for part in parts if part])
    found = found_separators(world, this, separators) if separators and not 0 <= lim < 1 else iter(())
    return world.new_list(_parts(world, this, found, lim, keep_sep, keep_empty))


def _parts(
    world: World, text: str, separators: Iterator[tuple[int, int]], lim: float, keep_sep: bool, keep_empty: bool
) -> list[Any]:
    string = world.string
    parts: list[Any] = []
    begin = 0
    for number, (at, end) in enumerate(separators, 1):
        if keep_empty or begin < at:
            parts.append(string(text[begin:at]))
        if keep_sep:
            parts.append(string(text[at:end]))
        begin = end
        if 0 <= lim < number + 1 or len(parts) > MAX_LIST_LENGTH:
            break
    if keep_empty or begin < len(text):
        parts.append(string(text[begin:]))
    if len(parts) > MAX_LIST_LENGTH:
        raise too_long("members", MAX_LIST_LENGTH)
    return parts


@TABLE.primitive("join")
def join(world: World, this: str, members: Value, prefix: str = "", suffix: str = "") -> str:
    """Join the members' ``asString`` with this string between them, a prefix before and a suffix after."""
    return joined(world, this, members, prefix, suffix)


def joined(world: World, this: str, members: Value, prefix: str, suffix: str) -> str:
    """The text of ``join``."""
    texts = texts_of(world, members)
    length = len(this) * len(texts)
    if members.__class__ is not TextList:  # which has the parts of one String
        length += sum(map(len, texts))
    if length > MAX_STRING_LENGTH:
        raise too_long("characters", MAX_STRING_LENGTH)
    return prefix + this.join(texts) + suffix


@TABLE.primitive("replace")
def replace(world: World, this: str, old: str, new: str) -> str:
    """A copy with every occurrence of ``old`` replaced by ``new``."""
    return replaced(world, this, old, new) if old else this


@TABLE.raw("[]", least=1, most=2)
def get_item(world: World) -> Any:
    """The characters from index ``begin`` up to, but not including, ``end``; one character without ``end``."""

    def run(this: Value, begin: Value, end: Value = None) -> String:
        text = _text(world, this)
        start, stop = _range(world, text, begin, end)
        return world.string(text[start:stop])

    return run


@TABLE.primitive("[]=")
def set_item(world: World, this: String, begin: Value, end: Value, other: Value = None) -> Value:
    """Replace the characters from index ``begin`` up to, but not including, ``end`` by ``other``; one character without
    ``end``.  Returns ``other``."""
    position = 2 if other is None else 3
    if other is None:
        end, other = None, end
    if not isinstance(other, String):
        raise world.type_error(position, other, "String")
    start, stop = _range(world, this.s, begin, end)
    if len(this.s) + len(other.s) - (stop - start) > MAX_STRING_LENGTH:
        raise too_long("characters", MAX_STRING_LENGTH)
    this.s = this.s[:start] + other.s + this.s[stop:]
    this.touch()
    return other


def _range(world: World, text: str, begin: Value, end: Value) -> tuple[int, int]:
    start = count(world, begin)
    if start >= len(text):
        raise errors.primitive(f"invalid index: {start}")
    if end is None:
        return start, start + 1
    stop = count(world, end, 2)
    if stop > len(text):
        raise errors.primitive(f"invalid index: {stop}")
    if stop < start:
        raise errors.primitive(f"range starting after its end does not make sense: {start}, {stop}")
    return start, stop


# ---------------------------------------------------------------- operators


def _text(world: World, value: Value) -> str:
    if not isinstance(value, String):
        raise world.type_error(None, value, "String")
    return value.s


@TABLE.raw("+", "+=", least=1)
def plus(world: World) -> Any:
    """This string followed by the other's ``asString``."""
    string, text, void = world.string, world.text, world.void

    def run(this: Value, other: Value) -> String:
        if other is void:
            raise errors.unexpected_void()
        return string(_text(world, this) + text(other))

    return run


@TABLE.raw("*", least=1)
def times(world: World) -> Any:
    """This string repeated a number of times, a non-negative integer."""

    def run(this: Value, number: Value) -> String:
        text = _text(world, this)
        return world.string(text * repetitions(world, number, len(text), MAX_STRING_LENGTH, "characters"))

    return run


@TABLE.raw("==", least=1)
def equals(world: World) -> Any:
    """Whether the other value is a string with the same bytes."""
    true, false = world.true, world.false

    def run(this: Value, other: Value) -> Value:
        return true if isinstance(other, String) and _text(world, this) == other.s else false

    return run


@TABLE.raw("!=", least=1)
def differs(world: World) -> Any:
    """Whether the other value is not a string with the same bytes."""
    true, false = world.true, world.false

    def run(this: Value, other: Value) -> Value:
        return false if isinstance(other, String) and _text(world, this) == other.s else true

    return run


@TABLE.primitive("<")
def before(world: World, this: str, other: str) -> bool:
    """Whether this string comes before the other, compared byte by byte."""
    return this < other


@TABLE.primitive("<=")
def not_after(world: World, this: str, other: str) -> bool:
    """Whether this string does not come after the other."""
    return this <= other


@TABLE.primitive(">")
def after(world: World, this: str, other: str) -> bool:
    """Whether this string comes after the other."""
    return this > other


@TABLE.primitive(">=")
def not_before(world: World, this: str, other: str) -> bool:
    """Whether this string does not come before the other."""
    return this >= other


# ---------------------------------------------------------------- likeness


@TABLE.primitive("distance")
def distance(world: World, this: str, other: str) -> float:
    """The minimum number of insertions, removals, replacements and swaps of neighbours that turn this string into the
    other.
    """
    return float(edits(world, this, other))


def edits(world: World, a: str, b: str) -> int:
    """The edit distance of two strings (``slips``); other jobs get turns meanwhile."""
    if len(a) > MAX_COMPARED_LENGTH or len(b) > MAX_COMPARED_LENGTH:
        raise errors.primitive(f"too long: expected strings of at most {MAX_COMPARED_LENGTH} characters")
    return slips(a, b, partial(give_way, world))


@TABLE.primitive("closest")
def closest(world: World, this: str, among: Any) -> Value:
    """The member most similar to this string, the first of equally similar ones; nil if none has at most one edit per
    three characters (one of two), or a difference only in upper and lower case."""
    names = [_text(world, member) for member in in_slices(world, [*members_of(world, among)])]
    reach = max(len(this) // 3, min(1, len(this) - 1))
    nearest, least = None, reach + 1
    for name in in_slices(world, names):
        if abs(len(name) - len(this)) <= reach and (number := edits(world, this, name)) < least:
            nearest, least = name, number
    if nearest is None:
        lower = this.lower()
        nearest = next((name for name in in_slices(world, names) if name.lower() == lower), None)
    return world.nil if nearest is None else world.string(nearest)


def install(world: World, programs: Any) -> None:
    """Install ``fresh``, whose counter belongs to the world."""
    numbers = Table("String")
    used = 0

    @numbers.primitive("fresh")
    def fresh(world: World, this: str) -> str:
        """A string that begins with this one and was not returned before."""
        nonlocal used
        used += 1
        return f"{this}_{used}"

    numbers.install(world, world.string_proto)
