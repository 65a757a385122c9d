"""A job: one flow of execution with a state, run by a carrier (see ``coro``).

A job runs until it asks the scheduler for something (``Scheduler.yield_``, ``sleep``, ``suspend``); nothing takes
the processor away from it.  While it waits, ``undo`` says how to leave the place where it waits, so that stopping or
freezing it never has to search.
"""

from __future__ import annotations

from collections.abc import Callable
from types import FrameType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from urbihw.kernel.sched.coro import Carrier
    from urbihw.kernel.sched.group import Group
    from urbihw.kernel.sched.scheduler import Scheduler
    from urbihw.kernel.sched.tag import TagEntry
    from urbihw.kernel.sched.timequeue import Timer

READY, RUNNING, SLEEPING, WAITING, TERMINATED = "starting", "running", "sleeping", "waiting", "terminated"


class Job:
    """One flow of execution.  Made by ``Scheduler.spawn``; the fields are read by all and written by ``sched`` only.

    ``context`` belongs to the layer above (the runtime keeps the lobby there) and is inherited by jobs made from it.
    ``epoch`` is what ``Scheduler.epoch`` was when the statement began that the job belongs to; jobs made from it
    inherit it, so that all parts of one statement are equally old.
    """

    __slots__ = (
        "__weakref__",
        "body",
        "carrier",
        "context",
        "done",
        "entries",
        "epoch",
        "error",
        "face",
        "frozen",
        "frozen_at",
        "group",
        "held",
        "name",
        "on_end",
        "payer",
        "pending",
        "result",
        "scheduler",
        "shift",
        "started",
        "state",
        "timer",
        "undo",
        "wake_left",
    )

    def __init__(self, scheduler: Scheduler, body: Callable[[], Any], name: str, context: Any) -> None:
        self.scheduler = scheduler
        self.body: Callable[[], Any] | None = body
        self.carrier: Carrier | None = None
        self.name = name
        self.context = context
        self.state = READY
        self.started = False
        self.done = False
        self.result: Any = None
        self.error: BaseException | None = None
        self.pending: BaseException | None = None
        self.undo: Callable[[], None] | None = None
        self.timer: Timer | None = None
        self.wake_left = 0.0
        self.entries: list[TagEntry] = []
        self.epoch = scheduler.epoch
        self.frozen = False
        self.frozen_at = 0.0
        self.held = False
        self.shift = 0.0
        self.group: Group | None = None
        self.on_end: list[Callable[[Job], None]] | None = None
        self.face: Any = None
        self.payer = context
        """The context among whose jobs this one counts, whatever it speaks to for a moment."""

    def main(self) -> None:
        """Run the body (in a carrier) and tell the scheduler of the end."""
        try:
            assert self.body is not None
            self.result = self.body()
        except KeyboardInterrupt:  # nobody has taken the signal over yet, so it is for the whole process
            raise
        except BaseException as error:
            self.error = error
        self.body = None
        self.scheduler.ended(self)

    def time_is_up(self) -> None:
        """A sleeper's time has come: it is ready."""
        self.timer = None
        self.state = READY
        self.scheduler.ready.append(self)

    def frame(self) -> FrameType | None:
        """The Python frame in which a suspended job stands, to look at its call stack."""
        return None if self.carrier is None else self.carrier.frame()

    def status(self) -> str:
        """``running``, ``sleeping``, ``waiting`` ...; with `` (frozen)`` behind it when a tag holds the job."""
        if self.done:
            return TERMINATED
        return self.state + (" (frozen)" if self.frozen else "")

    def when_ended(self, action: Callable[[Job], None]) -> None:
        """Call ``action(job)`` once when the job is over; at once if it is already."""
        if self.done:
            action(self)
        elif self.on_end is None:
            self.on_end = [action]
        else:
            self.on_end.append(action)

    def renew(self) -> None:
        """A new statement begins in this job: it, and who waits for it, is as old as what begins now."""
        job: Job | None = self
        while job is not None and job.epoch != self.scheduler.epoch:
            job.epoch = self.scheduler.epoch
            job = None if job.group is None else job.group.owner

    def local_time(self, now: float) -> float:
        """The job's own time: what the clock says less what it spent frozen."""
        return now - self.shift
