"""A limit in SI units is kept by whole counts: what is applied never lies beyond it, and at most one count inside."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import pytest
from bioloid_lab import BAUD
from bioloid_lab import Lab as Bioloid
from cia402_lab import Lab as Drives
from hypothesis import given, settings
from hypothesis import strategies as st
from lab import RobotLab
from nxt_lab import Lab as Nxt
from p3dx_lab import Lab as Pioneer
from segway_lab import Lab as Segway

from urbihw.platforms.limits import LimitSettings, whole_counts
from urbihw_fakes.bioloid import Bioloid as Kit

COUNT = st.floats(-1e6, 1e6)


@given(COUNT, COUNT)
def test_whole_counts_lie_between_the_two_if_any_do(one: float, other: float) -> None:
    low, high = sorted((one, other))
    least, most = whole_counts(low, high)
    assert least == int(least) and most == int(most)
    if math.ceil(low) <= math.floor(high):
        assert low - 1e-3 <= least <= most <= high + 1e-3
        assert least < low + 1 and most > high - 1
    else:
        assert least == most and abs(least - (low + high) / 2) <= 0.5


@given(st.integers(1, 10**6), st.sampled_from([0.001, 0.1, 0.0175, 1 / 3, math.tau / 4096]))
def test_a_limit_of_whole_counts_is_not_rounded_away(count: int, step: float) -> None:
    assert whole_counts(-count * step / step, (count * step) * (1 / step)) == (-count, count)


@pytest.mark.parametrize("ends", [(-math.inf, math.inf), (-math.inf, 2.0), (-2.0, math.inf)])
def test_what_is_not_limited_stays_so(ends: tuple[float, float]) -> None:
    assert whole_counts(*ends) == ends


@dataclass(frozen=True)
class Row:
    """A slot, the limit that acts on it, and what one count of it is."""

    make: Callable[[], RobotLab]
    device: str
    kind: str
    slot: str
    count: float
    least: float
    most: float
    shows: str = ""

    @property
    def place(self) -> str:
        """The object that tells what was applied."""
        return self.shows or self.slot.rpartition(".")[0]


def _made(make: Callable[[], RobotLab], *texts: str) -> Callable[[], RobotLab]:
    def begin() -> RobotLab:
        lab = make()
        for text in texts:
            lab.say(text, 1.0)
        return lab

    return begin


AX = _made(lambda: Bioloid.ready(Kit(servos=(6, 7), sensors=(), baud=BAUD)),
           "motor7.cwLimit = motor7.ccwLimit = 0|;")
X = _made(lambda: Bioloid.ready(Kit.x_series(2, baud=BAUD)),
          "motor1.load = 1|;", "motor2.cwLimit = motor2.ccwLimit = 0|; sleep(500ms); motor2.load = 1|;")
NXT, SEGWAY = _made(Nxt.ready), _made(Segway.ready)
PIONEER = _made(Pioneer.ready, "P3dx.body.load = 1|;")
DRIVE = _made(Drives.ready, "drive5.load = 1|;")

ROWS = {
    "AX-12, joint": Row(AX, "motor6", "position", "motor6.val", math.radians(300) / 1023, 0.01, 2.6),
    "AX-12, wheel": Row(AX, "motor7", "speed", "motor7.speed", 59 * math.tau / 60 / 1023, 0.01, 6.1),
    "AX-12, torque": Row(AX, "motor6", "torque", "", 1.5 / 1023, 0.01, 1.4),
    "X, joint": Row(X, "motor1", "position", "motor1.val", math.tau / 4096, 0.01, 3.1),
    "X, wheel": Row(X, "motor2", "speed", "motor2.speed", 0.229 * math.tau / 60, 0.03, 6.0),
    "NXT": Row(NXT, "C", "speed", "wheelL.speed", 1.0, 1.0, 100.0),
    "Segway, speed": Row(SEGWAY, "base", "speed", "rmp.forwardSpeed", 3.576 / 1176, 0.01, 3.5),
    "Segway, turn": Row(SEGWAY, "base", "turn", "rmp.yawSpeed", 1 / 446.9071, 0.01, 2.0),
    "Pioneer, speed": Row(PIONEER, "robot", "speed", "P3dx.body.x.speed", 0.001, 0.01, 0.7),
    "Pioneer, turn": Row(PIONEER, "robot", "turn", "P3dx.body.yaw.speed", math.radians(1), 0.02, 1.5),
    "CiA 402, position": Row(DRIVE, "drive5", "position", "drive5.val", math.tau / 4096, 0.01, 50.0),
    "CiA 402, speed": Row(DRIVE, "drive5", "speed", "drive5.speed", math.tau / 4096, 0.01, 20.0),
}


def limit(lab: RobotLab, table: Mapping[str, Any]) -> None:
    lab.robot.limits.settings = LimitSettings.of(table)
    lab.robot.limits.send()
    lab.run(0.05)


@pytest.mark.parametrize("name", ROWS)
def test_what_is_applied_is_within_the_limit_by_less_than_two_counts(name: str) -> None:
    row = ROWS[name]
    lab = row.make()

    @settings(max_examples=12, deadline=None)
    @given(st.floats(row.least, row.most))
    def check(most: float) -> None:
        limit(lab, {row.device: {row.kind: [-most, most] if row.kind == "position" else most}})
        if row.kind == "torque":
            lab.say("motor6.torqueLimit = 1.5|;", 0.5)
            assert most - 2 * row.count < lab.number("motor6.torqueLimit") <= most * (1 + 1e-5)
            return
        for sign in (1, -1):
            lab.say(f"{row.slot} = {sign * 10_000}|;", 0.1)
            applied = sign * lab.number(f"{row.place}.applied")
            # The console shows six digits.
            assert most - 2 * row.count < applied <= most * (1 + 1e-5), (most, applied)
        lab.say(f"{row.slot} = 0|;", 0.1)

    check()
