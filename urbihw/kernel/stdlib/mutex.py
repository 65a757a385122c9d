"""Mutex: a tag under which one job runs at a time.

Source: manual, specs/mutex.  Jobs get it in the order in which they came; a job that holds it may enter again.
"""

from __future__ import annotations

from collections import deque
from typing import Any

from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.passage import TagObject, TagPassage
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.job import Job
from urbihw.kernel.sched.tag import Tag

TABLE = Table("Mutex")


class MutexObject(TagObject):
    """An urbiscript Mutex."""

    __slots__ = ("_depth", "_holder", "_waiting")

    def __init__(self, world: World, protos: list[Obj], parent: Tag | None = None) -> None:
        super().__init__(world, protos, Tag(world.scheduler, "mutex", parent))
        self._holder: Job | None = None
        self._depth = 0
        self._waiting: deque[Job] = deque()

    def clone(self) -> MutexObject:
        """A free mutex."""
        return MutexObject(self.world, [self], self.tag)

    def open(self) -> MutexPassage:
        """A passage through code under this mutex."""
        return MutexPassage(self)

    def acquire(self) -> None:
        """Wait until the running job holds this mutex."""
        scheduler = self.world.scheduler
        job = scheduler.running()
        if self._holder is None:
            self._holder = job
        elif self._holder is not job:
            self._waiting.append(job)
            try:
                while self._holder is not job:
                    scheduler.suspend(None)
            except BaseException:
                if self._holder is job:
                    self._pass_on()
                else:
                    self._waiting.remove(job)
                raise
        self._depth += 1

    def release(self) -> None:
        """The running job holds it once less; the next in line gets it when it is free."""
        self._depth -= 1
        if self._depth == 0:
            self._pass_on()

    def _pass_on(self) -> None:
        self._holder = self._waiting.popleft() if self._waiting else None
        if self._holder is not None:
            self.world.scheduler.wake(self._holder)


class MutexPassage(TagPassage):
    """A passage through code under a mutex."""

    __slots__ = ("_held", "_mutex")

    def __init__(self, mutex: MutexObject) -> None:
        super().__init__(mutex)
        self._mutex = mutex
        self._held = False

    def enter(self) -> None:
        """Wait for the mutex and go in."""
        self._mutex.acquire()
        self._held = True
        super().enter()

    def exit(self) -> None:
        """Go out and give the mutex back."""
        try:
            super().exit()
        finally:
            if self._held:
                self._held = False
                self._mutex.release()


CLASSES = {"Mutex": MutexObject}
PROTOS = {"Mutex": ("Tag",)}


@TABLE.primitive("init")
def init(world: World, this: MutexObject) -> None:
    """A free mutex; it takes no name."""


@TABLE.primitive("asMutex")
def as_mutex(world: World, this: MutexObject) -> Any:
    """This mutex itself."""
    return this


@TABLE.primitive("asString", "asPrintable")
def as_string(world: World, this: MutexObject) -> str:
    """``Mutex_`` and the identity."""
    return f"{world.type_name(this)}_{world.uid(this)}"
