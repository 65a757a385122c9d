"""Watched conditions: the slots that an ``at (expression)`` depends on, and re-evaluation when they change.

While a job evaluates a condition, ``Recorder.present`` is its watch, and each read (of a slot, of the content of a
container, of a captured variable) reports its place to ``Recorder.read``.  The watch is then in the ``watchers`` of all
these places; writing any of them calls ``Watch.touched``, which evaluates the condition again, at once, in the job that
writes. Nothing is polled.

So a condition is evaluated when it is set up, and after that only when a slot, a captured variable, the members of a
container, or a UVar that it has read is written.  Other inputs do not notify it: the time (``System.time``,
``Job.timeShift``), random numbers, files, the number of jobs.  A condition on these alone keeps its first value.  A
program that needs "after five seconds" uses ``sleep`` or ``at (x ~ 5s)``, or an ``every`` that writes the time to a
slot.

Reading costs one test of ``active`` when nothing is being recorded.  A captured local variable is a ``Box``; it turns
into a ``WatchedBox`` (same layout, writing notifies) only when some condition has read it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.slot import SlotMeta, meta_of
from urbihw.kernel.value import Value

if TYPE_CHECKING:
    from urbihw.kernel.sched.job import Job
    from urbihw.kernel.sched.scheduler import Scheduler


class Recorder:
    """The watches whose conditions are being evaluated.  One per world.

    ``active`` has them by the job that evaluates; it is None while there are none, which is quick to test.  A condition
    may sleep: other jobs then read slots, and evaluate conditions of their own, and neither counts for it.
    """

    __slots__ = ("_made", "_scheduler", "active")

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._made = 0
        self.active: dict[Job | None, ConditionWatch] | None = None

    def next_number(self) -> int:
        """The number of a new watch: the watches of one place react in this order."""
        self._made += 1
        return self._made

    def present(self) -> ConditionWatch | None:
        """The watch whose condition the running job evaluates, or a job that waits for this one as its child."""
        if self.active is None:
            return None
        job = self._scheduler.current
        watch = self.active.get(job)
        while watch is None and job is not None and job.group is not None:
            job = job.group.owner
            watch = self.active.get(job)
        return watch

    def begin(self, watch: ConditionWatch) -> ConditionWatch | None:
        """The running job evaluates the condition of a watch; returns the watch that it evaluated so far."""
        if self.active is None:
            self.active = {}
        outer = self.active.get(self._scheduler.current)
        self.active[self._scheduler.current] = watch
        return outer

    def end(self, outer: ConditionWatch | None) -> None:
        """The running job goes on with the outer condition, if there is one."""
        assert self.active is not None
        if outer is not None:
            self.active[self._scheduler.current] = outer
            return
        del self.active[self._scheduler.current]
        self.active = self.active or None

    def read(self, target: Value, name: str, number: bool = False) -> None:
        """The present watch depends on this slot (whether it exists or not); ``number``: its value is a Float."""
        watch = self.present()
        if watch is not None and isinstance(target, Obj):
            watch.depend(meta_of(target, name), number)

    def called(self) -> None:
        """The present condition has called a function, which may read other places the next time."""
        watch = self.present()
        if watch is not None:
            watch.steady = False

    def boxes(self, function: Any) -> None:
        """The present watch depends on the variables that this Python function captured."""
        watch = self.present()
        if watch is None:
            return
        for cell in getattr(function, "__closure__", None) or ():
            content = cell.cell_contents if _filled(cell) else None
            if isinstance(content, Box):
                content.watch(watch)


def mark_straight(condition: Callable[[], Any]) -> Callable[[], Any]:
    """Mark the function of a condition that has no branches (see ``ConditionWatch``)."""
    condition.__dict__["straight"] = True
    return condition


def _filled(cell: Any) -> bool:
    try:
        cell.cell_contents  # noqa: B018
    except ValueError:
        return False
    return True


class ConditionWatch:
    """One watched condition: evaluates ``condition`` and calls ``changed(value)`` when its truth changes.

    The condition is evaluated in the job that writes, which must not get its errors: ``failed(error)`` is called
    instead, and the truth stays the same.

    A condition without branches that has called no function reads the same places again as long as only numbers in them
    become other numbers.  Then nothing is recorded: ``steady`` is set.
    """

    __slots__ = (
        "_again", "_busy", "_changed", "_condition", "_failed", "_places", "_recorder", "_straight", "live", "number",
        "steady", "value",
    )  # fmt: skip

    def __init__(
        self,
        recorder: Recorder,
        condition: Callable[[], Any],
        changed: Callable[[bool], None],
        failed: Callable[[Exception], None],
    ) -> None:
        self._recorder = recorder
        self.number = recorder.next_number()
        self._condition = condition
        self._changed = changed
        self._failed = failed
        self._straight = bool(getattr(condition, "straight", False))
        self.steady = False
        self._places: list[dict[ConditionWatch, bool]] = []
        self._busy = False
        self._again = False
        self.live = True
        self.value = False

    def depend(self, meta: SlotMeta, number: bool = False) -> None:
        """Add a place that was read; ``number``: it holds a Float."""
        if meta.watchers is None:
            meta.watchers = {}
        self.depend_on(meta.watchers, number)

    def depend_on(self, watchers: dict[ConditionWatch, bool], number: bool) -> None:
        """Add a place that was read, by its table of watchers."""
        if self not in watchers:
            watchers[self] = number
            self._places.append(watchers)
        elif not number:
            watchers[self] = False

    def begin(self) -> None:
        """Evaluate the condition for the first time; if it fails, it is not watched, and the error is raised."""
        try:
            self._update()
        except BaseException:
            self.stop()
            raise

    def touched(self, same: bool = False) -> None:
        """Evaluate the condition again, because a place that it read was written; ``same``: a number by a number."""
        if self._busy:  # written by this evaluation, or while it has yielded: `_update` goes round once more
            self._again = True
        elif self.live and not (same and self.steady and self._is_unchanged()):
            try:
                self._update()
            except Exception as error:
                self._failed(error)

    def _is_unchanged(self) -> bool:
        """Whether the truth is certainly the same, found without recording."""
        if self._recorder.active is not None:  # the reads would count for another condition
            return False
        self._busy = True
        self._again = False
        try:
            return bool(self._condition()) is self.value and not self._again
        except Exception:  # evaluated once more, and reported then
            return False
        finally:
            self._busy = False

    def _update(self) -> None:
        """Evaluate the condition, and call ``changed`` when its truth is another one."""
        self._busy = True
        try:
            # A condition may write a place that it reads, or yield to a job that does.  Then it is evaluated once more
            # after this evaluation, and not inside it.
            self._again = True
            while self._again and self.live:
                # Cleared before the evaluation: a write during it must not get lost.
                self._again = False
                value = self._evaluate()
                if value != self.value:
                    # The truth is stored first: `changed` may write, and so come back to `touched`.
                    self.value = value
                    self._changed(value)
        finally:
            self._busy = False

    def _evaluate(self) -> bool:
        """Evaluate the condition once and record what it reads."""
        # Each evaluation may read other places: of `a && b`, b is read only while a is true.
        # ``_places`` mirrors the tables that this watch stands in, so that leaving them needs no search.
        for place in self._places:
            place.pop(self, None)
        self._places.clear()
        self.steady = self._straight
        outer = self._recorder.begin(self)
        try:
            self._recorder.boxes(self._condition)
            return bool(self._condition())
        finally:
            self._recorder.end(outer)

    def stop(self) -> None:
        """Stop watching, and leave all places that were read."""
        self.live = False
        for place in self._places:
            place.pop(self, None)
        self._places.clear()


def notify(meta: SlotMeta, value: Value = None) -> None:
    """Evaluate all conditions that have read a slot, in the order in which they were set up.

    ``value`` is the new value; None stands for any change that is not that of a value.
    """
    if meta.watchers:
        touch_all(meta.watchers, value)


def touch_all(watchers: dict[ConditionWatch, bool], value: Value) -> None:
    """Evaluate the conditions in a table, in the order in which they were set up; the new ``value`` was written."""
    number = value.__class__ is float
    # A copy, since each evaluation may remove its watch from the table and add it again, at the end.
    for watch, was_number in sorted(watchers.items(), key=_set_up_at):
        watch.touched(number and was_number)


def _set_up_at(row: tuple[ConditionWatch, bool]) -> int:
    return row[0].number


class Box:
    """A local variable that an inner function captures and that is assigned after its declaration."""

    __slots__ = ("v", "watchers")

    def __init__(self, value: Value) -> None:
        self.v = value
        self.watchers: dict[ConditionWatch, bool] | None = None

    def watch(self, watch: ConditionWatch) -> None:
        """Record that a condition reads this variable."""
        if self.watchers is None:
            self.watchers = {}
            self.__class__ = WatchedBox
        watch.depend_on(self.watchers, self.v.__class__ is float)


_raw = Box.__dict__["v"]


class WatchedBox(Box):
    """A variable that a condition has read: writing it evaluates the condition again."""

    __slots__ = ()

    @property
    def v(self) -> Any:
        """The value of the variable."""
        return _raw.__get__(self, WatchedBox)

    @v.setter
    def v(self, value: Value) -> None:
        _raw.__set__(self, value)
        if self.watchers:
            touch_all(self.watchers, value)
