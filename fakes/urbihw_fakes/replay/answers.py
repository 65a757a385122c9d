"""Which recorded answer belongs to a request; bytes only.

Whatever came after a request and before the next one is its answer. The same request asked again gets the answers in
the order recorded, then the last one again and again. One that only writes other values than a recorded one (goals,
speeds) gets what that got.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import takewhile
from typing import Final

from urbihw_fakes.replay.capture import Piece
from urbihw_fakes.replay.framing import Framing

AFTER: Final = 1e-6  # s after the last piece at which the adapter goes
BEFORE: Final = 1e-3  # s before the first piece at which it is back, for who opens it

@dataclass
class Exchanged:
    """A request, and what came back: pieces with their delays in s from the request.

    `gap` is None, or when the adapter was lost afterwards and when it was back, as delays too.
    """

    request: bytes
    answers: list[tuple[float, bytes]] = field(default_factory=list)
    gap: tuple[float, float] | None = None


def exchanges(pieces: Iterable[Piece], framing: Framing) -> Iterator[Exchanged]:
    """Yield the exchanges of a capture in their order, without its prelude."""
    made: list[Exchanged] = []
    asked_at = last_at = 0.0
    gap = False
    rest = b""
    for piece in pieces:
        if piece.way == ">":
            if gap and made:
                made[-1].gap = (last_at - asked_at + AFTER, piece.time - asked_at - BEFORE)
            requests, rest = cut(rest + piece.data, framing)
            gap = False
            made += map(Exchanged, requests)
            asked_at = piece.time
        elif piece.way == "<" and made:
            made[-1].answers.append((piece.time - asked_at, piece.data))
        gap = gap or piece.way == "!"
        last_at = piece.time
    yield from made


def prelude(pieces: Iterable[Piece]) -> list[tuple[float, bytes]]:
    """Return what came before the first request, with delays in s from the first piece: some robots speak unasked."""
    before = list(takewhile(lambda piece: piece.way != ">", pieces))
    return [(piece.time - before[0].time, piece.data) for piece in before if piece.way == "<"]


def cut(buffer: bytes, framing: Framing) -> tuple[list[bytes], bytes]:
    """Cut bytes into requests; return them, and the beginning of one that is not complete."""
    requests = []
    while buffer:
        size = framing.size(buffer)
        if size == 0:
            break
        if size > 0:
            requests.append(buffer[:size])
        buffer = buffer[abs(size) :]
    return requests, buffer


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
        number = min(self._next[key], len(known) - 1)
        self._next[key] += 1
        return known[number]


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
