"""The verbs of generated code for tags, ``every`` and trajectories."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from urbihw.kernel.runtime.blend import check_end, find_blending
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.tagscope import (
    ConditionScope,
    EventScope,
    LoopScope,
    ScopeTag,
    TagObject,
    TimeoutScope,
)
from urbihw.kernel.runtime.trajectory import Trajectory
from urbihw.kernel.runtime.verbs import locals_of
from urbihw.kernel.runtime.watch import Box
from urbihw.kernel.sched.tag import Tag
from urbihw.kernel.value import Value

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World


class EveryPace:
    """The deadlines of an ``every``, in the job's own time; after an overrun, the next iteration starts at once."""

    __slots__ = ("_due", "_job", "_world")

    def __init__(self, world: World) -> None:
        self._world = world
        self._job = world.scheduler.running()
        self._due = self._job.local_time(world.scheduler.clock.now())

    def wait(self, period: Value) -> None:
        """Sleep until one period after the last deadline."""
        if period.__class__ is not float:
            raise self._world.type_error(1, period, "Float", "+=")
        scheduler = self._world.scheduler
        now = self._job.local_time(scheduler.clock.now())
        self._due = max(self._due + period, now)
        scheduler.sleep(self._due - now)


def tag_verbs(world: World) -> dict[str, Any]:
    """The scopes of tagged code: tags, detaching loops, ``timeout``, ``stopif``, ``freezeif``."""

    def tag_open(value: Value) -> Value:
        """The scope of a tag (or a mutex)."""
        opener = getattr(value, "open", None)
        if opener is None:
            raise world.type_error(None, value, "Tag", None)
        return opener()

    def tag_named(holder: Value, implicit: bool, path: tuple[str, ...]) -> Any:
        """The scope of the tag of this name; a tag is made in Tag for an undeclared name."""
        return tag_open(world.tag_by_name(holder, implicit, path))

    def scope_tag() -> TagObject:
        """The tag of a scope."""
        tag = Tag(world.scheduler, "scope")
        return ScopeTag(world, [world.tag_proto], tag)

    def loop_tag() -> LoopScope:
        """The scope of a loop whose body detaches jobs."""
        return LoopScope(world)

    def timeout(duration: Value) -> TimeoutScope:
        """``timeout (duration)``."""
        return TimeoutScope(world, world.as_float(duration, None, "timeout"))

    def guard(kind: str, condition: Callable[[], Any]) -> ConditionScope:
        """``stopif (condition)`` and ``freezeif (condition)``."""
        return ConditionScope(world, condition, kind == "freezeif")

    def event_guard(kind: str, event: Value, accept: Callable[[list[Any]], Any]) -> EventScope:
        """``stopif (event?)`` and ``freezeif (event?)``."""
        if not isinstance(event, Event):
            raise world.type_error(None, event, "Event", None)
        return EventScope(world, event, accept, kind == "freezeif")

    return locals_of(tag_open, tag_named, scope_tag, loop_tag, timeout, guard, event_guard)


def time_verbs(world: World) -> dict[str, Any]:
    """The periods of ``every``, and trajectories of slots and local variables."""

    def pace() -> EveryPace:
        """The deadlines of an ``every``."""
        return EveryPace(world)

    def move_slot(target: Value, name: str, value: Value, attributes: dict[str, Any]) -> None:
        """``target.name = value time: 1s``."""
        if target.__class__ is not float and target.assigns_to_members and name not in target.slots:
            target.distribute(value, lambda member, share: move_slot(member, name, share, attributes))
            return
        read = world.ops.send0
        properties, blender, variable = find_blending(world, target, name)
        Trajectory(
            world, lambda: read(target, name), lambda v: world.update_slot(target, name, v), value, attributes,
            properties, blender, variable,
        ).run()
        check_end(world, target, name)

    def move_local(box: Box, value: Value, attributes: dict[str, Any]) -> None:
        """``local = value time: 1s``."""

        def write(v: Value) -> None:
            box.v = v

        Trajectory(world, lambda: box.v, write, value, attributes).run()

    return locals_of(pace, move_slot, move_local)
