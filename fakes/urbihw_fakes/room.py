"""A room as a camera sees it: four walls of their own colours, a floor and a ceiling.

The wall ahead (+x) is red, the left one (+y) green, the one behind (-x) blue, the right one (-y) yellow; the middle of
the room is (0, 0).  A picture is first a plane of one byte a pixel, the number of a surface; what these look like in
some colour space is a palette.  A camera that is tilted by an angle a sees the picture of a level one, moved up by
``focal * tan(a)``: verticals stay vertical.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

CEILING, FLOOR, RED, GREEN, BLUE, YELLOW = range(6)
RGB = ((235, 235, 235), (90, 90, 90), (200, 30, 30), (30, 160, 30), (30, 30, 200), (210, 200, 30))
"""The palette: the colours of the surfaces, by number."""
NEAREST = 0.05
"""m: a camera comes no closer to a wall, nor behind it."""


class View(NamedTuple):
    """Where a camera is, and where it looks: m, rad (``heading`` to the left, ``pitch`` down), pixels."""

    x: float
    y: float
    z: float
    heading: float
    pitch: float
    focal: float


class Room:
    """A room; m from its middle to the walls in x and in y, and the height of the walls."""

    def __init__(self, half_length: float, half_width: float, height: float) -> None:
        self._height = height
        self._walls = (
            (1.0, 0.0, half_length, RED), (0.0, 1.0, half_width, GREEN),
            (-1.0, 0.0, half_length, BLUE), (0.0, -1.0, half_width, YELLOW),
        )  # fmt: skip

    def render(self, view: View, width: int, height: int) -> bytes:
        """The plane of surfaces that is seen, row by row."""
        plane = bytearray(width * height)
        horizon = height / 2 - view.focal * math.tan(view.pitch)
        cos, sin = math.cos(view.heading), math.sin(view.heading)
        for column in range(width):
            aside = (width / 2 - 0.5 - column) / view.focal
            depth, wall = self._find_wall(view.x, view.y, cos - aside * sin, sin + aside * cos)
            top = horizon - view.focal * (self._height - view.z) / depth
            bottom = horizon + view.focal * view.z / depth
            first = min(max(round(top), 0), height)
            last = min(max(round(bottom), first), height)
            plane[column::width] = (
                bytes([CEILING]) * first + bytes([wall]) * (last - first) + bytes([FLOOR]) * (height - last)
            )
        return bytes(plane)

    def _find_wall(self, x: float, y: float, along_x: float, along_y: float) -> tuple[float, int]:
        """How deep the nearest wall along a ray lies, and which it is."""
        found = []
        for nx, ny, far, wall in self._walls:
            towards = nx * along_x + ny * along_y
            if towards > 1e-9:
                found.append((max((far - nx * x - ny * y) / towards, NEAREST), wall))
        return min(found)


def paint(plane: bytes, colours: Sequence[Sequence[int]]) -> bytes:
    """The pixels of a plane: all components of one pixel beside each other."""
    count = len(colours[0])
    pixels = bytearray(len(plane) * count)
    for component in range(count):
        pixels[component::count] = plane.translate(_table(colours, component))
    return bytes(pixels)


def paint_yuyv(plane: bytes, colours: Sequence[Sequence[int]]) -> bytes:
    """The same of YUV colours, with one U and one V for two pixels: Y U Y V."""
    pixels = bytearray(len(plane) * 2)
    pixels[0::2] = plane.translate(_table(colours, 0))
    pixels[1::4] = plane[0::2].translate(_table(colours, 1))
    pixels[3::4] = plane[0::2].translate(_table(colours, 2))
    return bytes(pixels)


def _table(colours: Sequence[Sequence[int]], component: int) -> bytes:
    return bytes(colour[component] for colour in colours).ljust(256, b"\0")


def yuv_of(rgb: Sequence[int]) -> tuple[int, int, int]:
    """A colour as JPEG files have it (ITU-R BT.601, 0 to 255)."""
    r, g, b = rgb
    y = 0.299 * r + 0.587 * g + 0.114 * b
    return round(y), round(128 + 0.564 * (b - y)), round(128 + 0.713 * (r - y))
