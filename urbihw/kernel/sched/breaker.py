"""Breaking into a job that does not yield.

Only a signal handler of the scheduler's thread can: it runs between two instructions of whatever holds the interpreter.
Raising right there might leave a list of the kernel half changed.  So the handler arms a trace function, which waits
for a place where generated code can be left like by any other exception: a backward jump, or the beginning of a
function.  An endless program comes to one of them again and again.  As long as nobody breaks in, this costs nothing.
"""

from __future__ import annotations

import dis
import sys
import time
from collections.abc import Callable
from types import FrameType
from typing import TYPE_CHECKING, Any, Final

from urbihw.kernel.sched.signals import goes_further

if TYPE_CHECKING:
    from urbihw.kernel.sched.job import Job
    from urbihw.kernel.sched.scheduler import Scheduler

BACKWARD: Final = frozenset(code for name, code in dis.opmap.items()
                            if "JUMP_BACKWARD" in name and "NO_INTERRUPT" not in name)

DEEPER: Final = 200
"""How many calls more than usual a signal handler may nest that breaks in where a program is as deep as it may be."""

Trace = Callable[[FrameType, str, Any], Any]


class Breaker:
    """Throws something into the running job; a debugger's trace function, if there is one, is lost by it.

    There is one for each scheduler: two would take the trace function from each other.
    """

    def __init__(self, scheduler: Scheduler, now: Callable[[], float] = time.monotonic) -> None:
        """``now`` tells, in seconds, how long a job has held the interpreter, which no simulated clock does."""
        self._scheduler = scheduler
        self._now = now
        self._job: Job | None = None
        self._cycle = 0
        self._error: BaseException | None = None
        self._due = 0.0

    def armed(self) -> bool:
        """Whether something is still to be thrown."""
        return self._error is not None

    def break_in(self, frame: FrameType | None, error: BaseException, after: float = 0.0) -> None:
        """Make the running job leave what it does by ``error`` if it has not yielded ``after`` so many seconds.

        To be called by a signal handler, with the frame that it interrupted; nothing happens when no job runs.  Of two
        that are to reach one job the one that leads further out wins.
        """
        scheduler = self._scheduler
        if scheduler.current is None:
            return
        before = None if self._gave_way() else self._error
        due = self._now() + after
        if before is not None and not goes_further(error, before):
            error, due = before, min(due, self._due)
        self._job, self._cycle = scheduler.current, scheduler.cycle
        self._error, self._due = error, due
        self._arm(frame)

    def again(self, frame: FrameType | None) -> None:
        """Arm the trace function once more, if something is still to be thrown; to be called by a signal handler.

        Python drops a trace function that fails, and it does where no call fits on the stack any more.
        """
        if not self._gave_way():
            self._arm(frame)

    def _arm(self, frame: FrameType | None) -> None:
        while frame is not None:
            if self._scheduler.is_program(frame):
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

    def _gave_way(self) -> bool:
        """Whether nothing is to be thrown any more: the job has yielded meanwhile."""
        scheduler = self._scheduler
        return self._error is None or scheduler.current is not self._job or scheduler.cycle != self._cycle

    def _is_over(self) -> bool:
        """The same; then nobody is traced any more."""
        if not self._gave_way():
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
