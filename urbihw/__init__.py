"""urbihw: a gateway daemon that serves the hardware of robot kits as live urbiscript objects.

``urbihw.connect("robot.local")`` is for programs that use a robot (``client``), ``urbihw.fleet("school")`` for those
that use several (``fleets``); neither loads a kernel.

What to read, in order: ``kernel`` (the language), ``buses`` (wires), ``navigation`` (maps and paths), ``platforms``
(robots), ``figure`` (their links and joints), ``daemon`` and ``cli`` (the programs that users start).  The simulated
robots are beside this package, in ``urbihw_fakes``.
"""

from __future__ import annotations

TYPE_CHECKING = False  # as ``typing`` has it, whose import a stop cannot wait for
if TYPE_CHECKING:
    from typing import Any

    from urbihw.client.robot import connect
    from urbihw.fleets.program import fleet

__all__ = ["connect", "fleet"]


def __getattr__(name: str) -> Any:
    """Load the client library when it is used: most of urbihw does not need it."""
    if name == "connect":
        from urbihw.client.robot import connect

        return connect
    if name == "fleet":
        from urbihw.fleets.program import fleet

        return fleet
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
