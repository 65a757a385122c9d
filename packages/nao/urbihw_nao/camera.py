"""The object ``camera``: the cameras of the head (manual, section "Camera")."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Container
from typing import Final

from urbihw.buses.messages import Reply
from urbihw.kernel.uobject import UImage, UVar, number, owned, reading, set_range
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.devicelog import DeviceLog
from urbihw.platforms.streamed import Streamed
from urbihw_nao import words
from urbihw_nao.camera_part import CAMERA, FILM, RETRY_S, VIDEO
from urbihw_nao.pictures import FORMATS, JPEG, RESOLUTIONS, YUV, CameraMode, NaoPicture, has_pillow, no_pillow

LEAST_RATE, MOST_RATE = 0.1, 30.0
"""Pictures per second."""
CAMERAS: Final = 2


class NaoCamera(Streamed):
    """The cameras: ``val`` is the newest picture while ``load`` is 1 and somebody reads or follows it.

    ``index`` chooses the camera: 0 on top, 1 at the bottom; ``formatDetail`` the format: 1 rgb, 2 ycbcr, 3 jpeg, 4 ppm,
    5 yuv422, 6 grey8, 7 grey4; ``format`` only jpeg (1) or yuv (0); ``resolution`` 0 to 3: 640 x 480, 320 x 240,
    160 x 120, 80 x 60; ``rate`` pictures per second; ``quality`` of JPEG, 0 to 100.  ``width`` and ``height`` (pixels)
    are those of the pictures, ``xfov`` and ``yfov`` the angles of view (rad), ``frames`` counts pictures.  ``threaded``
    changes nothing: pictures always come by the worker, a process of its own.
    """

    slot_words = words.CAMERA

    nothing = UImage.of(b"", 0, 0, "jpeg")
    load = owned(0.0)
    index = owned(0.0)
    format = owned(1.0)
    formatDetail = owned(float(JPEG))
    quality = owned(75.0)
    rate = owned(4.0)
    resolution = owned(1.0)
    threaded = owned(1.0)
    width = reading(320.0)
    height = reading(240.0)
    xfov = reading(math.nan)
    yfov = reading(math.nan)
    frames = reading(0.0)

    def init(self, channel: DeviceChannel, log: DeviceLog, is_linked: Callable[[], bool]) -> None:
        """Speak to the worker through ``channel``; failures go to ``log``."""
        super().init(channel)
        self._log, self._is_linked = log, is_linked
        self._has_video = False
        self._film_at = math.inf
        set_range(self.load, 0.0, 1.0)
        set_range(self.quality, 0.0, 100.0)
        set_range(self.rate, LEAST_RATE, MOST_RATE)
        self.notify_change(self.load, self._write_load)
        self.notify_change(self.format, self._write_format)
        self.notify_change(self.formatDetail, lambda: self._choose_format(choice(self.formatDetail, FORMATS)))
        self.notify_change(self.resolution, self._write_resolution)
        self.notify_change(self.index, lambda: self._accept(self.index, choice(self.index, range(CAMERAS))))
        self.notify_change(self.threaded, lambda: self._accept(self.threaded, choice(self.threaded, range(2))))
        self.notify_change(self.quality, lambda: self._accept(self.quality, number(self.quality)))
        self.notify_change(self.rate, lambda: self._accept(self.rate, number(self.rate)))

    # ---------------------------------------------------------------- what is written

    def _write_load(self) -> None:
        on = number(self.load) > 0
        if on and not self._has_video:
            raise ValueError(f"this robot has no {VIDEO}: there are no pictures")
        if on:
            _check_format(int(self.formatDetail.sensed))
        self.load.sense(float(on))
        self.update_stream()

    def _write_format(self) -> None:
        self._choose_format(JPEG if choice(self.format, range(2)) else YUV)

    def _choose_format(self, detail: int) -> None:
        _check_format(detail)
        self.format.sense(float(detail == JPEG))
        self._accept(self.formatDetail, detail)

    def _write_resolution(self) -> None:
        resolution = choice(self.resolution, RESOLUTIONS)
        _, width, height = RESOLUTIONS[resolution]
        self.width.sense(float(width))
        self.height.sense(float(height))
        self._accept(self.resolution, resolution)

    def _accept(self, var: UVar, value: float) -> None:
        before = self._mode()
        var.sense(float(value))
        if self.on.sensed:
            if not self._mode().shows_same(before):
                # What was seen before is no picture of this kind.
                self.val.sense(self.nothing)
            self._film()

    # ---------------------------------------------------------------- the stream

    def may_stream(self) -> bool:
        return self.load.sensed > 0 and self._has_video

    def switch_stream(self, on: bool) -> None:
        self._film()

    def update_stream(self) -> None:
        """See ``Streamed``; also try again what has failed."""
        super().update_stream()
        if self.on.sensed and self.host.now() >= self._film_at:
            self._film()

    def connect(self, services: Container[str]) -> None:
        """The robot was found, by this worker or by another one: tell it what is wanted."""
        self._has_video = VIDEO in services
        self.update_stream()
        if self.on.sensed:
            self._film()

    def _film(self) -> None:
        self._film_at = math.inf
        self.channel.send_request(FILM, CAMERA, self._answered, value=self._mode() if self.on.sensed else None)

    def _mode(self) -> CameraMode:
        numbers = (self.index, self.resolution, self.formatDetail, self.quality)
        index, resolution, detail, quality = (int(var.sensed) for var in numbers)
        return CameraMode(index, resolution, detail, quality, self.rate.sensed)

    def _answered(self, reply: Reply) -> None:
        # Without a link it is asked for when the link is back.
        if not reply.ok and self._is_linked():
            self.lost(reply.error)

    def lost(self, reason: str) -> None:
        """There are no pictures at present."""
        self._log.warning("camera: %s; trying again", reason)
        self._film_at = self.host.now() + RETRY_S

    def show(self, picture: NaoPicture, stamp: float) -> None:
        """Show a picture that came at a time of the kernel's clock."""
        if not self.on.sensed or not picture.mode.shows_same(self._mode()):
            return
        for var, value in (
            (self.width, picture.width), (self.height, picture.height), (self.xfov, picture.xfov),
            (self.yfov, picture.yfov), (self.frames, self.frames.sensed + 1),
        ):  # fmt: skip
            var.sense(float(value))
        self.val.sense(UImage.of(picture.data, picture.width, picture.height, picture.keyword), stamp)


def choice(var: UVar, choices: Collection[int]) -> int:
    """The value of a variable that takes some whole numbers.  Raises ValueError for another one."""
    value = number(var)
    if value not in choices:
        raise ValueError(f"this slot takes one of {', '.join(map(str, choices))}")
    return int(value)


def _check_format(detail: int) -> None:
    if detail == JPEG and not has_pillow():
        raise ValueError(no_pillow())
