"""The camera of LeRobot: one that a daemon serves, for any robot of LeRobot."""

from __future__ import annotations

import threading
import time
from typing import Any, Final

import numpy
from lerobot.cameras.camera import Camera

import urbihw
from lerobot_robot_urbihw.configs import UrbihwCameraConfig
from urbihw.client.errors import ClientError
from urbihw.client.robot import Robot as DaemonRobot

TIMEOUT_S: Final = 10.0
DEFAULT_RATE_HZ: Final = 30


class UrbihwCamera(Camera):
    """A slot with pictures, on a connection of its own, so that a large picture delays no action."""

    def __init__(self, config: UrbihwCameraConfig) -> None:
        super().__init__(config)
        self.config = config
        self._daemon: DaemonRobot | None = None
        self._changed = threading.Condition()
        self._newest: Any = None
        self._at = 0.0
        self._taken = True
        self._why = ""
        self._thread: threading.Thread | None = None

    @staticmethod
    def find_cameras() -> list[dict[str, Any]]:
        """Those of the daemon of this machine, empty if there is none."""
        try:
            with urbihw.connect(timeout=2) as robot:
                rows = robot.overview()["sensors"]
        except ClientError:
            return []
        return [{"name": row["slot"], "type": "urbihw_camera", "id": row["slot"]}
                for row in rows if row["role"] == "camera"]  # fmt: skip

    @property
    def is_connected(self) -> bool:
        """Whether pictures can come."""
        return self._daemon is not None and self._daemon.connected

    def connect(self, warmup: bool = True) -> None:
        """Connect, and wait for the first picture.  Raises ClientError, ValueError for one of another size."""
        self.disconnect()
        self._why = ""
        self._daemon = urbihw.connect(self.config.address, timeout=TIMEOUT_S, reconnect=False)
        try:
            pictures = self._daemon.pictures(self.config.slot, hz=self.fps or DEFAULT_RATE_HZ, timeout=TIMEOUT_S)
            first = next(shot for shot in pictures if shot.value.data)  # a camera has none at first
            self._store(first.value)
            height, width, _ = self._newest.shape
            if (height, width) != (self.config.height or height, self.config.width or width):
                raise ValueError(f"{self.config.slot} has pictures of {width} x {height}")
        except BaseException:
            self.disconnect()
            raise
        self.height, self.width = height, width
        self._thread = threading.Thread(target=self._follow, args=(pictures,), daemon=True)
        self._thread.start()

    def _follow(self, pictures: Any) -> None:
        try:
            for shot in pictures:
                self._store(shot.value)
        except Exception as error:
            self._why = str(error) or type(error).__name__
        with self._changed:
            self._changed.notify_all()

    def _store(self, picture: Any) -> None:
        array = picture.array
        colours = array if array.ndim == 3 else numpy.repeat(array[:, :, None], 3, axis=2)
        with self._changed:
            self._newest, self._at, self._taken = colours, time.perf_counter(), False
            self._changed.notify_all()

    def read(self) -> Any:
        """The next new picture."""
        return self.async_read(TIMEOUT_S * 1000)

    def async_read(self, timeout_ms: float = 200) -> Any:
        """A picture that was not read before.  Raises TimeoutError, ConnectionError."""
        with self._changed:
            came = self._changed.wait_for(
                lambda: not self._taken or self._why or self._daemon is None, timeout_ms / 1000
            )
            if self._why or self._daemon is None:
                raise ConnectionError(self._why or "not connected")
            if not came:
                raise TimeoutError(f"{self.config.slot}: no new picture within {timeout_ms:g} ms")
            self._taken = True
            return self._newest

    def read_latest(self, max_age_ms: float = 500) -> Any:
        """The newest picture, also one that was read before.  Raises TimeoutError for an older one."""
        if self._daemon is None or self._newest is None:
            raise ConnectionError("not connected")
        age = 1000 * (time.perf_counter() - self._at)
        if age > max_age_ms:
            raise TimeoutError(f"{self.config.slot}: the newest picture is {age:.0f} ms old")
        return self._newest

    def disconnect(self) -> None:
        """End the connection to the daemon; a second call does nothing."""
        robot, self._daemon = self._daemon, None
        if robot is not None:
            robot.close()
        if self._thread is not None:
            self._thread.join(5)
            self._thread = None
        with self._changed:
            self._changed.notify_all()
