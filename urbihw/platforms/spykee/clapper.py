"""The Clapper of the manual: counts short and loud sounds, such as those of clapping hands.

    var Global.clap = Clapper.new("micro.val", 0.2, 200, 800, 4000);

Its arguments: the variable to listen to, the loudness from which it is a clap (0..1), the least and the greatest time
between two claps, and the longest that a sequence may be, all in ms.
"""

from __future__ import annotations

import array
import sys
from typing import Final

from urbihw.kernel.uobject import UObject, USound, event, reading, variable
from urbihw.platforms.spykee import words

BLOCK_S: Final = 0.01
"""Seconds of sound whose loudness is one number."""
QUIET_S: Final = 0.03
"""Seconds below the threshold after which a sound is over."""

SHOWN_S: Final = 0.05
"""Seconds for which ``val`` is the number: a handler of the change reads it a moment later."""


class Counter:
    """Counts claps in blocks of loudness; times in seconds of the sound that came, so delays do not matter."""

    def __init__(self, threshold: float, least: float, most: float, longest: float) -> None:
        self._threshold, self._least, self._most, self._longest = threshold, least, most, longest
        self._now = 0.0
        self._count = 0
        self._first = self._last = 0.0
        self._began: float | None = None
        self._loud_at = 0.0

    def add_block(self, loudness: float) -> int:
        """Add a block; returns the number of claps of the sequence that ends with it, or 0."""
        self._now += BLOCK_S
        if loudness >= self._threshold:
            self._loud_at = self._now
            if self._began is None:
                self._began = self._now
        elif self._began is not None and self._now - self._loud_at >= QUIET_S:
            self._end_sound(self._began)
            self._began = None
        waits = self._began is None and self._now - self._last > self._most
        if self._count and (waits or self._now - self._first > self._longest):
            count, self._count = self._count, 0
            return count
        return 0

    def _end_sound(self, began: float) -> None:
        """Count a sound that has ended as a clap if it was short and is no echo of the clap before."""
        if self._loud_at - began >= self._least or (self._count and began - self._last < self._least):
            return
        if not self._count:
            self._first = began
        self._count += 1
        self._last = began


class Clapper(UObject):
    """Counts claps in the sound of a variable, and shows the number.

    When a sequence of claps ends, ``val`` becomes their number and then 0 again; if ``emitEvent`` is set, the event
    ``sequence`` is emitted with the number.
    """

    slot_words = words.CLAPPER

    val = reading(0.0)
    emitEvent = variable(False)
    sequence = event()

    def init(self, source: str, threshold: float, least: float, most: float, longest: float) -> None:
        """``Clapper.new("micro.val", 0.2, 200, 800, 4000)``"""
        if not 0 < threshold <= 1 or not 0 < least < most <= longest:
            raise ValueError("expected a threshold up to 1, then rising times in ms, as in 0.2, 200, 800, 4000")
        self._counter = Counter(threshold, least / 1000, most / 1000, longest / 1000)
        self.notify_change(self.var(source), self._count_claps)

    def _count_claps(self, sound: USound) -> None:
        if (sound.bits, sound.channels) != (16, 1) or not sound.rate:
            return
        samples = array.array("h")
        samples.frombytes(bytes(sound.data)[: len(sound) // 2 * 2])
        if sys.byteorder == "big":
            samples.byteswap()
        size = max(1, round(sound.rate * BLOCK_S))
        for at in range(0, len(samples), size):
            block = samples[at : at + size]
            count = self._counter.add_block(max(max(block), -min(block)) / 32768)
            if count:
                self._show_count(count)

    def _show_count(self, count: int) -> None:
        self.val.sense(float(count))
        timer = 0

        def reset() -> None:
            self.remove_timer(timer)
            self.val.sense(0.0)

        timer = self.set_timer(SHOWN_S, reset)
        if self.emitEvent.value:
            self.sequence.emit(float(count))
