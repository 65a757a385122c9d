"""A kernel on a simulated clock, and a user."""

from __future__ import annotations

import time

from urbihw.kernel import Kernel
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.uobject import UObject


class Console:
    def __init__(self, *kinds: type[UObject]) -> None:
        self.kernel = Kernel(SimClock())
        self.host = self.kernel.host
        for kind in kinds:
            self.host.register(kind)
        self.lobby = self.kernel.open_lobby()

    def say(self, text: str, until: float | None = None) -> list[str]:
        answer = self.kernel.run_text(self.lobby, text, until)
        return [line.partition("] ")[2] for line in answer.splitlines()]

    def wait(self, lines: int) -> list[str]:
        """What is said until so many lines have come, on the real clock: threads do not know ours."""
        said = b""
        for _ in range(500):
            self.kernel.run()
            said += self.lobby.output.take_bytes()
            if said.count(b"\n") >= lines:
                break
            time.sleep(0.01)
        return [line.partition("] ")[2] for line in said.decode("latin-1").splitlines()]
