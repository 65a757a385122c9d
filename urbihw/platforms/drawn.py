"""The figure of a robot for urbiscript: its text, and the readings by which a link comes to a place.

``robot.figure`` (``urbihw/robot/figures.u``) asks the object of the platform for both.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection
from typing import Any

from urbihw.extras import install_command
from urbihw.figure import Figure
from urbihw.figure.reach import JointRange, reach
from urbihw.kernel.uobject import LOCK_FUNCTION, DevicePart, UObject, function, threaded


class DrawnRobot(DevicePart):
    """The figure of one robot; ``figure`` returns it, None for a robot without one."""

    def __init__(self, device: UObject, figure: Callable[[], Figure | None]) -> None:
        super().__init__(device)
        self._figure = figure
        self._told: tuple[Figure | None, str] = None, ""

    @function("figureText")
    def text(self) -> str:
        """Return the links, joints and shapes of the robot as JSON; "" for a robot without a figure."""
        figure = self._figure()
        # The same figure is asked for with each place of a link: its text is made once.
        if figure is not self._told[0]:
            self._told = figure, "" if figure is None else json.dumps(figure.as_table(), separators=(",", ":"))
        return self._told[1]

    @threaded(LOCK_FUNCTION, name="figureGoals")
    def goals(self, link: str, place: list[float], joints: list[Any]) -> list[list[Any]]:
        """Return the name and the reading of each joint by which a link is at a place [x, y, z]; ``joints`` has name,
        reading, least and greatest reading of those that may move."""
        figure = self._figure()
        if figure is None:
            raise ValueError("this robot has no figure")
        if len(place) != 3 or not all(map(math.isfinite, place)):
            raise ValueError("a place is a List of x, y and z, in m")
        try:
            ranges = _ranges(joints, {each.joint.device for each in figure.chain(link) if each.joint is not None})
            return [[name, value] for name, value in reach(figure, link, place, ranges).items()]
        except KeyError:
            raise ValueError(f"the figure has no link {link!r}") from None
        except ImportError as error:
            raise ValueError(f"this needs scipy: {install_command('navigation')}") from error


def _ranges(rows: list[Any], carrying: Collection[str]) -> dict[str, JointRange]:
    """The joints of a client by their names.  Raises ValueError for one that does not carry the link: a search takes
    longer with each joint, and cannot be ended.
    """
    ranges = {}
    for row in rows:
        if not isinstance(row, list) or len(row) != 4:
            raise ValueError("a joint is a List of its name, its reading, the least and the greatest one")
        name, reading, low, high = row
        if name not in carrying:
            raise ValueError(f"{name} is no joint that carries this link")
        ranges[name] = JointRange(float(reading), float(low), float(high))
        if not math.isfinite(ranges[name].reading):
            raise ValueError(f"{name} has no reading")
    return ranges
