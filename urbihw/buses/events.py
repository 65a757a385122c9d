"""The messages of a worker as events: objects of JSON, for the clients of its control socket; no I/O.

Most of a message is numbers and texts, which the encoder of JSON takes as they are: only what it does not know is
converted, when it comes to that (`json_value`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any


def message_event(message: Any) -> dict[str, Any]:
    """Return a message as an event: the name of its class, and its fields.

    A table whose keys are devices and items becomes a list of rows: device, item, value.
    """
    event = {"event": type(message).__name__}
    for name in message.__slots__:
        event[name] = _rows(getattr(message, name))
    return event


def json_value(value: Any) -> Any:
    """Return what JSON has for a value that its encoder does not know; bytes are only counted."""
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, set | frozenset):
        return [*value]
    if isinstance(value, bytes):
        return f"{len(value)} bytes"
    if is_dataclass(value) and not isinstance(value, type):
        return {each.name: getattr(value, each.name) for each in fields(value)}
    return str(value)


def _rows(value: Any) -> Any:
    if isinstance(value, Mapping) and isinstance(next(iter(value), None), tuple):
        return [[*key, inner] for key, inner in value.items()]
    return value
