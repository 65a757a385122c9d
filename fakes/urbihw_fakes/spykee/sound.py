"""Microphone and loudspeaker: 16000 samples a second, 16 bits signed little-endian, one channel.

The microphone hears what it is made to hear (`clap`, `tone`, `play`) and what the robot's own loudspeaker plays.  The
loudspeaker keeps what it has played, with the times: `record` has silence where nothing was there to play.
"""

from __future__ import annotations

import array
import math
import random
import sys

RATE = 16_000
LOUD = 30_000
ECHO = 0.4
"""How loud the microphone hears the robot's own loudspeaker."""
CLAP_SECONDS = 0.03
LONGEST = 600 * RATE
"""Samples that the loudspeaker keeps."""


def samples_of(pcm: bytes) -> array.array[int]:
    """The samples in some bytes, as numbers."""
    found = array.array("h")
    found.frombytes(pcm[: len(pcm) // 2 * 2])
    if sys.byteorder == "big":
        found.byteswap()
    return found


def bytes_of(samples: array.array[int]) -> bytes:
    """Samples as bytes, as the robot sends them."""
    if sys.byteorder == "big":
        samples = array.array("h", samples)
        samples.byteswap()
    return samples.tobytes()


class Track:
    """Pieces of sound, each with the time at which it begins."""

    def __init__(self) -> None:
        self.pieces: list[tuple[float, array.array[int]]] = []

    def add_sound(self, at: float, samples: array.array[int]) -> None:
        """Add a piece of sound to the track."""
        self.pieces.append((at, samples))

    def between(self, start: float, count: int) -> list[int]:
        """`count` samples from `start` on; silence where there is no sound."""
        out = [0] * count
        for at, samples in self.pieces:
            offset = round((start - at) * RATE)
            first, last = max(0, -offset), min(count, len(samples) - offset)
            for index in range(first, last):
                out[index] += samples[index + offset]
        return out

    def remove_before(self, before: float) -> None:
        """Remove the pieces that end before a time."""
        self.pieces = [(at, samples) for at, samples in self.pieces if at + len(samples) / RATE > before]


class Speaker:
    """The loudspeaker, fed by packets: what comes too late leaves a gap."""

    def __init__(self) -> None:
        self.track = Track()
        self.on = False
        self.ends = -math.inf

    def switch(self, on: bool) -> None:
        """The stream begins, or is over."""
        self.on = on
        self.ends = -math.inf

    def feed(self, pcm: bytes, now: float) -> None:
        """Play a packet; it is ignored while the stream is off."""
        if not self.on:
            return
        samples = samples_of(pcm)
        at = max(now, self.ends)
        self.track.add_sound(at, samples)
        self.ends = at + len(samples) / RATE

    def gaps(self) -> list[float]:
        """Seconds of silence between pieces that were played."""
        ends = [at + len(samples) / RATE for at, samples in self.track.pieces]
        return [at - end for (at, _), end in zip(self.track.pieces[1:], ends, strict=False) if at - end > 1e-6]

    def record(self) -> array.array[int]:
        """All that was played, from its first sample to its last."""
        out = array.array("h")
        for at, samples in self.track.pieces:
            silence = round((at - self.track.pieces[0][0]) * RATE) - len(out)
            out.extend([0] * min(max(0, silence), LONGEST))
            out.extend(samples)
        return out[:LONGEST]


class Microphone:
    """What the robot hears."""

    def __init__(self, speaker: Speaker) -> None:
        self.track = Track()
        self._speaker = speaker
        self._chance = random.Random(7)

    def clap(self, at: float, loudness: float = 0.9) -> None:
        """Somebody claps once near the robot."""
        count = round(CLAP_SECONDS * RATE)
        peak = loudness * LOUD
        fading = (peak * (1 - index / count) * self._chance.uniform(-1, 1) for index in range(count))
        samples = array.array("h", [round(value) for value in fading])
        samples[0] = round(peak)
        self.track.add_sound(at, samples)

    def tone(self, at: float, frequency: float, seconds: float, loudness: float = 0.5) -> None:
        """Somebody whistles a tone near the robot."""
        turn = math.tau * frequency / RATE
        self.track.add_sound(
            at, array.array("h", [round(loudness * LOUD * math.sin(turn * k)) for k in range(round(seconds * RATE))])
        )

    def play(self, at: float, pcm: bytes) -> None:
        """Somebody plays a recording."""
        self.track.add_sound(at, samples_of(pcm))

    def record(self, start: float, count: int) -> bytes:
        """What the microphone hears: `count` samples from `start` on."""
        outside = self.track.between(start, count)
        if self._speaker.track.pieces:
            own = self._speaker.track.between(start, count)
            outside = [a + round(ECHO * b) for a, b in zip(outside, own, strict=True)]
        self.track.remove_before(start - 1)
        return bytes_of(array.array("h", [max(-32768, min(32767, value)) for value in outside]))
