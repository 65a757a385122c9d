"""Draws a map with paths and poses as an SVG picture; no I/O."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from urbihw.navigation.frames import Point, Pose
from urbihw.navigation.maps import Bounds, Map

SCALE: Final = 40
"""Pixels per m."""
MARGIN: Final = 0.3
STYLES: Final = {
    "wall": "stroke:#222;stroke-width:3",
    "block": "fill:#222;stroke:none",
    "seen": "fill:#d95f02;stroke:none",
    "path": "stroke:#7570b3;stroke-width:2;stroke-dasharray:8 6",
    "trail": "stroke:#1b9e77;stroke-width:3",
    "goal": "stroke:#7570b3;stroke-width:3",
    "robot": "stroke:#1b9e77;stroke-width:3;fill:#1b9e7740",
}
"""What is drawn -> its style: walls and occupied boxes of the map, obstacles that sensors see, a path, where
the robot was, its goal and itself."""


def draw_map(map_: Map, seen: Sequence[Point], cell: float, path: Sequence[Point], pose: Pose, radius: float) -> str:
    """A picture of a map, the obstacles seen (the middles of cells of this size), a path, and the robot."""
    drawing = Drawing(map_.bounds)
    for line in map_.lines:
        drawing.add_line([line[:2], line[2:]], "wall")
    for box in map_.boxes:
        drawing.add_box(box, "block")
    for x, y in seen:
        drawing.add_box((x - cell / 2, y - cell / 2, x + cell / 2, y + cell / 2), "seen")
    drawing.add_line(path, "path")
    drawing.add_pose(pose, radius, "robot")
    return drawing.text()


class Drawing:
    """A picture of a part of the plane; all coordinates in m."""

    def __init__(self, bounds: Bounds) -> None:
        self._left, bottom, right, self._top = bounds
        self._size = ((right - self._left + 2 * MARGIN) * SCALE, (self._top - bottom + 2 * MARGIN) * SCALE)
        self._parts: list[str] = []

    def _at(self, x: float, y: float) -> tuple[float, float]:
        return (x - self._left + MARGIN) * SCALE, (self._top - y + MARGIN) * SCALE

    def add_line(self, points: Sequence[Point], kind: str) -> None:
        """Add a line through some points; ``kind`` is a key of ``STYLES``."""
        corners = " ".join("{:.1f},{:.1f}".format(*self._at(*point)) for point in points)
        self._parts.append(f'<polyline class="{kind}" points="{corners}"/>')

    def add_box(self, box: Bounds, kind: str) -> None:
        """Add a box to the picture."""
        x, y = self._at(box[0], box[3])
        wide, high = (box[2] - box[0]) * SCALE, (box[3] - box[1]) * SCALE
        self._parts.append(f'<rect class="{kind}" x="{x:.1f}" y="{y:.1f}" width="{wide:.1f}" height="{high:.1f}"/>')

    def add_pose(self, pose: Pose, radius: float, kind: str) -> None:
        """Add a round robot that looks ahead."""
        x, y, heading = pose
        across, down = self._at(x, y)
        self._parts.append(f'<circle class="{kind}" cx="{across:.1f}" cy="{down:.1f}" r="{radius * SCALE:.1f}"/>')
        self.add_line([(x, y), (x + radius * math.cos(heading), y + radius * math.sin(heading))], kind)

    def text(self) -> str:
        """The picture, in ASCII."""
        wide, high = (round(size) for size in self._size)
        styles = "".join(f".{kind}{{{style}}}" for kind, style in STYLES.items())
        return "\n".join(
            [
                f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide} {high}" width="{wide}" height="{high}">',
                f"<style>*{{fill:none}}{styles}</style>",
                f'<rect width="{wide}" height="{high}" style="fill:#fff"/>',
                *self._parts,
                "</svg>",
                "",
            ]
        )
