"""Which slots an ``at (expression)`` depends on, and when to look again.

While a condition is evaluated, ``Recorder.active`` is the watch it belongs to, and every read (of a slot, of the
content of a container, of a captured variable) reports where it came from by ``Recorder.read``.  The watch is then in
the ``watchers`` of all these places; writing any of them calls ``Watch.touched``, which evaluates the condition anew,
at once, in the job that wrote.  Nobody polls.

Reading costs one test of ``active`` when nothing is being recorded.  A captured local variable is a ``Box``; it turns
into a ``WatchedBox`` (same layout, writing notifies) only when some condition has read it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.slot import SlotMeta, meta_of


class Recorder:
    """Which watch is evaluating its condition, if any.  One per world."""

    __slots__ = ("active",)

    def __init__(self) -> None:
        self.active: Watch | None = None

    def read(self, target: Any, name: str) -> None:
        """The active watch depends on this slot (whether it exists or not)."""
        if self.active is not None and isinstance(target, Obj):
            self.active.depend(meta_of(target, name))

    def boxes(self, function: Any) -> None:
        """The active watch depends on the variables that this Python function captured."""
        watch = self.active
        if watch is None:
            return
        for cell in getattr(function, "__closure__", None) or ():
            content = cell.cell_contents if _filled(cell) else None
            if isinstance(content, Box):
                content.watch(watch)


def _filled(cell: Any) -> bool:
    try:
        cell.cell_contents  # noqa: B018
    except ValueError:
        return False
    return True


class Watch:
    """One watched condition: evaluates ``condition`` and calls ``changed(value)`` when its truth changes.

    It is evaluated by whoever writes what it has read, who must not suffer when it fails: ``failed(error)`` is told
    then, and the condition counts as it did before.
    """

    __slots__ = ("_again", "_busy", "_changed", "_condition", "_failed", "_places", "_recorder", "live", "value")

    def __init__(
        self,
        recorder: Recorder,
        condition: Callable[[], Any],
        changed: Callable[[bool], None],
        failed: Callable[[Exception], None],
    ) -> None:
        self._recorder = recorder
        self._condition = condition
        self._changed = changed
        self._failed = failed
        self._places: list[dict[Watch, None]] = []
        self._busy = False
        self._again = False
        self.live = True
        self.value = False

    def depend(self, meta: SlotMeta) -> None:
        """Remember one place that was read."""
        if meta.watchers is None:
            meta.watchers = {}
        self.depend_on(meta.watchers)

    def depend_on(self, watchers: dict[Watch, None]) -> None:
        """Remember one place by its table of watchers."""
        if self not in watchers:
            watchers[self] = None
            self._places.append(watchers)

    def begin(self) -> None:
        """Evaluate the condition for the first time; if it fails, it is not watched, and the error is raised."""
        try:
            self._look()
        except BaseException:
            self.stop()
            raise

    def touched(self) -> None:
        """Something the condition read was written: evaluate it again."""
        if self._busy:
            self._again = True
        elif self.live:
            try:
                self._look()
            except Exception as error:
                self._failed(error)

    def _look(self) -> None:
        self._busy = True
        try:
            self._again = True
            while self._again and self.live:
                self._again = False
                value = self._evaluate()
                if value != self.value:
                    self.value = value
                    self._changed(value)
        finally:
            self._busy = False

    def _evaluate(self) -> bool:
        for place in self._places:
            place.pop(self, None)
        self._places.clear()
        outer, self._recorder.active = self._recorder.active, self
        try:
            self._recorder.boxes(self._condition)
            return bool(self._condition())
        finally:
            self._recorder.active = outer

    def stop(self) -> None:
        """Look no more."""
        self.live = False
        for place in self._places:
            place.pop(self, None)
        self._places.clear()


def notify(meta: SlotMeta) -> None:
    """A watched slot was written: all conditions that read it look again, in the order in which they began to."""
    if meta.watchers:
        for watch in list(meta.watchers):
            watch.touched()


class Box:
    """A local variable that some inner function captured and that is assigned after its declaration."""

    __slots__ = ("v", "watchers")

    def __init__(self, value: Any) -> None:
        self.v = value
        self.watchers: dict[Watch, None] | None = None

    def watch(self, watch: Watch) -> None:
        """A condition reads this variable."""
        if self.watchers is None:
            self.watchers = {}
            self.__class__ = WatchedBox
        watch.depend_on(self.watchers)


_raw = Box.__dict__["v"]


class WatchedBox(Box):
    """A variable that a condition has read: writing it makes the condition look again."""

    __slots__ = ()

    @property
    def v(self) -> Any:
        """The value."""
        return _raw.__get__(self, WatchedBox)

    @v.setter
    def v(self, value: Any) -> None:
        _raw.__set__(self, value)
        for watch in list(self.watchers or ()):
            watch.touched()
