"""Objects of a robot as HTML for notebooks, and as text for ``help``; properties as Python shows them."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

HEAD = ("slot", "value", "unit", "range", "meaning")


def object_html(title: str, rows: Sequence[Sequence[str]]) -> str:
    """An object and its slots: name, value, unit, range, meaning."""
    if not rows:
        return f"<code>{escape(title)}</code>"
    head = "".join(f"<th>{word}</th>" for word in HEAD)
    body = "".join(f"<tr>{''.join(f'<td>{escape(str(word))}</td>' for word in row)}</tr>" for row in rows)
    return f"<b>{escape(title)}</b><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def robot_html(title: str, devices: Sequence[str], problem: str = "") -> str:
    """A connection, and the names of the devices, or why they are not known."""
    names = ", ".join(f"<code>{escape(name)}</code>" for name in devices)
    return f"<b>{escape(title)}</b><br>{names or escape(problem) or 'no devices'}"


def slots_text(title: str, rows: Sequence[Sequence[str]]) -> str:
    """An object and its slots, a line each, with unit, range and meaning; "" for one without a table."""
    if not rows:
        return ""
    width = max(len(row[0]) for row in rows)
    lines = []
    for name, _, unit, limits, meaning in rows:
        told = ", ".join(filter(None, (unit if unit != "1" else "", limits)))
        lines.append(f"{name:{width}}  {meaning}{f' ({told})' if told else ''}".rstrip())
    return "\n".join([title, "", *lines])


def first_line(said: Any) -> str:
    """What the server says about a slot, without the line on unit and range."""
    return said.partition("\n")[0] if isinstance(said, str) else ""


def number_or(value: Any, default: float) -> float:
    """A number as it is, and the default for anything else."""
    return float(value) if isinstance(value, int | float) else default
