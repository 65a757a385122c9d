"""The text of ``help``."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from prompt_toolkit.formatted_text import AnyFormattedText, FormattedText

from urbihw.client.assistant import Description

INTRODUCTION: Final = "what you type goes to the server when it ends with ; (and wait) or , (in the background)"
KEYS: Final = (
    ("Enter", "send; while the statement is unfinished, begin a new line; on an empty line, add the missing ;"),
    ("Esc Enter", "send as it is"),
    ("Tab", "complete the name of a slot: first what the robot has, with its meaning"),
    ("Up, Down", "what was typed before; Ctrl-R: search it"),
    ("Ctrl-C", "drop what is typed; with nothing typed: kill what runs in the foreground"),
    ("Ctrl-D", "leave; the server goes on"),
    ("help NAME", "what the server knows of a slot, such as help String.split; NAME? is the same"),
)
"""What the keys and the commands of the console do."""

MAX_LINES: Final = 12
"""Maximum number of lines of a function's source that are shown."""
LEAST_TEXT: Final = 24
"""Columns that a text beside others needs at least; with less room it stands below them."""
MOST_VALUE: Final = 20
"""Columns of a table for values; a longer value moves the text beside it to the next line."""
_IDENTIFIER: Final = re.compile(r"[A-Za-z_]\w*")


def keys_text(columns: int) -> str:
    """What the keys do, for a terminal of so many columns."""
    width = max(len(key) for key, _ in KEYS)
    rows = [line for key, text in KEYS for line in _beside(f"   {key:<{width}}", text, columns)]
    return "\n".join([*_wrapped(INTRODUCTION, columns), *rows])


def described(name: str, what: Description, columns: int) -> AnyFormattedText:
    """Format a description for a terminal of so many columns."""
    parts: list[tuple[str, str]] = [("class:prompt", name), ("", f": {what.type}\n")]
    if what.text:
        parts.append(("", _paragraphs(what.text, columns)))
    if what.protos:
        parts.append(("class:note", _lines(_wrapped(f"  prototypes: {what.protos}", columns))))
    if what.source:
        lines = what.source.splitlines()
        cut = [*lines[:MAX_LINES], "..."] if len(lines) > MAX_LINES else lines
        parts.append(("", textwrap.indent("\n".join(cut), "  ") + "\n"))
    if any("\t" in slot for slot in what.slots):
        parts.append(("", _table(what.slots, columns)))
        return FormattedText(parts)
    slots = [slot for slot in what.slots if _IDENTIFIER.fullmatch(slot) and not slot.startswith("_")]
    if slots:
        parts.append(("class:other", _lines(_wrapped("  " + "  ".join(sorted(slots)), columns))))
    return FormattedText(parts)


def _paragraphs(text: str, columns: int) -> str:
    """A description: paragraphs are filled, the lines of anything else, such as a list, stay."""
    made = []
    for paragraph in text.strip().split("\n\n"):
        lines = paragraph.splitlines()
        is_prose = not any(line.startswith((" ", "-", "*", "Unit: ", "Range: ")) for line in lines)
        whole = [" ".join(lines)] if is_prose else lines
        made.append("\n".join(line for each in whole for line in _wrapped("  " + each, columns)))
    return "\n\n".join(made) + "\n"


def _table(rows: Sequence[str], columns: int) -> str:
    """The slots of a device: name, present value with its unit, meaning and range."""
    cells = []
    for row in rows:
        name, value, unit, span, meaning = row.split("\t")
        shown = f"{value} {unit}" if unit not in ("", "1") and value not in ("", "nil", "nan") else value
        # Where no value has the unit with it, the note has.
        note = f"{span} {unit}".strip() if span or shown == value else ""
        note = note.removesuffix("1").rstrip() if unit == "1" else note
        cells.append((name, shown, f"{meaning} ({note})" if note else meaning))
    first = max(len(name) for name, _, _ in cells)
    second = min(max(len(value) for _, value, _ in cells), MOST_VALUE)
    width = 4 + first + second
    heads = ((f"  {name:<{first}}  {value:<{second}}", rest) for name, value, rest in cells)
    return _lines(line for head, rest in heads for line in _beside(head, rest, columns, width))


def _lines(lines: Iterable[str]) -> str:
    return "".join(f"{line}\n" for line in lines)


def _beside(head: str, text: str, columns: int, width: int = 0) -> Iterator[str]:
    """A text beside a head that is ``width`` columns wide, or below it where there is no room for it."""
    width = width or len(head)
    room = columns - width - 3
    if not text:
        yield head.rstrip()
    elif room < LEAST_TEXT:
        yield head.rstrip()
        yield from _wrapped(" " * 6 + text, columns)
    else:
        lines = _wrapped(text, room)
        if len(head) > width:
            yield head
            head = ""
        for line in lines:
            yield f"{head:<{width}}  {line}"
            head = ""


def _wrapped(text: str, columns: int) -> list[str]:
    """A text in lines of at most so many columns, indented alike; words stay whole."""
    indent = " " * (len(text) - len(text.lstrip()))
    return textwrap.wrap(
        text, max(columns - 1, LEAST_TEXT), subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    )
