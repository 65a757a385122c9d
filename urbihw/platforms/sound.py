"""Sound as a loudspeaker takes it: 16 bits, one channel, at the rate of the robot, made of what programs have.

Only what is played next is converted, a piece at a time: a long recording must not hold the interpreter.
"""

from __future__ import annotations

import array
import io
import sys
import wave
from collections.abc import Iterator
from typing import Final

from urbihw.kernel.uobject import USound

PIECE_SAMPLES: Final = 2000
RATES: Final = range(1000, 192_001)
_MIDDLE: Final = bytes(value ^ 0x80 for value in range(256))
"""Unsigned samples of 8 bits -> signed ones, and back."""


class SoundRecording:
    """A sound, to be taken piece by piece, ``play_rate`` samples a second.

    Raises ValueError for what is no sound, in words for the user.

    Attributes:
        seconds: how long it is.
    """

    def __init__(self, sound: USound, play_rate: int) -> None:
        data, channels, rate, bits, signed = _raw(sound)
        if channels not in (1, 2) or rate not in RATES or bits not in (8, 16):
            wanted = f"1 or 2 channels, {RATES[0]} to {RATES[-1]} samples a second, of 8 or 16 bits"
            raise ValueError(f"the loudspeaker takes sound of {wanted}, not {sound.keywords!r}")
        if bits == 8 and not signed:
            data = data.translate(_MIDDLE)
        elif bits == 16 and not signed:
            turned = bytearray(data)
            turned[1::2] = turned[1::2].translate(_MIDDLE)
            data = bytes(turned)
        samples = array.array("h" if bits == 16 else "b")
        samples.frombytes(data[: len(data) // samples.itemsize * samples.itemsize])
        if bits == 16 and sys.byteorder == "big":
            samples.byteswap()
        self._samples, self._channels, self._step = samples, channels, rate / play_rate
        self._loud = 1 if bits == 16 else 256
        frames = len(samples) // channels
        self._count = frames * play_rate // rate
        self.seconds = self._count / play_rate

    def pieces(self) -> Iterator[bytes]:
        """The sound, in pieces of at most PIECE_SAMPLES samples."""
        for start in range(0, self._count, PIECE_SAMPLES):
            piece = array.array("h", self._between(start, min(start + PIECE_SAMPLES, self._count)))
            if sys.byteorder == "big":
                piece.byteswap()
            yield piece.tobytes()

    def _between(self, start: int, end: int) -> Iterator[int]:
        """Samples of the loudspeaker's rate; each lies between two of the recording."""
        step = self._step
        last = len(self._samples) // self._channels - 1
        for index in range(start, end):
            place = index * step
            before = int(place)
            here = self._frame(before)
            part = place - before
            yield here if not part else round(here + (self._frame(min(before + 1, last)) - here) * part)

    def _frame(self, index: int) -> int:
        if self._channels == 1:
            return self._samples[index] * self._loud
        return (self._samples[2 * index] + self._samples[2 * index + 1]) * self._loud // 2


def _raw(sound: USound) -> tuple[bytes, int, int, int, bool]:
    """Samples, channels, samples a second, bits, and whether they are signed."""
    data = bytes(sound.data)
    if data[:4] != b"RIFF":
        return data, sound.channels, sound.rate, sound.bits, sound.signed
    try:
        with wave.open(io.BytesIO(data)) as file:
            bits = 8 * file.getsampwidth()
            return file.readframes(file.getnframes()), file.getnchannels(), file.getframerate(), bits, bits != 8
    except (wave.Error, EOFError) as error:
        raise ValueError(f"this is no WAVE file that can be played: {error}") from error
