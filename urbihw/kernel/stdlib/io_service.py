"""IoService: the events of Sockets and Servers, queued until a program polls; the default service needs no polling.

Events are handled in jobs, and each job counts for one connection: the connection that polls, or else the one that has
opened the Socket or the Server.  So no connection waits for the handlers of others.

Source: manual, specs/ioservice.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.errors import TooManyJobs
from urbihw.kernel.sched.job import Job
from urbihw.kernel.sched.waiting import WaitQueue

TABLE = Table("IoService")

Action = Callable[[], None]


RETRY_DELAY_S = 0.1
"""Delay in seconds before another attempt to handle an event, if its connection has reached its limit of jobs."""


class ServiceObject(Obj):
    """An urbiscript IoService: a queue of unhandled events."""

    __slots__ = ("_pollers", "_queues", "automatic", "pending")

    def __init__(self, world: World, protos: list[Obj], automatic: bool = False) -> None:
        super().__init__(world, protos)
        self.automatic = automatic
        self.pending: deque[tuple[Any, Action]] = deque()
        """The events, each with its lobby (None for none) and its action."""
        self._pollers = WaitQueue(world.scheduler)
        """Jobs that wait for an event."""
        self._queues: dict[Any, deque[Action]] = {}
        """The queues of automatically handled events, per lobby; one job handles each queue."""

    def clone(self) -> ServiceObject:
        """Make a new service, which must be polled."""
        return ServiceObject(self.world, [self])

    def queue_event(self, owner: Any, action: Action) -> None:
        """Queue an event for a lobby, to be handled in a job; must be called in the kernel's thread."""
        self.pending.append((owner, action))
        self._pollers.wake_all()
        self._distribute_pending()

    def set_automatic(self, automatic: bool) -> None:
        """Select whether events are handled at once or wait for a poll."""
        self.automatic = automatic
        self._distribute_pending()

    def _distribute_pending(self) -> None:
        while self.automatic and self.pending:
            owner, action = self.pending.popleft()
            queue = self._queues.get(owner)
            if queue is None:
                queue = self._queues[owner] = deque()
                queue.append(action)
                self._serve(owner)
            else:
                queue.append(action)

    def _serve(self, owner: Any) -> None:
        """Handle the queue of a lobby in a job; if the job fails or is killed, another job handles the rest."""
        queue, scheduler = self._queues[owner], self.world.scheduler

        def handle() -> None:
            while queue:
                queue.popleft()()
                scheduler.yield_()

        def over(job: Job) -> None:
            if not queue:
                del self._queues[owner]
            elif isinstance(job.error, TooManyJobs):
                scheduler.call_at(scheduler.clock.now() + RETRY_DELAY_S, lambda: self._serve(owner))
            else:
                self._serve(owner)

        scheduler.spawn(handle, "network", context=owner).when_ended(over)

    def poll(self) -> None:
        """Handle all queued events in the running job; each one starts after the handlers of the one before have
        started.
        """
        while self.pending:
            self.poll_one()
            self.world.scheduler.yield_()

    def poll_one(self) -> None:
        """Handle the first queued event."""
        _, action = self.pending.popleft()
        action()

    def wait(self, deadline: float) -> None:
        """Suspend the running job until an event arrives, or until ``deadline``."""
        while not self.pending and self.world.scheduler.clock.now() < deadline:
            self._pollers.wait_until(deadline)


CLASSES = {"IoService": ServiceObject}


@TABLE.primitive("poll")
def poll(world: World, this: ServiceObject) -> None:
    """Handle all events that have arrived so far."""
    if not this.automatic:
        this.poll()


@TABLE.primitive("pollFor")
def poll_for(world: World, this: ServiceObject, duration: float) -> None:
    """Handle all events during this number of seconds."""
    deadline = world.scheduler.clock.now() + duration
    while world.scheduler.clock.now() < deadline:
        this.wait(deadline)
        if not this.automatic:
            this.poll()


@TABLE.primitive("pollOneFor")
def poll_one_for(world: World, this: ServiceObject, duration: float) -> None:
    """Handle the first event within this number of seconds."""
    this.wait(world.scheduler.clock.now() + duration)
    if this.pending and not this.automatic:
        this.poll_one()
