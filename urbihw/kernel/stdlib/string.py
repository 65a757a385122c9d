"""String: sequences of bytes, shown as latin-1 characters; mutable only by ``[]=``.

Source: manual, specs/string.  The operators compare and index bytes; nothing here knows about UTF-8.
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
from urbihw.kernel.runtime.values import MOST_CHARACTERS, MOST_MEMBERS, String, too_long
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.members import count, members_of, repetitions, strings_of
from urbihw.kernel.stdlib.searching import found_separators, replaced
from urbihw.kernel.stdlib.slices import give_way, in_slices, text_slices

__breakable__ = True

TABLE = Table("String")
PROTOS = {"String": ("Comparable", "Orderable", "RangeIterable")}

NUMBER = re.compile(r"[-+]?(?:(?:\d++(?:\.\d*+)?|\.\d++)(?:[eE][-+]?\d++)?|inf|nan)\Z")
"""Nothing of it is tried a second time: what is no number is known to be none after going through it once."""
LONGEST_LIKENED = 10_000
"""Characters of a string that is likened to others: the time goes with the product of the lengths."""
SHOWN = 60
"""Characters of a string that an error shows."""


# ---------------------------------------------------------------- conversions


@TABLE.primitive("asString")
def as_string(world: World, this: String) -> Any:
    """This string itself."""
    return this


@TABLE.primitive("asPrintable")
def as_printable(world: World, this: str) -> str:
    """This string as a literal, with quotes and escapes."""
    return '"' + "".join([escaped(piece)[1:-1] for piece in text_slices(world, this)]) + '"'


@TABLE.primitive("empty")
def empty(world: World, this: str) -> bool:
    """Whether this string has no character."""
    return this == ""


@TABLE.primitive("asBool")
def as_bool(world: World, this: str) -> bool:
    """Whether this string is not empty."""
    return this != ""


@TABLE.primitive("asFloat")
def as_float(world: World, this: str) -> float:
    """The number that this string is; an error if anything but a number stands in it."""
    if NUMBER.match(this) is None:
        shown = this if len(this) <= SHOWN else this[:SHOWN] + "..."
        raise errors.primitive(f"unable to convert to float: {escaped(shown)}")
    return float(this)


@TABLE.primitive("toAscii")
def to_ascii(world: World, this: str) -> float:
    """The code (0 to 255) of the first character; an error if there is none."""
    if not this:
        raise errors.primitive("unexpected empty string")
    return float(ord(this[0]))


@TABLE.primitive("fromAscii")
def from_ascii(world: World, this: str, code: int) -> str:
    """The one-character string of a code, 0 to 255."""
    if not 0 <= code <= 255:
        raise errors.bad_number("BadInteger", f"expected integer in range [0, 255], got {code}")
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
"""Manual, specs/string, the table of character handling functions; true of the empty string."""


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

    def run(this: Any) -> float:
        return float(len(_text(world, this)))

    return run


@TABLE.primitive("split")
def split(
    world: World, this: str, sep: Any = None, lim: float = -1.0, keep_sep: bool = False, keep_empty: bool | None = None
) -> Any:
    """The parts between separators (a String, or a List of them, white space if left out), after at most ``lim`` splits
    (any number if negative), with the separators if ``keepSep``, with the empty parts if ``keepEmpty``."""
    separators = [" ", "\t", "\n", "\r"] if sep is None else strings_of(world, sep, 1)
    if keep_empty is None:
        keep_empty = sep is not None
    if lim != lim:
        raise errors.bad_number("BadNumber", "expected a number of splits, got nan")
    if "" in separators:
        if len(this) > MOST_MEMBERS:
            raise too_long("members", MOST_MEMBERS)
        return world.new_list([world.string(character) for character in in_slices(world, this)])
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
        if 0 <= lim < number + 1 or len(parts) > MOST_MEMBERS:
            break
    if keep_empty or begin < len(text):
        parts.append(string(text[begin:]))
    if len(parts) > MOST_MEMBERS:
        raise too_long("members", MOST_MEMBERS)
    return parts


@TABLE.primitive("join")
def join(world: World, this: str, members: Any, prefix: str = "", suffix: str = "") -> str:
    """The members' ``asString``, with this string between them, a prefix before and a suffix behind."""
    texts = [world.text(member) for member in in_slices(world, [*members_of(world, members)])]
    if sum(map(len, texts)) + len(this) * len(texts) > MOST_CHARACTERS:
        raise too_long("characters", MOST_CHARACTERS)
    return prefix + this.join(texts) + suffix


