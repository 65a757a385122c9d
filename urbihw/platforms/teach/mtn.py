"""Motion files of ROBOTIS RoboPlus Motion 1.x (``.mtn``): pages of steps for servos of 1024 positions.

The file is text of lines ``key=values``.  RoboPlus writes a byte order mark before them and two bytes of a check sum
behind them, which are no part of the text::

    type=motion
    version=1.01
    enable=0 1 1 ...          one number for each of the ids 0 to 25: 1 if the motion moves it
    motor_type=0 0 0 ...      the same: the kind of servo
    page_begin
    name=Bow
    compliance=5 5 5 ...      the same: compliance slope
    play_param=0 0 1 1.0 32   next page, exit page, repetitions, speed, inertial force
    step=512 235 ... 0.1 1.0  goal positions of the ids 0 to 25, seconds of pause after the movement, seconds of it
    page_end

Pages are counted from 1, and page 0 means no page.  A page without steps is empty.  The speed divides all times.

Sources: ROBOTIS e-Manual, "RoboPlus Motion" (next and exit page, number of repetitions, speed rate, inertial force);
the format as in the file bio_prm_soccertypea_en.mtn of the repository tician/opencm-1.5, and as read by the loaders of
bioloidgp (``Motion::loadMTN``) and of Peter Lanius' translate_motion, whose table of enabled servos begins with id 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from urbihw.frozen import frozen
from urbihw.platforms.teach.recording import BadMotion

IDS: Final = 26
"""Numbers of a line of the file: the ids 0 to 25."""
MAX_PAGES: Final = 255
MAX_STEPS: Final = 7
"""Steps of a page: RoboPlus shows and plays at most seven."""
COUNTS: Final = 1023
MIDDLE: Final = COUNTS / 2
RAD_PER_COUNT: Final = math.radians(300) / COUNTS
"""An AX-12 has 0 to 1023 for 300 degrees (e-Manual, AX-12A, Goal Position)."""
MAX_SECONDS: Final = 60.0
"""Maximum of a pause or of the time of a step."""
MAX_SPEED: Final = 10.0
_MARK: Final = "\ufeff"


@frozen(slots=False)
class MtnStep:
    """Positions in rad from the middle of the servo, by id; seconds of the movement, and of the pause after it."""

    positions: dict[int, float]
    time: float
    pause: float


@frozen(slots=False)
class Page:
    """A page: its number and name, the numbers of the pages after it and after a request to end, 0 for none."""

    number: int
    name: str
    next: int
    exit: int
    repeat: int
    speed: float
    steps: tuple[MtnStep, ...]


@frozen(slots=False)
class MotionFile:
    """The pages of a file, in order."""

    pages: tuple[Page, ...]

    def page(self, number: int) -> Page | None:
        """The page of a number, counted from 1; None if there is none, or if it is empty."""
        found = self.pages[number - 1] if 0 < number <= len(self.pages) else None
        return found if found is not None and found.steps else None

    def find(self, name: str) -> Page | None:
        """The first page of a name, or the page of a number; the first of all for "".  An empty page does not count."""
        filled = [page for page in self.pages if page.steps]
        if not name:
            return filled[0] if filled else None
        named = next((page for page in filled if page.name == name), None)
        return named or (self.page(int(name)) if name.isascii() and name.isdigit() else None)


def angle_of(count: int) -> float:
    """Return the position in rad from the middle of a servo for a number of the file."""
    return (count - MIDDLE) * RAD_PER_COUNT


class _MtnReader:
    """Reads the lines of a file; ``place`` is the line for messages."""

    def __init__(self, where: str) -> None:
        self._where = where
        self.place = where
        self.pages: list[Page] = []
        self._enabled: Sequence[int] = ()
        self._name = ""
        self._play: Sequence[float] = ()
        self._steps: list[MtnStep] = []
        self._inside = False

    def read(self, lines: Sequence[str]) -> MotionFile:
        """Return the pages.  Raises BadMotion."""
        for number, line in enumerate(lines, 1):
            self.place = f"{self._where}:{number}"
            key, equals, values = line.strip().lstrip(_MARK).partition("=")
            if equals or key in ("page_begin", "page_end"):
                self._take(key, values)
            # What has no key is the check sum at the end of the file.
        if self._inside or not self.pages:
            raise BadMotion(f"{self._where}: a motion file has pages from page_begin to page_end")
        return MotionFile(tuple(self.pages))

    def _take(self, key: str, values: str) -> None:
        match key:
            case "type":
                self._require(values.strip() == "motion", "type is motion")
            case "version":
                self._require(values.strip() == "1.01", "only version 1.01 of motion files is known")
            case "enable":
                self._enabled = [int(value) for value in self._numbers(values, IDS)]
            case "page_begin":
                self._begin_page()
            case "page_end":
                self._end_page()
            case "name":
                self._name = values.strip()
            case "play_param":
                self._play = self._numbers(values, 5)
            case "step":
                self._require(self._inside and len(self._steps) < MAX_STEPS, f"at most {MAX_STEPS} steps, in a page")
                self._steps.append(self._step(self._numbers(values, IDS + 2)))

    def _step(self, values: Sequence[float]) -> MtnStep:
        *counts, pause, time = values
        self._require(len(self._enabled) == IDS, "the line enable comes before the pages")
        self._require(all(0 <= count <= COUNTS for count in counts), f"positions are 0 to {COUNTS}")
        self._require(0 <= pause <= MAX_SECONDS and 0 <= time <= MAX_SECONDS, f"times are 0 to {MAX_SECONDS:g} s")
        moved = {number: angle_of(int(count)) for number, count in enumerate(counts) if self._enabled[number]}
        self._require(bool(moved), "the line enable has at least one 1")
        return MtnStep(moved, time, pause)

    def _begin_page(self) -> None:
        free = not self._inside and len(self.pages) < MAX_PAGES
        self._require(free, f"at most {MAX_PAGES} pages, none inside another")
        self._inside, self._name, self._play, self._steps = True, "", (), []

    def _end_page(self) -> None:
        self._require(self._inside and len(self._play) == 5, "a page has page_begin and play_param")
        after, leave, repeat, speed, _ = self._play
        self._require(0 <= after <= MAX_PAGES and 0 <= leave <= MAX_PAGES, f"pages are 0 to {MAX_PAGES}")
        fits = 0 <= repeat <= 255 and 0 < speed <= MAX_SPEED
        self._require(fits, f"0 to 255 repetitions, a speed up to {MAX_SPEED:g}")
        number, repeat = len(self.pages) + 1, max(repeat, 1)
        self.pages.append(
            Page(number, self._name, int(after), int(leave), int(repeat), speed, tuple(self._steps))
        )
        self._inside = False

    def _numbers(self, text: str, count: int) -> list[float]:
        words = text.split()
        try:
            values = [float(word) for word in words]
        except ValueError:
            values = []
        self._require(len(values) == count and all(map(math.isfinite, values)), f"this line has {count} numbers")
        return values

    def _require(self, holds: bool, rule: str) -> None:
        if not holds:
            raise BadMotion(f"{self.place}: {rule}")


def parse(data: bytes, where: str) -> MotionFile:
    """Return the pages of a motion file; ``where`` is its name for messages.  Raises BadMotion."""
    text = data.decode("utf-8", "replace")
    if not text.lstrip(_MARK).startswith("type="):
        raise BadMotion(f"{where}: a motion file of RoboPlus begins with type=motion")
    return _MtnReader(where).read(text.splitlines())
