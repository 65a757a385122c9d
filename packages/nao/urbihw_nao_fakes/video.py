"""ALVideoDevice: the two cameras in the head, and who has subscribed to them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from urbihw_fakes import room
from urbihw_nao_fakes.body import Body
from urbihw_nao_fakes.services import Failed, Later, Service, method

SIZES = {0: (160, 120), 1: (320, 240), 2: (640, 480), 3: (1280, 960), 7: (80, 60), 8: (40, 30)}
"""Number of a resolution -> pixels."""
Y_ONLY, YUV422, YUV, RGB, BGR = 0, 9, 10, 11, 13
LAYERS = {Y_ONLY: 1, YUV422: 2, YUV: 3, RGB: 3, BGR: 3}
"""Number of a colour space -> bytes of a pixel."""
MOST_OF_A_NAME = 6
MOST_FPS = 30
TILTS = (0.0209, 0.6929)
"""rad by which the cameras look down from the head's own direction: the top one, the bottom one."""
HALF_ANGLE = 1.0641 / 2
"""rad from the middle of a picture to its side."""
HEIGHTS = {"standing": 0.51, "crouching": 0.33, "fallen": 0.1}
"""m of the cameras above the floor."""
ROOM = room.Room(3.0, 2.5, 1.2)
PICTURE = "(iiiiiiriffff)"
"""Width, height, layers, colour space, seconds, microseconds, pixels, camera, angles: left, top, right, bottom."""
PARAMETERS = {0: 55, 1: 32, 2: 128, 6: 32, 11: 1, 12: 1, 17: 10, 18: 0}
"""Number of a setting of a camera -> its value at first."""
NO_PICTURE = (0, 0, 0, 0, 0, 0, b"", 0, 0.0, 0.0, 0.0, 0.0)

_YUV = [room.yuv_of(colour) for colour in room.RGB]
_PAINTERS: Mapping[int, Callable[[bytes], bytes]] = {
    Y_ONLY: lambda plane: room.paint(plane, [colour[:1] for colour in _YUV]),
    YUV422: lambda plane: room.paint_yuyv(plane, _YUV),
    YUV: lambda plane: room.paint(plane, _YUV),
    RGB: lambda plane: room.paint(plane, room.RGB),
    BGR: lambda plane: room.paint(plane, [colour[::-1] for colour in room.RGB]),
}


@dataclass
class Subscriber:
    """Who gets pictures, and of which kind; ``next_at`` is when the next one is ready."""

    camera: int
    resolution: int
    space: int
    fps: int
    next_at: float = -math.inf


class Video(Service):
    """ALVideoDevice; ``clock`` gives seconds.

    A handle is the name of its subscriber, then with ``_1`` to ``_5``; it outlives the connection.

    Attributes:
        subscribers: by handle.
        sent: how many pictures were sent.
    """

    name = "ALVideoDevice"

    def __init__(self, body: Body, clock: Callable[[], float]) -> None:
        super().__init__()
        self.body, self._clock = body, clock
        self.subscribers: dict[str, Subscriber] = {}
        self.sent = 0
        self._parameters = [dict(PARAMETERS) for _ in TILTS]
        self._seen: tuple[Any, bytes] = None, b""

    @method("subscribeCamera", "(siiii)", "s")
    def subscribe(self, name: str, camera: int, resolution: int, space: int, fps: int) -> str:
        """A handle for pictures of a camera, "" for what there is not."""
        known = camera < len(TILTS) and resolution in SIZES and space in LAYERS and 1 <= fps <= MOST_FPS
        handles = (name, *(f"{name}_{index}" for index in range(1, MOST_OF_A_NAME)))
        free = [handle for handle in handles if handle not in self.subscribers]
        if not known or camera < 0 or not free:
            return ""
        self.subscribers[free[0]] = Subscriber(camera, resolution, space, fps)
        return free[0]

    @method("subscribe", "(siii)", "s")
    def subscribe_top(self, name: str, resolution: int, space: int, fps: int) -> str:
        """Subscribe the top camera, in the older form."""
        return self.subscribe(name, 0, resolution, space, fps)

    @method("unsubscribe", "(s)", "b")
    def unsubscribe(self, handle: str) -> bool:
        """Give a handle back."""
        return self.subscribers.pop(handle, None) is not None

    @method("unsubscribeAllInstances", "(s)")
    def unsubscribe_all(self, name: str) -> None:
        """Give back all handles of a name."""
        for handle in list(self.subscribers):
            if handle == name or handle.startswith(f"{name}_"):
                del self.subscribers[handle]

    @method("getImageRemote", "(s)", PICTURE)
    def get_image(self, handle: str) -> Any:
        """The next picture, as soon as it is ready: no more of them come than were subscribed to."""
        subscriber = self.subscribers.get(handle)
        if subscriber is None:
            return NO_PICTURE
        picture: list[Any] = []

        def is_ready() -> bool:
            now = self._clock()
            if now < subscriber.next_at - 1e-9:
                return False
            subscriber.next_at = max(now, subscriber.next_at + 1 / subscriber.fps)
            picture[:] = self._take_picture(subscriber)
            return True

        return Later(is_ready, picture)

    @method("releaseImage", "(s)", "b")
    def release_image(self, handle: str) -> bool:
        """Unlock a picture that was got without a copy; these here are copies."""
        return handle in self.subscribers

    @method("setParameter", "(iii)", "b")
    def set_parameter(self, camera: int, parameter: int, value: int) -> bool:
        """Write a setting of a camera; pictures do not show it."""
        if camera not in range(len(TILTS)) or parameter not in PARAMETERS:
            return False
        self._parameters[camera][parameter] = value
        return True

    @method("getParameter", "(ii)", "i")
    def get_parameter(self, camera: int, parameter: int) -> int:
        """Read a setting of a camera.  Raises Failed."""
        if camera not in range(len(TILTS)) or parameter not in PARAMETERS:
            raise Failed(f"ALVideoDevice: camera {camera} has no parameter {parameter}")
        return self._parameters[camera][parameter]

    def view(self, camera: int, width: int) -> room.View:
        """Where a camera is and looks, for pictures of this width."""
        body = self.body
        stance = "fallen" if body.fallen else "standing" if body.standing else "crouching"
        yaw, pitch = body.joints["HeadYaw"].angle, body.joints["HeadPitch"].angle
        focal = width / 2 / math.tan(HALF_ANGLE)
        return room.View(body.x, body.y, HEIGHTS[stance], body.heading + yaw, pitch + TILTS[camera], focal)

    def _take_picture(self, subscriber: Subscriber) -> tuple[Any, ...]:
        width, height = SIZES[subscriber.resolution]
        view = self.view(subscriber.camera, width)
        if self._seen[0] != (view, height):
            self._seen = (view, height), ROOM.render(view, width, height)
        self.sent += 1
        second, part = divmod(self._clock(), 1.0)
        upright = math.atan(math.tan(HALF_ANGLE) * height / width)
        return (
            width, height, LAYERS[subscriber.space], subscriber.space, int(second), int(part * 1e6),
            _PAINTERS[subscriber.space](self._seen[1]), subscriber.camera,
            HALF_ANGLE, -upright, -HALF_ANGLE, upright,
        )  # fmt: skip
