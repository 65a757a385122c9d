"""Tags: stop, freeze and block the code that runs under them.

A job keeps the list of its *entries*, outermost first.  Entering tagged code adds an entry; a job made by another
inherits the entries of its maker, and being stopped at an inherited entry ends the job.  A tag made from another
(``clone``) is its child: stopping, freezing or blocking the parent does the same to the child's code.
"""

from __future__ import annotations

import weakref
from typing import TYPE_CHECKING, Any, Protocol

from urbihw.kernel.sched.signals import StopTag
from urbihw.kernel.sched.waiting import wait_unfrozen

if TYPE_CHECKING:
    from urbihw.kernel.sched.job import Job
    from urbihw.kernel.sched.scheduler import Scheduler


class TagEntry:
    """The entry of one job into tagged code, with the jobs that it makes there."""

    __slots__ = ("depth", "jobs", "owner", "tag")

    def __init__(self, tag: Tag, owner: Job) -> None:
        self.tag = tag
        self.owner = owner
        self.depth = len(owner.entries)
        self.jobs: dict[Job, None] = {owner: None}

    def remove_job(self, job: Job) -> None:
        """Remove a job that is over or has left the tagged code."""
        self.jobs.pop(job, None)
        if not self.jobs:
            self.tag.live.pop(self, None)


class Hook(Protocol):
    """Something other than a job that was set up under a tag, such as an ``at``, and ends when the tag is stopped.

    The tag refers to it weakly: an ``at`` on an event without other references is freed together with the event.
    """

    def stopped(self) -> None:
        """The tag was stopped."""
        ...


class Tag:
    """A tag of the scheduler; ``face`` is the urbiscript Tag that it belongs to."""

    def __init__(self, scheduler: Scheduler, name: str, parent: Tag | None = None) -> None:
        self.scheduler = scheduler
        self.name = name
        self.parent = parent
        self.frozen = False
        self.blocked = False
        self.block_value: Any = None
        self.face: Any = None
        self.live: dict[TagEntry, None] = {}
        self._children: list[weakref.ref[Tag]] = []
        self.hooks: weakref.WeakKeyDictionary[Hook, None] = weakref.WeakKeyDictionary()
        if parent is not None:
            parent._children.append(weakref.ref(self, parent._children.remove))

    # ---------------------------------------------------------------- state

    def is_frozen(self) -> bool:
        """Whether this tag or one it derives from is frozen."""
        tag: Tag | None = self
        while tag is not None:
            if tag.frozen:
                return True
            tag = tag.parent
        return False

    def blocker(self) -> Tag | None:
        """This tag or the ancestor that is blocked, None if no one is."""
        tag: Tag | None = self
        while tag is not None:
            if tag.blocked:
                return tag
            tag = tag.parent
        return None

    # ---------------------------------------------------------------- passing through

    def enter(self) -> TagEntry:
        """Let the running job enter code under this tag; it waits first while the tag is frozen.

        Raises StopTag for the new entry when the tag is blocked.
        """
        job = self.scheduler.running()
        entry = TagEntry(self, job)
        job.entries.append(entry)
        self.live[entry] = None
        blocker = self.blocker()
        if blocker is not None:
            self.leave(entry)
            raise StopTag(entry, blocker.block_value)
        if self.scheduler.frozen_tags:
            job.update_frozen()
        if job.frozen:
            try:
                wait_unfrozen(self.scheduler)
            except BaseException:
                self.leave(entry)
                raise
        return entry

    def leave(self, entry: TagEntry) -> None:
        """Let the running job leave the tagged code."""
        job = entry.owner
        if job.entries and job.entries[-1] is entry:
            job.entries.pop()
        elif entry in job.entries:
            job.entries.remove(entry)
        entry.remove_job(job)
        if job.frozen:
            job.update_frozen()

    # ---------------------------------------------------------------- commands

    def stop(self, value: Any) -> None:
        """Stop all code under this tag and its children, with a value; the running job last, if it is under the tag."""
        mine: StopTag | None = None
        for tag in self.descendants():
            for entry in list(tag.live):
                for job in list(entry.jobs):
                    outer = _outermost(job, self)
                    signal = StopTag(outer, value)
                    if job is self.scheduler.current:
                        mine = signal
                    else:
                        self.scheduler.throw(job, signal)
            for hook in list(tag.hooks):
                hook.stopped()
        if mine is not None:
            raise mine

    def freeze(self) -> None:
        """Freeze all code under this tag, at once, the running job included."""
        if not self.frozen:
            self.frozen = True
            self.scheduler.frozen_tags += 1
        self._update_jobs()
        if self.scheduler.current is not None:
            wait_unfrozen(self.scheduler)

    def unfreeze(self) -> None:
        """Let the code go on, unless another tag freezes it."""
        if self.frozen:
            self.frozen = False
            self.scheduler.frozen_tags -= 1
        self._update_jobs()

    def block(self, value: Any) -> None:
        """Stop the code under this tag, and let no code enter until ``unblock``."""
        self.blocked = True
        self.block_value = value
        self.stop(value)

    def unblock(self) -> None:
        """Let code enter again."""
        self.blocked = False
        self.block_value = None

    def descendants(self) -> list[Tag]:
        """This tag and all that derive from it."""
        family = [self]
        for tag in family:
            family.extend(child for child in (ref() for ref in tag._children) if child is not None)
        return family

    def _update_jobs(self) -> None:
        for tag in self.descendants():
            for entry in list(tag.live):
                for job in list(entry.jobs):
                    job.update_frozen()


def _outermost(job: Job, tag: Tag) -> TagEntry:
    for entry in job.entries:
        over: Tag | None = entry.tag
        while over is not None:
            if over is tag:
                return entry
            over = over.parent
    raise LookupError(f"job {job.name} is not under tag {tag.name}")
