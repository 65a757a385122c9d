"""The scheduler: runs the jobs that are ready, in turn, and says when it wants to be called next.

One *round* runs each job that was ready when it began, once, first in first out (of very many jobs only some: see
``crowd``); a round has one time (``now``), which is also the time stamp of what is written in it.  ``run()`` makes
rounds until nobody is ready and returns the time of the next wake-up; who calls it (an asyncio loop, a simulated
clock) is not its business.

Jobs made by ``spawn`` start at the end of the queue; ``start_now`` gives the processor to the new job at once and
puts its maker at the end of the queue, which is what a ``,`` in urbiscript does.

``post()`` is the one door for other threads: what they post runs between rounds.  ``interrupt()`` makes ``run``
return soon although jobs are ready, so that an endless loop of ``;`` cannot starve the sockets.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from types import FrameType
from typing import TYPE_CHECKING, Any

from urbihw.kernel.sched import job as states
from urbihw.kernel.sched.breaker import Breaker
from urbihw.kernel.sched.clock import Clock
from urbihw.kernel.sched.coro import Pool
from urbihw.kernel.sched.crowd import REST, Crowd, Mark
from urbihw.kernel.sched.errors import TooManyJobs
from urbihw.kernel.sched.job import Job
from urbihw.kernel.sched.signals import JobKilled, goes_further
from urbihw.kernel.sched.timequeue import TimeQueue, Timer
from urbihw.kernel.sched.trace import Tracer

if TYPE_CHECKING:
    from urbihw.kernel.sched.tag import TagEntry


MOST_JOBS = 150_000
"""How many jobs there may be; each takes about 8 kB once it has begun, and a program that forks without end gets there
within seconds."""
AIR = 0.004
"""Seconds after which ``run`` returns between two rounds although jobs are ready: the sockets must have their turn."""
SPARED = 100
"""How many jobs a context may have even when there are too many of the others."""


_INTERRUPT = Mark()
"""Makes a job that runs alone look up from its loop."""


class Scheduler:
    """All jobs of one kernel."""

    def __init__(self, clock: Clock, wake_host: Callable[[], None] = lambda: None) -> None:
        self.clock = clock
        self._pool = Pool()
        self.ready: deque[Job | Mark] = deque()
        self.timers = TimeQueue()
        self.current: Job | None = None
        self.now = clock.now()
        self.cycle = 0
        self.jobs: dict[Job, None] = {}
        self.tracer: Tracer | None = None
        self.frozen_tags = 0
        self.epoch = 0
        """Advanced by who must tell the statements that began before a moment from those that began after it."""
        self.most_jobs = MOST_JOBS
        self.most_jobs_of_one = MOST_JOBS
        """How many jobs of one context there may be."""
        self._shares: dict[Any, int] = {}
        """How many jobs there are of each context."""
        self.latest: Job | None = None
        """Who had the turn last, of those that were given it by ``run`` itself."""
        self.breaker = Breaker(self)
        self._left = 0
        """How many jobs of the round have not had their turn."""
        self._interrupted = False
        self._preferred: tuple[Job | None, int, Job] | None = None
        """Who made the last job that was preferred in this round, its place in the queue, and that job."""
        self._crowd = Crowd()
        self._crowded = False
        """Whether the ready jobs are shared out, since a round of all of them takes too long."""
        self.place: Callable[[FrameType], str] = lambda frame: ""
        """Says for the log where in its program a Python frame stands; the layer above knows."""
        self.is_program: Callable[[FrameType], bool] = lambda frame: False
        """Whether a Python frame is one of generated code."""
        self.failed: Callable[[Job, Exception], None] = lambda job, error: None
        self._round_hooks: list[Callable[[], None]] = []
        self._posted: deque[Callable[[], None]] = deque()
        self._wake_host = wake_host

    # ---------------------------------------------------------------- making jobs

    def spawn(
        self,
        body: Callable[[], Any],
        name: str = "",
        context: Any = None,
        parent: Job | None = None,
        entries: Iterable[TagEntry] = (),
    ) -> Job:
        """A new job at the end of the ready queue.

        ``parent`` gives its tags, its context and its own time; without one, ``entries`` are the tags it begins under.
        ``failed`` is called with whatever error ends a job that belongs to no group.  Raises TooManyJobs; a job without
        parent and tags is made all the same, and fails by that as soon as it begins, unless it has no context: then it
        is the kernel's own and is never refused.
        """
        if parent is not None:
            context = parent.context if context is None else context
            entries = parent.entries
        share = self._shares.get(context, 0)
        if share >= self.most_jobs_of_one or (share >= SPARED and len(self.jobs) >= self.most_jobs):
            refusal = TooManyJobs(f"too many jobs: {share} of this connection") \
                if share >= self.most_jobs_of_one else TooManyJobs("too many jobs")
            if parent is not None or entries:
                raise refusal
            if context is not None:
                body = refusal.throw
        self._shares[context] = share + 1
        made = Job(self, body, name, context)
        if parent is not None:
            made.shift = parent.shift
            made.epoch = parent.epoch
        self.jobs[made] = None
        for entry in entries:
            made.entries.append(entry)
            entry.jobs[made] = None
            entry.tag.live[entry] = None
        if self.frozen_tags:
            self.recheck_frozen(made)
        self.ready.append(made)
        if self.tracer is not None:
            self.tracer.created(made)
        return made

    def jobs_of(self, context: Any) -> int:
        """How many jobs there are of a context."""
        return self._shares.get(context, 0)

    def start_now(self, made: Job) -> None:
        """Run a job just spawned before its maker goes on; the maker queues up behind it."""
        self._take_back(made)
        self.ready.appendleft(made)
        self.yield_()

    def run_first(self, made: Job) -> None:
        """Run a job just spawned before its maker goes on; the maker goes on as soon as it yields."""
        maker = self.running()
        self._take_back(made)
        self.ready.appendleft(maker)
        self.ready.appendleft(made)
        maker.state = states.READY
        self._leave(maker)

    def prefer(self, made: Job) -> None:
        """Let a job just spawned take its turn before those of its context that have begun, behind the new ones."""
        self._take_back(made)
        ready = self.ready
        place = 0
        if self._preferred is not None:  # thousands may be made in one turn
            maker, at, last = self._preferred
            if maker is self.current and at < len(ready) and ready[at] is last and not last.started:
                place = at + 1
        while place < len(ready):  # another thread may append meanwhile
            waiting = ready[place]
            if waiting is REST:
                self._crowd.prefer(made)
                return
            if isinstance(waiting, Mark) or (waiting.started and waiting.payer is made.payer):
                break
            place += 1
        ready.insert(place, made)
        self._preferred = (self.current, place, made)

    def _take_back(self, made: Job) -> None:
        """Out of the ready queue again; a job just spawned is its last entry unless a thread interrupted."""
        if self.ready[-1] is made:
            self.ready.pop()
        else:
            self.ready.remove(made)

    def running(self) -> Job:
        """The job that runs; only a job may call what needs this."""
        if self.current is None:
            raise RuntimeError("no job is running: this may only be called from inside a job")
        return self.current

    # ---------------------------------------------------------------- what a job asks for

    def yield_(self) -> None:
        """Let the other ready jobs run; come back behind them."""
        job = self.running()
        # As `_leave`, written out: behind the append no Python function may be called, since a job that is as deep in
        # calls as it may be would go on with the error and stand in the queue as well.
        ready = self.ready
        ready.append(job)
        job.state = states.READY
        following: Any = ready[0]
        if self._left and following.carrier is not None and not following.frozen and not self._interrupted:
            self._left -= 1
            ready.popleft()
            self.current = following
            following.state = states.RUNNING
            following.carrier.coro.switch()
        else:
            self._pool.hub.switch()
        if job.pending is not None:
            error, job.pending = job.pending, None
            raise error

    def give_way(self, seconds: float) -> None:
        """Let the sockets and other jobs have their turn if this round has lasted longer than that."""
        if self.clock.now() - self.now > seconds:
            self.interrupt()
            self.yield_()

    def sleep(self, seconds: float) -> None:
        """Come back after this much time, less what is spent frozen; zero or less is a yield."""
        if seconds <= 0:
            self.yield_()
            return
        job = self.running()
        job.timer = self.timers.add(self.clock.now() + seconds, job.time_is_up)
        job.state = states.SLEEPING
        self._leave(job)

    def suspend(self, undo: Callable[[], None] | None) -> None:
        """Park the running job until ``wake``; ``undo`` takes it out of where it waits if it is stopped before."""
        job = self.running()
        job.state = states.WAITING
        job.undo = undo
        self._leave(job)

    def wake(self, job: Job) -> None:
        """Make a parked job ready; harmless if it is not parked (a sleeper is not: it wakes when its time has come)."""
        if job.state == states.WAITING and not job.held and not job.done:
            job.undo = None
            job.state = states.READY
            self.ready.append(job)

    def throw(self, job: Job, error: BaseException) -> None:
        """Make a job leave what it does by an exception; the running job leaves at once.

        Of two that are to reach a job the one that leads further out wins.
        """
        if job.done:
            return
        if job is self.current:
            raise error
        if job.pending is not None:
            if goes_further(error, job.pending):
                job.pending = error
            return
        job.pending = error
        if job.timer is not None:
            job.timer.cancel()
            job.timer = None
        if job.undo is not None:
            undo, job.undo = job.undo, None
            undo()
        if job.held or job.state in (states.WAITING, states.SLEEPING):
            job.held = False
            job.state = states.READY
            self.ready.append(job)

    def kill(self, job: Job) -> None:
        """End a job; its finally clauses run."""
        self.throw(job, JobKilled())

    def call_at(self, deadline: float, action: Callable[[], None]) -> Timer:
        """Call ``action`` (outside any job) at a time; the timer can be cancelled."""
        return self.timers.add(deadline, action)

    # ---------------------------------------------------------------- freezing

    def recheck_frozen(self, job: Job) -> None:
        """A tag of the job was frozen or unfrozen, entered or left: bring the job's state in line."""
        frozen = self.frozen_tags > 0 and any(entry.tag.is_frozen() for entry in job.entries)
        if frozen == job.frozen or job.done:
            return
        job.frozen = frozen
        now = self.clock.now()
        if frozen:
            job.frozen_at = now
            if job.timer is not None:
                job.wake_left = job.timer.deadline - now
                job.timer.cancel()
            return
        job.shift += now - job.frozen_at
        if job.held:
            job.held = False
            job.state = states.READY
            self.ready.append(job)
        elif job.timer is not None:
            job.timer = self.timers.add(now + job.wake_left, job.time_is_up)

    def hold_if_frozen(self) -> None:
        """The running job stops here while a tag holds it (it froze itself, or it stands at a frozen tag's door)."""
        job = self.running()
        while job.frozen:
            job.held = True
            job.state = states.WAITING
            self._leave(job)

    # ---------------------------------------------------------------- other threads and the host

    def post(self, action: Callable[[], None]) -> None:
        """From any thread: run ``action`` between two rounds, outside any job."""
        self._posted.append(action)
        self._wake_host()

    def set_wake_host(self, wake_host: Callable[[], None]) -> None:
        """Whom ``post`` calls so that ``run`` is called soon."""
        self._wake_host = wake_host

    def add_round_hook(self, hook: Callable[[], None]) -> None:
        """Call ``hook`` (outside any job) at the end of each round."""
        self._round_hooks.append(hook)

    def interrupt(self) -> None:
        """From any thread: make a running ``run`` return at the end of the present job's turn."""
        self._interrupted = True
        self.ready.append(_INTERRUPT)

    def run(self) -> float | None:
        """Run rounds until no job is ready (or ``interrupt``); the time of the next wake-up, None for never.

        Returns the present time when interrupted, or after ``AIR`` seconds: call again soon.
        """
        self._pool.enter_hub()
        enough = self.clock.now() + AIR
        while True:
            self.now = now = self.clock.round()
            if self._posted:
                for _ in range(len(self._posted)):  # threads may post faster than this takes
                    self._posted.popleft()()
            while self.timers.soonest <= now:
                action = self.timers.pop_due(now)
                if action is not None:
                    action()
            ready = self.ready
            if not ready:
                self._round_over()
                if not ready and not self._posted:
                    self.latest = None
                    return self.timers.next_deadline()
                if now > enough:
                    return now
                continue
            if now > enough:
                return now
            self.cycle += 1
            self._preferred = None
            if self._crowded:
                self._left = self._crowd.share_out(ready)
                self._crowded = REST in ready
            else:
                self._left = len(ready)
            while self._left:
                self._left -= 1
                job = ready.popleft()
                if job is not _INTERRUPT:
                    self._resume(job)  # type: ignore[arg-type]
                if self._interrupted:
                    self._interrupted = False
                    self._crowded = self._crowded or self._left > 0
                    self._round_over()
                    return now
            self._round_over()

    def run_turn(self) -> float | None:
        """The same, but only one job gets a turn; ``latest`` tells which."""
        self._interrupted = True
        return self.run()

    def run_simulated(self, until: float | None = None) -> None:
        """With a simulated clock: run until all jobs are over or wait for ever, or until a time."""
        while True:
            deadline = self.run()
            if self.ready:
                continue
            if deadline is None or (until is not None and deadline > until):
                if until is not None:
                    self.clock.idle(until)
                    self.now = self.clock.now()
                return
            self.clock.idle(deadline)

    def abandon(self) -> None:
        """Nobody will run this scheduler any more: end all jobs, wherever they are.

        What a suspended greenlet holds is invisible to Python's collector, so without this nothing of a kernel that was
        dropped would ever be freed.  Nobody is told of errors in ``finally`` clauses, which run now.
        """
        self.failed = lambda job, error: None
        self._pool.enter_hub()
        for job in list(self.jobs):
            if job.carrier is not None and not job.done:
                self.current = job
                job.carrier.end()
        self.current = None
        self._pool.end()

    # ---------------------------------------------------------------- inside

    def ended(self, job: Job) -> None:
        """A job's body is over (called at the end of the job's own greenlet)."""
        job.done = True
        job.state = states.TERMINATED
        self.jobs.pop(job, None)
        share = self._shares[job.payer] - 1
        if share:
            self._shares[job.payer] = share
        else:
            del self._shares[job.payer]
        if job.entries:
            for entry in job.entries:
                entry.forget(job)
            job.entries = []
        if self.tracer is not None:
            self.tracer.ended(job)
        error = job.error
        if job.group is not None:
            job.group.child_ended(job, error)
        elif isinstance(error, Exception):
            self.failed(job, error)
        if job.on_end is not None:
            for action in job.on_end:
                action(job)
            job.on_end = None

    def _round_over(self) -> None:
        for hook in self._round_hooks:
            hook()

    def _leave(self, job: Job) -> None:
        """Give the processor away; throw what somebody wants thrown when the job is resumed."""
        self.hand_over()
        if job.pending is not None:
            error, job.pending = job.pending, None
            raise error

    def hand_over(self) -> None:
        """Give the processor to the next job of this round if that needs no care, else to the hub.

        From one job to the next there is half the way that there is by the hub.
        """
        if self._left and self.ready and not self._interrupted:
            following: Any = self.ready[0]
            if following.carrier is not None and not following.frozen:
                self._left -= 1
                self.ready.popleft()
                self.current = following
                following.state = states.RUNNING
                following.carrier.coro.switch()
                return
        self._pool.hub.switch()

    def _resume(self, job: Job) -> None:
        if job.done:
            return
        if job.frozen and job.pending is None:
            job.held = True
            job.state = states.WAITING if job.state == states.READY else job.state
            return
        self.current = self.latest = job
        job.state = states.RUNNING
        if not job.started:
            job.started = True
            if job.pending is not None:
                job.error, job.pending = job.pending, None
                job.body = None
                self.ended(job)
                self.current = None
                return
            job.carrier = self._pool.take(job)
        carrier = job.carrier
        assert carrier is not None
        carrier.coro.switch()
        self.current = None
