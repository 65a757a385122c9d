"""Where the wheels say that a base is, and where it is on the map: an object of urbiscript."""

from __future__ import annotations

from urbihw.kernel.uobject import UObject, finite_numbers, owned, reading
from urbihw.navigation.frames import ORIGIN, Pose, compose, frame_of, wrapped


class Odometry(UObject):
    """The pose in the frame of the odometry (``x``, ``y``, ``yaw``) and in the absolute frame (``position``).

    A platform derives its own class, which has the name that urbiscript knows.
    """

    x = reading(0.0)
    y = reading(0.0)
    z = reading(0.0)
    yaw = reading(0.0)
    coveredDistance = reading(0.0)
    coveredAngle = reading(0.0)
    position = owned([0.0, 0.0, 0.0, 0.0])

    def init(self) -> None:
        """Both frames are the same until ``position`` is written."""
        self.odometric: Pose = ORIGIN
        self.frame: Pose = ORIGIN
        self.notify_change(self.position, self._position_written)

    @property
    def absolute(self) -> Pose:
        """The pose in the absolute frame."""
        return compose(self.frame, self.odometric)

    def show_pose(self, x: float, y: float, heading: float, way: float, angle: float, stamp: float) -> None:
        """The odometry moved on: to a pose, by a way and an angle."""
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
        """The robot is at a pose of the absolute frame."""
        self.frame = frame_of(pose, self.odometric)
        self._show_position(self.host.now())

    def _position_written(self) -> None:
        x, y, _, yaw = finite_numbers(self.position.value, 4, 4, "[x, y, z, yaw]")
        self.correct((x, y, yaw))

    def _show_position(self, stamp: float) -> None:
        x, y, yaw = self.absolute
        self.position.sense([x, y, 0.0, yaw], stamp)
