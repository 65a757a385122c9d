"""Random programs that move a robot, and what is known of each: what it may move, how fast, and for how long.

A recipe makes a ``Program``, a ``Plant`` says what a platform has of them: each platform has a ``<name>_plant.py`` with
a function ``plant``.  What a program says of itself is never less than the truth: it may ask for motion for a shorter
time, or for slower motion, than it says.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any

from motions import Numbers

TICK = 0.02
"""Seconds of a tick, in all labs here."""
LATE = 0.4
"""Seconds that a program may end later than it says: rounds, ticks, and the wire."""
INF = math.inf


@dataclass(frozen=True)
class Program:
    """What a client says.

    Attributes:
        text: of the body.
        parts: indices of the parts of the body that it moves => the greatest speed that it asks for.
        lasts: seconds until it ends by itself; infinite for one that does not.
        tail: seconds for which a part may go on moving after its last write: a joint to its goal, a wheel for ever.
        rests: what ends by itself leaves nothing that moves.
        begins: greatest speed in the first ``LEAD`` seconds, on the way to where a course begins.
        form: "plain", "tagged", "at" (a body for the event ``trip``), "load" (a file); not said by any client: "hand",
            "other" (another master).
        steered: a job of its own steers it, so that freezing its caller changes nothing.
    """

    text: str
    parts: dict[int, float]
    lasts: float = INF
    tail: float = INF
    rests: bool = False
    begins: float = 0.0
    form: str = "tagged"
    steered: bool = False

    def said(self, tag: str, folder: Path) -> str:
        """The words of the client; nothing else has this tag."""
        if self.form == "plain":
            return self.text
        text = self.text
        if self.form == "at":
            text = f"at (Global.trip?) {{ {text} }}"
        elif self.form == "load":
            path = folder / f"{tag}.u"
            path.write_text(text + "\n")
            text = f'load("{path}")'
        return f"{tag}: {{ {text} }},"


Recipe = Callable[[Random], Program]

LEAD = 4.0
"""Seconds in which a course reaches its beginning, from wherever the joint was."""


@dataclass(frozen=True)
class Hand:
    """A joint that a hand can hold, turn, and let go.

    Attributes:
        hold: holds the horn in this lab, or lets it go.
        turn: turns the horn by an angle, rad.
        middle: where the body is in the middle of its range, rad.
        springs: how fast it comes back to a goal without a limit; infinite if only its motor bounds it.
    """

    hold: Callable[[Any, bool], None]
    turn: Callable[[Any, float], None]
    middle: float
    springs: float = INF


@dataclass(frozen=True)
class Push:
    """What another master does to the simulated robot.

    Attributes:
        go: does it.
        parts: of the body that it moves => the greatest speed.
        lasts: seconds for which they go on.
    """

    go: Callable[[Any], None]
    parts: dict[int, float]
    lasts: float = INF


@dataclass(frozen=True)
class Limit:
    """A limit of the settings: of which device, how it is called, and its greatest value that is tried.

    ``unit`` is the speed of the body, rad/s or m/s, at a value of 1; ``grain`` what may come on top of it: a servo is
    led in steps.
    """

    device: str
    most: float
    name: str = "speed"
    unit: float = 1.0
    grain: float = 0.0


@dataclass(frozen=True)
class Plant:
    """A platform, as the random programs see it.

    Attributes:
        make: a lab whose robot is open.
        devices: as the worker calls them => the parts of the body that are theirs.
        recipes: of its programs.
        zeros: what lets a device stand, by device.
        setup: what is said once.
        settle: seconds after which nothing moves without a request.
        more: what may come on top of a speed: of all parts, rad/s and m/s.
        units: devices => numbers for power and silence at the fake; None for all of it.
        garbage: what may befall the wire: faults of the fake, or bytes from nowhere ("raw").
        drift: how far a part may move without a request, m and rad.
        hands: joints that a hand can hold, by device; each is one part of the body.
        others: what another master can do.
        limits: of the settings, by part of the body.
    """

    make: Callable[[], Any]
    devices: dict[Any, tuple[int, ...]]
    recipes: list[Recipe]
    zeros: dict[Any, str]
    setup: str
    settle: float
    more: Numbers
    end: Callable[[Any], Any]
    device: Callable[[Any], Any]
    units: dict[Any, int | None] = field(default_factory=dict)
    drift: float = 0.01
    garbage: tuple[str, ...] = ("noise", "checksum", "cut", "raw")
    hands: dict[Any, Hand] = field(default_factory=dict)
    others: tuple[Push, ...] = ()
    limits: dict[int, Limit] = field(default_factory=dict)


def setter(slot: str, parts: dict[int, float], values: Callable[[Random], object], tail: float = INF) -> Recipe:
    """A plain write."""
    return lambda rng: Program(f"{slot} = {values(rng)};", parts, 0.0, tail, form="plain")


def course(slot: str, middle: str, ampli: float, part: int, *, place: bool, tail: float, begins: float) -> Recipe:
    """A swing: of a place, whose speed is its slope; or of a speed."""

    def make(rng: Random) -> Program:
        period = rng.choice((1.5, 2.0, 3.0))
        most = ampli * math.tau / period if place else ampli
        return Program(f"{slot} = {middle} sin:{period}s ampli:{ampli};", {part: most}, tail=tail, begins=begins)

    return make


def ramp(slot: str, part: int, most: float, values: Callable[[Random], object], tail: float) -> Recipe:
    """A way to a value in some time."""

    def make(rng: Random) -> Program:
        time = rng.choice((0.5, 1.0, 3.0))
        return Program(f"{slot} = {values(rng)} time:{time}s;", {part: most}, time, tail, form="tagged")

    return make


def steps(
    slot: str, values: tuple[float, float], parts: dict[int, float], tail: float, still: str = ""
) -> list[Recipe]:
    """Two values in turn, by a loop, by ``every``, by an ``at``, by a file; ``still`` lets it stand at the end."""
    first, second = values

    def loop(rng: Random) -> Program:
        a, b = rng.choice((50, 200, 500)), rng.choice((50, 300, 700))
        text = f"loop {{ {slot} = {first}; sleep({a}ms); {slot} = {second}; sleep({b}ms) }};"
        return Program(text, parts, tail=tail)

    def every(rng: Random) -> Program:
        text = f"every ({rng.choice((0.4, 0.9))}s) {{ {slot} = {first}; sleep(200ms); {slot} = {second} }};"
        return Program(text, parts, tail=tail)

    def once(form: str) -> Recipe:
        def make(rng: Random) -> Program:
            wait = rng.choice((0.1, 0.4, 1.0))
            text = f"{slot} = {first}; sleep({wait}s); {slot} = {second}; sleep({wait}s); {still}"
            return Program(text, parts, 2 * wait, tail, rests=bool(still), form=form)

        return make

    return [loop, every, once("at"), once("load"), once("tagged")]


def between(low: float, high: float) -> Callable[[Random], object]:
    """A number in a range."""
    return lambda rng: f"{rng.uniform(low, high):.2f}"


def either_way(most: float) -> Callable[[Random], object]:
    """A speed, forward or backward, the greatest or half of it."""
    return lambda rng: rng.choice((-most, -most / 2, most / 2, most))


def base_recipes(x: str, yaw: str, x_most: float, yaw_most: float) -> list[Recipe]:
    """The programs of a base that drives: the slots of its two speeds, and the greatest of each."""
    still = f"{x} = 0 | {yaw} = 0;"
    both = {0: 0.3, 1: 0.7}
    return [
        setter(x, {0: x_most}, either_way(x_most)),
        setter(yaw, {1: yaw_most}, either_way(yaw_most)),
        course(x, "0", x_most * 0.8, 0, place=False, tail=INF, begins=x_most),
        course(yaw, "0", yaw_most * 0.8, 1, place=False, tail=INF, begins=yaw_most),
        ramp(yaw, 1, yaw_most, either_way(yaw_most), INF),
        *steps(x, (x_most, -x_most / 2), {0: x_most}, INF, still),
        *steps(yaw, (yaw_most, -yaw_most / 2), {1: yaw_most}, INF, still),
        lambda rng: Program(f"robot.go({rng.uniform(-0.6, 0.6):.2f});", both, 12.0, rests=True, steered=True),
        lambda rng: Program(f"robot.turn({rng.uniform(-3, 3):.2f});", both, 16.0, rests=True, steered=True),
    ]


def plant_of(platform: str) -> Plant:
    """What a platform says of its random programs."""
    found: Plant = importlib.import_module(f"{platform}_plant").plant()
    return found
