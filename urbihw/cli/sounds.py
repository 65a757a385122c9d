"""Sound in the formats of servers: converts the keywords and bytes of Binaries into WAVE files.

Keywords: ``raw C R S F`` and ``wav C R S F``: channels, samples a second, bits of a sample, 1 signed or 2 unsigned
(remote UObject protocol, section 6).  Samples are little-endian.  A WAVE file has unsigned samples of 8 bits and signed
ones of 16 (Microsoft's description of the format), so others are turned into these.
"""

from __future__ import annotations

import io
import wave
from collections.abc import Iterable
from typing import Final

from urbihw.cli.options import CliRefused
from urbihw.client.lines import Binary
from urbihw.exitcodes import EX_RUNTIME
from urbihw.frozen import frozen

RATES: Final = range(1000, 400_001)
_FLIPPED: Final = bytes(value ^ 0x80 for value in range(256))


@frozen(slots=False)
class WaveFormat:
    """The format of samples: channels, samples per second, bytes per sample (1 or 2)."""

    channels: int
    rate: int
    width: int

    def seconds(self, size: int) -> float:
        """The duration of ``size`` bytes, in seconds."""
        return size / (self.channels * self.rate * self.width)


@frozen(slots=False)
class SoundFile:
    """Samples in the format of a WAVE file."""

    format: WaveFormat
    samples: bytes

    @classmethod
    def of(cls, binary: Binary) -> SoundFile:
        """The sound in a Binary.  Raises CliRefused if it is no sound."""
        kind, *numbers = binary.keywords.split() or [""]
        if kind == "wav" and binary.data[:4] == b"RIFF":
            return cls._of_file(binary.data)
        plain = all(text.isdigit() and len(text) < 7 for text in numbers)
        if kind not in ("raw", "wav") or len(numbers) < 4 or not plain:
            raise CliRefused(
                f"this is no sound that is known: {binary.keywords!r}; known is: raw CHANNELS RATE BITS SIGN",
                EX_RUNTIME,
            )
        channels, rate, bits, sign = map(int, numbers[:4])
        if channels not in (1, 2) or rate not in RATES or bits not in (8, 16) or sign not in (1, 2):
            raise CliRefused(f"sound of this kind cannot be written: {binary.keywords!r}", EX_RUNTIME)
        data = binary.data
        if bits == 8 and sign == 1:
            data = data.translate(_FLIPPED)
        elif bits == 16 and sign == 2:
            turned = bytearray(data)
            turned[1::2] = turned[1::2].translate(_FLIPPED)
            data = bytes(turned)
        return cls(WaveFormat(channels, rate, bits // 8), data)

    @classmethod
    def _of_file(cls, data: bytes) -> SoundFile:
        try:
            with wave.open(io.BytesIO(data)) as file:
                made = WaveFormat(file.getnchannels(), file.getframerate(), file.getsampwidth())
                return cls(made, file.readframes(file.getnframes()))
        except (wave.Error, EOFError) as error:
            raise CliRefused(f"the sound is broken: {error}", EX_RUNTIME) from error


def wave_file(sounds: Iterable[SoundFile]) -> bytes:
    """Join pieces of sound to one file.  Raises CliRefused if their formats differ, and if there are none."""
    pieces = list(sounds)
    if not pieces:
        raise CliRefused("the device gave no sound; is it switched on (load = 1)?", EX_RUNTIME)
    format = pieces[0].format
    if any(piece.format != format for piece in pieces):
        raise CliRefused("the device changed the kind of its sound while it was recorded", EX_RUNTIME)
    out = io.BytesIO()
    with wave.open(out, "wb") as file:
        file.setnchannels(format.channels)
        file.setframerate(format.rate)
        file.setsampwidth(format.width)
        file.writeframes(b"".join(piece.samples for piece in pieces))
    return out.getvalue()
