"""Global localization: where on a map a robot is that was carried there; a particle filter with numpy, no I/O.

Thrun, Burgard, Fox: Probabilistic Robotics (2005): Monte Carlo localization (table 8.2), likelihood fields as the model
of the laser (table 6.3), low variance resampling (table 4.4).  The first set of particles covers all free cells and
headings.  As in ROS's AMCL a scan counts only after the robot has moved, because particles of a standing robot gather
at one of several equal places by chance.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from urbihw.navigation.base import Echo
from urbihw.navigation.frames import Pose, compose, frame_of, wrapped
from urbihw.navigation.grid import Grid
from urbihw.navigation.localize import match_scan

SPACING: Final = 0.25
HEADINGS: Final = 48
"""Distance in m of the first particles, and number of their headings."""
PARTICLES: Final = 6000
BEAMS: Final = 40
"""Number of readings used of a scan."""
SIGMA: Final = 0.2
"""Standard deviation in m of an echo from a wall: mostly the distance between particles."""
RANDOM_SHARE: Final = 0.1
"""Share of echoes from what the map does not show."""
WEIGHT_POWER: Final = 0.1
"""The readings of a scan depend on each other, so that each counts less than a whole one."""
MOVED, TURNED = 0.1, math.radians(8)
"""m or rad after which the next scan counts."""
NOISE_M, NOISE_RAD = 0.05, 0.04
"""Standard deviation of what is added to each particle with each counted scan."""
CLUSTER, CLUSTER_TURN = 0.5, 0.35
"""m and rad around the best particle within which particles support it."""
AGREED: Final = 0.9
"""Share of the weight that must support the best particle."""
SURE_SCORE: Final = 0.5
"""Score of ``match_scan`` that the estimate must reach."""
CONFIRMATIONS: Final = 10
"""Scans in a row that one place must explain, each after some movement: one scan may fit a place that looks alike."""
RIVALS: Final = 16
"""Other places of the map that are compared with the one that was found."""
LEAD: Final = 0.05
"""Lead in ``Match.merit`` with which the place must explain the last scans better than each of them."""
MAX_SCANS: Final = 40
"""Scans that count after which the search begins anew."""

_Floats = NDArray[np.floating[Any]]


class ParticleFilter:
    """Particles (x, y, heading) on the free cells of a map.

    Attributes:
        is_ambiguous: more than one place explains the scans; the robot must be driven to where they differ.
    """

    def __init__(self, walls: Grid, seed: int = 1) -> None:
        self._walls = walls
        self._random = np.random.default_rng(seed)
        distances = np.array(walls.distances()).reshape(walls.height, walls.width)
        field = (1 - RANDOM_SHARE) * np.exp(-(distances**2) / (2 * SIGMA**2)) + RANDOM_SHARE
        # A border for echoes outside of the map.
        self._field = np.pad(np.log(field), 1, constant_values=math.log(RANDOM_SHARE))
        self._free = distances > SIGMA
        self._particles: _Floats = np.empty((0, 3))
        self._last: Pose | None = None
        self._scans = self._confirmed = 0
        self._taken: deque[tuple[Pose, Sequence[Echo]]] = deque(maxlen=CONFIRMATIONS)
        self.is_ambiguous = False

    def add_scan(self, odometric: Pose, echoes: Sequence[Echo], place: float) -> Pose | None:
        """Process a scan taken at a pose of the odometry, whose frame may be any but must not change; returns the pose
        on the map once one place explains the scans."""
        local = _sampled(echoes, place)
        if not len(local) or not self._move_particles(odometric):
            return None
        self._taken.append((odometric, echoes))
        weights = self._weigh(local)
        best = self._particles[int(np.argmax(weights))].copy()
        off = np.abs((self._particles[:, 2] - best[2] + math.pi) % math.tau - math.pi)
        near = (np.hypot(*(self._particles[:, :2] - best[:2]).T) < CLUSTER) & (off < CLUSTER_TURN)
        agreed = float(weights[near].sum()) >= AGREED
        self._resample(weights)
        self._scans += 1
        if not agreed:
            self._confirmed = 0
            self.is_ambiguous = self._scans >= MAX_SCANS
            return None
        match = match_scan(self._walls, (float(best[0]), float(best[1]), float(best[2])), echoes, place)
        self._confirmed = self._confirmed + 1 if match.is_there and match.score >= SURE_SCORE else 0
        if self._confirmed >= CONFIRMATIONS:
            self._confirmed = 0
            self.is_ambiguous = self._has_rival(match.pose, local, place)
            return None if self.is_ambiguous else match.pose
        if not match.is_there or self._scans >= MAX_SCANS:
            # They have gathered at a wrong place, and no particle is left at the right one.
            self._last = None
        return None

    def _has_rival(self, found: Pose, local: _Floats, place: float) -> bool:
        """Whether another place of the map explains the last scans nearly as well or better: particles gather at one of
        several rooms that look alike, and then none is left in the others."""
        echoes = self._taken[-1][1]
        enough = self._explain(found, place, 0.0) - LEAD
        rivals = (match_scan(self._walls, pose, echoes, place).pose for pose in self.best_places(local, found))
        return any(not _is_near(pose, found) and self._explain(pose, place, enough) > enough for pose in rivals)

    def _explain(self, pose: Pose, place: float, least: float) -> float:
        """The mean merit of the last scans on the way to a pose, each matched with the map as the wheels slip; 0 as
        soon as it cannot reach ``least``."""
        lost, count = 0.0, len(self._taken)
        after = self._taken[-1][0]
        for then, echoes in reversed(self._taken):
            match = match_scan(self._walls, compose(frame_of(pose, after), then), echoes, place)
            pose, after = match.pose, then
            lost += 1 - match.merit
            if 1 - lost / count < least:
                return 0.0
        return 1 - lost / count

    def best_places(self, local: _Floats, *known: Pose) -> Iterator[Pose]:
        """The places of the whole map at which a scan fits best, beside those that are known."""
        everywhere = self._everywhere()
        weights = self._weigh(local, everywhere)
        chosen = list(known)
        for index in np.argsort(weights)[::-1]:
            x, y, heading = everywhere[index]
            pose = float(x), float(y), float(heading)
            if any(_is_near(pose, other) for other in chosen):
                continue
            chosen.append(pose)
            yield pose
            if len(chosen) > RIVALS:
                return

    def _move_particles(self, odometric: Pose) -> bool:
        """Move the particles as the odometry moved; False if that was too little to count."""
        last = self._last
        if last is None:
            self._spread()
        else:
            forward, left, turn = _relative(last, odometric)
            if math.hypot(forward, left) < MOVED and abs(turn) < TURNED:
                return False
            x, y, heading = self._particles.T
            c, s = np.cos(heading), np.sin(heading)
            moved = np.stack((x + c * forward - s * left, y + s * forward + c * left, heading + turn), axis=1)
            self._particles = moved + self._random.normal(0, (NOISE_M, NOISE_M, NOISE_RAD), moved.shape)
        self._last = odometric
        return True

    def _spread(self) -> None:
        """Put particles on all free cells, in all headings."""
        self._particles = self._everywhere()
        self._scans = self._confirmed = 0

    def _everywhere(self) -> _Floats:
        walls = self._walls
        skip = max(1, round(SPACING / walls.cell))
        rows, columns = np.nonzero(self._free[::skip, ::skip])
        headings = np.arange(HEADINGS) * (math.tau / HEADINGS)
        x = walls.left + (columns * skip + 0.5) * walls.cell
        y = walls.bottom + (rows * skip + 0.5) * walls.cell
        places = np.repeat(np.stack((x, y), axis=1), HEADINGS, axis=0)
        return np.column_stack((places, np.tile(headings, len(rows))))

    def _weigh(self, local: _Floats, particles: _Floats | None = None) -> _Floats:
        """The share of each particle (by default, of the filter's) in the explanation of a scan; the sum is 1."""
        walls, field = self._walls, self._field
        x, y, heading = (self._particles if particles is None else particles).T
        c, s = np.cos(heading) / walls.cell, np.sin(heading) / walls.cell
        column0, row0 = (x - walls.left) / walls.cell + 1, (y - walls.bottom) / walls.cell + 1
        total = np.zeros(len(x))
        for px, py in local:
            columns = np.clip(column0 + c * px - s * py, 0, field.shape[1] - 1).astype(np.intp)
            rows = np.clip(row0 + s * px + c * py, 0, field.shape[0] - 1).astype(np.intp)
            total += field[rows, columns]
        weights = np.exp((total - total.max()) * WEIGHT_POWER)
        shares: _Floats = weights / weights.sum()
        return shares

    def _resample(self, weights: _Floats) -> None:
        """Draw the next particles by their weights."""
        marks = (self._random.random() + np.arange(PARTICLES)) / PARTICLES
        chosen = np.searchsorted(np.cumsum(weights), marks).clip(0, len(weights) - 1)
        self._particles = self._particles[chosen]


def has_better_place(walls: Grid, echoes: Sequence[Echo], place: float, merit: float) -> bool:
    """Whether somewhere on a map a scan has more than a ``Match.merit``."""
    local = _sampled(echoes, place)
    poses = ParticleFilter(walls).best_places(local) if len(local) else ()
    matches = (match_scan(walls, pose, echoes, place) for pose in poses)
    return any(match.is_there and match.merit > merit for match in matches)


def _sampled(echoes: Sequence[Echo], place: float) -> _Floats:
    """Where some of the readings end, in the frame of the robot."""
    step = max(1, len(echoes) // BEAMS)
    return np.array([(place + r * math.cos(a), r * math.sin(a)) for r, a in echoes[::step]])


def _is_near(pose: Pose, other: Pose) -> bool:
    """Whether two poses count as one place."""
    return math.dist(pose[:2], other[:2]) < 2 * CLUSTER and abs(wrapped(pose[2] - other[2])) < 2 * CLUSTER_TURN


def _relative(last: Pose, now: Pose) -> Pose:
    """A pose as seen from another one: ahead, to the left, turned."""
    dx, dy = now[0] - last[0], now[1] - last[1]
    c, s = math.cos(last[2]), math.sin(last[2])
    return c * dx + s * dy, c * dy - s * dx, math.remainder(now[2] - last[2], math.tau)
