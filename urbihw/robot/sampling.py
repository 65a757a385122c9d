"""A job that is given a turn at a rate, and sends lines to the client that asked for them.

A timer of the scheduler wakes the job.  A job that still waits in a reading when its next turn has come keeps that
reading for itself (``is_held_up``), and another job takes its place, so that one slow reading never delays the others.
A sample for which the client has no room, or the server no time, is left out and counted.  Nothing queues up.
"""

from __future__ import annotations

from typing import Any, Final

from urbihw.kernel.library import Job, Timer, TooManyJobs, WaitQueue, World, errors

MAX_RATE_HZ: Final = 200.0
MIN_RATE_HZ: Final = 0.1
MAX_CHANGE_RATE_HZ: Final = 50.0
"""Rate at which the values are compared when only changes are sent."""
MAX_BACKLOG: Final = 64 * 1024
"""Number of bytes that the client has not read from which on samples are left out."""
MAX_FEEDS: Final = 64
"""Maximum number of subscriptions of a connection."""
KIND: Final = "subscriptions"
"""The kind of resource as which a lobby holds them."""


class Feed:
    """A subscription's job and timer; derived classes define ``sample``.

    Attributes:
        name: its channel.
        rate: wanted samples in a second, 0 for each change.
        number: number of samples so far, with those left out.
        lost: number of those left out.
        sent: number of those sent.
        closed: whether it has ended.
        face: its urbiscript object.
    """

    def __init__(self, world: World, face: Any, name: str, rate: float) -> None:
        """Begin at once, as a resource of the running job's lobby and under the tags of that job.

        Raises an urbiscript error without a lobby, for a name that is taken, and when the lobby has too many.
        """
        scheduler = world.scheduler
        maker = scheduler.running()
        if maker.context is None:
            raise errors.primitive("a subscription needs a connection to which it sends")
        self.world = world
        self.face = face
        self.name = name
        self.lobby: Any = maker.context
        self.number = 0
        self.lost = 0
        self.sent = 0
        self.closed = False
        if any(feed.name == name for feed in feeds_of(self.lobby)):
            raise errors.primitive(f"this connection has a subscription {name} already: stop it first")
        self.lobby.holdings.check(KIND, MAX_FEEDS)
        self._due = 0.0
        self._timer: Timer | None = None
        self._turns = WaitQueue(scheduler)
        self._job: Job
        self._begin_job(maker)
        self.lobby.holdings.register(self, KIND, MAX_FEEDS)
        self.set_rate(rate)

    @property
    def period(self) -> float:
        """Seconds between two turns."""
        return 1.0 / (self.rate or MAX_CHANGE_RATE_HZ)

    def set_rate(self, rate: float) -> None:
        """Change the rate, in samples a second."""
        self.rate = rate
        if self._timer is not None:
            self._timer.cancel()
        self._due = self.world.scheduler.clock.now() + self.period
        self._timer = self.world.scheduler.call_at(self._due, self._tick)

    def send_line(self, text: str) -> None:
        """Send a line on the channel of this subscription."""
        self.lobby.output.line(text, self.name)

    def close(self) -> None:
        """End it; a second call does nothing."""
        if self.closed:
            return
        self.closed = True
        if self._timer is not None:
            self._timer.cancel()
        self.lobby.holdings.unregister(self)
        for job in self.jobs():
            if job is not self.world.scheduler.current:
                self.world.scheduler.kill(job)

    # ---------------------------------------------------------------- for derived classes

    def jobs(self) -> list[Job]:
        """The jobs that work for it."""
        return [self._job]

    def sample(self) -> None:
        """In the job: read and send."""
        raise NotImplementedError

    def leave_out(self, count: int) -> None:
        """Count turns without a sample."""
        raise NotImplementedError

    def is_held_up(self) -> bool:
        """Whether the job waits in the middle of ``sample``."""
        raise NotImplementedError

    def hand_over(self, job: Job) -> None:
        """The job keeps the reading in which it waits; another one takes its place in ``sample``."""
        raise NotImplementedError

    # ---------------------------------------------------------------- inside

    def _begin_job(self, maker: Job) -> None:
        job = self.world.scheduler.spawn(self._run, f"subscription {self.name}", maker.context, entries=maker.entries)
        job.when_ended(self._job_ended)
        self._job = job

    def _run(self) -> None:
        job = self.world.scheduler.running()
        while job is self._job and not self.closed:
            self.sample()
            self._turns.wait()

    def _job_ended(self, job: Job) -> None:
        if job is self._job:
            self.close()

    def _tick(self) -> None:
        """Give the job its turn, outside any job."""
        scheduler = self.world.scheduler
        late = int((scheduler.now - self._due) / self.period)
        self._due += (late + 1) * self.period
        self._timer = scheduler.call_at(self._due, self._tick)
        if self._job.frozen:
            return
        self.leave_out(late)
        if self._turns and self.lobby.output.backlog <= MAX_BACKLOG:
            self._turns.wake_one()
            return
        self.leave_out(1)
        if self.is_held_up():
            held = self._job
            self.hand_over(held)
            try:
                self._begin_job(held)
            except TooManyJobs as error:
                self.lobby.output.line(f"!!! subscription {self.name} has ended: {error}", "error")
                self.close()


def feeds_of(lobby: Any) -> list[Feed]:
    """The subscriptions of a lobby, in the order in which they began."""
    return [one for one in lobby.holdings.held() if isinstance(one, Feed)]
