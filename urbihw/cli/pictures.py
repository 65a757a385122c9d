"""Images in the formats of servers: converts the keywords and bytes of a Binary for files and windows.

Keywords: ``jpeg W H``, ``ppm W H``, ``rgb W H``, ``ycbcr W H``, ``yuv422 W H``, ``grey8 W H``, ``grey4 W H`` (remote
UObject protocol, section 6; manual, specs/naming-standard and platforms/nao).  Pillow is only needed to convert.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Final

from urbihw.cli.options import CliRefused
from urbihw.client.lines import Binary
from urbihw.exitcodes import EX_CONFIG, EX_RUNTIME
from urbihw.extras import install_command
from urbihw.frozen import frozen

if TYPE_CHECKING:
    from PIL import Image

RAW: Final = {
    "rgb": ("RGB", 24), "ycbcr": ("YCbCr", 24), "ycrcb": ("YCbCr", 24), "yuv422": ("YCbCr", 16), "grey8": ("L", 8),
    "grey4": ("L", 4),
}  # fmt: skip
"""Keyword -> Pillow's mode, bits per pixel."""
ENCODED: Final = {"jpeg": (".jpg", ".jpeg"), "ppm": (".ppm", ".pnm")}
"""Keyword -> extensions of files that store the bytes unchanged."""
MAX_PIXELS: Final = 64 * 1024 * 1024


@frozen(slots=False)
class PictureFile:
    """An image; ``width`` and ``height`` in pixels, 0 if unknown."""

    kind: str
    width: int
    height: int
    data: bytes

    @classmethod
    def of(cls, binary: Binary) -> PictureFile:
        """The image in a Binary.  Raises CliRefused if it is no image."""
        kind, *sizes = binary.keywords.split() or [""]
        if kind not in RAW and kind not in ENCODED:
            known = ", ".join((*ENCODED, *RAW))
            raise CliRefused(f"this is no image that is known: {binary.keywords!r}; known are: {known}", EX_RUNTIME)
        numbers = [int(size) for size in sizes[:2] if size.isdigit() and len(size) < 6]
        width, height = numbers if len(numbers) == 2 else (0, 0)
        if not binary.data:
            raise CliRefused("the image is empty; is the camera switched on (load = 1)?", EX_RUNTIME)
        if kind in RAW and len(binary.data) * 8 != width * height * RAW[kind][1]:
            raise CliRefused(
                f"an image of {width} x {height} in {kind} cannot have {len(binary.data)} bytes", EX_RUNTIME
            )
        return cls(kind, width, height, binary.data)

    def save(self, path: Path) -> None:
        """Write a file in the format of its extension.  Raises CliRefused."""
        if path.suffix.lower() in ENCODED.get(self.kind, ()):
            data = self.data
        elif self.kind == "rgb" and path.suffix.lower() in ENCODED["ppm"]:
            data = b"P6\n%d %d\n255\n" % (self.width, self.height) + self.data
        else:
            data = self._converted(path)
        try:
            path.write_bytes(data)
        except OSError as error:
            raise CliRefused(f"cannot write {path}: {error.strerror}", EX_CONFIG) from error

    def _converted(self, path: Path) -> bytes:
        image, out = self.decoded(), io.BytesIO()
        try:
            (image if image.mode in ("L", "RGB") else image.convert("RGB")).save(out, _format(path))
        except OSError as error:
            raise CliRefused(f"{path}: this image cannot be converted to that: {error}", EX_RUNTIME) from error
        return out.getvalue()

    def decoded(self) -> Image.Image:
        """The image as an object of Pillow.  Raises CliRefused."""
        try:
            from PIL import Image
        except ImportError as error:
            raise CliRefused(
                f"this needs Pillow: {install_command('images')}; without it, JPEG can be saved as .jpg, RGB "
                "and PPM as .ppm",
                EX_CONFIG,
            ) from error
        try:
            if self.kind in RAW:
                return Image.frombytes(RAW[self.kind][0], (self.width, self.height), _unpacked(self.kind, self.data))
            image = Image.open(io.BytesIO(self.data), formats=["JPEG", "PPM"])
            if image.width * image.height > MAX_PIXELS:
                raise CliRefused(f"an image of {image.width} x {image.height} pixels is too large", EX_RUNTIME)
            image.load()
        except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
            raise CliRefused(f"the image is broken: {error}", EX_RUNTIME) from error
        return image


def _unpacked(kind: str, data: bytes) -> bytes:
    """The pixels with one byte for each component."""
    if kind == "yuv422":
        pixels = bytearray(len(data) // 4 * 6)
        pixels[0::3] = data[0::2]
        for component in (1, 2):
            # Two pixels beside each other have the same colour.
            pixels[component::6] = pixels[component + 3 :: 6] = data[2 * component - 1 :: 4]
        return bytes(pixels)
    if kind == "grey4":
        pixels = bytearray(len(data) * 2)
        pixels[0::2] = (value // 16 * 17 for value in data)
        pixels[1::2] = (value % 16 * 17 for value in data)
        return bytes(pixels)
    return data


def _format(path: Path) -> str:
    """Pillow's name for the format of a file's extension.  Raises CliRefused."""
    from PIL import Image

    name = Image.registered_extensions().get(path.suffix.lower())
    if name is None or name not in Image.SAVE:
        raise CliRefused(f"{path}: no kind of image has that ending; try .png, .jpg or .ppm", EX_CONFIG)
    return name
