"""The remote UObject of ``urbihw latency``: a process of its own, which writes back what is written to it."""

from __future__ import annotations

from urbihw.kernel.uobject import UObject, variable


class UrbihwLatency(UObject):
    """Sets ``back`` to each new value of ``val``; drives nothing."""

    val = variable(0.0)
    back = variable(0.0)

    def init(self) -> None:
        """Called by ``new``."""
        self.notify_change(self.val, self.answer)

    def answer(self) -> None:
        """Write the value back."""
        self.back.value = self.val.value
