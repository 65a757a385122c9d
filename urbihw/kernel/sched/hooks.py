"""Callbacks of the scheduler to the layer above, which knows the programs that the jobs run."""

from __future__ import annotations

from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from urbihw.kernel.sched.job import Job


class SchedulerHooks:
    """The defaults, for jobs that run plain Python."""

    def job_failed(self, job: Job, error: Exception) -> None:
        """Handle an error that ended a job without a group, or that was raised while another error ended the job."""

    def describe_frame(self, frame: FrameType) -> str:
        """The position of a Python frame in its program, for the log."""
        return ""

    def is_program(self, frame: FrameType) -> bool:
        """Whether an error may be raised at any instruction of a Python frame, because it runs generated code."""
        return False
