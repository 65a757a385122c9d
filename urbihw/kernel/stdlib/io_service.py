"""IoService: what happened at Sockets and Servers, kept until somebody polls; the default one needs no polling.

Source: manual, specs/ioservice.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.job import Job

TABLE = Table("IoService")

Action = Callable[[], None]


class ServiceObject(Obj):
    """An urbiscript IoService: what happened and was not handled yet."""

    __slots__ = ("automatic", "busy", "pending", "sleepers")

    def __init__(self, world: World, protos: list[Obj], automatic: bool = False) -> None:
        super().__init__(world, protos)
        self.automatic = automatic
        self.busy = False
        self.pending: deque[Action] = deque()
        self.sleepers: dict[Job, None] = {}

    def clone(self) -> ServiceObject:
        """A service of its own, which has to be polled."""
        return ServiceObject(self.world, [self])

    def happened(self, action: Action) -> None:
        """From any thread: something to be handled in a job."""
        self.world.scheduler.post(lambda: self._arrived(action))

    def look_after_itself(self, automatic: bool) -> None:
        """Whether what happens is handled at once, or waits until somebody polls."""
        self.automatic = automatic
        self._begin()

    def _arrived(self, action: Action) -> None:
        self.pending.append(action)
        for job in list(self.sleepers):
            self.world.scheduler.wake(job)
        self._begin()

    def _begin(self) -> None:
        if self.automatic and self.pending and not self.busy:
            self.busy = True
            self.world.scheduler.spawn(self._serve, "network")

    def _serve(self) -> None:
        """The job that handles what happens to the default service; one that fails leaves the rest to another."""
        try:
            self.poll()
        finally:
            self.busy = False
            self._begin()

    def poll(self) -> None:
        """Handle all that happened, in the running job; the next thing after the handlers of the last began."""
        while self.pending:
            self.pending.popleft()()
            self.world.scheduler.yield_()

    def poll_one(self) -> None:
        """Handle the first thing that happened."""
        self.pending.popleft()()

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
