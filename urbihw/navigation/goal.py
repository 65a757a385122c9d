"""A goal of the navigator, and how often it tries to reach it."""

from __future__ import annotations

import math
from typing import Final

from urbihw.frozen import frozen
from urbihw.navigation.frames import Point, path_length

MAX_WAITS: Final = 8
"""Maximum number of pauses of one goal because of obstacles; together longer than a mark of the sensors lasts."""
MAX_NEW_WAYS: Final = 40
"""Maximum number of new plans for one goal while it is driven to."""
MAX_APPROACHES: Final = 3
"""Maximum number of new plans for a goal beside which the robot has come to stand."""
MAX_PATIENCE: Final = 5
"""Maximum number of pauses of one goal in place of a detour."""
DETOUR: Final = 2.0
"""Ratio of a way around obstacles to the way without them from which a pause is better: obstacles may move."""


@frozen
class Goal:
    """A goal.

    Attributes:
        place, heading: a point and a heading on the map.
        scanned: a scanner was on when the goal was named, so the robot does not drive without.
        waits, new_ways, approaches, patience: remaining numbers of pauses before obstacles, of new plans under way, of
            new plans beside the goal, and of pauses in place of a detour.
        direct: m to drive when obstacles closed the way.
    """

    place: Point
    heading: float
    scanned: bool = False
    waits: int = MAX_WAITS
    new_ways: int = MAX_NEW_WAYS
    approaches: int = MAX_APPROACHES
    patience: int = MAX_PATIENCE
    direct: float = math.inf

    def is_detour(self, path: list[Point], direct: float) -> bool:
        """Whether to wait until obstacles have moved instead of driving a path; ``direct``: m to drive without them."""
        return self.patience > 0 and path_length(path) > DETOUR * direct
