"""Builds a world: natives first, then the urbiscript half of the library, from one ordered list.

The only file of the kernel that imports all of it.
"""

from __future__ import annotations

from typing import Any

from urbihw.kernel.compiler import compile_node
from urbihw.kernel.lobby.shell import Programs, report_failure
from urbihw.kernel.runtime.backtrace import describe_frame, is_program
from urbihw.kernel.runtime.ops import make_ops
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.scheduler import Scheduler
from urbihw.kernel.stdlib import install
from urbihw.kernel.uobject.natives import install as install_uobject
from urbihw.kernel.uremote.external import install as install_remotes

OWED = ("shutdown", "reboot", "resetLibrary")
"""Slots of System that no program can take from the others."""
OWED_BY_LOBBY = ("lobby", "quit", "interrupt", "onDisconnect")
"""Slots of Lobby of that kind."""


def build(scheduler: Scheduler) -> Programs:
    """A world with the standard library, and what lobbies need to run programs in it."""
    world = World(scheduler)
    ops = make_ops(world)

    def run_late(node: Any, this: Any, local: Any) -> Any:
        unit = compile_node(node, world.lazy_names, late=local.names, generic=world.generic_floats)
        place = local.place
        return unit.function(ops, place.base, place.system, late_locals=local)(this)

    world.run_late = run_late
    scheduler.failed = report_failure
    scheduler.place = describe_frame
    scheduler.is_program = is_program
    programs = Programs(world, ops)
    install(world, programs)
    install_remotes(world, install_uobject(world))
    system = world.classes["System"]
    world.record.owe(world.lobby_proto, "System", "Lobby", "Global", "Object", *OWED, *OWED_BY_LOBBY)
    world.record.owe(system, *OWED)
    return programs

