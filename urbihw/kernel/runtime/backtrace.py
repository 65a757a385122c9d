"""From a Python traceback to what an urbiscript user understands.

Generated code runs in frames whose globals hold ``__urbi__``, the line map of their unit; the "line number" of an
instruction is an index into that map.  So the call stack of an error costs nothing until somebody looks at it: it is
read off the traceback, leaving out the frames of native code.  The innermost frame says where the error happened and
which call raised it; each frame further out says from where the next was called, and by what name.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from types import FrameType, TracebackType
from typing import Any, NamedTuple, Protocol

LINE_MAP = "__urbi__"
BREAKABLE = "__breakable__"
MOST_CALLS = 500
"""How many calls a call stack tells at either end; what lies between is left out, with their number.  An error that
comes through thousands of jobs has tens of thousands of calls behind it, which takes seconds to tell."""


class LineMap(Protocol):
    """What this module needs of the compiler's line map."""

    system: bool

    def frames(self, index: int) -> list[Frame]:
        """The urbiscript frames of one instruction, innermost first (a for-each body counts as called by ``each``)."""
        ...


class Frame(NamedTuple):
    """One step of a call stack: where a call was made, and the name that was called (None if it is no call)."""

    location: Any
    name: str | None


class Stack(NamedTuple):
    """A call stack: where it happened, the routine that was called there, and the calls that led to it."""

    location: Any
    routine: str | None
    calls: tuple[Frame, ...]


NO_STACK = Stack(None, None, ())


def stack_of(error: BaseException, hide_system: bool = True) -> Stack:
    """The urbiscript call stack of an exception, innermost first: what it went through, and who called that."""
    places: list[tuple[LineMap, int]] = []
    tb: TracebackType | None = error.__traceback__
    outer = None if tb is None else tb.tb_frame.f_back
    while tb is not None:
        line_map = tb.tb_frame.f_globals.get(LINE_MAP)
        if line_map is not None:
            places.append((line_map, _entry(tb.tb_frame, tb.tb_lasti)))
        tb = tb.tb_next
    places.reverse()
    return _stack(places + _callers(outer), hide_system)


def failed_in_program(error: BaseException) -> bool:
    """Whether an exception went through a function of a program, and not only through the library."""
    return any(not line_map.system for line_map in _line_maps(error))


def failed_in_code(error: BaseException) -> bool:
    """Whether an exception went through urbiscript, of a program or the library, on its way up to here."""
    return any(True for _ in _line_maps(error))


def _line_maps(error: BaseException) -> Iterator[LineMap]:
    tb: TracebackType | None = error.__traceback__
    while tb is not None:
        line_map = tb.tb_frame.f_globals.get(LINE_MAP)
        if line_map is not None:
            yield line_map
        tb = tb.tb_next


def current_stack(hide_system: bool = True) -> Stack:
    """The call stack of the running job, innermost first."""
    return _stack(_callers(sys._getframe(1)), hide_system)


def calling_frame() -> FrameType | None:
    """The Python frame of the innermost urbiscript function that is running."""
    frame: FrameType | None = sys._getframe(1)
    while frame is not None and LINE_MAP not in frame.f_globals:
        frame = frame.f_back
    return frame


def entry_of(frame: FrameType) -> int:
    """Where a frame of generated code stands, as an index into its line map."""
    return _entry(frame, frame.f_lasti)


def _entry(frame: FrameType, at: int) -> int:
    """The index for the instruction at an offset.  CPython writes some of its own, such as a jump back to the head of a
    loop, that have none: they belong to what comes before them."""
    entry = 0
    for begin, _, line in frame.f_code.co_lines():
        if begin > at:
            break
        entry = line or entry
    return entry


def running_call() -> str | None:
    """The name of the call that the innermost urbiscript function is making."""
    frame = calling_frame()
    steps = [] if frame is None else frame.f_globals[LINE_MAP].frames(entry_of(frame))
    return steps[0].name if steps else None


def _callers(frame: FrameType | None) -> list[tuple[LineMap, int]]:
    places: list[tuple[LineMap, int]] = []
    while frame is not None:
        line_map = frame.f_globals.get(LINE_MAP)
        if line_map is not None:
            places.append((line_map, entry_of(frame)))
        frame = frame.f_back
    return places


def _stack(places: list[tuple[LineMap, int]], hide_system: bool) -> Stack:
    shown = [place for place in places if not (hide_system and place[0].system)]
    left_out = len(shown) - 2 * MOST_CALLS
    if left_out > 0:
        inner, outer = _flat(shown[:MOST_CALLS]), _flat(shown[-MOST_CALLS:])
        flat = [*inner, Frame(outer[0].location if outer else None, f"... {left_out} calls left out"), *outer]
    else:
        flat = _flat(shown)
    if not flat:
        return NO_STACK
    calls = tuple(frame for frame in flat[1:] if frame.name is not None)
    return Stack(flat[0].location, flat[0].name, calls)


def _flat(places: list[tuple[LineMap, int]]) -> list[Frame]:
    return [frame for line_map, index in places for frame in line_map.frames(index)]


def is_program(frame: FrameType) -> bool:
    """Whether a Python frame may be left by an error wherever it calls or loops: it is generated code, or that of a
    module that says so of itself by ``BREAKABLE``, because what it has done by half nobody sees."""
    return LINE_MAP in frame.f_globals or BREAKABLE in frame.f_globals


def describe_frame(frame: FrameType | None) -> str:
    """`` (file:line.col: name)`` of the innermost urbiscript call in a Python frame, for the log."""
    while frame is not None:
        line_map = frame.f_globals.get(LINE_MAP)
        if line_map is not None:
            steps: list[Frame] = line_map.frames(entry_of(frame))
            if steps:
                return f" at {steps[0].location}" + (f" in {steps[0].name}" if steps[0].name else "")
        frame = frame.f_back
    return ""
