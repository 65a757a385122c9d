"""An assembly machine that takes its time: the quick start of the Urbi manual, in Python.

In urbiscript, once the class is registered (``loadModule("factory");``)::

    var machine = UFactory.new(10ms)|;
    machine.assemble(["a", "b", "c"]);      // "abc", after 30 ms
"""

from __future__ import annotations

import time

from urbihw.kernel.uobject import LOCK_INSTANCE, UObject, threaded, variable


class UFactory(UObject):
    """Puts pieces together, one after the other; several machines work at the same time."""

    duration = variable(0.01)

    def init(self, duration: float) -> None:
        """Called by ``new``: how long one piece takes, in seconds."""
        if duration < 0:
            raise ValueError("a machine cannot be that fast")
        self.duration.value = duration

    @threaded(LOCK_INSTANCE)
    def assemble(self, pieces: list[float | str]) -> str:
        """All pieces in one; the caller waits, others go on."""
        time.sleep(self.duration.value * len(pieces))
        return "".join(piece if isinstance(piece, str) else f"{piece:g}" for piece in pieces)
