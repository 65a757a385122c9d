"""Pictures, sounds and other Binaries of a robot as Python values; numpy and Pillow are imported only when needed.

``numpy.asarray(robot.camera.val)`` is the array of a picture: height, width, 3 colours or grey.  The keywords are those
of the remote UObject protocol, section 6: ``jpeg W H``, ``ppm W H``, ``rgb W H``, ``grey8 W H``; ``raw C R S F`` and
``wav C R S F`` with channels, samples a second, bits of a sample, 1 signed or 2 unsigned; samples are little-endian.
"""

from __future__ import annotations

from typing import Any, Final

from urbihw.client.lines import Binary

ENCODED: Final = ("jpeg", "ppm", "png")
_BANDS: Final = {"rgb": 3, "ycbcr": 3, "grey8": 1}

_MODES: Final = {"rgb": "RGB", "ycbcr": "YCbCr", "grey8": "L"}
"""Format -> the mode of Pillow with the same bytes."""


class Blob:
    """A Binary: ``data``, the bytes, and ``keywords``, what they are."""

    def __init__(self, keywords: str, data: bytes) -> None:
        self.keywords = keywords
        self.data = data

    def __len__(self) -> int:
        """The number of bytes."""
        return len(self.data)

    def __bytes__(self) -> bytes:
        return self.data

    def __eq__(self, other: object) -> bool:
        """Whether both have the same keywords and bytes."""
        return isinstance(other, Blob) and (self.keywords, self.data) == (other.keywords, other.data)

    def __hash__(self) -> int:
        """Equal values have the same hash."""
        return hash((self.keywords, self.data))

    def __repr__(self) -> str:
        """The class, the keywords and the size."""
        return f"<{type(self).__name__} {self.keywords!r}, {len(self.data)} bytes>"


class Picture(Blob):
    """A picture: ``format`` such as jpeg or rgb, ``width`` and ``height`` in pixels, 0 if unknown."""

    def __init__(self, keywords: str, data: bytes) -> None:
        super().__init__(keywords, data)
        self.format, *sizes = keywords.split()
        numbers = [int(size) for size in sizes[:2] if size.isdigit() and len(size) < 6]
        self.width, self.height = numbers if len(numbers) == 2 else (0, 0)

    @property
    def array(self) -> Any:
        """A numpy array of bytes: height, width and, for colours, 3.  jpeg needs Pillow, too.  Raises ImportError
        without them, ValueError for a broken picture.
        """
        import numpy

        if self.format in ENCODED:
            import io

            from PIL import Image

            with Image.open(io.BytesIO(self.data)) as image:
                return numpy.asarray(image)
        bands = _BANDS.get(self.format)
        if bands is None:
            raise ValueError(f"pictures of the format {self.format} have no array")
        shape = (self.height, self.width, bands) if bands > 1 else (self.height, self.width)
        return numpy.frombuffer(self.data, numpy.uint8).reshape(shape)

    def __array__(self, dtype: Any = None, copy: Any = None) -> Any:
        """The array of numpy's ``asarray``."""
        found = self.array
        return found if dtype is None else found.astype(dtype)

    def _repr_jpeg_(self) -> bytes | None:
        """The picture in a notebook."""
        return self.data if self.format == "jpeg" else None

    def _repr_png_(self) -> bytes | None:
        """The picture in a notebook, if it is no jpeg."""
        try:
            return None if self.format == "jpeg" else self.encoded("png")
        except (ImportError, OSError, ValueError):
            return None

    def encoded(self, kind: str) -> bytes:
        """The picture as a file of the kind ``jpeg`` or ``png``.  Raises ImportError without Pillow, ValueError for a
        broken picture or a format without one."""
        if self.format == kind:
            return self.data
        import io

        from PIL import Image

        out = io.BytesIO()
        if self.format in ENCODED:
            image: Image.Image = Image.open(io.BytesIO(self.data))
        elif self.format in _MODES:
            image = Image.frombytes(_MODES[self.format], (self.width, self.height), self.data)
        else:
            raise ValueError(f"pictures of the format {self.format} cannot be shown")
        image.convert("RGB").save(out, kind.upper())
        return out.getvalue()


class Sound(Blob):
    """A sound: ``channels``, ``rate`` in Hz, ``bits`` of a sample, ``signed``; ``samples`` are its bytes."""

    def __init__(self, keywords: str, data: bytes) -> None:
        super().__init__(keywords, data)
        self.format, *words = keywords.split()
        numbers = [int(word) for word in words[:4] if word.isdigit() and len(word) < 7]
        self.channels, self.rate, self.bits, sign = numbers if len(numbers) == 4 else (1, 8000, 16, 1)
        self.signed = sign == 1
        self.samples = data
        if data[:4] == b"RIFF":
            self._read_wave(data)

    def _read_wave(self, data: bytes) -> None:
        import io
        import wave

        try:
            with wave.open(io.BytesIO(data)) as file:
                self.channels, self.rate, self.bits = file.getnchannels(), file.getframerate(), 8 * file.getsampwidth()
                self.signed = self.bits > 8
                self.samples = file.readframes(file.getnframes())
        except (wave.Error, EOFError):
            pass  # the keywords tell the format

    @property
    def array(self) -> Any:
        """A numpy array of the samples: moments, or moments and channels.  Raises ImportError without numpy."""
        import numpy

        samples = numpy.frombuffer(self.samples, f"<{'i' if self.signed else 'u'}{self.bits // 8}")
        return samples.reshape(-1, self.channels) if self.channels > 1 else samples

    def __array__(self, dtype: Any = None, copy: Any = None) -> Any:
        """The array of numpy's ``asarray``."""
        found = self.array
        return found if dtype is None else found.astype(dtype)


def media_of(found: Binary) -> Blob:
    """The Python value of a Binary, by its keywords."""
    kind = found.keywords.split(" ", 1)[0]
    if kind in ENCODED or kind in ("rgb", "ycbcr", "ycrcb", "yuv422", "grey8", "grey4"):
        return Picture(found.keywords, found.data)
    if kind in ("raw", "wav"):
        return Sound(found.keywords, found.data)
    return Blob(found.keywords, found.data)
