"""The messages of a worker as events: objects of JSON, for the clients of its control socket; no I/O."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, Final

MOST_TEXT: Final = 4000
"""Characters of a text in an event; what is longer is cut."""


def message_event(message: Any) -> dict[str, Any]:
    """Return a message as an event: the name of its class, and its fields."""
    values = {name: plain(getattr(message, name)) for name in message.__slots__}
    return {"event": type(message).__name__, **values}


def plain(value: Any) -> Any:
    """Return a value as JSON can have it.

    Bytes are only counted. A table whose keys are devices and items becomes a list of rows: device, item, value.
    """
    if isinstance(value, Mapping):
        if any(isinstance(key, tuple) for key in value):
            return [[*map(plain, key), plain(inner)] for key, inner in value.items()]
        return {str(key): plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(inner) for inner in value]
    if isinstance(value, bytes):
        return f"{len(value)} bytes"
    if is_dataclass(value) and not isinstance(value, type):
        return {each.name: plain(getattr(value, each.name)) for each in fields(value)}
    text = value if value is None or isinstance(value, str | int | float | bool) else str(value)
    return text[:MOST_TEXT] if isinstance(text, str) else text
