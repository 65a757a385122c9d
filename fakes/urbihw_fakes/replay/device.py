"""A device that plays recorded answers."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from urbihw_fakes.device import Answer, Device
from urbihw_fakes.replay.answers import AnswerOrder, AnswerTable, Exchanged, cut, exchanges
from urbihw_fakes.replay.capture import Capture
from urbihw_fakes.replay.framing import framing_of

THE_ROBOT = 1
"""The number of what answers, for `urbihw_fakes.faults`."""


class Replay(Device):
    """Answers as a capture says.

    `strict`: requests must come in the recorded order (see `AnswerOrder`); otherwise each request has its own answers.
    `speed` divides the recorded delays; 0 answers at once. With `strict` an adapter that was lost is lost again: then
    `plug` is called with False, and with True when it was back. The delays contain the time on the recorded wire, so
    this device is never paced.
    """

    def __init__(self, capture: Capture, *, strict: bool = False, speed: float = 1.0) -> None:
        super().__init__()
        self._framing = framing_of(capture.platform)
        recorded = list(exchanges(capture.pieces, self._framing))
        self.answers = AnswerOrder(recorded) if strict else AnswerTable(recorded, self._framing)
        self.plug: Callable[[bool], None] = lambda is_plugged: None
        self._strict = strict
        self._scale = 1 / speed if speed else 0.0
        self._rest = b""
        self._gaps: deque[tuple[float, bool]] = deque()

    def receive(self, data: bytes, now: float) -> list[Answer]:
        """Answer the requests that these bytes complete."""
        requests, self._rest = cut(self._rest + data, self._framing)
        answers: list[Answer] = []
        for request in requests:
            found = self.answers.find(request)
            if found is not None:
                answers += self._answers_of(found, now)
        return answers

    def tick(self, now: float) -> list[Answer]:
        """Take the adapter away, or bring it back."""
        while self._gaps and self._gaps[0][0] <= now:
            self.plug(self._gaps.popleft()[1])
        return []

    def due(self) -> float | None:
        """Return when the adapter goes or comes next."""
        return self._gaps[0][0] if self._gaps else None

    def power_off(self, now: float, who: int | None = None) -> None:
        """Be silent until `power_on`."""
        self.faults.start("silence")

    def power_on(self, now: float, who: int | None = None) -> None:
        """Answer requests again from now on."""
        self.faults.stop("silence")

    def compared(self) -> str:
        """Return how the requests differ from the recorded ones, in words."""
        if isinstance(self.answers, AnswerTable):
            return f"{self.answers.unknown} requests that the recording has nothing like"
        return self.answers.differences or f"as recorded; {self.answers.left} requests have not come"

    def _answers_of(self, found: Exchanged, asked_at: float) -> list[Answer]:
        if found.gap and self._strict:
            down, up = found.gap
            self._gaps += [(asked_at + down * self._scale, False), (asked_at + up * self._scale, True)]
        answers = []
        for delay, data in found.answers:
            late, heard = self.faults.disturb(THE_ROBOT, data)
            if heard:
                answers.append(Answer(asked_at + delay * self._scale + late, heard))
        return answers
