"""Keeps the pose of a base on its map by the scans of a laser, and searches the whole map for a base that is lost.

While the pose is known each scan corrects it (``localize``), as far as the wheels allow (``belief``).  A scan whose
readings end before the walls that the map shows says nothing: boxes or people stand there.  After ``MAX_MISFITS`` scans
that go through walls the pose is reconsidered: a better one nearby is taken (also after some odd scans of a base that
stands, which somebody may have pushed); if a place elsewhere on the map explains the scan better, somebody has carried
the base, and it is lost; if there is none, the furniture was moved.  For a lost base a particle filter (``montecarlo``,
in a thread) takes the scans until one place explains them.  Standing still may not be enough for that: a program has to
turn or drive the base, the locator never does.

The corrections while the wheels turn are added up.  If they undo half of the way, the base is lost too: the laser sends
one old scan for ever, or the wheels spin.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Final

from urbihw.navigation.background import Background
from urbihw.navigation.base import Echo, PoseEstimate
from urbihw.navigation.belief import Belief
from urbihw.navigation.extra import how_to_install, load_montecarlo
from urbihw.navigation.frames import ORIGIN, Pose, compose, frame_of, wrapped
from urbihw.navigation.grid import Grid
from urbihw.navigation.localize import Match, match_scan, search_near, track_scan

MAX_MISFITS: Final = 5
"""Consecutive scans that speak against the pose after which another one is looked for."""
DUMB_SCAN: Final = 0.2
"""What a scan of a moving base counts for of which the map explains little, and that does not speak against the pose;
while the base stands it counts nothing: it knows where it came to stand."""
PRECISE: Final = 0.06
"""m of the belief's spread up to which the pose is good enough to tell walls that are gone."""
LEAD: Final = 0.1
"""What another pose must have in ``Match.merit`` before the one that was believed."""
ODD_SCANS: Final = 5
"""Consecutive scans of a standing base, explained less than ``EXPLAINED``, after which it may have been pushed."""
EXPLAINED, EXPLAINED_WELL = 0.75, 0.95
"""A pushed base is where a pose nearby explains so much: moved furniture leaves readings that no pose explains."""
MAX_ROUNDS: Final = 3
"""How often the whole map is searched for a better place without finding one, before the base is lost anyway."""
MAX_FIRST_SCANS: Final = 20
"""Maximum number of scans to find the pose on a new map."""
WAY, TURN = 1.0, 1.5
"""m or rad after which the corrections are added up anew."""
MAX_SLIP: Final = 0.5
"""Share of them that the corrections may reach."""
MOST_BETWEEN: Final = 8
"""Scans between two readings of the wheels of a moving robot, at most; with more, it stands."""


class _Slip:
    """Compares the way by the wheels with the corrections of it by scans."""

    def __init__(self) -> None:
        self._last: Pose | None = None
        self._way = self._turned = 0.0
        self._sum = ORIGIN
        self._between = ORIGIN
        """Corrections since the wheels have last moved, from so many scans:"""
        self._scans = 0

    def add(self, guess: Pose, matched: Pose) -> bool:
        """Add a correction from ``guess`` to ``matched``; returns whether the wheels and the scans contradict."""
        last, self._last = self._last, matched
        if last is None:
            return False
        way, turn = math.dist(last[:2], guess[:2]), wrapped(guess[2] - last[2])
        correction = matched[0] - guess[0], matched[1] - guess[1], wrapped(matched[2] - guess[2])
        if not way and not turn:
            # A moving robot whose wheels are read less often than its laser sends: the next reading takes this back.
            self._between = _plus(self._between, correction)
            self._scans += 1
            return False
        if self._scans > MOST_BETWEEN:
            # It stood: somebody pushed it, or the match has become better.
            self._between = ORIGIN
        if self._way >= WAY or abs(self._turned) >= TURN:
            self._way = self._turned = 0.0
            self._sum = ORIGIN
        self._way += way
        self._turned += turn
        self._sum = _plus(_plus(self._sum, correction), self._between)
        self._between, self._scans = ORIGIN, 0
        return math.hypot(self._sum[0], self._sum[1]) > MAX_SLIP * WAY or abs(self._sum[2]) > MAX_SLIP * TURN


