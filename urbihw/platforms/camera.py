"""A camera whose pictures do not come by the robot's own wire; any platform may have one (``camera_url``)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Protocol

from urbihw.frozen import frozen
from urbihw.kernel.uobject import UImage, reading
from urbihw.platforms import jpeg
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.film import Film, check_url
from urbihw.platforms.streamed import Streamed
from urbihw.settings import TEXT, Mistake, SettingsTable, setting


class CameraLog(Protocol):
    """Receives warnings: the log of the robot."""

    def warning(self, text: str, *values: Any) -> None:
        """Log a warning, formatted with ``%``."""
        ...


@frozen(slots=False)
class CameraOptions(SettingsTable):
    """The option of a robot that may carry such a camera.

    Attributes:
        camera_url: its pictures: ``http://`` of a JPEG or of an MJPEG stream, or ``v4l2:/dev/video0``; "" for none.
    """

    camera_url: str = setting("", TEXT)

    def clashes(self) -> Iterator[Mistake]:
        """Yield a url that is not that of a camera."""
        yield from super().clashes()
        if self.camera_url and (problem := check_url(self.camera_url)):
            yield Mistake("camera_url", problem)


class PictureCamera(Streamed):
    """The camera: ``val`` is the newest picture, a JPEG; it is read while somebody reads or follows ``val``."""

    nothing = UImage.of(b"", 0, 0, "jpeg")
    width = reading(0.0)
    height = reading(0.0)
    xfov = reading(math.nan)
    yfov = reading(math.nan)
    format = reading("jpeg")
    frames = reading(0.0)

    def init(self, channel: DeviceChannel, url: str, log: CameraLog) -> None:
        """``url`` is that of the option ``camera_url``; "" for a camera without pictures."""
        self._log = log
        self._film = Film(url, self.host.post, self._show_picture, self._tell) if url else None
        super().init(channel)

    def may_stream(self) -> bool:
        """Whether there are pictures."""
        return self._film is not None

    def switch_stream(self, on: bool) -> None:
        """Begin or end to read pictures."""
        if self._film is not None:
            (self._film.start if on else self._film.stop)()

    def close(self) -> None:
        """Read no more pictures."""
        self.switch_stream(False)

    def _show_picture(self, picture: bytes) -> None:
        width, height = jpeg.size_of(picture) or (0, 0)
        self.width.sense(float(width))
        self.height.sense(float(height))
        self.frames.sense(self.frames.sensed + 1)
        self.val.sense(UImage.of(picture, width, height, "jpeg"), self.host.now())

    def _tell(self, problem: str) -> None:
        self._log.warning("camera: %s", problem or "it is back")
