"""A scope and the jobs it waits for: the basis of ``,``, ``&``, ``for&`` and the like.

The owner starts children, goes on, and joins them at the end.  The error of a child is thrown into the owner, wherever
the owner is.  When the owner leaves the group by an error, the other children are stopped, and the owner waits until
their ``finally`` clauses are over.
"""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING, Any

from urbihw.kernel.sched.signals import JobKilled, StopTag, supersedes
from urbihw.kernel.sched.waiting import Completion

if TYPE_CHECKING:
    from urbihw.kernel.sched.job import Job
    from urbihw.kernel.sched.scheduler import Scheduler


class Group:
    """The jobs of a block of code; a context manager in the owning job."""

    __slots__ = ("_children", "_failed", "_joined", "_scheduler", "closed", "owner")

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self.owner = scheduler.running()
        self._children: dict[Job, None] = {}
        self._joined: Completion[None] | None = None
        """Completed when the last child is over; None while the owner does not join."""
        self._failed: tuple[BaseException, TracebackType | None] | None = None
        """The error of a child that was thrown into the owner, with the traceback that it had then."""
        self.closed = False

    def __enter__(self) -> Group:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        if error is not None:
            self._forget_owner(error)
            self._abandon_for(error)
            return
        try:
            self.join()
        except BaseException as thrown:
            self._forget_owner(thrown)
            self._abandon_for(thrown)
            raise

    def start(self, body: Callable[[], Any], name: str = "") -> None:
        """Start a child that runs at once; the owner goes to the end of the ready queue (the separator ``,``)."""
        self._scheduler.start_now(self._make(body, name))

    def launch(self, body: Callable[[], Any], name: str = "") -> None:
        """Start a child that runs at once; the owner goes on as soon as the child yields (the branches of ``&``)."""
        self._scheduler.run_first(self._make(body, name))

    def _make(self, body: Callable[[], Any], name: str) -> Job:
        child = self._scheduler.spawn(body, name, parent=self.owner)
        child.group = self
        self._children[child] = None
        return child

    def join(self) -> None:
        """Wait until all children are over."""
        while self._children:
            self._joined = Completion(self._scheduler)
            self._joined.wait()

    def child_ended(self, child: Job, error: BaseException | None) -> None:
        """Count a child that is over; called by the scheduler."""
        self._children.pop(child, None)
        if error is not None and not self.closed and not _concerns_child_only(error):
            self.closed = True
            self._failed = (error, error.__traceback__)
            self._scheduler.throw(self.owner, error)
        elif not self._children and self._joined is not None:
            self._joined.complete(None)

    def _forget_owner(self, error: BaseException) -> None:
        """Take the place where the owner was out of the traceback of a child's error: the child was not called from
        there.
        """
        failed, self._failed = self._failed, None
        if failed is not None and failed[0] is error:
            error.__traceback__ = failed[1]

    def _abandon_for(self, error: BaseException) -> None:
        """Call ``abandon`` because the block is left by ``error``; errors thrown meanwhile do not replace ``error``."""
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
        """Stop the children and wait until they are over, because the block is left by return, break or an error."""
        self.closed = True
        for child in list(self._children):
            self._scheduler.kill(child)
        self.join()


def _concerns_child_only(error: BaseException) -> bool:
    """Whether an error ends the child only: a stopped tag or a kill.  If the owner is concerned too, it gets its
    own.
    """
    return isinstance(error, JobKilled | StopTag)
