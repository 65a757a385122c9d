"""Camera, receiver, speaker and display of a simulated robot."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Final

from urbihw.kernel.uobject import UImage, UObject, event, function, reading
from urbihw.platforms.webots import simulator as s
from urbihw.platforms.webots import words
from urbihw.platforms.webots.sensors import SimSensor
from urbihw.platforms.webots.surface import surface_of

CAMERA_PERIOD_S: Final = 0.1
"""Seconds between two pictures; rendering one takes as long as some steps of the physics."""


class Camera(SimSensor):
    """``Camera.new(name)``: pictures of 24 bits (rgb), while ``load`` is 1; only one object for a camera."""

    slot_words = words.CAMERA
    kind = s.CAMERA
    period = CAMERA_PERIOD_S
    val = reading()
    width = reading(math.nan)
    height = reading(math.nan)
    xfov = reading(math.nan)
    yfov = reading(math.nan)
    near = reading(math.nan)
    far = reading(math.nan)
    format = reading("rgb")

    def init(self, name: str) -> None:
        surface = surface_of(self)
        if surface.is_taken(name):
            raise ValueError(f"camera {name!r} has an object already; there can be only one")
        self.watchers: list[Callable[[bytes, int, int, float], None]] = []
        super().init(name)
        width, height = self.fact("width"), self.fact("height")
        yfov, xfov = self.fact("yfov"), self.fact("xfov")
        if math.isnan(xfov):
            xfov = 2 * math.atan(math.tan(yfov / 2) * width / height)
        elif math.isnan(yfov):
            yfov = 2 * math.atan(math.tan(xfov / 2) * height / width)
        for var, value in ((self.width, width), (self.height, height), (self.xfov, xfov), (self.yfov, yfov)):
            var.sense(value)
        self.near.sense(self.fact("near"))
        self.far.sense(self.fact("far", surface.options.camera_far))
        self.val.sense(UImage.of(b"", 0, 0))

    def sensed(self, value: bytes, stamp: float) -> None:
        width, height = int(self.fact("width")), int(self.fact("height"))
        self.val.sense(UImage.of(value, width, height), stamp)
        for watcher in self.watchers:
            watcher(value, width, height, stamp)


class Receiver(SimSensor):
    """``Receiver.new(name)``: ``received`` is emitted with each packet, ``val`` is the last one."""

    slot_words = words.RECEIVER
    kind = s.RECEIVER
    val = reading("")
    channel = reading(math.nan)
    received = event()

    def init(self, name: str) -> None:
        super().init(name)
        self.channel.sense(self.fact("channel"))

    def sensed(self, value: Sequence[bytes], stamp: float) -> None:
        for packet in value:
            text = packet.decode("latin-1")
            self.val.sense(text, stamp)
            self.received.emit(text)


class Speaker(UObject):
    """``Speaker.new(name)``: ``say(text)``, and ``play(file)``, a file that the simulator can read."""

    slot_words = words.SPEAKER
    spoken = reading("")
    node = reading("")

    def init(self, name: str) -> None:
        self._surface = surface_of(self)
        self._surface.world.device(name, s.SPEAKER)
        self.node.sense(name)

    @function
    def say(self, text: str) -> None:
        """Speak a text in the simulation."""
        self.spoken.sense(text)
        self._surface.write(str(self.node.sensed), "speech", text)

    @function
    def play(self, file: str) -> None:
        """Play a sound file."""
        self._surface.write(str(self.node.sensed), "sound", file)


class Display(UObject):
    """``Display.new(name)``: texts and rectangles; colours are 0xRRGGBB, places pixels from the top left."""

    slot_words = words.DISPLAY
    width = reading(math.nan)
    height = reading(math.nan)
    node = reading("")

    def init(self, name: str) -> None:
        self._surface = surface_of(self)
        device = self._surface.world.device(name, s.DISPLAY)
        self.node.sense(name)
        self.width.sense(float(device.facts.get("width", math.nan)))
        self.height.sense(float(device.facts.get("height", math.nan)))

    def _draw(self, item: str, *values: Any) -> None:
        self._surface.write(str(self.node.sensed), item, values)

    @function
    def text(self, text: str, x: int, y: int, colour: int = 0xFFFFFF) -> None:
        """Draw a text on the display."""
        self._draw("text", text, x, y, colour)

    @function
    def rectangle(self, x: int, y: int, width: int, height: int, colour: int = 0) -> None:
        """Fill a rectangle of the display."""
        self._draw("rectangle", x, y, width, height, colour)
