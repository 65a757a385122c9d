"""The tag of all that a connection runs.

Its statements go through it at top level, so what others do with it must not keep them from going on: it can be
stopped, as the manual has it, but neither blocked nor frozen.
"""

from __future__ import annotations

from urbihw.kernel.runtime.passage import TagObject
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.tag import Tag


class ConnectionTag(TagObject):
    """The urbiscript Tag ``connectionTag`` of a lobby."""

    __slots__ = ()
    for_all = "the tag of a connection can only be stopped"

    def __init__(self, world: World, name: str) -> None:
        super().__init__(world, [world.tag_proto], Tag(world.scheduler, name))