@TABLE.primitive("replace")
def replace(world: World, this: str, old: str, new: str) -> str:
    """A copy with every occurrence of ``old`` replaced by ``new``."""
    return replaced(world, this, old, new) if old else this


@TABLE.raw("[]", least=1, most=2)
def get_item(world: World) -> Any:
    """The characters from an index up to, not including, another (the next one if left out)."""

    def run(this: Any, begin: Any, end: Any = None) -> String:
        text = _text(world, this)
        start, stop = _range(world, text, begin, end)
        return world.string(text[start:stop])

    return run


@TABLE.primitive("[]=")
def set_item(world: World, this: String, begin: Any, end: Any, other: Any = None) -> Any:
    """Replace the characters from an index up to, not including, another (the next one if left out) by ``other``;
    gives ``other``."""
    position = 2 if other is None else 3
    if other is None:
        end, other = None, end
    if not isinstance(other, String):
        raise world.type_error(position, other, "String")
    start, stop = _range(world, this.s, begin, end)
    if len(this.s) + len(other.s) - (stop - start) > MOST_CHARACTERS:
        raise too_long("characters", MOST_CHARACTERS)
    this.s = this.s[:start] + other.s + this.s[stop:]
    this.touch()
    return other


def _range(world: World, text: str, begin: Any, end: Any) -> tuple[int, int]:
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


def _text(world: World, value: Any) -> str:
    if not isinstance(value, String):
        raise world.type_error(None, value, "String")
    return value.s


@TABLE.raw("+", "+=", least=1)
def plus(world: World) -> Any:
    """This string followed by the other's ``asString``."""
    string, text, void = world.string, world.text, world.void

    def run(this: Any, other: Any) -> String:
        if other is void:
            raise errors.unexpected_void()
        return string(_text(world, this) + text(other))

    return run


@TABLE.raw("*", least=1)
def times(world: World) -> Any:
    """This string repeated a number of times, a non-negative integer."""

    def run(this: Any, number: Any) -> String:
        text = _text(world, this)
        return world.string(text * repetitions(world, number, len(text), MOST_CHARACTERS, "characters"))

    return run


@TABLE.raw("==", least=1)
def equals(world: World) -> Any:
    """Whether the other is a string of the same bytes."""
    true, false = world.true, world.false

    def run(this: Any, other: Any) -> Any:
        return true if isinstance(other, String) and _text(world, this) == other.s else false

    return run


@TABLE.raw("!=", least=1)
def differs(world: World) -> Any:
    """Whether the other is no string of the same bytes."""
    true, false = world.true, world.false

    def run(this: Any, other: Any) -> Any:
        return false if isinstance(other, String) and _text(world, this) == other.s else true

    return run


@TABLE.primitive("<")
def before(world: World, this: str, other: str) -> bool:
    """Whether this string comes before the other, byte by byte."""
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
    """How many characters to insert, remove, replace or swap with their neighbour to get the other string."""
    return float(edits(world, this, other))


def edits(world: World, a: str, b: str) -> int:
    """The edits between two strings (``slips``), while others have their turn."""
    if len(a) > LONGEST_LIKENED or len(b) > LONGEST_LIKENED:
        raise errors.primitive(f"too long: expected strings of at most {LONGEST_LIKENED} characters")
    return slips(a, b, partial(give_way, world))


@TABLE.primitive("closest")
def closest(world: World, this: str, among: Any) -> Any:
    """The one member that is like this string: by at most one edit in three characters, or else but for the case of
    letters; nil if there is none or more than one."""
    names = [_text(world, member) for member in in_slices(world, [*members_of(world, among)])]
    reach = max(1, len(this) // 3)
    alike = [name for name in in_slices(world, names) if abs(len(name) - len(this)) <= reach]
    near = [name for name in in_slices(world, alike) if edits(world, this, name) <= reach]
    if not near:
        lower = this.lower()
        near = [name for name in in_slices(world, names) if name.lower() == lower]
    return world.string(near[0]) if len(near) == 1 else world.nil


def install(world: World, programs: Any) -> None:
    """``fresh`` counts, so it is made per world."""
    numbers = Table("String")
    used = 0

    @numbers.primitive("fresh")
    def fresh(world: World, this: str) -> str:
        """A string beginning with this one that was never given before."""
        nonlocal used
        used += 1
        return f"{this}_{used}"

    numbers.install(world, world.string_proto)
