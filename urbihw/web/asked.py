"""Fields of a request, checked."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, Final

from urbihw.client.literals import checked_path

_NONE: Any = object()
_OWN: Final = re.compile(r"(?:^|\.)__")


class WebRefusal(Exception):
    """A request is refused; ``code`` is one of those of the protocol."""

    def __init__(self, text: str, code: str = "bad") -> None:
        super().__init__(text)
        self.code = code


def number_of(request: Mapping[str, Any], name: str, least: float, most: float, default: Any = _NONE) -> float:
    """A number within bounds.  Raises WebRefusal."""
    value = request.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= most:
        raise WebRefusal(f"{name} wants a number from {least:g} to {most:g}")
    return float(value)


def text_of(request: Mapping[str, Any], name: str, default: str | None = None) -> str:
    """A text.  Raises WebRefusal, also for halves of surrogate pairs, which JSON can have and no program can."""
    value = request.get(name, default)
    if not isinstance(value, str):
        raise WebRefusal(f"{name} wants a text")
    try:
        value.encode()
    except UnicodeEncodeError as error:
        raise WebRefusal(f"{name}: character {error.start + 1} is half of a surrogate pair") from error
    return value


def path_of(request: Mapping[str, Any], name: str) -> str:
    """The path of a slot; names of the gateway's own slots, which begin with ``__``, are refused.  Raises
    WebRefusal."""
    try:
        path = checked_path(text_of(request, name, ""))
    except ValueError as error:
        raise WebRefusal(f"{name}: {error}") from error
    if _OWN.search(path):
        raise WebRefusal(f"{name}: {path}: names that begin with __ are internal")
    return path


def paths_of(request: Mapping[str, Any], name: str, most: int) -> list[str]:
    """Paths of slots, at least one.  Raises WebRefusal."""
    value = request.get(name)
    if not isinstance(value, list) or not 0 < len(value) <= most:
        raise WebRefusal(f"{name} wants a list of 1 to {most} paths of slots, such as [\"motor6.val\"]")
    return [path_of({name: each}, name) for each in value]


def names_of(request: Mapping[str, Any], name: str, most: int) -> list[str]:
    """Names of persons, at least one.  Raises WebRefusal."""
    value = request.get(name)
    if not isinstance(value, list) or not 0 < len(value) <= most:
        raise WebRefusal(f"{name} wants a list of 1 to {most} names")
    return [text_of({name: each}, name) for each in value]


def truth_of(request: Mapping[str, Any], name: str) -> bool:
    """True or false.  Raises WebRefusal."""
    value = request.get(name)
    if not isinstance(value, bool):
        raise WebRefusal(f"{name} wants true or false")
    return value
