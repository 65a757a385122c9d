"""Which recorded answer a request gets; bytes only.

The same request asked again gets the answers in the order recorded, then the last one that had an answer again and
again: what was silent for a moment is not silent for ever. One that only writes other values than a recorded one
(goals, speeds) gets what that got.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

from urbihw_fakes.replay.exchanges import Exchanged
from urbihw_fakes.replay.framing import Framing


class AnswerTable:
    """Finds the answer to a request. `unknown` counts requests that the recording has nothing like."""

    def __init__(self, recorded: Iterable[Exchanged], framing: Framing) -> None:
        self.unknown = 0
        self._kind = framing.kind
        self._same: dict[bytes, list[Exchanged]] = defaultdict(list)
        self._alike: dict[bytes, list[Exchanged]] = defaultdict(list)
        self._next: dict[bytes, int] = defaultdict(int)
        for each in recorded:
            self._same[each.request].append(each)
            self._alike[self._kind(each.request)].append(each)

    def find(self, request: bytes) -> Exchanged | None:
        """Return the next recorded exchange for a request; None if there is none."""
        table, key = (self._same, request) if request in self._same else (self._alike, self._kind(request))
        known = table.get(key)
        if known is None:
            self.unknown += 1
            return None
        number = self._next[key]
        self._next[key] += 1
        if number < len(known):
            return known[number]
        return next((each for each in reversed(known) if each.answers), known[-1])


class AnswerOrder:
    """The same in the recorded order: for the test of a driver.

    `differences` are the first request that was another one than recorded, and the recorded one, in hex; from there on
    nothing is answered.
    """

    def __init__(self, recorded: Iterable[Exchanged]) -> None:
        self.differences = ""
        self._recorded = list(recorded)
        self._at = 0

    @property
    def left(self) -> int:
        """How many recorded requests have not come yet."""
        return len(self._recorded) - self._at

    def find(self, request: bytes) -> Exchanged | None:
        """Return the next recorded exchange if it is for this request."""
        if self.differences or not self.left:
            return None
        wanted = self._recorded[self._at]
        if wanted.request != request:
            asked, recorded = request.hex(" ").upper(), wanted.request.hex(" ").upper()
            self.differences = f"request {self._at + 1}: {asked}, recorded was {recorded}"
            return None
        self._at += 1
        return wanted
