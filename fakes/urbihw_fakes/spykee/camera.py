"""What the camera sees: four walls of their own colours, a floor and a ceiling, as a JPEG of 320 by 240.

The wall ahead (+x) is red, the left one (+y) green, the one behind (-x) blue, the right one (-y) yellow.  The camera is
0.15 m above the floor, the walls are 0.5 m high, it looks straight ahead, and its focal length is 277 pixels (60
degrees from side to side).  Needs Pillow; without it there are no pictures.
"""

from __future__ import annotations

import io
import math
from typing import Any

from urbihw_fakes.spykee.body import HALF_LENGTH, HALF_WIDTH

WIDTH, HEIGHT = 320, 240
FOCAL = 277.0
CAMERA_HEIGHT, WALL_HEIGHT = 0.15, 0.5
QUALITY = 60
RED, GREEN, BLUE, YELLOW = (200, 30, 30), (30, 160, 30), (30, 30, 200), (210, 200, 30)
FLOOR, CEILING = (90, 90, 90), (235, 235, 235)

_WALLS = (
    ((1.0, 0.0), HALF_LENGTH, RED), ((0.0, 1.0), HALF_WIDTH, GREEN),
    ((-1.0, 0.0), HALF_LENGTH, BLUE), ((0.0, -1.0), HALF_WIDTH, YELLOW),
)  # fmt: skip


def has_pictures() -> bool:
    """Whether there is a library that makes them."""
    try:
        import PIL.Image  # noqa: F401
    except ImportError:
        return False
    return True


def picture(x: float, y: float, heading: float, dark: bool = False) -> bytes:
    """The JPEG that is seen from a place; `dark` is a room without light."""
    from PIL import Image, ImageDraw

    image = Image.new("RGB", (WIDTH, HEIGHT), CEILING)
    draw: Any = ImageDraw.Draw(image)
    draw.rectangle((0, HEIGHT // 2, WIDTH, HEIGHT), fill=FLOOR)
    ahead, left = (math.cos(heading), math.sin(heading)), (-math.sin(heading), math.cos(heading))
    for column in range(WIDTH):
        aside = (WIDTH / 2 - 0.5 - column) / FOCAL
        ray = (ahead[0] + aside * left[0], ahead[1] + aside * left[1])
        depth, colour = min(_hits(x, y, ray))
        top = HEIGHT / 2 - FOCAL * (WALL_HEIGHT - CAMERA_HEIGHT) / depth
        bottom = HEIGHT / 2 + FOCAL * CAMERA_HEIGHT / depth
        draw.line((column, round(top), column, round(bottom)), fill=colour)
    if dark:
        image = image.point([value // 4 for value in range(256)] * 3)
    out = io.BytesIO()
    image.save(out, "JPEG", quality=QUALITY)
    return out.getvalue()


def _hits(x: float, y: float, ray: tuple[float, float]) -> list[tuple[float, tuple[int, int, int]]]:
    """How deep each wall lies along a ray that faces it."""
    found = []
    for (nx, ny), far, colour in _WALLS:
        towards = nx * ray[0] + ny * ray[1]
        if towards > 1e-9:
            found.append(((far - nx * x - ny * y) / towards, colour))
    return found
