"""The figure of a robot for urbiscript: its text, and the readings by which a link comes to a place.

``robot.figure`` (``urbihw/robot/figures.u``) asks the object of the platform for both.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from urbihw.extras import install_command
from urbihw.figure import Figure
from urbihw.figure.reach import JointRange, reach
from urbihw.kernel.uobject import DevicePart, UObject, function, threaded


class DrawnRobot(DevicePart):
    """The figure of one robot; ``figure`` returns it, None for a robot without one."""

    def __init__(self, device: UObject, figure: Callable[[], Figure | None]) -> None:
        super().__init__(device)
        self._figure = figure

    @function("figureText")
    def text(self) -> str:
        """Return the links, joints and shapes of the robot as JSON; "" for a robot without a figure."""
        figure = self._figure()
        return "" if figure is None else json.dumps(figure.as_table(), separators=(",", ":"))

    @threaded(name="figureGoals")
    def goals(self, link: str, place: list[float], joints: list[Any]) -> list[list[Any]]:
        """Return the name and the reading of each joint by which a link is at a place [x, y, z]; ``joints`` has name,
        reading, least and greatest reading of those that may move."""
        figure = self._figure()
        if figure is None:
            raise ValueError("this robot has no figure")
        if len(place) != 3:
            raise ValueError("a place is a List of x, y and z, in m")
        ranges = {str(name): JointRange(*map(float, numbers)) for name, *numbers in joints}
        try:
            return [[name, value] for name, value in reach(figure, link, place, ranges).items()]
        except ImportError as error:
            raise ValueError(f"this needs scipy: {install_command('navigation')}") from error
