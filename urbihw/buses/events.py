"""The messages of a worker as events: lines of JSON, for the clients of its control socket; no I/O.

Most of a message is numbers and texts, which the encoder of JSON takes as they are: only what it does not know is
converted, when it comes to that. Nothing that a driver or a platform puts into a message raises here: the loop of the
worker, which stops the robot, would end with it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, Final

_DEEPEST: Final = 20
"""Levels of a value that is converted as a whole."""
_LONGEST_BITS: Final = 10_000
"""Bits of a number that is written in digits: Python refuses some thousand digits, since they take long."""


def message_event(message: Any) -> dict[str, Any]:
    """Return a message as an event: the name of its class, and its fields.

    A table whose keys are devices and items becomes a list of rows: device, item, value.
    """
    event = {"event": type(message).__name__}
    for name in message.__slots__:
        event[name] = _rows(getattr(message, name))
    return event


def event_line(event: Mapping[str, Any]) -> bytes:
    """Return an event, or an answer, as a line."""
    try:
        text = json.dumps(event, separators=(",", ":"), default=_known)
    except (TypeError, ValueError, RecursionError):
        # A table with keys that JSON does not have, a value that contains itself, or a number too long for digits.
        text = json.dumps(_plain(event, _DEEPEST), separators=(",", ":"))
    return text.encode("utf-8", "backslashreplace") + b"\n"


def _known(value: Any) -> Any:
    """What JSON has for a value that its encoder does not know; bytes are only counted."""
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, set | frozenset):
        return [*value]
    if isinstance(value, bytes):
        return f"{len(value)} bytes"
    if is_dataclass(value) and not isinstance(value, type):
        return {each.name: getattr(value, each.name) for each in fields(value)}
    return _text(value)


def _text(value: Any) -> str:
    """A value in words, also one that has none."""
    if isinstance(value, int) and value.bit_length() > _LONGEST_BITS:
        return f"a number of {value.bit_length()} bits"
    try:
        return str(value)
    except Exception:
        # What a value of a driver or a platform does when it is asked is its own affair, and the worker goes on.
        return f"a {type(value).__name__}"


def _plain(value: Any, depth: int) -> Any:
    """The same for a value as a whole, to a depth."""
    if isinstance(value, int) and value.bit_length() > _LONGEST_BITS:
        return _text(value)
    if value is None or isinstance(value, str | int | float | bool):
        return value
    if depth == 0:
        return "..."
    if isinstance(value, Mapping):
        return {_text(key): _plain(inner, depth - 1) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner, depth - 1) for inner in value]
    return _plain(_known(value), depth - 1)


def _rows(value: Any) -> Any:
    if isinstance(value, Mapping) and isinstance(next(iter(value), None), tuple):
        return [[*key, inner] if isinstance(key, tuple) else [key, inner] for key, inner in value.items()]
    return value
