"""Binary values as device code sees them: bytes with a header that describes their format.

The header is that of the urbiscript Binary, its keywords: ``rgb 640 480`` or ``jpeg 640 480`` for images, ``raw 2 44100
16 1`` or ``wav ...`` for sounds (channels, rate, bits, format: 1 signed, 2 unsigned).  Source: remote UObject protocol,
section 6.  Any other header is passed through.

A value never changes after its construction.  ``data`` may be any buffer: ``bytes`` are shared by all readers of the
value; a ``bytearray`` or ``memoryview`` is copied when it is written to a variable, unless the variable is in zero-copy
mode.
"""

from __future__ import annotations

from urbihw.frozen import frozen
from urbihw.kernel.runtime.binary import Buffer

IMAGE_FORMATS = ("rgb", "jpeg", "ycbcr", "ppm", "yuv411", "yuv420", "yuv422", "grey8", "grey4", "png")
SOUND_FORMATS = ("raw", "wav")


@frozen
class UBinary:
    """Bytes and the keywords that describe their format."""

    data: Buffer
    keywords: str = ""

    def __post_init__(self) -> None:
        if "\n" in self.keywords or ";" in self.keywords:
            raise ValueError(f"the keywords of a binary are one line without semicolons, not {self.keywords!r}")

    def __len__(self) -> int:
        return memoryview(self.data).nbytes


class UImage(UBinary):
    """An image, made with ``UImage.of(data, 640, 480, "rgb")``."""

    __slots__ = ()

    @classmethod
    def of(cls, data: Buffer, width: int, height: int, format: str = "rgb") -> UImage:
        """Make an image.  Raises ValueError for a size that does not fit the data."""
        if width < 0 or height < 0:
            raise ValueError(f"an image cannot be {width} by {height}")
        if format == "rgb" and memoryview(data).nbytes != width * height * 3:
            raise ValueError(
                f"an rgb image of {width} by {height} has {width * height * 3} bytes, not {memoryview(data).nbytes}"
            )
        return cls(data, f"{format} {width} {height}")

    @property
    def format(self) -> str:
        """The format: ``rgb``, ``jpeg`` ..."""
        return self.keywords.split(" ", 1)[0]

    @property
    def width(self) -> int:
        """Width in pixels; 0 if the header does not contain it."""
        return _number(self.keywords, 1)

    @property
    def height(self) -> int:
        """Height in pixels; 0 if the header does not contain it."""
        return _number(self.keywords, 2)


class USound(UBinary):
    """A sound, made with ``USound.of(samples, channels=1, rate=16000, bits=16)``."""

    __slots__ = ()

    @classmethod
    def of(
        cls, data: Buffer, channels: int = 1, rate: int = 16000, bits: int = 16, *, signed: bool = True,
        format: str = "raw",
    ) -> USound:
        """Make a sound.  Raises ValueError if the data ends within a sample."""
        frame = channels * bits // 8
        if channels < 1 or rate < 1 or bits not in (8, 16, 24, 32):
            raise ValueError(f"a sound cannot have {channels} channels, {rate} Hz and {bits} bits")
        if format == "raw" and memoryview(data).nbytes % frame:
            raise ValueError(f"{memoryview(data).nbytes} bytes are no whole number of samples of {frame} bytes")
        return cls(data, f"{format} {channels} {rate} {bits} {1 if signed else 2}")

    @property
    def format(self) -> str:
        """The format: ``raw`` or ``wav``."""
        return self.keywords.split(" ", 1)[0]

    @property
    def channels(self) -> int:
        """Number of channels, 1 or 2; 0 if the header does not contain it."""
        return _number(self.keywords, 1)

    @property
    def rate(self) -> int:
        """Sampling rate in samples per second (Hz)."""
        return _number(self.keywords, 2)

    @property
    def bits(self) -> int:
        """Size of one sample of one channel, in bits."""
        return _number(self.keywords, 3)

    @property
    def signed(self) -> bool:
        """Whether samples are signed."""
        return _number(self.keywords, 4) != 2

    @property
    def duration(self) -> float:
        """Duration in seconds; 0 if the header does not determine it."""
        each = self.rate * self.channels * self.bits // 8
        return len(self) / each if each else 0.0


def _number(keywords: str, index: int) -> int:
    parts = keywords.split()
    return int(parts[index]) if index < len(parts) and parts[index].isdigit() else 0


def make_binary(data: Buffer, keywords: str) -> UBinary:
    """Make an image, a sound or another binary value, according to its keywords."""
    kind = keywords.split(" ", 1)[0]
    if kind in IMAGE_FORMATS:
        return UImage(data, keywords)
    if kind in SOUND_FORMATS:
        return USound(data, keywords)
    return UBinary(data, keywords)
