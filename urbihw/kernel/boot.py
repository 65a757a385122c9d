"""Builds a world: first the natives, then the urbiscript half of the library, from one ordered list.

The only file of the kernel that imports all other packages.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import FrameType
from typing import Any

from urbihw.kernel.compiler import compile_node
from urbihw.kernel.lobby.host_process import HostProcess
from urbihw.kernel.lobby.shell import Programs, report_failure
from urbihw.kernel.runtime import backtrace
from urbihw.kernel.runtime.ops import make_ops
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.hooks import SchedulerHooks
from urbihw.kernel.sched.job import Job
from urbihw.kernel.sched.scheduler import Scheduler
from urbihw.kernel.stdlib import Library, install
from urbihw.kernel.uobject import Host
from urbihw.kernel.uobject.natives import install as install_uobject
from urbihw.kernel.uremote.external import declare
from urbihw.kernel.uremote.external import install as install_remotes

PROTECTED_SYSTEM_SLOTS = ("shutdown", "reboot", "resetLibrary")
"""Protected slots of System: no program can remove, replace or hide them."""
PROTECTED_LOBBY_SLOTS = ("lobby", "quit", "interrupt", "onDisconnect")
"""Protected slots of Lobby."""


class KernelHooks(SchedulerHooks):
    """The scheduler's hooks in a kernel: its jobs run urbiscript, and their errors are reported to their lobbies."""

    def job_failed(self, job: Job, error: Exception) -> None:
        """Report an error that has ended a job."""
        report_failure(job, error)

    def describe_frame(self, frame: FrameType) -> str:
        """The location of a frame in the urbiscript source."""
        return backtrace.describe_frame(frame)

    def is_program(self, frame: FrameType) -> bool:
        """Whether a frame is generated code, or may be left in the same way."""
        return backtrace.is_program(frame)


def build(scheduler: Scheduler, process: HostProcess, libraries: Sequence[Library]) -> tuple[Programs, Host]:
    """A world with the standard library and others.

    Returns the programs that lobbies run in a process, and the host for devices.
    """
    world = World(scheduler)
    def run_late(node: Any, this: Any, local: Any) -> Any:
        place, state = local.place, (world.lazy_names.known(), world.generic_floats)
        kept = place.late_units.get(node)
        if kept is None or kept[0] != state:
            unit = compile_node(node, state[0], late=local.names, generic=state[1])
            kept = place.late_units[node] = (state, unit)
        unit = kept[1]
        return unit.function(ops, place.base, place.system, late_locals=local)(this)

    ops = make_ops(world, run_late, declare)
    programs = Programs(world, ops, process)
    install(world, programs, libraries)
    host = install_uobject(world, programs)
    install_remotes(world, host.registry)
    system = world.classes["System"]
    names = ("System", "Lobby", "Global", "Object", *PROTECTED_SYSTEM_SLOTS, *PROTECTED_LOBBY_SLOTS)
    world.record.protect(world.lobby_proto, *names)
    world.record.protect(system, *PROTECTED_SYSTEM_SLOTS)
    world.record.note_library()
    return programs, host

