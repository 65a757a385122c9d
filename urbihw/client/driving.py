"""Driving a base by orders that must be repeated: what a client defines in its lobby, its order, and the answer.

The server has the dead man: without an order for the given time the base stands (``drive.u``).
"""

from __future__ import annotations

from importlib.resources import files
from typing import Final, NamedTuple

PROGRAM: Final = files("urbihw.client").joinpath("drive.u").read_text("ascii")
"""The urbiscript that defines ``drive`` in a lobby."""


class Driven(NamedTuple):
    """The answer to an order.

    Attributes:
        deferred: whether somebody else has stopped or moved the base, so that orders wait for one that lets it stand.
        late: whether the order came too late to be carried out.
        time: the server's time, s.
        x, yaw: the speeds in force, m/s and rad/s to the left.
        position: x, y, theta, in m and rad.
    """

    deferred: bool
    late: bool
    time: float
    x: float
    yaw: float
    position: tuple[float, float, float]


def order_text(x: float, yaw: float, limit: float, made: float) -> str:
    """The expression that orders speeds, m/s and rad/s, for ``limit`` s; ``made`` is the server's time of the order."""
    return f"drive.order({x:.4g}, {yaw:.4g}, {limit}, {made:.3f})"


def parse_answer(text: str) -> Driven:
    """The answer to an order.  Raises ValueError."""
    deferred, late, *words = text.strip('"').split("|")
    time, x, yaw, *place = map(float, words)
    return Driven(deferred == "true", late == "true", time, x, yaw, (place[0], place[1], place[2]))
