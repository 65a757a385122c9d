"""Readings of joints by which a link comes to a place (inverse kinematics): SciPy's bounded least squares over our own
``kinematics``.

Only the place is asked for, not the turn: arms of five joints do not reach both.  Limits hold, since the search is
bounded by them.  It begins at the pose of the robot and stays near it where it can; if that ends elsewhere, it begins
anew from other poses.  An arm of six joints takes some 50 ms: for a thread.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from urbihw.figure.kinematics import frames, ways_of
from urbihw.figure.model import UNITS, Figure, FigureLink, Triple
from urbihw.figure.pose import Pose

NEAR_M: Final = 0.001
"""m from the wanted place at which it is reached."""
STARTS: Final = 8
"""Poses from which it is tried."""
FARTHEST_M: Final = 1.0
"""m along which a slide without an end is searched."""
_STAY: Final = 1e-4
"""m that a radian away from the pose of the robot weighs."""


class JointRange(NamedTuple):
    """A joint as the search sees it: its reading, and the least and greatest one that is allowed."""

    reading: float
    low: float
    high: float


class CannotReach(ValueError):
    """There is no pose within the limits in which the link is at the place; the message tells the nearest one."""


def reach(figure: Figure, link: str, place: Sequence[float], joints: Mapping[str, JointRange]) -> dict[str, float]:
    """The readings by which a link is at ``place``, m in the frame of the robot.

    ``joints`` are those between the frame and the link that may move.  Raises CannotReach, KeyError for an unknown
    link, ImportError without SciPy.
    """
    from scipy.optimize import least_squares

    joints = _searched(figure, link, joints)
    names = [name for name, joint in joints.items() if joint.low < joint.high]
    if not names:
        raise CannotReach(f"no joint moves {link}")
    here = [min(max(joints[name].reading, joints[name].low), joints[name].high) for name in names]
    fixed = {name: joint.reading for name, joint in joints.items()}

    def chain(values: Sequence[float]) -> list[tuple[FigureLink, Pose]]:
        return frames(figure, link, {**fixed, **dict(zip(names, map(float, values), strict=True))})

    def found(values: Sequence[float]) -> Triple:
        return chain(values)[-1][1].place

    def slopes(values: Sequence[float]) -> list[list[float]]:
        links = chain(values)
        ways = ways_of(links, links[-1][1].place)
        stay = [[_STAY if name == other else 0.0 for other in names] for name in names]
        return [*([ways[name][axis] for name in names] for axis in range(3)), *stay]

    def missed(values: Sequence[float]) -> list[float]:
        off = [is_ - wanted for is_, wanted in zip(found(values), place, strict=True)]
        return [*off, *(_STAY * (value - start) for value, start in zip(values, here, strict=True))]

    bounds = [joints[name].low for name in names], [joints[name].high for name in names]
    best, nearest = here, math.inf
    for start in _starts(here, bounds):
        values = least_squares(missed, start, slopes, bounds=bounds, xtol=1e-7, ftol=1e-10).x
        far = math.dist(found(values), place)
        if far < nearest:
            best, nearest = list(map(float, values)), far
        if nearest < NEAR_M:
            return dict(zip(names, best, strict=True))
    raise CannotReach(_why(link, place, found(best), nearest, {
        name: value for name, value in zip(names, best, strict=True)
        if min(value - joints[name].low, joints[name].high - value) < 0.01 * (joints[name].high - joints[name].low)
    }))  # fmt: skip


def _searched(figure: Figure, link: str, joints: Mapping[str, JointRange]) -> dict[str, JointRange]:
    """The joints with a range to search in: an end that is open is a turn, or ``FARTHEST_M``, from the reading."""
    units = {each.joint.device: each.joint.unit for each in figure.chain(link) if each.joint is not None}
    found = {}
    for name, (reading, low, high) in joints.items():
        unit = units.get(name, "rad")
        most = FARTHEST_M if unit == "m" else 2 * math.pi / UNITS[unit]
        found[name] = JointRange(
            reading, low if low > -math.inf else min(reading, high) - most,
            high if high < math.inf else max(reading, low) + most,
        )  # fmt: skip
    return found


def _starts(here: Sequence[float], bounds: tuple[Sequence[float], Sequence[float]]) -> Iterator[list[float]]:
    """The pose of the robot, the middle of the ranges, and others that are the same each time."""
    inside = [_inside(value, low, high) for value, low, high in zip(here, *bounds, strict=True)]
    yield inside
    yield [(low + high) / 2 for low, high in zip(*bounds, strict=True)]
    dice = random.Random(1)
    for _ in range(STARTS - 2):
        yield [dice.uniform(low, high) for low, high in zip(*bounds, strict=True)]


def _inside(value: float, low: float, high: float) -> float:
    """A value that is not on a bound, as the solver wants it."""
    rim = 1e-6 * (high - low)
    return min(max(value, low + rim), high - rim)


def _why(link: str, place: Sequence[float], nearest: Sequence[float], far: float, ends: Mapping[str, float]) -> str:
    """Why a place cannot be reached: the nearest one, and the joints that are at an end of their range there."""
    wanted, here = (", ".join(f"{share:.3f}" for share in each) for each in (place, nearest))
    held = f"; at the end of its range: {', '.join(ends)}" if ends else ""
    return f"{link} cannot reach [{wanted}]: the nearest place is [{here}], {100 * far:.1f} cm away{held}"
