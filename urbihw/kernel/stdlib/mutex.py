"""Mutex: a tag whose code is executed by one job at a time.

Source: manual, specs/mutex.  Jobs get the mutex in the order of their requests; a job that holds it may enter again.
"""

from __future__ import annotations

from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.tagscope import TagObject, TagObjectScope
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.job import Job
from urbihw.kernel.sched.tag import Tag
from urbihw.kernel.sched.waiting import HandoverQueue
from urbihw.kernel.stdlib.object import as_string as object_text
from urbihw.kernel.value import Value

TABLE = Table("Mutex")


class MutexObject(TagObject):
    """An urbiscript Mutex, with the jobs that wait for it."""

    __slots__ = ("_depth", "_holder", "_waiting")

    def __init__(self, world: World, protos: list[Obj], parent: Tag | None = None) -> None:
        super().__init__(world, protos, Tag(world.scheduler, "mutex", parent))
        self._holder: Job | None = None
        self._depth = 0
        self._waiting: HandoverQueue[None] = HandoverQueue(world.scheduler)

    def clone(self) -> MutexObject:
        """A new mutex that no job holds."""
        return MutexObject(self.world, [self], self.tag)

    def open(self) -> MutexScope:
        """A scope for code under this mutex."""
        return MutexScope(self)

    def acquire(self) -> None:
        """Wait until the running job holds the mutex."""
        job = self.world.scheduler.running()
        if self._holder is None:
            self._holder = job
        elif self._holder is not job:
            self._waiting.wait(lambda _: self._pass_on())
        self._depth += 1

    def release(self) -> None:
        """Release the mutex once for the running job; when it is free, the next waiting job gets it."""
        self._depth -= 1
        if self._depth == 0:
            self._pass_on()

    def _pass_on(self) -> None:
        self._holder = self._waiting.hand_over(None)


class MutexScope(TagObjectScope):
    """The scope of a mutex: one job at a time may be in it."""

    __slots__ = ("_held", "_mutex")

    def __init__(self, mutex: MutexObject) -> None:
        super().__init__(mutex)
        self._mutex = mutex
        self._held = False

    def enter(self) -> None:
        """Wait for the mutex and enter the scope."""
        self._mutex.acquire()
        self._held = True
        super().enter()

    def exit(self) -> None:
        """Leave the scope and release the mutex."""
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
    """Make a mutex without a name."""


@TABLE.primitive("asMutex")
def as_mutex(world: World, this: MutexObject) -> Value:
    """Returns this mutex itself."""
    return this


@TABLE.primitive("asString", "asPrintable")
def as_string(world: World, this: MutexObject) -> str:
    """As any object, and not as a Tag."""
    text: str = object_text(world, this)
    return text
