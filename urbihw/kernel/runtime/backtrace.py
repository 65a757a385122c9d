"""From a Python traceback to an urbiscript call stack.

Generated code runs in frames whose globals hold ``__urbi__``, the line map of their unit; the "line number" of an
instruction is an index into that map.  So the call stack of an error costs nothing until it is needed: it is read off
the traceback without the frames of native code.  The innermost frame has the place of the error and the call that
raised it; each outer frame has the place and the name of the next call.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from functools import partial
from types import CodeType, FrameType, TracebackType
from typing import Any, Final, NamedTuple, Protocol

LINE_MAP = "__urbi__"
BREAKABLE = "__breakable__"
CALLS = "__calls__"
"""The name of a table in a module of built-ins: Python function -> the names of the calls that it makes of a function
that it was given, innermost first.  They stand for the calls that a built-in written in urbiscript would show in a call
stack."""
IMPLIED_CALLS = "__implied_calls__"
"""The name of a table in a module of the kernel: Python function -> the name of the call that it makes for a program
that does not name it.  A call stack shows this call."""
MAX_CALLS = 500
"""Maximum number of calls kept at either end of a call stack; the number of the others is kept instead of them.  An
error that passes through thousands of jobs has tens of thousands of calls, which take seconds to look up."""
MAX_SHOWN_CALLS = 19
"""Maximum number of calls printed at either end of a call stack, so that the report of a recursion without end has 40
lines: the error stays on the screen."""


class LineLookup(Protocol):
    """The part of the compiler's line map that this module uses."""

    system: bool
    has_bounced: bool
    """Whether there are arguments of calls that bounce to the lobby."""

    def frames(self, index: int, bounces: bool = False) -> list[CallFrame]:
        """The urbiscript frames of one instruction, innermost first (a for-each body counts as called by ``each``).

        ``bounces``: ``this`` is not the lobby, so that calls of ``echo`` bounce to it.
        """
        ...


class CallFrame(NamedTuple):
    """One step of a call stack: where a call was made, and the name that was called (None if it is no call)."""

    location: Any
    name: str | None


class BuiltInCalls:
    """Represents, in a call stack, a built-in that calls a function passed to it."""

    def __init__(self, names: tuple[str, ...], system: bool) -> None:
        self._names = names
        self.system = system
        self.has_bounced = False

    def frames(self, index: int, bounces: bool = False) -> list[CallFrame]:
        """The calls that the built-in makes; they have no location of their own."""
        return [CallFrame(None, name) for name in self._names]


class Stack(NamedTuple):
    """A call stack: the location, the routine that was called there, and the calls that led to it."""

    location: Any
    routine: str | None
    calls: tuple[CallFrame, ...]
    left_out: int = 0
    """How many calls one of ``calls`` stands for."""

    def lines(self) -> list[str]:
        """The lines of an error message about the calls, innermost first."""
        calls = self.calls
        lines = [f"   called from: {frame.location}: {frame.name}" for frame in calls]
        more = len(calls) - 2 * MAX_SHOWN_CALLS
        if more <= 1:
            return lines
        more += max(0, self.left_out - 1)
        return [*lines[:MAX_SHOWN_CALLS], f"   called from: ... {more} calls left out", *lines[-MAX_SHOWN_CALLS:]]


class NotedCall(NamedTuple):
    """A step of a call stack as it is noted: the instruction at an offset in some code.  To look it up takes longer and
    is done only for the steps that are shown."""

    line_map: LineLookup
    code: CodeType | None
    """None for a built-in that calls a function."""
    at: int
    bounces: bool = False


_new: Final = tuple.__new__
NO_STACK = Stack(None, None, ())


def stack_of(error: BaseException, hide_system: bool = True) -> Stack:
    """The urbiscript call stack of an exception, innermost first: the functions that it left, and their callers."""
    return note_stack(error, hide_system)()


def note_stack(error: BaseException, hide_system: bool = True) -> Callable[[], Stack]:
    """The call stack of an exception as ``stack_of`` tells it, found when it is asked for; it keeps no frame alive."""
    places: list[NotedCall] = []
    tb: TracebackType | None = error.__traceback__
    outer = None if tb is None else tb.tb_frame.f_back
    while tb is not None:
        frame = tb.tb_frame
        names = frame.f_globals
        if LINE_MAP in names:
            places.append(_place(names[LINE_MAP], frame, tb.tb_lasti))
        elif CALLS in names or IMPLIED_CALLS in names:
            _note_built_in(frame, places)
        tb = tb.tb_next
    places.reverse()
    _note_callers(outer, places)
    return partial(_stack, places, hide_system)


def failed_in_program(error: BaseException) -> bool:
    """Whether an exception left a function of a program, and not only functions of the library."""
    return any(not line_map.system for line_map in _line_maps(error))


def failed_in_code(error: BaseException) -> bool:
    """Whether an exception left an urbiscript function, of a program or of the library, before it was caught here."""
    return any(True for _ in _line_maps(error))


def _line_maps(error: BaseException) -> Iterator[LineLookup]:
    tb: TracebackType | None = error.__traceback__
    while tb is not None:
        line_map = tb.tb_frame.f_globals.get(LINE_MAP)
        if line_map is not None:
            yield line_map
        tb = tb.tb_next


