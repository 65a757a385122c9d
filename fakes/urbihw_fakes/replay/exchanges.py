"""Requests and what came back on them, from a capture; bytes only.

What comes after a request and before the next one is its answer, unless it tells that it is the answer of another
unit: then it belongs to the last request to that one. So an answer that was late, on a busy computer, stays the late
answer of its own request, and is not one more answer to the next.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import takewhile
from typing import Final

from urbihw_fakes.replay.capture import Piece
from urbihw_fakes.replay.framing import Framing

AFTER: Final = 1e-6  # s after the last piece at which the adapter goes
BEFORE: Final = 1e-3  # s before the first piece at which it is back, for who opens it
PATIENCE_S: Final = 0.5
"""Seconds for which the rest of a packet is waited for; behind that it is a damaged one."""


@dataclass(eq=False)
class Exchanged:
    """A request, and what came back: pieces with their delays in s from the request.

    `asked_at` is when it was asked, in s of the capture. `gap` is None, or when the adapter was lost afterwards and
    when it was back, as delays too.
    """

    request: bytes
    asked_at: float = 0.0
    answers: list[tuple[float, bytes]] = field(default_factory=list)
    gap: tuple[float, float] | None = None


def exchanges(pieces: Iterable[Piece], framing: Framing) -> Iterator[Exchanged]:
    """Yield the exchanges of a capture in their order, without its prelude."""
    made: list[Exchanged] = []
    answers = _Answers(framing)
    last_at = 0.0
    gap = False
    rest = b""
    for piece in pieces:
        if piece.way == ">":
            if gap and made:
                asked_at = made[-1].asked_at
                made[-1].gap = (last_at - asked_at + AFTER, piece.time - asked_at - BEFORE)
            requests, rest = cut(rest + piece.data, framing)
            gap = False
            for request in requests:
                made.append(Exchanged(request, piece.time))
                answers.ask(made[-1])
        elif piece.way == "<" and made:
            answers.add(piece)
        else:
            answers.flush()
        gap = gap or piece.way == "!"
        last_at = piece.time
    answers.flush()
    yield from made


class _Answers:
    """Adds what comes back to the exchanges to which it belongs."""

    def __init__(self, framing: Framing) -> None:
        self._framing = framing
        self._last: Exchanged | None = None
        self._asked: dict[int, Exchanged] = {}
        """The last request to each unit."""
        self._held: list[tuple[Piece, bytes, Exchanged]] = []
        """The beginning of a packet: pieces, what is left of their bytes, and the last request at that time."""
        self._given: tuple[Piece | None, Exchanged | None] = None, None
        """The piece that was given away last, and to what. Only bytes of one piece come back as one: two telegrams on
        a CAN bus may have the same time."""

    def ask(self, exchanged: Exchanged) -> None:
        """Take note of a request that has gone out."""
        self._last = exchanged
        for unit in self._framing.units(exchanged.request):
            self._asked[unit] = exchanged

    def add(self, piece: Piece) -> None:
        """Add bytes that have come to what they belong to."""
        assert self._last is not None
        if self._held and piece.time - self._held[0][0].time > PATIENCE_S:
            self.flush()
        self._held.append((piece, piece.data, self._last))
        while self._held:
            buffer = b"".join(data for _, data, _ in self._held)
            size = self._framing.size(buffer)
            if size == 0:
                return
            self._take(abs(size), self._framing.unit(buffer) if size > 0 else None)

    def flush(self) -> None:
        """What is held will not be completed."""
        self._take(sum(len(data) for _, data, _ in self._held), None)

    def _take(self, size: int, unit: int | None) -> None:
        """Give away so many of the bytes that are held: those of a packet of a unit, or damaged ones."""
        while size > 0:
            piece, data, asked = self._held.pop(0)
            if len(data) > size:
                self._held.insert(0, (piece, data[size:], asked))
            owner = asked if unit is None else self._asked.get(unit, asked)
            delay, data, size = piece.time - owner.asked_at, data[:size], size - len(data)
            if self._given[0] is piece and self._given[1] is owner:
                owner.answers[-1] = (delay, owner.answers[-1][1] + data)
            else:
                owner.answers.append((delay, data))
            self._given = piece, owner


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
