"""Standard input as a user types it."""

from __future__ import annotations

import io
from collections.abc import Callable


class Typist(io.StringIO):
    """The user: each answer comes with what the user does before it."""

    def __init__(self, *steps: tuple[Callable[[], object] | None, str]) -> None:
        super().__init__()
        self._steps = list(steps)

    def readline(self, size: int | None = -1) -> str:  # type: ignore[override]
        if not self._steps:
            return ""
        action, answer = self._steps.pop(0)
        if action is not None:
            action()
        return answer + "\n"
