"""What every platform owes to the client that stops its robot: its body stands, soon, and stays so.

All platforms, all kinds of motion, all events that can be had in simulated time.  A platform takes part by the
``MOTION`` of its ``<name>_lab.py``; see ``motions``.  `make test` plays each fourth case, so that each kind meets two
events, and each event meets each fourth kind; `make long` plays the others.  The rest, with real processes:
``tests/e2e/test_faults.py``.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import pytest
from motions import DEAD_MAN, Motion, Scene

from urbihw.platforms import folders

STAY, STAY_LONG = 2.0, 5.0
"""Seconds for which a body that stands is looked at, in `make test` and in `make long`."""
GAP = 0.3
"""Seconds in which a worker is replaced."""
LOST = 1.0
"""Seconds without a link."""
FEWER = 4
"""One case in so many is no long test."""
FASTER = 1.1
"""How much faster than itself a movement may be that goes on after a lost link."""
_ENDED = re.compile(r"!!! .* was stopped after this statement had begun: (.*)")
_UNWRITTEN = re.compile(r"warning: \w+(, \w+)* of motor \d+ not written: ")
"""A write that a switch of the mode was waiting for is refused: the client hears of it, beside the reason for the
end."""
_HELD = re.compile(r"!!! .* is held by an emergency stop \(.+\): release it first")


def motion_of(platform: str) -> Motion:
    """What a platform says of its motion."""
    found: Motion = importlib.import_module(f"{platform}_lab").MOTION
    return found


Test = TypeVar("Test", bound=Callable[..., None])


def every_motion(turn: int) -> Callable[[Test], Test]:
    """Give a test each kind of motion of each platform; ``turn`` is its number, and chooses which are long tests."""
    kinds = [
        (platform, name, motion, kind)
        for platform in (folder.name for folder in folders())
        for motion in [motion_of(platform)]
        for name, kind in motion.kinds.items()
    ]
    cases = [
        pytest.param(
            (motion, kind), id=f"{platform}-{name.replace(' ', '-')}",
            marks=pytest.mark.long if (index + turn) % FEWER else (),
        )
        for index, (platform, name, motion, kind) in enumerate(kinds)
    ]  # fmt: skip
    return pytest.mark.parametrize("scene", cases, indirect=True)


@pytest.fixture
def scene(request: pytest.FixtureRequest, tmp_path: Path) -> Scene:
    """Each kind of motion of each platform, ready to begin."""
    motion, kind = request.param
    stay = STAY_LONG if request.node.get_closest_marker("long") else STAY
    return Scene(motion, kind, tmp_path, request.node.user_properties, stay)


def stands(scene: Scene, since: float, more: float = 0.0) -> None:
    """The body stands within the time of its platform (and ``more``) since then, and stays so."""
    within = more + scene.motion.standstill
    scene.run(max(0.0, since + within - scene.now()) + scene.stay)
    stood = max(scene.moved_last(), since)
    scene.measured.append(("standstill", round(stood - since, 3)))
    assert stood - since <= within, f"it moves {stood - since:.2f} s after the event"
    assert scene.drift(stood) <= scene.motion.drift


def errors_of(scene: Scene) -> list[str]:
    """The errors that the client has read, without the ways to them."""
    return [line for line in scene.heard().split("\n") if "!!!" in line and "called from" not in line]


def complains(scene: Scene, reason: str) -> None:
    """The client reads why its statement ended, once; it reads nothing if that was over before."""
    errors = errors_of(scene)
    ended = [found[1] for line in errors if (found := _ENDED.fullmatch(line))]
    if scene.kind.complains:
        assert len(ended) == 1 and reason in ended[0], errors
    else:
        assert [line for line in errors if not _UNWRITTEN.search(line)] == []


def goes_again(scene: Scene) -> None:
    """A statement that begins now moves the body."""
    scene.lab.look(scene.motion.revive)
    scene.run(1.0)
    scene.heard()
    scene.go(scene.kind.again)
    moves = scene.gets_faster(scene.kind.goes, max(scene.kind.lead, 3.0))
    assert moves, f"it does not move again: {scene.heard()}"


@every_motion(0)
def test_a_stop(scene: Scene) -> None:
    scene.begin()
    since = scene.now()
    scene.stop()
    stands(scene, since)
    complains(scene, "stop asked by")
    goes_again(scene)


@every_motion(1)
def test_a_stop_at_once(scene: Scene) -> None:
    scene.go()
    since = scene.now()
    scene.stop()
    stands(scene, since)
    assert scene.peak(since) <= scene.motion.rest, "it moved after the stop"


@every_motion(2)
def test_an_emergency_stop_holds_until_it_is_released(scene: Scene) -> None:
    scene.begin()
    since = scene.now()
    scene.estop()
    stands(scene, since)
    complains(scene, "emergency stop by")
    assert scene.lab.look(f"{scene.motion.slot}.estop") == "true"
    before = scene.now()
    scene.go()
    scene.run(1.0)
    errors = errors_of(scene)
    assert scene.kind.remote or (errors and all(_HELD.fullmatch(line) for line in errors)), errors
    scene.lab.look(f"{scene.motion.slot}.estop = false")
    scene.run(1.0)
    assert scene.peak(before) <= scene.motion.rest
    assert scene.lab.look(f"{scene.motion.slot}.estop") == "false"
    if scene.kind.remote:
        # It is a program that began before, and has no order since.
        scene.go()
        scene.run(1.0)
        assert scene.peak(before) <= scene.motion.rest
        scene.lab.look(f"{scene.motion.slot}.rearm")
    goes_again(scene)


@every_motion(3)
def test_a_kernel_that_stands_still(scene: Scene) -> None:
    scene.watch_master()
    scene.begin()
    since = scene.now()
    scene.silence(3.0)
    stands(scene, since, DEAD_MAN)
    complains(scene, "no sign of life from the master")
    goes_again(scene)


@every_motion(4)
def test_a_client_that_is_gone(scene: Scene) -> None:
    scene.begin()
    since = scene.now()
    scene.client_gone()
    stands(scene, since)
    scene.new_client()
    goes_again(scene)


@every_motion(5)
def test_a_worker_that_was_killed(scene: Scene) -> None:
    scene.begin()
    since = scene.now()
    scene.worker_killed(GAP)
    stands(scene, since, GAP)
    complains(scene, "it was killed; another one is started")
    goes_again(scene)


@every_motion(6)
def test_a_link_that_was_lost(scene: Scene) -> None:
    scene.begin()
    lost = scene.now()
    before = scene.pace(lost - scene.kind.lead)
    scene.link_lost(LOST)
    back = scene.now()
    if scene.kind.live:
        scene.run(STAY_LONG)
        after = scene.pace(back)
        scene.measured.append(("faster", round(after / before, 3)))
        assert after <= FASTER * before + scene.motion.grain
    else:
        stands(scene, back)
    goes_again(scene)


@every_motion(7)
def test_a_stop_while_the_link_is_lost(scene: Scene) -> None:
    scene.begin()
    scene.link_lost(LOST, scene.stop)
    stands(scene, scene.now())
