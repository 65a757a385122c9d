"""A blob of one colour in the pictures of a camera: ``Interface.BlobDetector`` for a simulated world, whose colours are
even.  No library is needed for pictures as small as those of a simulated robot."""

from __future__ import annotations

import math
from typing import Any, Final

from urbihw.kernel.uobject import UObject, number, owned, reading
from urbihw.platforms.webots import words
from urbihw.platforms.webots.media import Camera

MAX_PIXELS: Final = 4000
"""Pixels of a picture that are looked at, in a regular grid."""
LEAST_RATIO: Final = 0.0005
"""Share of a picture from which on a blob is visible."""
DARK: Final = 40
"""Sum of red, green and blue (0 to 765) below which a pixel has no colour."""


def find_blob(
    data: bytes, width: int, height: int, colour: tuple[float, float, float], threshold: float
) -> tuple[float, float, float]:
    """Return the middle of the pixels of a colour, and their share; nan for the middle if there are none.

    ``data`` is rgb.  A colour is recognised by the shares of red, green and blue, so that shadows do not matter;
    ``threshold`` is how much each share may differ.
    """
    total = sum(colour)
    red, green, _ = (each / total for each in colour)
    stride = max(1, math.isqrt(width * height // MAX_PIXELS))
    count = seen = sum_x = sum_y = 0
    for y in range(0, height, stride):
        row = y * width * 3
        for x in range(0, width, stride):
            place = row + x * 3
            r, g, b = data[place], data[place + 1], data[place + 2]
            seen += 1
            light = r + g + b
            if light > DARK and abs(r / light - red) < threshold and abs(g / light - green) < threshold:
                count += 1
                sum_x += x
                sum_y += y
    if not count:
        return math.nan, math.nan, 0.0
    return sum_x / count, sum_y / count, count / seen


class BlobDetector(UObject):
    """``BlobDetector.new(camera, red, green, blue)``: the middle of what has this colour (0 to 1) in its pictures."""

    slot_words = words.BLOB
    x = reading(math.nan)
    y = reading(math.nan)
    ratio = reading(0.0)
    visible = reading(False)
    threshold = owned(0.1)

    def init(self, camera: Camera, red: float, green: float, blue: float) -> None:
        if not red + green + blue > 0:
            raise ValueError("black is no colour to look for")
        self._colour = red, green, blue
        self.notify_change(self.threshold, self._write_threshold)
        camera.watchers.append(self.look)

    def _write_threshold(self) -> None:
        value = number(self.threshold)
        if not 0 < value <= 1:
            raise ValueError("threshold is greater than 0, and 1 at most")
        self.threshold.sense(value)

    def look(self, data: bytes, width: int, height: int, stamp: Any) -> None:
        """Look at a picture."""
        x, y, ratio = find_blob(data, width, height, self._colour, float(self.threshold.sensed))
        self.x.sense(x, stamp)
        self.y.sense(y, stamp)
        self.ratio.sense(ratio, stamp)
        self.visible.sense(ratio >= LEAST_RATIO, stamp)
