"""A device that plays recorded answers."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from urbihw_fakes.device import Answer, Device
from urbihw_fakes.replay.answers import AnswerOrder, AnswerTable
from urbihw_fakes.replay.capture import Capture
from urbihw_fakes.replay.exchanges import Exchanged, cut, exchanges, prelude
from urbihw_fakes.replay.framing import framing_of

PAUSE = 0.01  # s between two rounds of what a robot says unasked
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
        self._prelude = deque(prelude(capture.pieces))
        self._begun_at: float | None = None
        self._gaps: deque[tuple[float, bool]] = deque()

    def receive(self, data: bytes, now: float) -> list[Answer]:
        """Answer the requests that these bytes complete."""
        requests, self._rest = cut(self._rest + data, self._framing)
        self._prelude.clear()
        answers: list[Answer] = []
        for request in requests:
            found = self.answers.find(request)
            if found is not None:
                answers += self._answers_of(found, now)
        return answers

    def tick(self, now: float) -> list[Answer]:
        """Return what the robot says unasked until the first request; take the adapter away, or bring it back."""
        while self._gaps and self._gaps[0][0] <= now:
            self.plug(self._gaps.popleft()[1])
        said = []
        self._begun_at = now if self._begun_at is None else self._begun_at
        while self._prelude and (at := self._begun_at + self._prelude[0][0] * self._scale) <= now:
            said.append(Answer(at, self._prelude[0][1]))
            self._prelude.rotate(-1)
            if self._strict:
                self._prelude.pop()
            elif self._prelude[0][0] <= self._prelude[-1][0]:
                # From the beginning again, after a pause as long as those before.
                self._begun_at = now + PAUSE
        return said

    def due(self) -> float | None:
        """Return when the adapter goes or comes next, or the robot says something unasked."""
        begun = self._begun_at or 0.0
        dues = [begun + self._prelude[0][0] * self._scale] if self._prelude else []
        dues += [self._gaps[0][0]] if self._gaps else []
        return min(dues, default=None)

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
