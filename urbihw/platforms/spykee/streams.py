"""The devices with a stream: the camera and the microphone.  Each is on while somebody reads or follows its ``val``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

from urbihw.kernel.uobject import UImage, USound, reading
from urbihw.platforms import jpeg
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.spykee.protocol import SOUND_RATE
from urbihw.platforms.streamed import Streamed

WIDTH, HEIGHT = 320, 240


class SpykeeStream(Streamed):
    """A stream of the robot, watched in the worker under the name ``stream``."""

    stream: ClassVar[str]

    def switch_stream(self, on: bool) -> None:
        """Watch it, or no longer."""
        self.channel.watch(self.stream, ("val",), 0.0 if on else None)


class SpykeeCamera(SpykeeStream):
    """The camera: ``val`` is the newest picture, a JPEG; it is on while somebody reads or follows ``val``.

    ``width`` and ``height`` (pixels) are those of the picture; the angles of view (rad) are not known.
    """

    stream = "camera"
    nothing = UImage.of(b"", 0, 0, "jpeg")
    width = reading(float(WIDTH))
    height = reading(float(HEIGHT))
    xfov = reading(math.nan)
    yfov = reading(math.nan)
    format = reading("jpeg")
    frames = reading(0.0)

    def show_picture(self, image: bytes, stamp: float) -> None:
        """Show a picture, received at ``stamp`` of the kernel's clock."""
        width, height = jpeg.size_of(image) or (WIDTH, HEIGHT)
        self.width.sense(float(width))
        self.height.sense(float(height))
        self.frames.sense(self.frames.sensed + 1)
        self.val.sense(UImage.of(image, width, height, "jpeg"), stamp)


class SpykeeMicro(SpykeeStream):
    """The microphone: ``val`` is what was heard since the last change, 16000 samples a second of 16 bits.

    ``duration`` (ms) is how long that is.  It is on while somebody reads or follows ``val``.
    """

    stream = "micro"
    nothing = USound.of(b"", 1, SOUND_RATE, 16)
    duration = reading(0.0)

    def init(self, channel: DeviceChannel) -> None:
        """Called by ``new``; there is no sound yet."""
        super().init(channel)
        self._last = 0
        self._pieces: list[bytes] = []

    def show_sound(self, pieces: Mapping[str, tuple[int, bytes]], stamp: float) -> None:
        """Show pieces of sound; those of the same round become one sound."""
        fresh = sorted(piece for piece in pieces.values() if piece[0] > self._last)
        if not fresh:
            return
        self._last = fresh[-1][0]
        if not self._pieces:
            self.host.post(lambda: self._show_heard(stamp))
        self._pieces += [data for _, data in fresh]

    def reset_numbers(self) -> None:
        """Expect the numbers of another worker, which begin again."""
        self._last = 0

    def _show_heard(self, stamp: float) -> None:
        data, self._pieces = b"".join(self._pieces), []
        sound = USound.of(data[: len(data) // 2 * 2], 1, SOUND_RATE, 16)
        self.duration.sense(sound.duration * 1000)
        self.val.sense(sound, stamp)
