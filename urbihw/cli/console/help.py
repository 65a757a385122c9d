"""The text of ``help``."""

from __future__ import annotations

import re
import shutil
import textwrap
from collections.abc import Sequence
from typing import Final

from prompt_toolkit.formatted_text import AnyFormattedText, FormattedText

from urbihw.cli.console.assistant import Description

KEYS: Final = """what you type goes to the server when it ends with ; (and wait) or , (in the background)
   Enter         send; while the statement is unfinished, begin a new line; on an empty line, add the missing ;
   Esc Enter     send as it is
   Tab           complete the name of a slot; Up, Down: what was typed before; Ctrl-R: search it
   Ctrl-C        drop what is typed; with nothing typed: kill what runs in the foreground
   Ctrl-D        leave; the server goes on
   help NAME     what the server knows of a slot, such as help String.split"""

MAX_LINES: Final = 12
"""Maximum number of lines of a function's source that are shown."""
_IDENTIFIER: Final = re.compile(r"[A-Za-z_]\w*")


def described(name: str, what: Description) -> AnyFormattedText:
    """Format a description for the screen."""
    parts: list[tuple[str, str]] = [("class:prompt", name), ("", f": {what.type}\n")]
    if what.text:
        parts.append(("", textwrap.indent(what.text.strip(), "  ") + "\n"))
    if what.protos:
        parts.append(("class:note", f"  prototypes: {what.protos}\n"))
    if what.source:
        lines = what.source.splitlines()
        cut = [*lines[:MAX_LINES], "..."] if len(lines) > MAX_LINES else lines
        parts.append(("", textwrap.indent("\n".join(cut), "  ") + "\n"))
    if any("\t" in slot for slot in what.slots):
        parts.append(("", _table(what.slots)))
        return FormattedText(parts)
    slots = [slot for slot in what.slots if _IDENTIFIER.fullmatch(slot) and not slot.startswith("_")]
    if slots:
        width = max(40, shutil.get_terminal_size().columns - 2)
        parts.append(("class:other", textwrap.indent(textwrap.fill("  ".join(sorted(slots)), width), "  ") + "\n"))
    return FormattedText(parts)


def _table(rows: Sequence[str]) -> str:
    """The slots of a device, one in a line: name, present value with its unit, meaning and range."""
    lines = []
    for row in rows:
        name, value, unit, span, meaning = row.split("\t")
        shown = f"{value} {unit}" if unit not in ("", "1") and value not in ("", "nil", "nan") else value
        # Where no value has the unit with it, the note has.
        note = f"{span} {unit}".strip() if span or shown == value else ""
        note = note.removesuffix("1").rstrip() if unit == "1" else note
        lines.append((name, shown, f"{meaning} ({note})" if note else meaning))
    widths = [max(len(line[column]) for line in lines) for column in (0, 1)]
    return "".join(
        f"  {name:<{widths[0]}}  {value:<{widths[1]}}  {rest}".rstrip() + "\n" for name, value, rest in lines
    )
