"""Builds a map while the robot is driven by hand: hands the scans to ``mapping``, and its poses to the odometry."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from urbihw.navigation.background import Background
from urbihw.navigation.base import Echo, NavigationLog, PoseEstimate
from urbihw.navigation.extra import how_to_install, load_mapping
from urbihw.navigation.frames import Pose, compose, frame_of, wrapped

MOVED, TURNED = 0.1, math.radians(5)
"""m or rad after which the next scan is added to the map."""


class MapSurvey:
    """The building of a map."""

    def __init__(self, odometry: PoseEstimate, background: Background, log: NavigationLog) -> None:
        self._odometry = odometry
        self._background = background
        self._log = log
        self._builder: Any = None
        self._last: Pose | None = None

    def start(self) -> None:
        """Begin with an empty map.  Raises ValueError without the extra ``navigation``."""
        mapping = load_mapping()
        if mapping is None:
            raise ValueError(f"building a map needs numpy and scipy: {how_to_install()}")
        self.stop()
        self._builder = mapping.MapBuilder(self._odometry.absolute)

    def stop(self) -> None:
        """End the building, and forget the map."""
        self._background.drop()
        self._builder = self._last = None

    def take_scan(self, echoes: Sequence[Echo], place: float) -> None:
        """Add a scan to the map if the robot has moved, and correct its pose by it."""
        guess, last, builder = self._odometry.absolute, self._last, self._builder
        if builder is None or self._background.busy or not echoes:
            return
        if last is not None and math.dist(last[:2], guess[:2]) < MOVED and abs(wrapped(guess[2] - last[2])) < TURNED:
            return
        self._background.start(
            lambda: builder.add_scan(guess, echoes, place), lambda pose: self._take_pose(guess, pose), self._failed
        )

    def _take_pose(self, guess: Pose, pose: Pose) -> None:
        """The scan was taken at this pose and not at the guess; the robot has moved since."""
        self._odometry.correct(compose(frame_of(pose, guess), self._odometry.absolute))
        self._last = pose

    def _failed(self, error: Exception) -> None:
        self._log.warning("building the map: %s", error)

    def save(self, name: str) -> None:
        """Write the map to NAME.yaml and NAME.pgm.  Raises ValueError if there is none, or the files cannot be
        written."""
        if self._builder is None:
            raise ValueError("no map is being built; begin with startMapping")
        self._builder.save(name)
