"""Random programs that move a robot, and what is known of each: what it may move, how fast, and for how long.

A recipe makes a ``Program``.  What it says of itself is never less than the truth: it may ask for motion for a shorter
time, or for slower motion, than it says.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any

from bioloid_lab import BAUD
from bioloid_lab import Lab as BioloidLab
from cia402_lab import LivingLab
from motions import Numbers
from nxt_lab import Lab as NxtLab
from p3dx_lab import BAUD as P3DX_BAUD
from p3dx_lab import Lab as P3dxLab
from segway_lab import Lab as SegwayLab

from fakes.bioloid import Bioloid
from fakes.nxt.tribot import TriBot
from fakes.p3dx.kit import P3dx
from fakes.p3dx.world import World, box
from fakes.segway.frames import TRACTOR
from fakes.segway.rmp import SegwayRmp

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
        form: "plain", "tagged", "at" (a body for the event ``trip``), or "load" (a file).
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
class Plant:
    """A platform, as the random programs see it.

    Attributes:
        make: a lab whose robot is open.
        devices: as the worker calls them => the parts of the body that are theirs.
        recipes: of its programs.
        zeros: what lets a device stand, by device.
        setup: what is said once.
        settle: seconds after which nothing moves that nobody asks for.
        more: what may come on top of a speed: of all parts, rad/s and m/s.
        units: devices => numbers for power and silence at the fake; None for all of it.
        garbage: what may befall the wire: faults of the fake, or bytes from nowhere ("raw").
        drift: how far a part may move while nobody asks, m and rad.
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


def _between(low: float, high: float) -> Callable[[Random], object]:
    return lambda rng: f"{rng.uniform(low, high):.2f}"


def _speed(most: float) -> Callable[[Random], object]:
    return lambda rng: rng.choice((-most, -most / 2, most / 2, most))


# ---------------------------------------------------------------- the platforms

JOINT = 1.5
"""rad/s of a joint on its way to a goal."""
_WAY = 300 / 57.3 / JOINT + LATE
_OTHER = 3.2
"""rad/s of a servo that switches its mode: for a moment a speed of one mode may be taken for one of the other."""


class _Bioloid(BioloidLab):
    tick = TICK


def _bioloid() -> Plant:
    wheel, joint = "motor7.speed", "motor6.val"
    to_wheel = "motor8.cwLimit = motor8.ccwLimit = 0; motor8.speed = 1.5;"
    to_joint = "motor8.cwLimit = -150deg; motor8.ccwLimit = 150deg; motor8.speed = 1.5; motor8.val = {};"
    return Plant(
        make=lambda: _Bioloid.ready(Bioloid(servos=(6, 7, 8), sensors=(), baud=BAUD)),
        devices={6: (0,), 7: (1,), 8: (2,)},
        recipes=[
            setter(joint, {0: JOINT}, _between(-2, 2), _WAY),
            course(joint, "0", 0.3, 0, place=True, tail=1.0, begins=JOINT),
            ramp(joint, 0, JOINT, _between(-2, 2), _WAY),
            *steps(joint, (0.5, -0.5), {0: JOINT}, _WAY),
            setter(wheel, {1: 3.0}, _speed(3.0)),
            course(wheel, "0", 2.0, 1, place=False, tail=INF, begins=2.0),
            ramp(wheel, 1, 3.0, _speed(3.0), INF),
            *steps(wheel, (2.0, -1.0), {1: 2.0}, INF, "motor7.speed = 0;"),
            lambda rng: Program(to_wheel, {2: _OTHER}, 0.0, form="plain"),
            lambda rng: Program(to_joint.format(rng.uniform(-2, 2)), {2: _OTHER}, 0.0, _WAY, form="plain"),
            lambda rng: Program(f"{to_wheel} sleep(0.3s); {to_joint.format(1)} sleep(0.2s);", {2: _OTHER}, 0.5),
        ],
        zeros={7: "motor7.speed = 0;"},
        setup="motor6.speed = motor8.speed = 1.5; motor7.cwLimit = motor7.ccwLimit = 0;",
        settle=0.5,
        more=(0.15, 0.1, 0.15),
        end=lambda lab: lab.end,
        device=lambda lab: lab.kit,
        units={6: 6, 7: 7, 8: 8},
    )


class _Nxt(NxtLab):
    tick = TICK


