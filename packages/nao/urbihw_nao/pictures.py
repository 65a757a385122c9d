"""Pictures of NAOqi's cameras, and how they become those of the manual's formats; no I/O.

NAOqi is asked for the colour space that takes the least work here: its own conversions run on the robot, and only JPEG
is made on this side, from the camera's native YUV422, whose components a JPEG file has too.
"""

from __future__ import annotations

import io
import math
from collections.abc import Mapping
from importlib.util import find_spec
from typing import Any, Final

from urbihw.buses.errors import BadValue
from urbihw.extras import install_command
from urbihw.frozen import frozen
from urbihw_nao.qimessaging.checked import to_row, to_whole

RGB, YUV, JPEG, PPM, YUV422, GREY8, GREY4 = range(1, 8)
"""The values of ``camera.formatDetail`` (manual, section "Camera")."""
MOST_PIXELS: Final = 100_000
"""Largest side of a picture that is accepted, in pixels."""
_HIGH: Final = bytes(value & 0xF0 for value in range(256))
_LOW: Final = bytes(value >> 4 for value in range(256))


def no_pillow() -> str:
    """The message when JPEG is asked for without Pillow."""
    return f"JPEG needs Pillow: {install_command('images')}; camera.formatDetail = 1 (RGB) and others do without"


@frozen
class PictureFormat:
    """A format: the keyword of its Binary, the colour space to ask NAOqi for, and the bytes of a pixel there."""

    keyword: str
    space: int
    bytes_per_pixel: int


FORMATS: Final[Mapping[int, PictureFormat]] = {
    RGB: PictureFormat("rgb", 11, 3), YUV: PictureFormat("ycbcr", 10, 3), JPEG: PictureFormat("jpeg", 9, 2),
    PPM: PictureFormat("ppm", 11, 3),
    YUV422: PictureFormat("yuv422", 9, 2), GREY8: PictureFormat("grey8", 0, 1), GREY4: PictureFormat("grey4", 0, 1),
}  # fmt: skip
"""``formatDetail`` -> format; colour spaces: fact sheet, section 11."""
RESOLUTIONS: Final[Mapping[int, tuple[int, int, int]]] = {
    0: (2, 640, 480), 1: (1, 320, 240), 2: (0, 160, 120), 3: (7, 80, 60),
}  # fmt: skip
"""``camera.resolution`` -> NAOqi's number of it, width and height in pixels."""


@frozen
class CameraMode:
    """What is wanted of the cameras.

    Attributes:
        index: which camera: 0 on top, 1 at the bottom.
        resolution, format, quality: as the slots of the same names; ``format`` is ``formatDetail``.
        rate: pictures per second.
    """

    index: int
    resolution: int
    format: int
    quality: int
    rate: float

    def shows_same(self, other: CameraMode) -> bool:
        """Whether pictures of the other mode differ in their number and quality at most."""
        return (self.index, self.resolution, self.format) == (other.index, other.resolution, other.format)

    def subscription(self) -> tuple[int, int, int, int]:
        """What NAOqi must know: camera, resolution, colour space, whole pictures per second."""
        return self.index, RESOLUTIONS[self.resolution][0], FORMATS[self.format].space, max(1, math.ceil(self.rate))


@frozen
class NaoPicture:
    """A picture in its format, as it was wanted in ``mode``; sizes in pixels, angles of view in rad."""

    mode: CameraMode
    data: bytes
    width: int
    height: int
    keyword: str
    xfov: float
    yfov: float


def has_pillow() -> bool:
    """Whether JPEG can be made."""
    return find_spec("PIL") is not None


def read_picture(answer: Any, mode: CameraMode) -> NaoPicture | None:
    """The picture in an answer to getImageRemote; None where NAOqi has none.

    Raises BadValue for anything else than a picture of the size and the colour space that were asked for.
    """
    if not isinstance(answer, list | tuple) or not answer or not any(answer[:2]):
        return None
    wanted = FORMATS[mode.format]
    try:
        width, height, _, space = (to_whole(each, 0, MOST_PIXELS) for each in to_row(answer, 12)[:4])
        # An angle that is not known may be nan.
        left, top, right, bottom = map(float, answer[8:12])
    except (TypeError, ValueError) as error:
        raise BadValue("what NAOqi returned is no picture") from error
    if (width, height) != RESOLUTIONS[mode.resolution][1:] or space != wanted.space:
        size = "{} x {}".format(*RESOLUTIONS[mode.resolution][1:])
        raise BadValue(f"NAOqi sends {width} x {height} in colour space {space}, not {size} in {wanted.space}")
    pixels = answer[6]
    if not isinstance(pixels, bytes | bytearray) or len(pixels) != width * height * wanted.bytes_per_pixel:
        what = f"{len(pixels)} bytes" if isinstance(pixels, bytes | bytearray) else f"a {type(pixels).__name__}"
        raise BadValue(f"a picture of {width} x {height} in colour space {space} cannot be {what}")
    data = _convert(bytes(pixels), width, height, mode)
    return NaoPicture(mode, data, width, height, wanted.keyword, _angle(left, right), _angle(top, bottom))


def _angle(one: float, other: float) -> float:
    angle = abs(one - other)
    return angle if 0 < angle < math.pi else math.nan


def _convert(pixels: bytes, width: int, height: int, mode: CameraMode) -> bytes:
    if mode.format == JPEG:
        return _make_jpeg(pixels, width, height, mode.quality)
    if mode.format == PPM:
        return b"P6\n%d %d\n255\n" % (width, height) + pixels
    return _make_grey4(pixels) if mode.format == GREY4 else pixels


def _make_grey4(grey: bytes) -> bytes:
    """Two pixels a byte, the left one in its upper half."""
    left, right = grey[0::2].translate(_HIGH), grey[1::2].translate(_LOW)
    return (int.from_bytes(left) | int.from_bytes(right)).to_bytes(len(left))


def _make_jpeg(yuyv: bytes, width: int, height: int, quality: int) -> bytes:
    """A JPEG of pixels Y U Y V.  Raises BadValue without Pillow."""
    try:
        from PIL import Image
    except ImportError as error:
        raise BadValue(no_pillow()) from error
    half = width // 2, height
    planes = [Image.frombytes("L", (width, height), yuyv[0::2])]
    planes += [Image.frombytes("L", half, yuyv[at::4]).resize((width, height)) for at in (1, 3)]
    out = io.BytesIO()
    Image.merge("YCbCr", planes).save(out, "JPEG", quality=max(quality, 1))
    return out.getvalue()
