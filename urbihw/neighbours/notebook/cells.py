"""Cells of a notebook: whether one is complete, the orders that begin with %, and how a value is shown."""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

from urbihw.client.aio import AsyncSlot
from urbihw.client.assistant import Description
from urbihw.client.media import Blob, Picture
from urbihw.kernel.syntax.reader import StatementReader, SyntaxProblem

DEFAULT_PLOT_S: Final = 5.0
MAX_PLOT_S: Final = 600.0
_PLOT: Final = "%plot "
_ENDS_TOO_SOON: Final = "unexpected end of command"
"""What the parser says of a text that goes on."""


class PlotOrder(NamedTuple):
    """``%plot motor6.val motor7.val 10``: slots, and seconds to follow them."""

    slots: tuple[str, ...]
    seconds: float


def plot_order(code: str) -> PlotOrder | None:
    """The order to plot in a cell; None for urbiscript.  Raises ValueError for a time that cannot be."""
    if not code.startswith(_PLOT):
        return None
    slots, seconds = code.removeprefix(_PLOT).split(), DEFAULT_PLOT_S
    if slots and slots[-1][0].isdigit():
        seconds = float(slots.pop())
    if not 0 < seconds <= MAX_PLOT_S:
        raise ValueError(f"{seconds:g} s: give a time of up to {MAX_PLOT_S:g} s")
    return PlotOrder(tuple(slots), seconds)


def completeness(code: str) -> str:
    """Whether a cell is ``complete``, ``incomplete`` or ``invalid``: as the parser sees it."""
    if code.startswith("%"):
        return "complete"
    reader = StatementReader()
    wrong = _wrong(reader.feed(code.encode("utf-8", "replace"))) or _wrong(reader.finish())
    return {"": "complete", _ENDS_TOO_SOON: "incomplete"}.get(wrong, "invalid")


def _wrong(items: Sequence[object]) -> str:
    """The first error, "" for none."""
    return next((item.message for item in items if isinstance(item, SyntaxProblem) and not item.warning), "")


def shown_text(value: Any) -> str:
    """A value as urbiscript prints it."""
    if value is None:
        return "nil"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return f"{value:.6g}" if math.isfinite(value) else str(value)
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
        return f'"{escaped}"'
    if isinstance(value, list):
        return f"[{', '.join(map(shown_text, value))}]"
    if isinstance(value, dict):
        members = (f"{shown_text(key)} => {shown_text(each)}" for key, each in value.items())
        return f"[{', '.join(members) or '=>'}]"
    if isinstance(value, Blob):
        return f"BIN {len(value)} {value.keywords}"
    return value.urbiscript_path() if isinstance(value, AsyncSlot) else str(value)


def shown(value: Any) -> dict[str, str]:
    """A value by the types of Jupyter: as a text, and a picture as a picture, where it can be one."""
    data = {"text/plain": shown_text(value)}
    if isinstance(value, Picture):
        for kind, made in (("image/jpeg", value._repr_jpeg_()), ("image/png", value._repr_png_())):
            if made is not None:
                data[kind] = base64.b64encode(made).decode()
    return data


def described(name: str, what: Description) -> str:
    """The text of the help on a slot."""
    head = f"{name}: {what.type}"
    slots = "\n".join(slot.replace("\t", "  ") for slot in what.slots)
    return "\n\n".join(filter(None, (head, what.text, what.source, slots)))