def _nxt() -> Plant:
    speed, claw = "wheels.speed", "claw.val"
    both = {0: 8.0, 2: 8.0}
    return Plant(
        make=lambda: _Nxt.ready(TriBot(10_000.0)),
        devices={"A": (0,), "B": (1,), "C": (2,)},
        recipes=[
            setter("wheelL.speed", {2: 8.0}, _speed(50)),
            setter("wheelR.speed", {0: 8.0}, _speed(50)),
            setter(speed, both, _speed(50)),
            setter(claw, {1: 12.0}, _between(-200, 200), 5.0),
            course("wheelL.speed", "0", 40, 2, place=False, tail=INF, begins=6.3),
            course(claw, "0", 150, 1, place=True, tail=1.5, begins=12.0),
            *steps(speed, (50, -30), both, INF, "wheels.speed = 0;"),
            *steps(claw, (60, -60), {1: 12.0}, 3.0),
            lambda rng: Program(f"robot.go({rng.uniform(-0.6, 0.6):.2f});", both, 8.0, rests=True, steered=True),
            lambda rng: Program(f"robot.turn({rng.uniform(-3, 3):.2f});", both, 12.0, rests=True, steered=True),
        ],
        zeros={"A": "wheelR.speed = 0;", "C": "wheelL.speed = 0;"},
        setup="",
        settle=0.7,
        more=(1.0, 1.0, 1.0),
        end=lambda lab: lab.end,
        device=lambda lab: lab.device,
        units={"A": None},
    )


def _base(x: str, yaw: str, x_most: float, yaw_most: float) -> list[Recipe]:
    still = f"{x} = 0 | {yaw} = 0;"
    both = {0: 0.3, 1: 0.7}
    return [
        setter(x, {0: x_most}, _speed(x_most)),
        setter(yaw, {1: yaw_most}, _speed(yaw_most)),
        course(x, "0", x_most * 0.8, 0, place=False, tail=INF, begins=x_most),
        course(yaw, "0", yaw_most * 0.8, 1, place=False, tail=INF, begins=yaw_most),
        ramp(yaw, 1, yaw_most, _speed(yaw_most), INF),
        *steps(x, (x_most, -x_most / 2), {0: x_most}, INF, still),
        *steps(yaw, (yaw_most, -yaw_most / 2), {1: yaw_most}, INF, still),
        lambda rng: Program(f"robot.go({rng.uniform(-0.6, 0.6):.2f});", both, 12.0, rests=True, steered=True),
        lambda rng: Program(f"robot.turn({rng.uniform(-3, 3):.2f});", both, 16.0, rests=True, steered=True),
    ]


def _segway() -> Plant:
    x, yaw = "rmp.forwardSpeed", "rmp.yawSpeed"
    return Plant(
        # One that balances falls when its power is cut.
        make=lambda: SegwayLab.ready(SegwayRmp(mode=TRACTOR)),
        devices={"base": (0, 1)},
        recipes=[
            *_base(x, yaw, 0.4, 0.5),
            lambda rng: Program(f'rmp.mode = "tractor"; {x} = 0.3;', {0: 0.3}, 0.0, form="plain"),
        ],
        zeros={"base": f"{x} = 0 | {yaw} = 0;"},
        setup="",
        settle=0.7,
        more=(0.1, 0.1),
        end=lambda lab: lab.end,
        device=lambda lab: lab.device,
        units={"base": None},
    )


class _P3dx(P3dxLab):
    url = f"pipe://robot?baud={P3DX_BAUD}"


def _p3dx() -> Plant:
    x, yaw = "P3dx.body.x.speed", "P3dx.body.yaw.speed"
    return Plant(
        make=lambda: _P3dx.ready(P3dx(World([*box(-1e4, -1e4, 1e4, 1e4)]))),
        devices={"robot": (0, 1)},
        recipes=_base(x, yaw, 0.3, 0.5),
        zeros={"robot": f"{x} = 0 | {yaw} = 0;"},
        setup="P3dx.body.load = 1;",
        settle=1.8,
        more=(0.06, 0.3),
        end=lambda lab: lab.robot_line.end,
        device=lambda lab: lab.kit.robot,
        units={"robot": None},
    )


class _Drives(LivingLab):
    tick = TICK


def _cia402() -> Plant:
    speed, place = "drive5.speed", "drive5.val"
    back = "-drive5.val.sign"

    def near(rng: Random) -> str:
        return f"{place} + {rng.uniform(2, 10):.1f} * ({back})"

    return Plant(
        make=_Drives.ready,
        devices={5: (0,)},
        recipes=[
            setter(speed, {0: 6.0}, lambda rng: f"6 * ({back})"),
            setter(place, {0: 12.6}, near, 3.0),
            course(speed, "0", 5.0, 0, place=False, tail=INF, begins=5.0),
            course(place, place, 2.0, 0, place=True, tail=3.0, begins=12.6),
            *steps(speed, (6.0, -6.0), {0: 6.0}, INF, "drive5.speed = 0;"),
            lambda rng: Program(f"{place} = {near(rng)}; {speed} = 6 * ({back});", {0: 12.6}, 0.0, form="plain"),
        ],
        zeros={5: "drive5.speed = 0;"},
        setup="drive5.load = 1;",
        settle=0.6,
        more=(1.5,),
        end=lambda lab: lab.end,
        device=lambda lab: lab.device,
        units={5: None},
        drift=0.02,
        # What is damaged on a CAN bus is lost.
        garbage=("silence",),
    )


PLANTS: dict[str, Callable[[], Plant]] = {
    "bioloid": _bioloid, "nxt": _nxt, "segway": _segway, "p3dx": _p3dx, "cia402": _cia402,
}  # fmt: skip
