"""What the camera sees: the robot's `room`, as a JPEG of 320 by 240.

The camera is 0.15 m above the floor, the walls are 0.5 m high, it looks straight ahead, and its focal length is 277
pixels (60 degrees from side to side).  Needs Pillow; without it there are no pictures.
"""

from __future__ import annotations

import io

from urbihw_fakes import room
from urbihw_fakes.spykee.body import HALF_LENGTH, HALF_WIDTH

WIDTH, HEIGHT = 320, 240
FOCAL = 277.0
CAMERA_HEIGHT, WALL_HEIGHT = 0.15, 0.5
QUALITY = 60
ROOM = room.Room(HALF_LENGTH, HALF_WIDTH, WALL_HEIGHT)
DARK = [[value // 4 for value in colour] for colour in room.RGB]
"""The colours without light."""


def has_pictures() -> bool:
    """Whether there is a library that makes them."""
    try:
        import PIL.Image  # noqa: F401
    except ImportError:
        return False
    return True


def picture(x: float, y: float, heading: float, dark: bool = False) -> bytes:
    """The JPEG that is seen from a place; `dark` is a room without light."""
    from PIL import Image

    plane = ROOM.render(room.View(x, y, CAMERA_HEIGHT, heading, 0.0, FOCAL), WIDTH, HEIGHT)
    image = Image.frombytes("RGB", (WIDTH, HEIGHT), room.paint(plane, DARK if dark else room.RGB))
    out = io.BytesIO()
    image.save(out, "JPEG", quality=QUALITY)
    return out.getvalue()
