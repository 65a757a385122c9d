"""The object ``worldView``: a simulated world, seen from outside.  It is there where a world is simulated in MuJoCo."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, Protocol

from urbihw.files import write_regular
from urbihw.kernel.uobject import UBinary, UImage, function, number, owned, reading
from urbihw.platforms.scene.drawing import HEIGHT, WIDTH, SceneDrawing
from urbihw.platforms.scene.painting import ViewPoint
from urbihw.platforms.scene.recording import SceneRecording
from urbihw.platforms.streamed import OnDemand

log = logging.getLogger("urbihw.world")

PERIOD_S: Final = 0.04
"""Seconds between two states."""
DEFAULT: Final = ViewPoint()
TREE: Final = """
WorldView.addProto(Interface.VideoIn)|;
if (Global.hasLocalSlot("robot") && !robot.hasLocalSlot("experimentalWorldView"))
{
  robot.addDevice("experimentalWorldView", worldView);
  robot.makeCompactNames
}|;
"""
"""Puts it into the tree, where the panel finds it."""


class SceneSource(Protocol):
    """The simulator of the scene."""

    def begin(self, period: float, show: Callable[[bytes, float], None]) -> None:
        """Call ``show(state, time)`` in the kernel's thread every ``period`` seconds (of the simulation)."""

    def end(self) -> None:
        """Show no more; a second call does nothing."""

    def model(self) -> Path:
        """Return the file of the model.  Raises ValueError when there is none."""


class WorldView(OnDemand):
    """``val`` is the newest picture, a JPEG; it is drawn while somebody reads or follows it.  Looking moves nothing.

    ``state`` is what the picture was drawn from (``urbihw.platforms.scene.state``), for ``urbihw view``.
    """

    nothing = UImage.of(b"", 0, 0, "jpeg")
    slot_words = {
        "on": ("whether pictures are drawn now", ""), "frames": ("number of pictures drawn", "1"),
        "width": ("of the picture", "pixel"), "height": ("of the picture", "pixel"), "format": ("of the picture", ""),
        "xfov": ("width of the field of view", "rad"), "yfov": ("height of the field of view", "rad"),
        "azimuth": ("direction of the look, to the left of the x axis of the world", "rad"),
        "elevation": ("how far the look goes upwards; below zero: from above", "rad"),
        "distance": ("from the eye to what is looked at; 0: so that all of it is seen", "m"),
        "target": ("name of the body that stays in the middle; \"\" for the robot, or else the world", ""),
        "state": ("all that can change in a picture, for urbihw view", ""),
        "file": ("path of the model, on the machine of the server", ""),
    }  # fmt: skip

    width = reading(float(WIDTH))
    height = reading(float(HEIGHT))
    xfov = reading(2 * math.atan(math.tan(math.pi / 8) * WIDTH / HEIGHT))
    yfov = reading(math.pi / 4)
    format = reading("jpeg")
    frames = reading(0.0)
    azimuth = owned(DEFAULT.azimuth)
    elevation = owned(DEFAULT.elevation)
    distance = owned(DEFAULT.distance)
    target = owned(DEFAULT.target)
    state = reading()
    file = reading("")

    def init(self, source: Any = None) -> None:
        """Called by the server; programs cannot make another one."""
        if source is None:
            raise ValueError("there is one view of the world, worldView: it belongs to the simulation")
        self._source: SceneSource = source
        self._drawing = SceneDrawing(self.host.post, self._show_picture, self._tell)
        self._recording: SceneRecording | None = None
        self._running = False
        self.state.sense(UBinary(b"", "world state"))
        for var in (self.azimuth, self.elevation, self.distance, self.target):
            self.notify_change(var, lambda var=var: self._write(var))
        super().init()
        try:
            self.model()
        except ValueError as error:
            self._tell(str(error))

    def close(self) -> None:
        """Stop looking at the world."""
        self._drawing.stop()
        self._source.end()

    # ---------------------------------------------------------------- looking

    def switch_stream(self, on: bool) -> None:
        """Begin or end to draw."""
        (self._drawing.start if on else self._drawing.stop)()

    def update_stream(self) -> None:
        """See ``OnDemand``; states are also wanted without pictures."""
        super().update_stream()
        wanted = self.on.sensed or self.state.has_subscribers or self._recording is not None
        if wanted is not self._running:
            self._running = wanted
            if wanted:
                self._begin(PERIOD_S)
            else:
                self._source.end()

    def _begin(self, period: float) -> None:
        self._source.begin(period, self._show_state)

    def model(self) -> Path:
        """Return the file of the model.  Raises ValueError."""
        path = self._source.model()
        self.file.sense(str(path))
        return path

    def _show_state(self, state: bytes, time: float) -> None:
        self.state.sense(UBinary(state, "world state"), time)
        if self._recording is not None:
            self._recording.add(state)
        if not self.on.sensed:
            return
        try:
            model = self.model()
        except ValueError as error:
            self._tell(str(error))
            return
        azimuth, elevation, distance = (float(var.sensed) for var in (self.azimuth, self.elevation, self.distance))
        self._drawing.offer(model, state, time, ViewPoint(azimuth, elevation, distance, str(self.target.sensed)))

    def _show_picture(self, picture: bytes, time: float) -> None:
        self.frames.sense(self.frames.sensed + 1)
        self.val.sense(UImage.of(picture, WIDTH, HEIGHT, "jpeg"), time)

    def _tell(self, problem: str) -> None:
        if problem:
            log.warning("worldView gives no pictures: %s", problem)

    def _write(self, var: Any) -> None:
        if var is self.target:
            if not isinstance(var.value, str) or len(var.value) > 200:
                raise ValueError("target is the name of a body, or \"\"")
            var.sense(var.value)
            return
        value = number(var)
        if var is self.distance and not 0 <= value <= 1000:
            raise ValueError("distance is 0 to 1000 m")
        var.sense(value)

    # ---------------------------------------------------------------- recording

    @function
    def record(self, rate: float) -> None:
        """record(rate): keep ``rate`` states a second (of the simulation) from now on, for ``save``."""
        if not 0.1 <= rate <= 100:
            raise ValueError("the rate is 0.1 to 100 states a second")
        self._recording = SceneRecording.begin(self.model(), rate)
        self._running = True
        self._begin(1 / rate)

    @function
    def save(self, path: str) -> None:
        """save(path): write the states since ``record``, and end it; ``urbihw film`` draws them."""
        if self._recording is None:
            raise ValueError("nothing is recorded: say worldView.record(20) first")
        recording, self._recording = self._recording, None
        self._running = False
        self._source.end()
        self.update_stream()
        write_regular(Path(path), recording.data())
