"""The scheduler: runs the ready jobs in turn, and returns the time at which it must be called next.

A *round* runs each job that was ready when the round began, once, first in first out.  When rounds take too long, they
take only some of the ready jobs: those of the contexts that have used little lately (modules ``ready_queue`` and
``accounts``).  A round has one time (``now``), which is also the time stamp of its output.  ``run()`` makes rounds
until no job is ready, and returns the time of the next wake-up.  The caller is an asyncio loop or a simulated clock.

A job made by ``spawn`` starts at the end of the queue.  ``start_now`` runs the new job at once and puts its maker at
the end of the queue, as the ``,`` of urbiscript does.

Other threads call ``post()`` only: a posted function runs between two rounds.  ``interrupt()`` makes ``run`` return
soon although jobs are ready, so that an endless loop of ``;`` cannot starve the sockets.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from urbihw.kernel.sched import job as states
from urbihw.kernel.sched.accounts import Accounts
from urbihw.kernel.sched.breaker import Breaker
from urbihw.kernel.sched.clock import Clock
from urbihw.kernel.sched.coro import Pool
from urbihw.kernel.sched.hooks import SchedulerHooks
from urbihw.kernel.sched.job import Job
from urbihw.kernel.sched.ready_queue import INTERRUPT, TURN_END, Mark, ReadyQueue
from urbihw.kernel.sched.shares import Shares
from urbihw.kernel.sched.signals import JobKilled, JobSignal, takes_precedence
from urbihw.kernel.sched.timequeue import TimeQueue, Timer
from urbihw.kernel.sched.trace import Tracer

if TYPE_CHECKING:
    from urbihw.kernel.sched.tag import TagEntry


MAX_RUN_S = 0.004
"""Seconds after which ``run`` returns between two rounds although jobs are ready, so that the sockets are served."""


class Scheduler:
    """All jobs of one kernel."""

    def __init__(
        self, clock: Clock, wake_host: Callable[[], None] = lambda: None, hooks: SchedulerHooks | None = None
    ) -> None:
        """``wake_host`` is called, from any thread, when ``run`` should be called soon; ``hooks`` are the callbacks to
        the layer above.
        """
        self.clock = clock
        self.hooks = SchedulerHooks() if hooks is None else hooks
        self._pool = Pool()
        self._resting = self._pool.resting
        self._accounts = Accounts(clock.processor_time)
        self._queue = ReadyQueue(self._accounts)
        self.ready: deque[Job | Mark] = self._queue.jobs
        self.timers = TimeQueue()
        self.current: Job | None = None
        self.now = clock.now()
        self.cycle = 0
        """The number of rounds so far.  A job that runs in a later round than before has yielded in between."""
        self.jobs: dict[Job, None] = {}
        self.tracer: Tracer | None = None
        self.frozen_tags = 0
        self.abandoned = False
        """Whether no job will run any more."""
        self.era = 0
        """Tells statements that began before an event, such as an emergency stop, from later ones: ``begin_era``."""
        self._era_hooks: list[Callable[[], None]] = []
        self.shares = Shares(self._accounts)
        """How many jobs each context has and may have."""
        self.latest: Job | None = None
        """The job that had the last turn."""
        self.breaker = Breaker(self)
        self._left = 0
        """The number of turns that are left in this round: they go to the first jobs of ``ready``.  A job that becomes
        ready meanwhile is appended, so it waits for the next round and cannot keep this one from ending."""
        self._interrupted = False
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
        """Make a job at the end of the ready queue.

        A ``parent`` passes on its tags, its context and its own time; without a parent, the job begins under
        ``entries``.  ``hooks.job_failed`` is called with the error that ends a job without a group.

        Raises TooManyJobs.  A job without parent and tags is made in any case, and fails with that error when it
        starts.  A job that has no context either belongs to the kernel and is never refused.
        """
        if parent is not None:
            context = parent.context if context is None else context
            entries = parent.entries
        refusal = self.shares.refusal(context, len(self.jobs))
        if refusal is not None:
            if parent is not None or entries:
                raise refusal
            if context is not None:
                body = refusal.throw
        self.shares.add(context)
        made = Job(self, body, name, context)
        if parent is not None:
            made.shift = parent.shift
            made.descend(parent)
        self.jobs[made] = None
        for entry in entries:
            made.entries.append(entry)
            entry.jobs[made] = None
            entry.tag.live[entry] = None
        if self.frozen_tags:
            made.update_frozen()
        self.ready.append(made)
        if self.tracer is not None:
            self.tracer.created(made)
        return made

    def start_now(self, made: Job) -> None:
        """Run a new job at once; the running job goes to the end of the ready queue."""
        self._queue.remove(made)
        self._queue.put_first(self.running().charged_context, made)
        self.yield_()

    def run_first(self, made: Job) -> None:
        """Run a new job at once; the running job goes on as soon as the new job yields."""
        maker = self.running()
        self._queue.remove(made)
        self._queue.put_first(maker.charged_context, made, maker)
        maker.state = states.READY
        self._switch_away(maker)

    def prefer(self, made: Job) -> None:
        """Let a new job run before the started jobs of its context, but after the new ones."""
        self._queue.prefer(made, self.current)

    def running(self) -> Job:
        """The running job.  Raises RuntimeError outside any job."""
        if self.current is None:
            raise RuntimeError("no job is running: this may only be called from inside a job")
        return self.current

    # ---------------------------------------------------------------- what a job asks for

    def yield_(self) -> None:
        """Let the other ready jobs run, and go on after them."""
        job = self.running()
        # This is `_switch_away`, written out.  After the append, no Python function may be called: at the recursion
        # limit the call would fail, and the job would go on with that error while it stands in the queue.
        ready = self.ready
        ready.append(job)
        job.state = states.READY
        following: Any = ready[0]
        if self._left and not following.frozen and not self._interrupted:
            carrier = following.carrier
            if not following.started and following.pending is None and self._resting:
                carrier = following.carrier = self._resting.pop()
                carrier.job = following
                following.started = True
            if carrier is not None:
                self._left -= 1
                ready.popleft()
                self.current = following
                following.state = states.RUNNING
                carrier.coro.switch()
            else:
                self._pool.hub.switch()
        else:
            self._pool.hub.switch()
        if job.pending is not None:
            raise job.take_pending()

    def give_way(self, seconds: float) -> None:
        """Let the sockets and other jobs have their turn if this round has lasted longer than ``seconds``."""
        if self.clock.now() - self.now > seconds:
            self.interrupt()
            self.yield_()

    def sleep(self, seconds: float) -> None:
        """Suspend the running job for some seconds of its own time, which stands still while it is frozen; 0 is a
        yield.
        """
        if seconds <= 0:
            self.yield_()
            return
        job = self.running()
        job.timer = self.timers.add(self.clock.now() + seconds, job.end_sleep)
        job.state = states.SLEEPING
        self._switch_away(job)

    def suspend(self, undo: Callable[[], None] | None) -> None:
        """Park the running job until ``wake``.  If it is stopped before, ``undo`` removes it from the queue in which it
        waits.

        To be called by the module ``waiting`` only.
        """
        job = self.running()
        job.state = states.WAITING
        job.undo = undo
        self._switch_away(job)

    def wake(self, job: Job) -> None:
        """Make a parked job ready.  Does nothing to other jobs; a sleeping job wakes when its time has come."""
        if job.state == states.WAITING and not job.held and not job.done:
            job.undo = None
            job.state = states.READY
            self.ready.append(job)

    def throw(self, job: Job, error: BaseException) -> None:
        """Raise an error in a job: at once in the running job, in another job when it has its next turn.

        If an error is pending for the job already, ``takes_precedence`` decides between them.
        """
        if job.done:
            return
        if job is self.current:
            raise error
        # A stack can be unwound only by its own job, so the error waits for that job's turn.
        if job.pending is not None:
            if takes_precedence(error, job.pending):
                job.pending = error
            return
        job.pending = error
        # The job leaves the queue in which it waits now, not at its next turn: no value may be handed to it in between.
        if job.timer is not None:
            job.timer.cancel()
            job.timer = None
        if job.undo is not None:
            undo, job.undo = job.undo, None
            undo()
        # A ready job stands in the queue already; with a second entry it would get two turns in a round.
        if job.held or job.state in (states.WAITING, states.SLEEPING):
            job.held = False
            job.state = states.READY
            self.ready.append(job)

    def kill(self, job: Job) -> None:
        """End a job; its ``finally`` clauses run."""
        self.throw(job, JobKilled())

    def call_at(self, deadline: float, action: Callable[[], None]) -> Timer:
        """Call ``action`` (outside any job) at a time of the clock, in seconds; the timer can be cancelled."""
        return self.timers.add(deadline, action)

    # ---------------------------------------------------------------- other threads and the host

    def post(self, action: Callable[[], None]) -> None:
        """From any thread: run ``action`` between two rounds, outside any job."""
        self._posted.append(action)
        self._wake_host()

    def set_wake_host(self, wake_host: Callable[[], None]) -> None:
        """Set the function that ``post`` calls so that ``run`` is called soon."""
        self._wake_host = wake_host

    def add_round_hook(self, hook: Callable[[], None]) -> None:
        """Call ``hook`` (outside any job) at the end of each round."""
        self._round_hooks.append(hook)

    def add_era_hook(self, hook: Callable[[], None]) -> None:
        """Call ``hook`` before a new era begins: what has come until then belongs to the present one."""
        self._era_hooks.append(hook)

    def begin_era(self) -> int:
        """Begin a new era, and return its number: something happened that earlier statements could not know."""
        for hook in self._era_hooks:
            hook()
        self.era += 1
        return self.era

    def interrupt(self) -> None:
        """From any thread: make ``run`` return at the end of the running job's turn."""
        self._interrupted = True
        self.ready.append(INTERRUPT)

    def run(self) -> float | None:
        """Run rounds until no job is ready or ``interrupt`` is called; return the time of the next wake-up, None for
        never.

        Returns the present time when interrupted, or after ``MAX_RUN_S`` seconds: it must be called again soon.
        """
        self._pool.enter_hub()
        end = 0.0
        queue, ready = self._queue, self.ready
        while True:
            # One time for the whole round, and so one time stamp; timers that are due by then fire before its jobs.
            self.now = now = self.clock.round()
            end = end or now + MAX_RUN_S  # counted from the first round, which runs however late it begins
            if self._posted:
                for _ in range(len(self._posted)):  # threads may post further ones meanwhile
                    self._posted.popleft()()
            while self.timers.soonest <= now:
                action = self.timers.pop_due(now)
                if action is not None:
                    action()
            if not ready:
                self._run_round_hooks()
                # The hooks may have made jobs ready.
                if not ready and not self._posted:
                    self.latest = None
                    return self.timers.next_deadline()
                if now > end:
                    return now
                continue
            if now > end:  # only `interrupt` ends a round before all its jobs had their turn
                return now
            self.cycle += 1
            fair = queue.is_fair
            self._left = queue.begin_round()
            # Jobs also switch to each other (`hand_over`), which counts their turns: one `_resume` may take many.
            while self._left:
                self._left -= 1
                job = ready.popleft()
                if not isinstance(job, Mark):
                    self._resume(job)
                elif job is TURN_END:
                    self._end_turn()
                    if self.clock.now() > end:
                        self._interrupted = True
                if self._interrupted:
                    self._interrupted = False
                    # Jobs may be without their turn: from now on rounds are short, so no context starves another.
                    queue.is_fair = True
                    self._end_turn()
                    self._run_round_hooks()
                    return now
            if fair:
                self._end_turn()
            if self._round_hooks:
                self._run_round_hooks()

    def _end_turn(self) -> None:
        """Charge the context of the last turn: in a round that is not fair with all of the round, since a round that is
        too long most likely ends with the turn that made it so.
        """
        if self.latest is not None:
            self._accounts.charge(self.latest.charged_context, self.clock.now() - self.now)

    def run_turn(self) -> float | None:
        """Like ``run``, but give only one job a turn: the job in ``latest``."""
        self._interrupted = True
        return self.run()

    def run_simulated(self, until: float | None = None) -> None:
        """With a simulated clock: run until a time, or until no job will become ready any more."""
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
        """End all jobs, because this scheduler will not run any more.

        Python's collector does not see the references of a suspended greenlet, so without this call a dropped kernel
        would never be freed.  ``finally`` clauses run now; their errors are not reported.
        """
        self.hooks = SchedulerHooks()
        self.abandoned = True
        self._pool.enter_hub()
        for job in list(self.jobs):
            if job.carrier is not None and not job.done:
                self.current = job
                job.carrier.end()
        self.current = None
        self._pool.end()

    # ---------------------------------------------------------------- inside

    def ended(self, job: Job) -> None:
        """Do the accounting of a job whose body is over; called by the job itself."""
        job.done = True
        job.state = states.TERMINATED
        self.jobs.pop(job, None)
        self.shares.remove(job.charged_context)
        if job.entries:
            for entry in job.entries:
                entry.remove_job(job)
            job.entries = []
        if self.tracer is not None:
            self.tracer.ended(job)
        error = job.error
        if job.group is not None:
            job.group.child_ended(job, error)
        elif isinstance(error, Exception):
            # The report may run the program's own `asString`.  A signal that ends it there must not go further: nothing
            # is left of the job that could catch it, and it would end the scheduler.
            try:
                self.hooks.job_failed(job, error)
            except JobSignal:
                pass
        if job.on_end is not None:
            for action in job.on_end:
                action(job)
            job.on_end = None

    def _run_round_hooks(self) -> None:
        for hook in self._round_hooks:
            hook()

    def _switch_away(self, job: Job) -> None:
        """Switch to another job; when this job is resumed, raise the error that is pending for it."""
        self.hand_over()
        if job.pending is not None:
            raise job.take_pending()

    def hand_over(self) -> None:
        """Switch to the next job of this round if it can run as it is, else to the hub.

        A direct switch costs half of the way through the hub.  A carrier that has just become free, and finds a new
        job, starts that job without any switch.
        """
        if self._left and self.ready and not self._interrupted:
            following: Any = self.ready[0]
            carrier = None if following.frozen else following.carrier
            if not following.started and following.pending is None and not following.frozen and self._resting:
                carrier = following.carrier = self._resting.pop()
                carrier.job = following
                following.started = True
            if carrier is not None:
                self._left -= 1
                self.ready.popleft()
                self.current = following
                following.state = states.RUNNING
                carrier.coro.switch()
                return
        self._pool.hub.switch()

    def _resume(self, job: Job) -> None:
        if job.done:
            return
        # A frozen job with a pending error has its turn: it must be possible to stop it.
        if job.frozen and job.pending is None:
            job.held = True  # out of the queue until `update_frozen` appends it again
            job.state = states.WAITING if job.state == states.READY else job.state
            return
        self.current = job
        job.state = states.RUNNING
        if not job.started:
            job.started = True
            if job.pending is not None:
                job.error, job.pending = job.pending, None
                job.body = None
                self.ended(job)
                self.latest, self.current = job, None
                return
            job.carrier = self._pool.assign_carrier(job)
        carrier = job.carrier
        assert carrier is not None
        carrier.coro.switch()
        self.latest, self.current = self.current, None
