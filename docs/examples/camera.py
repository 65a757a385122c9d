"""A camera: the example of the Urbi manual, chapter 4.3, in Python.

In urbiscript, once the class is registered (``loadModule("camera");``)::

    var camera = Camera.new(0)|;
    camera.width;
    camera.val;                     // BIN 921600 rgb 640 480, and the pixels
"""

from __future__ import annotations

from typing import ClassVar, Protocol

from urbihw.kernel.uobject import UImage, UObject, reading


class Hardware(Protocol):
    """What a maker of cameras gives you: pixels are three bytes, red, green and blue, line by line."""

    def initialize(self, id: int) -> bool: ...
    def get_width(self, id: int) -> int: ...
    def get_height(self, id: int) -> int: ...
    def get_image(self, id: int) -> bytes: ...


class Camera(UObject):
    """Derive and set ``hardware``; every ``Camera.new(id)`` is then one camera."""

    hardware: ClassVar[Hardware]
    period: ClassVar[float] = 0.04
    """Seconds between two images."""

    val = reading()
    width = reading(0)
    height = reading(0)

    def init(self, id: int) -> None:
        """Called by ``new``."""
        self.camera = id
        self.frame = 1
        self.accessed = 0
        if not self.hardware.initialize(id):
            raise ValueError(f"there is no camera {id}")
        self.width.sense(self.hardware.get_width(id))
        self.height.sense(self.hardware.get_height(id))
        self.notify_access(self.val, self.get_val)
        self.set_update(self.period)

    def update(self) -> None:
        """There is a new image."""
        self.frame += 1

    def get_val(self) -> None:
        """``val`` is about to be read: get the image, unless that was done already."""
        if self.accessed != self.frame:
            self.accessed = self.frame
            pixels = self.hardware.get_image(self.camera)
            self.val.sense(UImage.of(pixels, int(self.width.sensed), int(self.height.sensed)))
