"""System.log: the last lines of the server's log, for consoles and panels.  Not in the manual.

Each entry is a Dictionary: ``n`` (its number), ``time`` (System.time), ``date`` (seconds since 1970), ``level``,
``text``, and ``fields``, another one: ``logger``, and where known ``robot``, ``devices``, ``event``.
"""

from __future__ import annotations

import json
from typing import Any, Final

from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib import prototype
from urbihw.kernel.value import Value

NOTES: Final = {
    "System.logged": "The event that is emitted with each new entry of the log.",
}
"""Descriptions of slots that hold values, which have no docstrings."""


def install(world: World, programs: Any) -> None:
    """Install ``log``, ``logText`` and ``logged`` in System."""
    table = Table("System")
    log = programs.log

    @table.primitive("log")
    def entries(world: World, this: Value) -> Value:
        """The last 200 entries of the server's log, a List of Dictionaries."""
        return world.from_python(list(log.entries))

    @table.primitive("logText")
    def log_text(world: World, this: Value, since: float = 0.0) -> str:
        """The entries of the server's log whose number ``n`` is greater than ``since``, as a text of JSON."""
        return json.dumps([entry for entry in log.entries if entry["n"] > since], separators=(",", ":"))

    table.install(world, prototype(world, "System"))
    prototype(world, "System").slots["logged"] = log.logged