def _plus(one: Pose, other: Pose) -> Pose:
    """The sum of two corrections, m and rad."""
    return one[0] + other[0], one[1] + other[1], one[2] + other[2]


def _differs(match: Match) -> str:
    """Why a base is lost whose scans do not match."""
    return f"the laser does not see what the map shows (score {match.score:.2f})"


class Locator:
    """Matches scans with a map.

    Attributes:
        found: the pose is known.
        score: how well the last scan matched, 0 to 1.
        is_sure: the last scan agreed with the map.
    """

    def __init__(
        self,
        odometry: PoseEstimate,
        background: Background,
        on_found: Callable[[], None],
        on_lost: Callable[[str, bool], None],
    ) -> None:
        """``on_found()`` is called when the pose becomes known; ``on_lost(why, searching)`` when it is not any more."""
        self.found = self.is_sure = False
        self.score = 0.0
        self._odometry = odometry
        self._background = background
        self._on_found = on_found
        self._on_lost = on_lost
        self._walls: Grid | None = None
        self._doubt, self._rounds = 0.0, 0
        self._odd = 0
        self._belief = Belief()
        self._searching = False
        self._filter: Any = None
        self._said_ambiguous = False
        self._slip = _Slip()

    @property
    def is_precise(self) -> bool:
        """Whether the last scan agreed with the map, and the pose is known to some centimetres in all directions."""
        return self.found and self.is_sure and self._belief.spread <= PRECISE

    @property
    def is_searching(self) -> bool:
        """Whether the pose is being searched on the whole map."""
        return self._searching

    def use_map(self, walls: Grid | None) -> None:
        """Match the scans with these walls from now on; None ends that."""
        self._walls = walls
        self.found = False
        self.trust_pose()

    def trust_pose(self) -> None:
        """Somebody has said where the base is: begin there, and end a search."""
        self._background.drop()
        self._doubt, self._rounds, self._searching, self._filter = 0.0, 0, False, None
        self._said_ambiguous = False
        self._slip, self._belief = _Slip(), Belief()

    def doubt_pose(self) -> None:
        """The pose is not known until a scan matches the map where the robot should be."""
        self.trust_pose()
        self.found = self.is_sure = False

    def take_scan(self, echoes: Sequence[Echo], place: float, stamp: float) -> None:
        """Process a scan of a laser ``place`` m ahead of the middle of the base; ``stamp`` is its time in s."""
        if self._walls is None:
            return
        if self._searching:
            self._search(self._walls, echoes, place, stamp)
        elif self.found:
            self._track(self._walls, echoes, place, stamp)
        else:
            self._begin(self._walls, echoes, place, stamp)

    def _begin(self, walls: Grid, echoes: Sequence[Echo], place: float, stamp: float) -> None:
        """Find the pose near where it is said to be."""
        match = match_scan(walls, self._odometry.absolute_at(stamp), echoes, place)
        self.score, self.is_sure = match.score, match.is_there
        if match.is_there:
            self.found = True
            self._go_to(match.pose, stamp)
            self._on_found()
            return
        self._doubt += 1
        if self._doubt >= MAX_FIRST_SCANS:
            self._lose(_differs(match))

    def _go_to(self, pose: Pose, stamp: float) -> None:
        """The base was at a pose that may be some centimetres off."""
        self._odometry.correct(pose, stamp)
        self._belief, self._slip = Belief(), _Slip()
        self._doubt = self._rounds = 0

    def _track(self, walls: Grid, echoes: Sequence[Echo], place: float, stamp: float) -> None:
        """Correct a pose that is known, unless the scan speaks against it."""
        guess, belief = self._odometry.absolute_at(stamp), self._belief
        belief.move(guess)
        match, information = track_scan(walls, guess, belief.information(), belief.spread, echoes, place)
        self.score, self.is_sure = match.score, match.is_there
        if self._was_pushed(match):
            near = search_near(walls, match.pose, echoes, place)
            if near.score >= EXPLAINED_WELL and near.merit >= match.merit + LEAD:
                self._go_to(near.pose, stamp)
                return
        if not match.is_there:
            if match.contradicts:
                self._doubt += 1
            elif belief.has_moved:
                self._doubt += DUMB_SCAN
            if self._doubt >= MAX_MISFITS:
                self._reconsider(walls, match, echoes, place, stamp)
            return
        self._doubt = self._rounds = 0
        if self._slip.add(guess, match.pose):
            self._lose("the wheels turn and the scans do not change as they should: old scans, or wheels that slip")
            return
        belief.measure(match.pose, information)
        self._odometry.correct(match.pose, stamp)

    # ---------------------------------------------------------------- doubt

    def _was_pushed(self, match: Match) -> bool:
        """Whether somebody may have pushed the base, whose wheels stand: its belief knows nothing of that."""
        is_odd = not self._belief.has_moved and match.score < EXPLAINED
        self._odd = self._odd + 1 if is_odd else 0
        return self._odd > 0 and self._odd % ODD_SCANS == 0

    def _reconsider(self, walls: Grid, match: Match, echoes: Sequence[Echo], place: float, stamp: float) -> None:
        """Look for a better pose nearby, then on the whole map; without one, and without a map that can be searched,
        the base is lost."""
        near = search_near(walls, match.pose, echoes, place)
        if near.is_there and near.merit >= match.merit + LEAD:
            self._go_to(near.pose, stamp)
            return
        montecarlo = load_montecarlo()
        if montecarlo is None or self._rounds >= MAX_ROUNDS or not echoes:
            self._lose(_differs(match))
        elif not self._background.busy:
            self._background.start(
                lambda: montecarlo.has_better_place(walls, echoes, place, match.merit + LEAD),
                lambda better: self._compared(match, better=better),
                self._search_failed,
            )

    def _compared(self, match: Match, *, better: bool) -> None:
        """The whole map has been searched for a place that explains the scan better."""
        if self._doubt < MAX_MISFITS:
            return
        if better:
            self._lose(_differs(match))
        else:
            self._doubt = 0
            self._rounds += 1

    # ---------------------------------------------------------------- searching the whole map

    def _lose(self, why: str) -> None:
        self.trust_pose()
        self.found = self.is_sure = False
        self._searching = load_montecarlo() is not None
        how = ": turn or drive the robot" if self._searching else f" needs numpy and scipy: {how_to_install()}"
        how = f"searching the map{how}"
        self._on_lost(f"{why}; {how}", self._searching)

    def _search(self, walls: Grid, echoes: Sequence[Echo], place: float, stamp: float) -> None:
        if self._background.busy:
            return
        pose, known = self._odometry.absolute_at(stamp), self._filter

        def work() -> tuple[Any, Pose | None]:
            particles = known or load_montecarlo().ParticleFilter(walls)
            return particles, particles.add_scan(pose, echoes, place)

        self._background.start(work, lambda result: self._take_estimate(pose, *result), self._search_failed)

    def _take_estimate(self, then: Pose, particles: Any, estimate: Pose | None) -> None:
        """Continue the search, or go to the pose that it has found; the base has moved since ``then``."""
        if particles.is_ambiguous and not self._said_ambiguous:
            self._said_ambiguous = True
            self._on_lost("more than one place explains the scans; drive the robot to where they differ", True)
        self._filter = particles
        if estimate is not None:
            self._odometry.correct(compose(frame_of(estimate, then), self._odometry.absolute))
            # The next scans must match there, as on a new map.
            self.trust_pose()

    def _search_failed(self, error: Exception) -> None:
        self.trust_pose()
        self._on_lost(str(error), False)
