"""Faults of a wire, injected on request, with the same names for every robot.

    word      amount (default)       what happens to an answer
    silence                          it is not sent; the unit still hears and obeys
    checksum                         its last byte is wrong
    cut       bytes kept (half)      the rest of it is never sent
    noise     bytes (4)              garbage, with a false header in it, comes before it
    late      seconds (0.05)         it comes that much later
    echo                             the adapter hands the host its own bytes back; always the whole bus

Each word may be asked for one unit or for the whole bus, for good or for the next few answers:

    faults.start("silence", 6)
    faults.start("checksum", 6, times=1)
    faults.start("late", amount=0.02)
    faults.stop()

Power cuts are `Device.power_off` / `power_on`, an adapter that goes and comes is `Endpoint.unplug` / `plug`.
Not covered: answers that collide with a later request because they are late (both arrive whole).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from urbihw_fakes.errors import UnknownRequest

DEFAULT_AMOUNTS: dict[str, float | None] = {
    "silence": None,
    "checksum": None,
    "cut": None,
    "noise": 4,
    "late": 0.05,
    "echo": None,
}
WORDS = tuple(DEFAULT_AMOUNTS)

# FF FF 01 looks like the start of a Dynamixel packet: a reader must not trust the first header it sees.
NOISE = bytes.fromhex("5A FF FF 01 00 A5 FF 7E")


@dataclass(frozen=True, slots=True)
class Fault:
    """One request: `who` None is the whole bus, `times` None is until stopped."""

    word: str
    who: int | None = None
    amount: float | None = None
    times: int | None = None


class Faults:
    """The faults of one device at the moment; empty at first."""

    def __init__(self) -> None:
        self._active: dict[tuple[str, int | None], Fault] = {}

    def __iter__(self) -> Iterator[Fault]:
        return iter(tuple(self._active.values()))

    @property
    def echo(self) -> bool:
        """True while the adapter echoes."""
        return bool(self._active) and ("echo", None) in self._active

    def start(
        self, word: str, who: int | None = None, *, amount: float | None = None, times: int | None = None
    ) -> None:
        """Ask for a fault (see the table on top); the same word for the same unit replaces the one before.

        Raises:
            UnknownRequest: no such word, an echo of one unit only, or `times` below 1.
        """
        if word not in DEFAULT_AMOUNTS:
            raise UnknownRequest(f"fault {word!r}: no such word; say one of {', '.join(WORDS)}")
        if word == "echo" and (who is not None or times is not None):
            raise UnknownRequest("fault 'echo': it is the adapter that echoes; ask for the whole bus, without a count")
        if times is not None and times < 1:
            raise UnknownRequest(f"fault {word!r}: times={times}; give 1 or more, or None for good")
        if amount is None:
            amount = DEFAULT_AMOUNTS[word]
        self._active[(word, who)] = Fault(word, who, amount, times)

    def stop(self, word: str | None = None, who: int | None = None) -> None:
        """Heal: one word or all words, of unit `who` or, with None, of the whole bus and of every unit."""
        self._active = {
            key: fault
            for key, fault in self._active.items()
            if not ((word is None or fault.word == word) and (who is None or fault.who == who))
        }

    def disturb(self, who: int, data: bytes) -> tuple[float, bytes]:
        """Apply the faults to an answer of unit `who`: return extra delay in s, and the bytes (b"": not sent)."""
        if not self._active or not data:
            return 0.0, data
        delay = 0.0
        for word in WORDS:
            fault = self._pop_fault(word, who)
            if fault is None:
                continue
            if word == "silence":
                return 0.0, b""
            if word == "late":
                delay = fault.amount or 0.0
            else:
                data = _spoil(word, data, fault.amount)
        return delay, data

    def _pop_fault(self, word: str, who: int) -> Fault | None:
        """Return the fault for this answer and count it down; a fault of the unit precedes one of the whole bus."""
        if word == "echo":
            return None
        for key in ((word, who), (word, None)):
            fault = self._active.get(key)
            if fault is not None:
                if fault.times == 1:
                    del self._active[key]
                elif fault.times is not None:
                    self._active[key] = replace(fault, times=fault.times - 1)
                return fault
        return None


def _spoil(word: str, data: bytes, amount: float | None) -> bytes:
    if word == "checksum":
        return data[:-1] + bytes([data[-1] ^ 0xFF])
    if word == "cut":
        return data[: len(data) // 2 if amount is None else int(amount)]
    count = int(amount or 0)
    return (NOISE * (count // len(NOISE) + 1))[:count] + data
