"""A scope and the jobs it waits for: what ``,`` ``&`` ``for&`` and their like are made of.

The owner starts children, goes on, and joins them at the end.  A child that fails takes the others with it: its error
is thrown into the owner, wherever that is, and leaving the group by an error stops the children that still run and
waits until their ``finally`` clauses are over.
"""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING, Any

from urbihw.kernel.sched.signals import JobKilled, StopTag, supersedes

if TYPE_CHECKING:
    from urbihw.kernel.sched.job import Job
    from urbihw.kernel.sched.scheduler import Scheduler


class Group:
    """Jobs that belong to a block of code; use as a context manager in the owning job."""

    __slots__ = ("_children", "_joining", "_scheduler", "closed", "owner")

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self.owner = scheduler.running()
        self._children: dict[Job, None] = {}
        self._joining = False
        self.closed = False

    def __enter__(self) -> Group:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        if error is not None:
            self._abandon_for(error)
            return
        try:
            self.join()
        except BaseException as thrown:
            self._abandon_for(thrown)
            raise

    def start(self, body: Callable[[], Any], name: str = "") -> None:
        """A child that runs at once; the owner queues up behind all that are ready (the separator ``,``)."""
        self._scheduler.start_now(self._make(body, name))

    def launch(self, body: Callable[[], Any], name: str = "") -> None:
        """A child that runs at once; the owner goes on as soon as it yields (the branches of ``&``)."""
        self._scheduler.run_first(self._make(body, name))

    def _make(self, body: Callable[[], Any], name: str) -> Job:
        child = self._scheduler.spawn(body, name, parent=self.owner)
        child.group = self
        self._children[child] = None
        return child

    def join(self) -> None:
        """Wait until all children are over."""
        while self._children:
            self._joining = True
            try:
                self._scheduler.suspend(None)
            finally:
                self._joining = False

    def child_ended(self, child: Job, error: BaseException | None) -> None:
        """Called by the scheduler when a child is over."""
        self._children.pop(child, None)
        if error is not None and not self.closed and not _concerns_child_only(error):
            self.closed = True
            self._scheduler.throw(self.owner, error)
        elif not self._children and self._joining:
            self._scheduler.wake(self.owner)

    def _abandon_for(self, error: BaseException) -> None:
        """``abandon``, since the block is left by ``error``; what is thrown meanwhile must not replace that."""
        leave = self.abandon
        while True:
            try:
                leave()
            except BaseException as thrown:
                if supersedes(thrown, error):
                    raise
                leave = self.join
            else:
                return

    def abandon(self) -> None:
        """Stop the children and wait until they are over: the block is left by return, break or an error."""
        self.closed = True
        for child in list(self._children):
            self._scheduler.kill(child)
        self.join()


def _concerns_child_only(error: BaseException) -> bool:
    """A child stopped by a tag or killed ends alone: whoever stopped it stops its owner too, if he means to."""
    return isinstance(error, JobKilled | StopTag)
