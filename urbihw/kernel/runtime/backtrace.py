"""From a Python traceback to what an urbiscript user understands.

Generated code runs in frames whose globals hold ``__urbi__``, the line map of their unit; the "line number" of an
instruction is an index into that map.  So the call stack of an error costs nothing until somebody looks at it: it is
read off the traceback, leaving out the frames of native code.  The innermost frame says where the error happened and
which call raised it; each frame further out says from where the next was called, and by what name.
"""

from __future__ import annotations

import sys
from types import FrameType, TracebackType
from typing import Any, NamedTuple, Protocol

LINE_MAP = "__urbi__"


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
    steps: list[tuple[bool, list[Frame]]] = []
    tb: TracebackType | None = error.__traceback__
    outer = None if tb is None else tb.tb_frame.f_back
    while tb is not None:
        line_map = tb.tb_frame.f_globals.get(LINE_MAP)
        if line_map is not None:
            steps.append((line_map.system, line_map.frames(tb.tb_lineno)))
        tb = tb.tb_next
    steps.reverse()
    return _stack(steps + _callers(outer), hide_system)


def current_stack(hide_system: bool = True) -> Stack:
    """The call stack of the running job, innermost first."""
    return _stack(_callers(sys._getframe(1)), hide_system)


def calling_frame() -> FrameType | None:
    """The Python frame of the innermost urbiscript function that is running."""
    frame: FrameType | None = sys._getframe(1)
    while frame is not None and LINE_MAP not in frame.f_globals:
        frame = frame.f_back
    return frame


def running_call() -> str | None:
    """The name of the call that the innermost urbiscript function is making."""
    frame = calling_frame()
    steps = [] if frame is None else frame.f_globals[LINE_MAP].frames(frame.f_lineno)
    return steps[0].name if steps else None


def _callers(frame: FrameType | None) -> list[tuple[bool, list[Frame]]]:
    steps: list[tuple[bool, list[Frame]]] = []
    while frame is not None:
        line_map = frame.f_globals.get(LINE_MAP)
        if line_map is not None:
            steps.append((line_map.system, line_map.frames(frame.f_lineno)))
        frame = frame.f_back
    return steps


def _stack(steps: list[tuple[bool, list[Frame]]], hide_system: bool) -> Stack:
    if hide_system:
        shown = [frames for system, frames in steps if not system]
    else:
        shown = [frames for _, frames in steps]
    flat = [frame for frames in shown for frame in frames]
    if not flat:
        return NO_STACK
    calls = tuple(frame for frame in flat[1:] if frame.name is not None)
    return Stack(flat[0].location, flat[0].name, calls)


def is_program(frame: FrameType) -> bool:
    """Whether a Python frame is one of generated code."""
    return LINE_MAP in frame.f_globals


def describe_frame(frame: FrameType | None) -> str:
    """`` (file:line.col: name)`` of the innermost urbiscript call in a Python frame, for the log."""
    while frame is not None:
        line_map = frame.f_globals.get(LINE_MAP)
        if line_map is not None:
            steps: list[Frame] = line_map.frames(frame.f_lineno)
            if steps:
                return f" at {steps[0].location}" + (f" in {steps[0].name}" if steps[0].name else "")
        frame = frame.f_back
    return ""
