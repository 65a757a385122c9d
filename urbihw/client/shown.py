"""Objects of a robot as HTML, for notebooks."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

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
