"""Blending: several movements, or a movement and an assignment, of the same variable at the same time.

The property ``blend`` of a slot decides, a String, or the number by which the C++ SDK names it (``BY_NUMBER``):

- ``normal`` (and anything else): each movement writes; the last written value counts;
- ``mix``: the mean of the values of all movements; ``add``: their sum;
- ``queue``: a movement waits until the earlier ones are over;
- ``discard``: a new movement is dropped while there is another one;
- ``cancel``: a new movement ends the others.

An assignment is a movement of zero length.  In the modes ``mix`` and ``add``, assignments to a device's variable are
collected until the end of the scheduler's round and written as one value, so that a fast program does not flood a slow
device (manual, section 4.1.1).  For a slot without a device, only movements are blended.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from urbihw.kernel.runtime.slot import SlotMeta, peek_meta
from urbihw.kernel.runtime.values import String
from urbihw.kernel.sched.waiting import WaitQueue
from urbihw.kernel.value import Value

if TYPE_CHECKING:
    from collections.abc import Iterator

    from urbihw.kernel.runtime.world import World
    from urbihw.kernel.sched.job import Job

MODES = ("normal", "mix", "add", "queue", "discard", "cancel")
BY_NUMBER = ("mix", "add", "queue", "discard", "cancel", "normal")
"""The modes by the numbers that programs of the C++ SDK send: ``val.blend = urbi::UMIX`` of the manual (section 4.1)
arrives as 0.  The order of the others is that in which the modes are documented; it was not seen on a wire."""


class Cancelled(Exception):
    """A later movement has ended this one."""


class Movement:
    """A movement in progress; ``value`` is its present value, ``pace`` its highest speed in units per second."""

    __slots__ = ("_blender", "cancelled", "job", "pace", "value")

    def __init__(self, blender: Blender, job: Job) -> None:
        self._blender = blender
        self.job = job
        self.value: float | None = None
        self.pace = math.inf
        self.cancelled = False

    def write(self, value: float) -> None:
        """Set the value of the movement.  Raises Cancelled, and the errors of the blender's guard."""
        if self.cancelled:
            raise Cancelled
        if self.job.movement is not None:
            self.job.movement = self.job.movement[0], self._blender.pace_of(self)
        self._blender.admit(value)
        self.value = value
        self._blender.apply(value)


class Blender:
    """The movements of one variable; ``put`` writes the blended value to it."""

    def __init__(self, world: World, meta: SlotMeta, put: Callable[[Any], Any]) -> None:
        self._world = world
        self._meta = meta
        self._put = put
        self._movements: dict[Movement, None] = {}
        self._line = WaitQueue(world.scheduler)
        self._waiting = 0
        self._gathered: list[float] = []
        self._ended: list[tuple[float, float]] = []
        self.admit: Callable[[float], None] = lambda value: None
        """Called before a movement writes; raises an error if it may not."""
        self._since: Callable[[], int] = lambda: 0

    def guard(self, admit: Callable[[float], None], since: Callable[[], int]) -> None:
        """Set the guard: ``admit`` raises an error for a write that is not allowed, ``since`` gives the ``Job.era``
        of the oldest statements that may write.
        """
        self.admit, self._since = admit, since

    @property
    def mode(self) -> str:
        """The blend mode, one of ``MODES``."""
        return mode_of(self._meta)

    @contextmanager
    def movement(self) -> Iterator[Movement | None]:
        """Begin a movement, in mode ``queue`` after the earlier ones; None if it is discarded."""
        mode = self.mode
        if not self._admit(mode):
            yield None
            return
        movement = Movement(self, self._world.scheduler.running())
        self._movements[movement] = None
        try:
            yield movement
        except Cancelled:
            pass
        finally:
            self._movements.pop(movement, None)
            if movement.value is not None:
                # See `_just_ended`: the others of this step have not written yet.
                self._ended = [*self._just_ended(), (self._world.scheduler.clock.now(), movement.value)]
            self._line.wake_one()

    def _admit(self, mode: str) -> bool:
        if mode == "discard":
            return not self._movements
        if mode == "cancel":
            for other in self._movements:
                other.cancelled = True
            self._movements.clear()
        if mode == "queue":
            while self._movements or self._waiting:
                self._waiting += 1
                try:
                    self._line.wait()
                finally:
                    self._waiting -= 1
                if not self._movements:
                    break
        return True

    def apply(self, value: float) -> None:
        """Write the blended value, after a movement has changed its value."""
        self._put(self._blended([]) if self.mode in ("mix", "add") else value)

    def pace_of(self, movement: Movement) -> float:
        """The highest speed of what is written for a movement: blended ones are no faster than all of them together."""
        return sum(each.pace for each in self._movements) if self.mode in ("mix", "add") else movement.pace

    def _blended(self, more: list[float]) -> float:
        since = self._since()
        # A movement of a stopped statement may not have had its turn to end yet: its value no longer counts.
        live = [movement for movement in self._movements if movement.job.era >= since]
        wanted = [movement.value for movement in live if movement.value is not None] + more
        wanted += [value for _, value in self._just_ended()]
        return sum(wanted) if self.mode == "add" else sum(wanted) / len(wanted)

    def _just_ended(self) -> list[tuple[float, float]]:
        """The movements that ended in this step; they still count, so that movements of the same length end at the
        blend of their targets.
        """
        since = self._world.scheduler.clock.now() - self._world.period / 2
        return [(time, value) for time, value in self._ended if time > since]

    def assign(self, value: Value) -> None:
        """Assign the variable, blended with its movements."""
        mode = self.mode
        if mode in ("mix", "add") and value.__class__ is float:
            if not self._gathered:
                scheduler = self._world.scheduler
                scheduler.call_at(scheduler.clock.now(), lambda: self._world.call_soon(self._flush))
            self._gathered.append(value)
        elif self._admit(mode):
            self._put(value)
            self._line.wake_one()

    def _flush(self) -> None:
        gathered, self._gathered = self._gathered, []
        self._put(self._blended(gathered))


def mode_of(meta: SlotMeta) -> str:
    """The blend mode of a slot."""
    value = None if meta.properties is None else meta.properties.get("blend")
    if value.__class__ is float and value in range(len(BY_NUMBER)):
        return BY_NUMBER[int(value)]
    return value.s if isinstance(value, String) and value.s in MODES else "normal"


def blender_of(world: World, meta: SlotMeta, put: Callable[[Any], Any]) -> Blender | None:
    """The blender of a slot, None if its mode is ``normal``."""
    if mode_of(meta) == "normal":
        return None
    if meta.blender is None:
        meta.blender = Blender(world, meta, put)
    return meta.blender


def check_end(world: World, target: Value, name: str) -> None:
    """A trajectory of a slot is over.  Raises an error if the slot is that of a device that cannot be reached."""
    holder = world.peek_obj(target).find(name)
    meta = None if holder is None else peek_meta(holder, name)
    accessor: Any = None if meta is None else meta.accessor
    if hasattr(accessor, "check_end"):
        accessor.check_end()


def find_blending(world: World, target: Value, name: str) -> tuple[dict[str, Any], Blender | None, Any]:
    """The properties of the slot that a movement will write, its blender, and the variable behind the slot."""
    holder = world.peek_obj(target).find(name)
    meta = None if holder is None else peek_meta(holder, name)
    if meta is None:
        return {}, None, None
    accessor: Any = meta.accessor
    if not meta.properties:
        return {}, None, accessor
    if accessor is not None:
        return meta.properties, accessor.blender() if hasattr(accessor, "blender") else None, accessor
    return meta.properties, blender_of(world, meta, lambda value: world.update_slot(target, name, value)), None
