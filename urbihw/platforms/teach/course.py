"""From motions to angles: where each joint is to be at each moment of a motion that is being played.

A motion is a sequence of ``Key``: a pose, and the seconds to go there from the one before.  Joints go straight from key
to key.  To a *blended* key (the begin of each motion, whatever the robot did before) they go as slowly as the safe
speed demands, starting and ending gently.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from urbihw.platforms.teach.mtn import MotionFile, Page
from urbihw.platforms.teach.recording import MotionRecording

SHORTEST_S: Final = 0.001
"""Minimum seconds from key to key, so that a motion that repeats for ever goes on in time."""
LONGEST_STEP_S: Final = 0.05
"""Maximum seconds by which a motion goes on at once: after a pause (a frozen job, a machine that was busy) it goes on
where it was, and does not jump."""
PEAK: Final = math.pi / 2
"""The greatest speed of a blend, relative to its mean speed: the cosine of half a turn."""


class Key(NamedTuple):
    """Seconds to a pose from the one before; the angles in rad by joint; whether to blend."""

    seconds: float
    pose: Mapping[str, float]
    blend: bool = False


class EndRequest:
    """A request to end a motion in good order: at the end of its present pass, by its exit page."""

    made = False


def keys_of(recording: MotionRecording, speed: float) -> Iterator[Key]:
    """The keys of a recorded motion at a multiple of its speed."""
    before = recording.rows[0].time
    for row in recording.rows:
        first = row is recording.rows[0]
        yield Key((row.time - before) / speed, dict(zip(recording.joints, row.angles, strict=True)), first)
        before = row.time


def keys_of_pages(
    motions: MotionFile,
    first: Page,
    speed: float,
    request: EndRequest,
    joint: Callable[[int, float], tuple[str, float]],
) -> Iterator[Key]:
    """The keys of a page and of the pages after it.  ``joint`` gives the joint and its angle for an id and a position.

    After a request to end, the exit page follows the present one, then the pages after that.
    """
    page: Page | None = first
    blend = True
    left: set[int] = set()
    while page is not None:
        for _ in range(page.repeat):
            for step in page.steps:
                pose = dict(joint(number, position) for number, position in step.positions.items())
                yield Key(step.time / (page.speed * speed), pose, blend)
                blend = False
                if step.pause:
                    yield Key(step.pause / (page.speed * speed), pose)
            if request.made:
                break
        after = page.exit if request.made and not left else page.next
        if request.made:
            # Pages that follow one another in a circle have no end.
            left.add(page.number)
        page = None if after in left else motions.page(after)


def repeat_keys(passes: Callable[[], Iterator[Key]], times: float, request: EndRequest) -> Iterator[Key]:
    """The keys of several passes of a motion; ``times`` may be infinite."""
    done = 0
    while done < times and not (done and request.made):
        yield from passes()
        done += 1


class Course:
    """A motion that is being played.

    Attributes:
        joints: the joints that it moves.
        request: the request to end it.
    """

    def __init__(self, start: Mapping[str, float], keys: Iterator[Key], safe_speed: float, request: EndRequest) -> None:
        """``start`` is where the joints are, in rad; ``safe_speed`` the greatest speed of a blend, in rad/s."""
        self.joints: Sequence[str] = tuple(start)
        self.request = request
        self._keys = keys
        self._safe_speed = safe_speed
        self._from = self._to = tuple(start[name] for name in self.joints)
        self._seconds = self._passed = 0.0
        self._blend = False
        self._looked_at: float | None = None
        self._over = False

    def pose_at(self, now: float) -> list[float]:
        """Return the angle of each joint in rad at a moment, in seconds of any clock; [] when the motion is over."""
        if self._over:
            return []
        if self._looked_at is not None:
            self._passed += min(max(now - self._looked_at, 0.0), LONGEST_STEP_S)
        self._looked_at = now
        while self._passed >= self._seconds:
            key = next(self._keys, None)
            if key is None:
                self._over = True
                return list(self._to)
            self._passed -= self._seconds
            self._go_to(key)
        share = self._passed / self._seconds
        if self._blend:
            share = (1 - math.cos(math.pi * share)) / 2
        return [old + (new - old) * share for old, new in zip(self._from, self._to, strict=True)]

    def _go_to(self, key: Key) -> None:
        self._from = self._to
        self._to = tuple(key.pose.get(name, old) for name, old in zip(self.joints, self._from, strict=True))
        self._blend = key.blend
        way = max(abs(new - old) for old, new in zip(self._from, self._to, strict=True)) if key.blend else 0.0
        self._seconds = max(key.seconds, way * PEAK / self._safe_speed, SHORTEST_S)
