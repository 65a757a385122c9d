"""Parses the expression before the cursor: the path of an object, and the beginning of the name of its slot."""

from __future__ import annotations

import re
from typing import Final

from urbihw.frozen import frozen

Step = str | tuple[float | str]
"""A name, or an index."""

_NAME: Final = r"[A-Za-z_]\w*"
_INDEX: Final = r'\[\s*(?:-?\d+(?:\.\d+)?|"[^"\\]*")\s*\]'
_SUBJECT: Final = re.compile(rf"((?:{_NAME}(?:{_INDEX})*\s*\.\s*)*)({_NAME})?$")
_STEP: Final = re.compile(rf'({_NAME})|\[\s*(?:(-?\d+(?:\.\d+)?)|"([^"\\]*)")\s*\]')
_CLOSED: Final = re.compile(r'"(?:[^"\\]|\\.)*"|//[^\n]*\n|/\*.*?\*/', re.DOTALL)
_OPEN: Final = re.compile(r'"|//|/\*')
"""The beginning of a string or comment; one that is left after the closed ones are removed is open."""
_PATH: Final = re.compile(rf"{_NAME}(?:{_INDEX})*(?:\s*\.\s*{_NAME}(?:{_INDEX})*)*")


_CALLED: Final = re.compile(rf"(?<![\w.\"\])])(?<!->)({_NAME}(?:{_INDEX})*(?:\s*\.\s*{_NAME}(?:{_INDEX})*)*)\s*$")
"""The path in front of a parenthesis; one behind an expression is no path."""


@frozen(slots=False)
class Subject:
    """The slot before the cursor: ``path`` leads from the lobby to the object, ``prefix`` is the typed part of the
    name."""

    path: tuple[Step, ...]
    prefix: str


def subject(text: str) -> Subject | None:
    """The subject at the end of a text; None where no name is expected, or where the object is not known."""
    match = _SUBJECT.search(text)
    if match is None or _OPEN.search(_CLOSED.sub("", text)):
        return None
    before = text[: match.start()].rstrip()
    prefix = match[2] or ""
    if before.endswith('".') and not match[1]:
        return Subject(("String",), prefix)
    if before.endswith((".", "->")) or text[: match.start()][-1:].isalnum():
        return None
    return Subject(steps(match[1]), prefix)


def open_call(text: str) -> tuple[tuple[Step, ...], str] | None:
    """The function whose arguments stand at the end of a text: the path of what has it, and its name.  None outside of
    parentheses, and where the function has no path."""
    bare = _CLOSED.sub(lambda found: " " * len(found[0]), text)
    if _OPEN.search(bare):
        bare = bare[: _OPEN.search(bare).start()]  # type: ignore[union-attr]  # the beginning of an argument
    closed = 0
    for at in range(len(bare) - 1, -1, -1):
        if bare[at] in ")]}":
            closed += 1
        elif bare[at] in "([{" and closed:
            closed -= 1
        elif bare[at] == "(":
            match = _CALLED.search(text[:at])
            found = steps(match[1]) if match is not None else ()
            return (found[:-1], found[-1]) if found and isinstance(found[-1], str) else None
        elif bare[at] in "[{;":
            return None
    return None


def steps(text: str) -> tuple[Step, ...]:
    """The steps of a path such as ``motors[6].val``; the lobby, where all paths begin, is no step."""
    found: list[Step] = []
    for name, number, word in _STEP.findall(text):
        if name:
            found.append(name)
        else:
            found.append((float(number),) if number else (word,))
    while found and found[0] in ("lobby", "this"):
        del found[0]
    return tuple(found)


def whole_path(text: str) -> tuple[Step, ...] | None:
    """The steps of a text that is a path and nothing else."""
    stripped = text.strip().rstrip(";").rstrip()
    return steps(stripped) or ("lobby",) if _PATH.fullmatch(stripped) else None
