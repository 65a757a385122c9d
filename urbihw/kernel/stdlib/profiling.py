"""Profiling: measures the duration of an expression."""

from __future__ import annotations

from typing import Any

from urbihw.kernel.compiler import print_node
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import CallMessage
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.members import count
from urbihw.kernel.stdlib.support import send_line

TABLE = Table("Profiling")


@TABLE.lazy("new", least=2, most=2)
def new(world: World, message: CallMessage) -> None:
    """Evaluate an expression a number of times, and print the number of scheduler rounds and the seconds that it
    took.
    """
    turns = count(world, message.eval_at(1), 2)
    scheduler, lazy = world.scheduler, message.args[0]
    cycle, start = scheduler.cycle, scheduler.clock.now()
    for _ in range(turns):
        lazy.force()
    cycles, seconds = scheduler.cycle - cycle, scheduler.clock.now() - start
    node: Any = lazy.node
    body = getattr(node, "body", None) if type(node).__name__ == "Scope" else node
    send_line(world, "Profiling information")
    context = scheduler.running().context
    if context is not None:
        lines = (
            f"  Expression:       {'' if body is None else print_node(body)}\n"
            f"  Iterations:       {turns}\n"
            f"  Cycles:           {cycles}\n"
            f"  Total time:       {seconds:g} s\n"
            f"  Single iteration: {seconds / max(turns, 1):g} s\n"
            f"                    {cycles / max(turns, 1):g} cycles\n"
        )
        context.output.write(lines.encode("latin-1", "replace"))
