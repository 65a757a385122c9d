"""Breaking into a job that does not yield.

Only a signal handler of the scheduler's thread can: it runs between two instructions of whatever holds the interpreter.
Raising right there might leave a list of the kernel half changed.  So the handler arms a trace function, which waits
for a place where generated code can be left like by any other exception: a backward jump, or the beginning of a
function.  An endless program comes to one of them again and again.  As long as nobody breaks in, this costs nothing.
"""

from __future__ import annotations

import dis
import sys
from collections.abc import Callable
from types import FrameType
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from urbihw.kernel.sched.job import Job
    from urbihw.kernel.sched.scheduler import Scheduler

BACKWARD: Final = frozenset(code for name, code in dis.opmap.items()
                            if "JUMP_BACKWARD" in name and "NO_INTERRUPT" not in name)

Trace = Callable[[FrameType, str, Any], Any]


class Breaker:
    """Throws something into the running job; a debugger's trace function, if there is one, is lost by it."""

    def __init__(self, scheduler: Scheduler, now: Callable[[], float]) -> None:
        """``now`` tells, in seconds, how long a job has held the interpreter."""
        self._scheduler = scheduler
        self._now = now
        self._job: Job | None = None
        self._cycle = 0
        self._error: BaseException | None = None
        self._due = 0.0

    def break_in(self, frame: FrameType | None, error: BaseException, after: float = 0.0) -> None:
        """Make the running job leave what it does by ``error`` if it has not yielded ``after`` so many seconds.

        To be called by a signal handler, with the frame that it interrupted; nothing happens when no job runs.
        """
        scheduler = self._scheduler
        if scheduler.current is None:
            return
        self._job, self._cycle = scheduler.current, scheduler.cycle
        self._error, self._due = error, self._now() + after
        while frame is not None:
            if scheduler.is_program(frame):
                self._watch(frame)
            frame = frame.f_back
        sys.settrace(self._called)

    def _watch(self, frame: FrameType) -> Trace:
        frame.f_trace = self._passed
        frame.f_trace_opcodes = True
        return self._passed

    def _called(self, frame: FrameType, event: str, argument: Any) -> Trace | None:
        """A function begins."""
        if self._is_over() or not self._scheduler.is_program(frame):
            return None
        self._throw_when_due()
        return self._watch(frame)

    def _passed(self, frame: FrameType, event: str, argument: Any) -> Trace | None:
        """A watched function comes to its next instruction."""
        if self._is_over():
            frame.f_trace_opcodes = False
            return None
        if event == "opcode" and _instruction(frame) in BACKWARD:
            self._throw_when_due()
        return self._passed

    def _is_over(self) -> bool:
        """Whether the job has yielded meanwhile; then nobody is traced any more."""
        scheduler = self._scheduler
        if self._error is not None and scheduler.current is self._job and scheduler.cycle == self._cycle:
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
    """The code of the instruction that a frame is about to execute."""
    code, at = frame.f_code.co_code, frame.f_lasti
    while code[at] == dis.EXTENDED_ARG:
        at += 2
    return code[at]