def current_stack(hide_system: bool = True) -> Stack:
    """The call stack of the running job, innermost first."""
    places: list[NotedCall] = []
    _note_callers(sys._getframe(1), places)
    return _stack(places, hide_system)


def later_stack() -> Callable[[], Stack]:
    """The call stack of the running job as ``current_stack`` tells it, found when it is asked for."""
    places: list[NotedCall] = []
    _note_callers(sys._getframe(1), places)
    return partial(_stack, places, True)


def calling_frame() -> FrameType | None:
    """The Python frame of the innermost urbiscript function that is running."""
    frame: FrameType | None = sys._getframe(1)
    while frame is not None and LINE_MAP not in frame.f_globals:
        frame = frame.f_back
    return frame


def entry_of(frame: FrameType) -> int:
    """The position of a frame of generated code, as an index into its line map."""
    return _entry(frame.f_code, frame.f_lasti)


def _entry(code: CodeType, at: int) -> int:
    """The index for the instruction at an offset.  Instructions that CPython adds, such as the jump back to the head of
    a loop, have no index of their own and get that of the instruction before them.
    """
    entry = 0
    for begin, _, line in code.co_lines():
        if begin > at:
            break
        entry = line or entry
    return entry


def running_call() -> str | None:
    """The name of the call that the innermost urbiscript function is making."""
    frame = calling_frame()
    steps = [] if frame is None else frame.f_globals[LINE_MAP].frames(entry_of(frame))
    return steps[0].name if steps else None


def _note_callers(frame: FrameType | None, places: list[NotedCall]) -> None:
    """Add a running frame and those that called it to a call stack."""
    while frame is not None:
        names = frame.f_globals
        if LINE_MAP in names:
            places.append(_place(names[LINE_MAP], frame, frame.f_lasti))
        elif CALLS in names or IMPLIED_CALLS in names:  # few Python frames are any of them
            _note_built_in(frame, places)
        frame = frame.f_back


def _place(line_map: LineLookup, frame: FrameType, at: int) -> NotedCall:
    """The place of compiled code, at an offset in it."""
    bounces = line_map.has_bounced and not _is_of_lobby(frame)
    return _new(NotedCall, (line_map, frame.f_code, at, bounces))


def _note_built_in(frame: FrameType, places: list[NotedCall]) -> None:
    """Add the frame of a built-in to a call stack, if it stands for calls."""
    names, routine = frame.f_globals, frame.f_code.co_name
    if CALLS in names and routine in names[CALLS]:
        places.append(NotedCall(BuiltInCalls(names[CALLS][routine], system=True), None, 0))
    elif IMPLIED_CALLS in names and routine in names[IMPLIED_CALLS]:
        places.append(NotedCall(BuiltInCalls((names[IMPLIED_CALLS][routine],), system=False), None, 0))


def _is_of_lobby(frame: FrameType) -> bool:
    """Whether ``this`` of a frame of generated code is a lobby."""
    code = frame.f_code
    for name in (*code.co_varnames[:1], *code.co_freevars):
        if name.startswith("this_"):
            return bool(getattr(frame.f_locals.get(name), "is_per_connection", False))
    return False


def _stack(places: list[NotedCall], hide_system: bool) -> Stack:
    shown = [place for place in places if not (hide_system and place.line_map.system)]
    left_out = len(shown) - 2 * MAX_CALLS
    if left_out > 0:
        inner, outer = _flat(shown[:MAX_CALLS]), _flat(shown[-MAX_CALLS:])
        flat = [*inner, CallFrame(outer[0].location if outer else None, f"... {left_out} calls left out"), *outer]
    else:
        flat = _flat(shown)
    if not flat:
        return NO_STACK
    calls = tuple(frame for frame in flat[1:] if frame.name is not None)
    return Stack(flat[0].location, flat[0].name, calls, max(0, left_out))


def _flat(places: list[NotedCall]) -> list[CallFrame]:
    """The frames of some places.  A call made by a built-in gets the location where the built-in was called."""
    frames = [
        frame
        for line_map, code, at, bounces in places
        for frame in line_map.frames(0 if code is None else _entry(code, at), bounces)
    ]
    location = None
    for at in range(len(frames) - 1, -1, -1):
        if frames[at].location is None:
            frames[at] = frames[at]._replace(location=location)
        location = frames[at].location
    return frames


def is_program(frame: FrameType) -> bool:
    """Whether an error may be raised at any call or loop of a Python frame: it runs generated code, or code of a module
    that allows this with ``BREAKABLE``, because its unfinished work is not visible to others.
    """
    return LINE_MAP in frame.f_globals or BREAKABLE in frame.f_globals


def describe_frame(frame: FrameType | None) -> str:
    """`` (file:line.col: name)`` of the innermost urbiscript call in a Python frame, for the log."""
    while frame is not None:
        line_map = frame.f_globals.get(LINE_MAP)
        if line_map is not None:
            steps: list[CallFrame] = line_map.frames(entry_of(frame))
            if steps:
                return f" at {steps[0].location}" + (f" in {steps[0].name}" if steps[0].name else "")
        frame = frame.f_back
    return ""
