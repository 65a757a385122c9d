"""A job: one flow of execution with a state, run by a carrier (module ``coro``).

Jobs are cooperative: a job runs until it calls ``Scheduler.yield_``, ``sleep`` or ``suspend``.  While it waits,
``undo`` removes it from the queue in which it waits, so that stopping it needs no search.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from types import FrameType
from typing import TYPE_CHECKING, Any

from urbihw.kernel.sched.signals import JobSignal

if TYPE_CHECKING:
    from urbihw.kernel.sched.coro import Carrier
    from urbihw.kernel.sched.group import Group
    from urbihw.kernel.sched.scheduler import Scheduler
    from urbihw.kernel.sched.tag import TagEntry
    from urbihw.kernel.sched.timequeue import Timer

READY, RUNNING, SLEEPING, WAITING, TERMINATED = "starting", "running", "sleeping", "waiting", "terminated"


class Job:
    """One flow of execution.  Made by ``Scheduler.spawn``.  All modules may read the fields; only ``sched`` writes
    them.

    ``context`` belongs to the layer above (the runtime stores the lobby there); jobs made by this job inherit it.
    ``era`` is the value of ``Scheduler.era`` when the job's statement began.  Jobs made by this job inherit it, so
    that all jobs of one statement have the same era.

    ``ordered`` is the value of ``Scheduler.era`` when somebody ordered this: the statement of a client, with all that
    it has set up, also handlers that run later; 0 where no client is behind it.  It stays when ``era`` is renewed.
    Statements of a program that began earlier, such as a device in another process, are not ordered one by one.
    """

    __slots__ = (
        "__weakref__",
        "body",
        "carrier",
        "context",
        "done",
        "entries",
        "era",
        "error",
        "face",
        "frozen",
        "frozen_at",
        "group",
        "held",
        "name",
        "movement",
        "on_end",
        "ordered",
        "charged_context",
        "pending",
        "result",
        "scheduler",
        "shift",
        "started",
        "state",
        "timer",
        "undo",
        "walk",
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
        self.era = scheduler.era
        self.ordered = 0
        self.frozen = False
        self.frozen_at = 0.0
        self.held = False
        self.shift = 0.0
        self.group: Group | None = None
        self.on_end: list[Callable[[Job], None]] | None = None
        self.movement: tuple[object, float] | None = None
        """The variable that the job moves at present by a trajectory, and the highest speed of that, in units per
        second; written by the trajectory."""
        self.face: Any = None
        self.walk: Any = None
        """The innermost built-in function in progress that walks a nested structure; written by the library."""
        self.charged_context = context
        """The context in whose number of jobs this job counts; it stays the same when ``context`` changes for a
        while."""

    def pace_of(self, variable: object) -> float:
        """Return the highest speed at which the job moves a variable, in units per second; inf for single writes."""
        movement = self.movement
        return movement[1] if movement is not None and movement[0] is variable else inf

    def main(self) -> None:
        """Run the body (in a carrier), and report the end to the scheduler."""
        try:
            assert self.body is not None
            self.result = self.body()
        except KeyboardInterrupt:  # no signal handler is installed yet, so it ends the process
            raise
        except JobSignal as signal:
            self.error = signal.with_traceback(None)  # it is not read, and refers to the job
        except BaseException as error:
            self.error = error
        self.body = None
        self.scheduler.ended(self)

    def take_pending(self) -> BaseException:
        """The error that is pending for the job.  It must not be held by a variable of the function that raises it: an
        error refers to the variables of all functions it leaves, and such a cycle would wait for Python's collector.
        """
        error, self.pending = self.pending, None
        assert error is not None
        return error

    def end_sleep(self) -> None:
        """Make the sleeping job ready, since its time has come."""
        self.timer = None
        self.state = READY
        self.scheduler.ready.append(self)

    def update_frozen(self) -> None:
        """Set whether the job is frozen, after one of its tags was frozen or unfrozen, or it entered or left a tag."""
        scheduler = self.scheduler
        frozen = scheduler.frozen_tags > 0 and any(entry.tag.is_frozen() for entry in self.entries)
        if frozen == self.frozen or self.done:
            return
        self.frozen = frozen
        now = scheduler.clock.now()
        # The job's own time stands still: the rest of its sleep is kept, and is slept when the job is unfrozen.
        if frozen:
            self.frozen_at = now
            if self.timer is not None:
                self.wake_left = self.timer.deadline - now
                self.timer.cancel()
            return
        self.shift += now - self.frozen_at
        if self.held:
            self.held = False
            self.state = READY
            scheduler.ready.append(self)
        elif self.timer is not None:
            self.timer = scheduler.timers.add(now + self.wake_left, self.end_sleep)

    def frame(self) -> FrameType | None:
        """The Python frame in which the job is suspended, for reading its call stack; None if it has no carrier."""
        return None if self.carrier is None else self.carrier.frame()

    def status(self) -> str:
        """``running``, ``sleeping``, ``waiting`` and so on; followed by `` (frozen)`` when a tag freezes the job."""
        if self.done:
            return TERMINATED
        return self.state + (" (frozen)" if self.frozen else "")

    def when_ended(self, action: Callable[[Job], None]) -> None:
        """Call ``action(job)`` once when the job is over; at once if it is over already."""
        if self.done:
            action(self)
        elif self.on_end is None:
            self.on_end = [action]
        else:
            self.on_end.append(action)

    def begin_statement(self, ordered: int | None = None) -> None:
        """A new statement of a client begins in this job; ``ordered`` is when it was ordered, None for now."""
        self.renew()
        self.ordered = self.scheduler.era if ordered is None else ordered

    def descend(self, maker: Job) -> None:
        """This job belongs to the statement of another one, though it does not have its tags."""
        self.era, self.ordered = maker.era, maker.ordered

    def is_part_of(self, statement: Job) -> bool:
        """Whether this is the job of a statement, or one of those that it waits for."""
        job: Job | None = self
        while job is not None and job is not statement:
            job = None if job.group is None else job.group.owner
        return job is not None

    def renew(self) -> None:
        """Let the statement of this job count as new: this job, and those that wait for it, get the present era."""
        job: Job | None = self
        while job is not None and job.era != self.scheduler.era:
            job.era = self.scheduler.era
            job = None if job.group is None else job.group.owner

    def local_time(self, now: float) -> float:
        """The job's own time: the time of the clock minus the time that the job spent frozen, in seconds."""
        return now - self.shift
