"""The pose of a base by its wheels, and its pose on the map: an object of urbiscript."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from urbihw.kernel.uobject import UObject, finite_numbers, function, owned, reading
from urbihw.navigation.frames import MAX_METRES, ORIGIN, Pose, compose, frame_of, moved, wrapped


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

    def add_way(self, way: float, angle: float, stamp: float) -> None:
        """Add a distance (m) and a turn (rad, to the left) since the last reading."""
        self.show_pose(*moved(self.odometric, way, angle), way, angle, stamp)

    def show_pose(self, x: float, y: float, heading: float, way: float, angle: float, stamp: float) -> None:
        """Show a new pose of the odometry, and the distance and turn to it."""
        self.odometric = (x, y, wrapped(heading))
        for var, value in ((self.x, x), (self.y, y), (self.yaw, self.odometric[2])):
            var.sense(value, stamp)
        if way:
            self.coveredDistance.sense(self.coveredDistance.sensed + abs(way), stamp)
        if angle:
            self.coveredAngle.sense(self.coveredAngle.sensed + abs(angle), stamp)
        if way or angle:
            self._show_position(stamp)

    def correct(self, pose: Pose) -> None:
        """Set the pose in the absolute frame."""
        self.frame = frame_of(pose, self.odometric)
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
