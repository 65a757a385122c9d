"""FormatInfo and Formatter: formats like those of C's printf, and ``format`` of Float and String.

Source: manual, specs/format-info and specs/formatter.  In the default and the fixed format, an integral number is
printed without decimals, as everywhere in urbiscript.  The manual calls ``=`` centered; recorded answers of the
original put the padding into the middle of the text, and so does this module.
"""

from __future__ import annotations

import math
import re
from typing import Any

from urbihw.frozen import frozen
from urbihw.kernel import errors
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import List, String
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.slices import CHECK_INTERVAL, give_way, in_slices
from urbihw.kernel.value import Value

__breakable__ = True

INFO = Table("FormatInfo")
FORMATTER = Table("Formatter")
FLOAT = Table("Float")
STRING = Table("String")
TABLES = [INFO, FORMATTER, FLOAT, STRING]

OPTIONS = r"(?P<flags>[-=+ 0#']*)(?P<width>\d{0,5})(?:\.(?P<precision>\d{1,5}))?"
BARE_OPTIONS = OPTIONS.replace("P<", "P<bare_")
PATTERN = re.compile(rf"%(?:\|{OPTIONS}(?P<spec>[sdDxXoeEf]?)\||{BARE_OPTIONS}(?P<bare_spec>[sdDxXoeEf]))")
MAX_CACHED_LENGTH = 1000
"""Maximum length, in characters, of a format string whose parsed form is cached."""
EXACT_LIMIT = 2.0**63
"""Integral numbers below this limit are printed with all their digits."""

