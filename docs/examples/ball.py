"""A ball detector, which looks at the images of any camera: the Urbi manual, chapter 4.5, in Python.

In urbiscript, once the class is registered (``loadModule("ball");``)::

    var ball = BallTracker.new(camera.getSlot("val"))|;
    at (ball.visible) echo("there it is: %s, %s" % [ball.x, ball.y]);
"""

from __future__ import annotations

from PIL import Image, ImageChops

from urbihw.kernel.uobject import UImage, UObject, UVar, reading

LEAST = 12
"""Pixels that a ball has at least."""


def find_ball(image: UImage) -> tuple[float, float] | None:
    """The middle of what is red, each coordinate from 0 (left, top) to 1; None if there is little of it."""
    picture = Image.frombytes("RGB", (image.width, image.height), bytes(image.data))
    red, green, blue = picture.split()
    redness = ImageChops.subtract(red, ImageChops.lighter(green, blue)).point(lambda value: 255 * (value > 80))
    box = redness.getbbox()
    if box is None or redness.histogram()[255] < LEAST:
        return None
    left, top, right, bottom = box
    return (left + right) / 2 / image.width, (top + bottom) / 2 / image.height


class BallTracker(UObject):
    """Follows a red ball."""

    visible = reading(0.0)
    x = reading(0.0)
    y = reading(0.0)

    def init(self, camera: UVar) -> None:
        """Called by ``new`` with the variable that holds the images."""
        self.notify_change(camera, self.new_image)

    def new_image(self, image: UImage) -> None:
        """There is one more image."""
        found = find_ball(image)
        if found is not None:
            self.x.sense(found[0])
            self.y.sense(found[1])
        self.visible.sense(float(found is not None))
