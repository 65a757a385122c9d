"""What others of a fleet tell, checked where it comes in: anybody may put anything under any key."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Final

MAX_TOLD_BYTES: Final = 1024 * 1024
MAX_TEXT: Final = 1000
MAX_MEMBERS: Final = 1000
"""Members of a list that is the value of a slot."""


class NotTold(ValueError):
    """What came is not what robots tell; the message is one line."""


def told_in(payload: bytes) -> dict[str, Any]:
    """The object of JSON in a message.  Raises NotTold."""
    try:
        told = json.loads(payload) if len(payload) <= MAX_TOLD_BYTES else None
    except (ValueError, RecursionError):
        told = None
    if not isinstance(told, dict):
        raise NotTold(f"what came is no object of JSON of at most {MAX_TOLD_BYTES} bytes")
    return told


def values_in(payload: bytes) -> dict[str, Any]:
    """``n``, ``t`` and the values ``v`` that a robot publishes, without those that no slot has.  Raises NotTold."""
    told = told_in(payload)
    values = told.get("v")
    if not isinstance(values, Mapping) or number_in(told.get("t")) is None:
        raise NotTold("what came are no values")
    return {**told, "v": {path: value for path, value in values.items() if is_value(value)}}


def is_value(value: Any, depth: int = 0) -> bool:
    """Whether a slot may have a value: a number, a truth, a short text, nil, or a flat list of those."""
    if isinstance(value, list):
        return depth == 0 and len(value) <= MAX_MEMBERS and all(is_value(each, 1) for each in value)
    if isinstance(value, str):
        return len(value) <= MAX_TEXT and not any("\ud800" <= each <= "\udfff" for each in value)
    return value is None or isinstance(value, bool) or number_in(value) is not None


def number_in(value: Any) -> float | None:
    """Turn what came into a number; None for anything else, and for an int that no float holds."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        return float(value)
    except OverflowError:
        return None