NOTES = {
    "FormatInfo": "The format of one value, like a conversion of C's printf: %5.2f.",
    "Formatter": "A parsed format string: texts and FormatInfos.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


@frozen(slots=False)
class FormatPattern:
    """A parsed format pattern.  ``alignment`` and ``uppercase`` are -1, 0 or 1 as in the manual."""

    pattern: str
    alignment: int
    alt: bool
    group: str
    pad: str
    precision: int
    given_precision: bool
    prefix: str
    spec: str
    uppercase: int
    width: int


def read(match: re.Match[str]) -> FormatPattern:
    """The format of a match of ``PATTERN``."""
    found = match.groupdict()
    kind = "" if found["spec"] is not None else "bare_"
    flags, spec = found[kind + "flags"], found[kind + "spec"] or "s"
    precision = found[kind + "precision"]
    return FormatPattern(
        pattern=match[0],
        alignment=-1 if "-" in flags else 0 if "=" in flags else 1,
        alt="#" in flags,
        group=" " if "'" in flags else "",
        pad="0" if "0" in flags else " ",
        precision=6 if precision is None else int(precision),
        given_precision=precision is not None,
        prefix="+" if "+" in flags else " " if " " in flags else "",
        spec=spec.lower(),
        uppercase=0 if spec == "s" else 1 if spec.isupper() else -1,
        width=int(found[kind + "width"] or 0),
    )


def cut(world: World, text: str) -> list[str | FormatPattern]:
    """Split a format string into plain texts and formats; ``%%`` is a plain ``%``."""
    pieces: list[str | FormatPattern] = []
    plain: list[str] = []
    position = turns = 0
    while position < len(text):
        turns += 1
        if not turns % CHECK_INTERVAL:
            give_way(world)
        if text[position] != "%":
            end = text.find("%", position)
            end = len(text) if end < 0 else end
            plain.append(text[position:end])
            position = end
        elif text.startswith("%%", position):
            plain.append("%")
            position += 2
        else:
            match = PATTERN.match(text, position)
            if match is None:
                raise errors.primitive(f"invalid format: {text[position : position + 8]}")
            pieces += (["".join(plain)] if plain else []) + [read(match)]
            plain.clear()
            position = match.end()
    return pieces + (["".join(plain)] if plain else [])


# ---------------------------------------------------------------- formatting


def format_float(form: FormatPattern, value: float) -> str:
    """Format a number by a parsed pattern."""
    if not math.isfinite(value):
        return _cased(form, _signed(form, f"{value:g}"))
    if form.spec in "xo":
        if value != int(value):
            raise errors.bad_number("BadInteger", f"expected integer, got {value:g}", value)
        digits = f"{abs(int(value)):{form.spec}}"
        base = ("0x" if form.spec == "x" else "0") if form.alt else ""
        text = ("-" if value < 0 else "") + base + digits
    elif form.spec == "e":
        text = f"{value:.{form.precision}e}"
    elif value == int(value) and abs(value) < EXACT_LIMIT:
        text = str(int(value))
    elif form.spec == "f":
        text = f"{value:.{form.precision}f}"
    else:
        text = f"{value:.{form.precision or 1}g}"
    return _cased(form, _padded(form, _signed(form, _grouped(form, text))))


def format_text(form: FormatPattern, text: str) -> str:
    """Format a text; ``%.3s`` truncates it."""
    if form.spec == "s" and form.given_precision:
        text = text[: form.precision]
    if form.prefix == " " and text[:1] not in ("+", "-"):
        text = " " + text
    return _cased(form, _padded(form, text))


def _grouped(form: FormatPattern, text: str) -> str:
    if not form.group:
        return text
    found = re.match(r"(-?)(\d+)(.*)\Z", text)
    if found is None:
        return text
    return found[1] + f"{int(found[2]):,}".replace(",", form.group) + found[3]


def _signed(form: FormatPattern, text: str) -> str:
    return text if text.startswith("-") else form.prefix + text


def _padded(form: FormatPattern, text: str) -> str:
    missing = form.width - len(text)
    if missing <= 0:
        return text
    if form.alignment < 0:
        return text + " " * missing
    if form.alignment == 0:
        middle = (len(text) + 1) // 2
        return text[:middle] + form.pad * missing + text[middle:]
    if form.pad == "0":
        head = re.match(r"[-+ ]?(?:0x)?", text)
        behind = head.end() if head is not None else 0
        return text[:behind] + "0" * missing + text[behind:]
    return " " * missing + text


def _cased(form: FormatPattern, text: str) -> str:
    return text if form.uppercase == 0 else text.upper() if form.uppercase > 0 else text.lower()


def apply(world: World, form: FormatPattern, value: Value) -> str:
    """Format any value: a number, or the result of its ``asString``."""
    if value.__class__ is float:
        return format_float(form, value)
    return format_text(form, world.text(value))


# ---------------------------------------------------------------- FormatInfo


class FormatInfoObject(Obj):
    """An urbiscript FormatInfo, with its parsed pattern."""

    __slots__ = ("form",)

    def __init__(self, world: World, protos: list[Obj], form: FormatPattern | None = None) -> None:
        super().__init__(world, protos)
        self.form = form if form is not None else one_format("%s")

    def clone(self) -> FormatInfoObject:
        """A FormatInfo with the same format."""
        return FormatInfoObject(self.world, [self], self.form)


def one_format(pattern: str) -> FormatPattern:
    """The format of a text that consists of one pattern.  Raises an error for any other text."""
    match = PATTERN.fullmatch(pattern)
    if match is None:
        raise errors.primitive(f"invalid format: {pattern}")
    return read(match)


@INFO.primitive("init")
def init_info(world: World, this: FormatInfoObject, pattern: str) -> None:
    """Parse a pattern: ``%`` options spec, or ``%|`` options [spec] ``|``."""
    this.form = one_format(pattern)


@INFO.primitive("asString", "asPrintable", "pattern")
def as_string(world: World, this: FormatInfoObject) -> str:
    """The pattern given to the constructor."""
    return this.form.pattern


def _add_field(slot: str, meaning: str) -> None:
    def get(world: World, this: FormatInfoObject) -> Value:
        return world.from_python(getattr(this.form, slot))

    get.__doc__ = meaning
    INFO.primitive(slot)(get)


for _slot, _meaning in {
    "alignment": "Where the text goes: -1 left, 0 both ends (=, with the padding in the middle), 1 right.",
    "alt": "Whether the base of a number is shown.",
    "group": "What is put between thousands.",
    "pad": "What fills the width: a blank or a zero.",
    "precision": "How many digits, or characters of a text, at most.",
    "prefix": "What stands before a positive number.",
    "spec": "The conversion character, in lower case.",
    "uppercase": "-1 for lower case, 0 for as it is, 1 for upper case.",
    "width": "How many characters at least.",
}.items():
    _add_field(_slot, _meaning)


@FLOAT.primitive("format")
def float_format(world: World, this: float, info: FormatInfoObject) -> str:
    """This number as a text in the given format."""
    return format_float(info.form, this)


@STRING.primitive("format")
def string_format(world: World, this: str, info: FormatInfoObject) -> str:
    """This string in the given format."""
    return format_text(info.form, this)


# ---------------------------------------------------------------- Formatter


class FormatterObject(Obj):
    """An urbiscript Formatter, with its parsed parts."""

    __slots__ = ("pieces",)

    def __init__(self, world: World, protos: list[Obj], pieces: list[str | FormatPattern] | None = None) -> None:
        super().__init__(world, protos)
        self.pieces: list[str | FormatPattern] = pieces if pieces is not None else []

    def clone(self) -> FormatterObject:
        """A Formatter with the same format."""
        return FormatterObject(self.world, [self], self.pieces)


CLASSES = {"FormatInfo": FormatInfoObject, "Formatter": FormatterObject}


@FORMATTER.primitive("init")
def init_formatter(world: World, this: FormatterObject, text: str) -> None:
    """Parse a format string into texts and formats."""
    this.pieces = cut(world, text)


@FORMATTER.primitive("asList")
def as_list(world: World, this: FormatterObject) -> Value:
    """The list of texts (Strings) and formats (FormatInfos), in order."""
    return _members(world, this)


def _members(world: World, this: FormatterObject) -> List:
    proto = world.global_.slots["FormatInfo"]
    return world.new_list(
        [
            world.string(piece) if isinstance(piece, str) else FormatInfoObject(world, [proto], piece)
            for piece in in_slices(world, this.pieces)
        ]
    )


@FORMATTER.primitive("asString", "asPrintable")
def formatter_as_string(world: World, this: FormatterObject) -> str:
    """``Formatter`` and its parts."""
    return f"Formatter {world.text(_members(world, this))}"


@FORMATTER.primitive("%")
def formatter_apply(world: World, this: FormatterObject, args: Value) -> str:
    """The text, with each format replaced by a member of a List, or by a single value."""
    return fill(world, this.pieces, args)


def fill(world: World, pieces: list[str | FormatPattern], args: Value) -> str:
    """Join the pieces, with the formats applied to the arguments."""
    values = list(args.l) if isinstance(args, List) else [args]
    wanted = sum(1 for piece in in_slices(world, pieces) if isinstance(piece, FormatPattern))
    if len(values) != wanted:
        raise errors.primitive(f"too {'few' if len(values) < wanted else 'many'} arguments")
    following = iter(values)
    parts = [p if isinstance(p, str) else apply(world, p, next(following)) for p in in_slices(world, pieces)]
    return "".join(parts)


def install(world: World, programs: Any) -> None:
    """Install ``String.'%'``, which caches parsed formats."""
    table = Table("String")
    known: dict[str, list[str | FormatPattern]] = {}

    @table.raw("%", least=1)
    def percent(world: World) -> Any:
        """Use this string as a format, filled with the members of a List or with a single value."""

        def run(this: Value, args: Value) -> String:
            if not isinstance(this, String):
                raise world.type_error(None, this, "String")
            pieces = known.get(this.s)
            if pieces is None:
                pieces = cut(world, this.s)
                if len(this.s) <= MAX_CACHED_LENGTH:
                    if len(known) > 500:
                        known.clear()
                    known[this.s] = pieces
            return world.string(fill(world, pieces, args))

        return run

    table.install(world, world.string_proto)
