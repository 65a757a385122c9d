"""The tag of all code of a connection.

The top-level statements of the connection enter it, so programs must not be able to hold them up: the tag can be
stopped, as the manual specifies, but neither blocked nor frozen.
"""

from __future__ import annotations

from urbihw.kernel.runtime.tagscope import TagObject
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.tag import Tag


class ConnectionTag(TagObject):
    """The urbiscript Tag ``connectionTag`` of a lobby."""

    __slots__ = ()
    freeze_refusal = "the tag of a connection can only be stopped"

    def __init__(self, world: World, name: str) -> None:
        super().__init__(world, [world.tag_proto], Tag(world.scheduler, name))
