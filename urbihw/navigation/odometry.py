"""The pose of a base by its wheels, and its pose on the map: an object of urbiscript."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import ClassVar, Final

from urbihw.kernel.uobject import UObject, finite_numbers, function, owned, reading
from urbihw.navigation.frames import MAX_METRES, ORIGIN, Pose, compose, frame_of, moved, share_of, wrapped

REMEMBERED: Final = 32
"""Readings whose poses are kept, for scans that were taken between them."""
LONGEST_GUESS: Final = 0.3
"""Seconds after the last reading for which its speeds are taken to last."""


class Odometry(UObject):
    """The pose in the frame of the odometry (``x``, ``y``, ``yaw``) and in the absolute frame (``position``).

    A platform derives its own class, whose name is that in urbiscript, and sets ``slot_name`` to its slot.
    """

    slot_name: ClassVar[str] = "robot.body.odometry"
    """Its slot in urbiscript."""

    x = reading(0.0)
    y = reading(0.0)
    z = reading(0.0)
    yaw = reading(0.0)
    coveredDistance = reading(0.0)
    coveredAngle = reading(0.0)
    position = owned([0.0, 0.0, 0.0, 0.0])

    slot_words = {
        "x": ("distance ahead since the start, in the direction of the start", "m"),
        "y": ("distance to the left since the start", "m"),
        "z": ("always 0", "m"),
        "yaw": ("heading since the start, to the left", "rad"),
        "coveredDistance": ("length of the way", "m"),
        "coveredAngle": ("sum of the turns", "rad"),
        "position": ("[x, y, z, yaw] on the map; write it to say where the robot is", "m, rad"),
    }

    def init(self) -> None:
        """Both frames are identical until ``position`` is written."""
        self.odometric: Pose = ORIGIN
        self.frame: Pose = ORIGIN
        self._readings: deque[tuple[float, Pose]] = deque(maxlen=REMEMBERED)
        self.placed: Callable[[], None] = lambda: None
        self.notify_change(self.position, self._position_written)

    @function("asString")
    def name_slot(self) -> str:
        """Return its slot, as the text of the object."""
        return self.slot_name

    @property
    def absolute(self) -> Pose:
        """The pose in the absolute frame."""
        return compose(self.frame, self.odometric)

    def absolute_at(self, stamp: float) -> Pose:
        """The pose in the absolute frame at some time, s: between the readings, or a little after the last one."""
        return compose(self.frame, self._odometric_at(stamp))

    def _odometric_at(self, stamp: float) -> Pose:
        readings = self._readings
        if len(readings) < 2:
            return self.odometric
        number = len(readings) - 2
        while number and readings[number][0] > stamp:
            number -= 1
        (before, last), (after, next_) = readings[number], readings[number + 1]
        stamp = max(before, min(stamp, after + LONGEST_GUESS))
        return share_of(last, next_, (stamp - before) / (after - before))

    def add_way(self, way: float, angle: float, stamp: float) -> None:
        """Add a distance (m) and a turn (rad, to the left) since the last reading."""
        self.show_pose(*moved(self.odometric, way, angle), way, angle, stamp)

    def show_pose(self, x: float, y: float, heading: float, way: float, angle: float, stamp: float) -> None:
        """Show a new pose of the odometry, and the distance and turn to it."""
        self.odometric = (x, y, wrapped(heading))
        if not self._readings or stamp > self._readings[-1][0]:
            self._readings.append((stamp, self.odometric))
        for var, value in ((self.x, x), (self.y, y), (self.yaw, self.odometric[2])):
            var.sense(value, stamp)
        if way:
            self.coveredDistance.sense(self.coveredDistance.sensed + abs(way), stamp)
        if angle:
            self.coveredAngle.sense(self.coveredAngle.sensed + abs(angle), stamp)
        if way or angle:
            self._show_position(stamp)

    def correct(self, pose: Pose, stamp: float | None = None) -> None:
        """Set the pose in the absolute frame at some time, s, or now."""
        self.frame = frame_of(pose, self.odometric if stamp is None else self._odometric_at(stamp))
        self._show_position(self.host.now())

    def _position_written(self) -> None:
        x, y, _, yaw = finite_numbers(self.position.value, 4, 4, "[x, y, z, yaw]")
        if abs(x) > MAX_METRES or abs(y) > MAX_METRES:
            raise ValueError(f"no map goes farther than {MAX_METRES:g} m; write [x, y, z, yaw] in m and rad")
        self.correct((x, y, yaw))
        self.placed()

    def _show_position(self, stamp: float) -> None:
        x, y, yaw = self.absolute
        self.position.sense([x, y, 0.0, yaw], stamp)
