"""IoService: what happened at Sockets and Servers, kept until somebody polls; the default one needs no polling.

What happens is handled in jobs, and each job counts among those of one connection: of the one that polls, or else of
the one that has opened the Socket or the Server.  So nobody waits for what others have to handle.

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

TABLE = Table("IoService")

Action = Callable[[], None]


RETRY = 0.1
"""Seconds until what happened is handled, if the connection it belongs to may have no further job at present."""


class ServiceObject(Obj):
    """An urbiscript IoService: what happened and was not handled yet."""

    __slots__ = ("_queues", "automatic", "pending", "sleepers")

    def __init__(self, world: World, protos: list[Obj], automatic: bool = False) -> None:
        super().__init__(world, protos)
        self.automatic = automatic
        self.pending: deque[tuple[Any, Action]] = deque()
        """The lobby that each belongs to (None for none), and what is to be done."""
        self.sleepers: dict[Job, None] = {}
        self._queues: dict[Any, deque[Action]] = {}
        """What is handled without a poll, of each lobby; a job handles each of them."""

    def clone(self) -> ServiceObject:
        """A service of its own, which has to be polled."""
        return ServiceObject(self.world, [self])

    def happened(self, owner: Any, action: Action) -> None:
        """Something to be handled in a job, on account of a lobby; in the kernel's thread."""
        self.pending.append((owner, action))
        for job in list(self.sleepers):
            self.world.scheduler.wake(job)
        self._share_out()

    def look_after_itself(self, automatic: bool) -> None:
        """Whether what happens is handled at once, or waits until somebody polls."""
        self.automatic = automatic
        self._share_out()

    def _share_out(self) -> None:
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
        """Handle the queue of a lobby in a job; what one that fails or is killed leaves, another handles."""
        queue, scheduler = self._queues[owner], self.world.scheduler

        def handle() -> None:
            while queue:
                queue.popleft()()
                scheduler.yield_()

        def over(job: Job) -> None:
            if not queue:
                del self._queues[owner]
            elif isinstance(job.error, TooManyJobs):
                scheduler.call_at(scheduler.clock.now() + RETRY, lambda: self._serve(owner))
            else:
                self._serve(owner)

        scheduler.spawn(handle, "network", context=owner).when_ended(over)

    def poll(self) -> None:
        """Handle all that happened, in the running job; the next thing after the handlers of the last began."""
        while self.pending:
            self.poll_one()
            self.world.scheduler.yield_()

    def poll_one(self) -> None:
        """Handle the first thing that happened."""
        _, action = self.pending.popleft()
        action()

    def wait(self, deadline: float) -> None:
        """Park the running job until something happens, or until a time."""
        scheduler = self.world.scheduler
        job = scheduler.running()
        timer = scheduler.call_at(deadline, lambda: scheduler.wake(job))
        self.sleepers[job] = None
        try:
            while not self.pending and scheduler.clock.now() < deadline:
                scheduler.suspend(None)
        finally:
            timer.cancel()
            self.sleepers.pop(job, None)


CLASSES = {"IoService": ServiceObject}


@TABLE.primitive("poll")
def poll(world: World, this: ServiceObject) -> None:
    """Handle all that happened so far."""
    if not this.automatic:
        this.poll()


@TABLE.primitive("pollFor")
def poll_for(world: World, this: ServiceObject, duration: float) -> None:
    """Handle all that happens during so many seconds."""
    deadline = world.scheduler.clock.now() + duration
    while world.scheduler.clock.now() < deadline:
        this.wait(deadline)
        if not this.automatic:
            this.poll()


@TABLE.primitive("pollOneFor")
def poll_one_for(world: World, this: ServiceObject, duration: float) -> None:
    """Handle the first thing that happens during so many seconds."""
    this.wait(world.scheduler.clock.now() + duration)
    if this.pending and not this.automatic:
        this.poll_one()
