"""Interrupts a job that does not yield.

Only a signal handler in the scheduler's thread can do this, because it runs between two instructions of the code that
holds the interpreter.  Raising an error right there could leave a list of the kernel half changed.  So the handler sets
a trace function, which waits for a place where generated code may be left by an exception: a backward jump, or the
beginning of a function.  An endless program reaches such places again and again.  While no error is pending, this costs
nothing.
"""

from __future__ import annotations

import dis
import sys
import time
from collections.abc import Callable
from types import FrameType
from typing import TYPE_CHECKING, Any, Final

from urbihw.kernel.sched.signals import takes_precedence

if TYPE_CHECKING:
    from urbihw.kernel.sched.job import Job
    from urbihw.kernel.sched.scheduler import Scheduler

BACKWARD: Final = frozenset(code for name, code in dis.opmap.items()
                            if "JUMP_BACKWARD" in name and "NO_INTERRUPT" not in name)

EXTRA_CALLS: Final = 200
"""Additional Python calls that a signal handler may nest when it interrupts a program at the recursion limit."""

Trace = Callable[[FrameType, str, Any], Any]
"""A trace function of ``sys.settrace``."""


class Breaker:
    """Raises an error in the running job.  It replaces the trace function of a debugger, if there is one.

    There is one for each scheduler: two would replace each other's trace function.
    """

    def __init__(self, scheduler: Scheduler, now: Callable[[], float] = time.monotonic) -> None:
        """``now`` is the clock that measures how long a job has held the interpreter, in seconds; never a simulated
        one.
        """
        self._scheduler = scheduler
        self._now = now
        self._job: Job | None = None
        self._cycle = 0
        self._error: BaseException | None = None
        self._due = 0.0
        # Python calls a trace function without a reference of its own, and a signal between may set another one.  So
        # these two objects live as long as the breaker: new bound methods for each signal were freed while in use.
        self._call_tracer: Trace = self._trace_call
        self._opcode_tracer: Trace = self._trace_opcode

    def armed(self) -> bool:
        """Whether an error is pending."""
        return self._error is not None

    def break_in(self, frame: FrameType | None, error: BaseException, after: float = 0.0) -> None:
        """Raise ``error`` in the running job if it has not yielded ``after`` seconds from now.

        To be called by a signal handler, with the frame that it interrupted.  Nothing happens when no job runs.  When
        another error is pending for the job, ``takes_precedence`` decides between them.
        """
        scheduler = self._scheduler
        if scheduler.current is None:
            return
        before = None if self._has_yielded() else self._error
        due = self._now() + after
        if before is not None and not takes_precedence(error, before):
            error, due = before, min(due, self._due)
        self._job, self._cycle = scheduler.current, scheduler.cycle
        self._error, self._due = error, due
        self._arm(frame)

    def rearm(self, frame: FrameType | None) -> None:
        """Set the trace function once more if an error is pending; to be called by a signal handler.

        Python drops a trace function that fails, and a trace function fails where the stack has no room for another
        call.
        """
        if not self._has_yielded():
            self._arm(frame)

    def _arm(self, frame: FrameType | None) -> None:
        """Watch the frames of the program from this one down to the first that is watched already.

        Those below are, too: a frame is watched when it begins, or here.  So a deep stack is walked only once, though a
        signal comes again and again.
        """
        while frame is not None:
            if self._scheduler.hooks.is_program(frame):
                if frame.f_trace is self._opcode_tracer and frame.f_trace_opcodes:
                    break
                self._watch(frame)
            frame = frame.f_back
        sys.settrace(self._call_tracer)

    def _watch(self, frame: FrameType) -> Trace:
        frame.f_trace = self._opcode_tracer
        frame.f_trace_opcodes = True
        return self._opcode_tracer

    def _trace_call(self, frame: FrameType, event: str, argument: Any) -> Trace | None:
        """Trace function: a Python function begins."""
        if self._stop_if_yielded() or not self._scheduler.hooks.is_program(frame):
            return None
        self._throw_when_due()
        return self._watch(frame)

    def _trace_opcode(self, frame: FrameType, event: str, argument: Any) -> Trace | None:
        """Trace function: a traced function is about to execute its next instruction."""
        if self._stop_if_yielded():
            frame.f_trace_opcodes = False
            return None
        if event == "opcode" and _instruction(frame) in BACKWARD:
            self._throw_when_due()
        return self._opcode_tracer

    def _has_yielded(self) -> bool:
        """Whether no error is pending, or the job has yielded since ``break_in``."""
        scheduler = self._scheduler
        return self._error is None or scheduler.current is not self._job or scheduler.cycle != self._cycle

    def _stop_if_yielded(self) -> bool:
        """The same; if so, the error is dropped and tracing ends."""
        if not self._has_yielded():
            return False
        self._job = self._error = None
        sys.settrace(None)
        return True

    def _throw_when_due(self) -> None:
        error = self._error
        if error is not None and self._now() >= self._due:
            self._job = self._error = None
            sys.settrace(None)
            raise error


def _instruction(frame: FrameType) -> int:
    """The opcode of the instruction that a frame is about to execute."""
    code, at = frame.f_code.co_code, frame.f_lasti
    while code[at] == dis.EXTENDED_ARG:
        at += 2
    return code[at]
