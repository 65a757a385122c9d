"""What must not move the robot: a position that is unknown, a latch that cannot be read, a pause of both processes."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from urbihw.buses import messages as m
from urbihw.buses.authority import MotionAuthority
from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.dynamixel.xseries import XSeries

from .conftest import Rig
from .test_worker import Bench, of

GOAL = (6, "goal_position")


def set_limits(bench: Bench, start: int) -> None:
    bench.tell(m.Limits({GOAL: m.Limit(start - 60, start + 90, 400.0, "limits")}))


def body_position(bench: Bench) -> float:
    """The position of the horn of servo 6 in counts, whether it has power or not."""
    unit = bench.rig.kit[6]
    return unit.motor.position if isinstance(unit, XSeries) else bench.rig.kit.servo(6).position


def lowest_and_fastest(bench: Bench, seconds: float, between: Callable[[], None] = lambda: None) -> tuple[float, float]:
    """The lowest position of the body of servo 6 in counts during some time, and its largest speed in counts/s."""
    lowest, fastest, step = body_position(bench), 0.0, 0.1
    for _ in range(round(seconds / step)):
        before = body_position(bench)
        between()
        bench.run(step)
        here = body_position(bench)
        lowest, fastest = min(lowest, here), max(fastest, abs(here - before) / step)
    return lowest, fastest


@pytest.fixture(params=("ax", "x"))
def limited(request: pytest.FixtureRequest, make_rig: Callable[[Bioloid], Rig]) -> Iterator[Bench]:
    """A new worker at a servo whose torque is on, with a client that writes before anything was read."""
    rig = make_rig(Bioloid(baud=1_000_000) if request.param == "ax" else Bioloid.x_series(18, baud=1_000_000))
    rig.kit[6].registers.put("torque_enable", 1)
    made = Bench(rig, m.Configure(dead_man=0, options={"protocol": 1 if request.param == "ax" else 2}))
    made.run(0.6)
    yield made
    made.close()


def test_a_joint_goes_straight_to_what_a_client_asks_for_while_its_position_is_unknown(limited: Bench) -> None:
    start = limited.rig.kit[6].registers.get("present_position")
    asked = start + 60

    def write() -> None:
        limited.tell(m.Targets({GOAL: asked}))

    set_limits(limited, start)
    write()
    limited.run(0.3)
    limited.tell(m.Watch(6, ("present_position",), 0.0))
    lowest, fastest = lowest_and_fastest(limited, 1.5, write)
    assert lowest >= start - 2
    assert fastest < 500
    assert limited.rig.kit[6].registers.get("present_position") == pytest.approx(asked, abs=4)


def test_a_position_that_nobody_watches_is_read_by_the_worker_while_the_joint_is_on_its_way(limited: Bench) -> None:
    start = limited.rig.kit[6].registers.get("present_position")
    set_limits(limited, start)
    lowest, fastest = lowest_and_fastest(limited, 1.5, lambda: limited.tell(m.Targets({GOAL: start + 60})))
    assert lowest >= start - 2
    assert fastest < 500
    assert limited.rig.kit[6].registers.get("present_position") == pytest.approx(start + 60, abs=4)


@pytest.mark.parametrize("lose", ("unplug", "power"))
def test_a_joint_that_comes_back_starts_from_where_it_is_then(limited: Bench, lose: str) -> None:
    rig, servo = limited.rig, limited.rig.kit[6]
    start = servo.registers.get("present_position")
    set_limits(limited, start)
    limited.tell(m.Watch(6, ("present_position",), 0.0))

    def write() -> None:
        limited.tell(m.Targets({GOAL: start + 60}))

    lowest_and_fastest(limited, 0.5, write)
    if lose == "unplug":
        rig.end.unplug()
    else:
        rig.kit.power_off(rig.clock.now(), 6)
    lowest_and_fastest(limited, 2.0, write)
    if lose == "unplug":
        rig.end.replug()
    else:
        rig.kit.power_on(rig.clock.now(), 6)
    lowest, fastest = lowest_and_fastest(limited, 3.0, write)
    assert lowest >= start - 4
    assert fastest < 500


# ---------------------------------------------------------------- the latch of the emergency stop


def spoil_with_bytes(file: Path) -> None:
    file.write_bytes(b"K\xfcche\n")


def spoil_with_folder(file: Path) -> None:
    file.mkdir()


def spoil_with_pipe(file: Path) -> None:
    os.mkfifo(file)


def spoil_with_length(file: Path) -> None:
    file.write_bytes(b"\xff" * 1_000_000)


def spoil_with_loop(file: Path) -> None:
    file.symlink_to(file)


@pytest.mark.parametrize(
    "spoil", (spoil_with_bytes, spoil_with_folder, spoil_with_pipe, spoil_with_length, spoil_with_loop)
)
def test_a_latch_that_cannot_be_read_holds_until_its_release(
    rig: Rig, tmp_path: Path, spoil: Callable[[Path], None]
) -> None:
    latch = tmp_path / "c.estop"
    spoil(latch)
    bench = Bench(rig, begin=m.Begin(m.Configure(dead_man=0), control=str(tmp_path / "c")))
    heard = bench.run(0.5)
    assert of(m.Latched, heard)
    lines = [one.reason for one in of(m.Refused, heard)]
    assert len(lines) == (spoil is not spoil_with_pipe)
    assert all(str(latch) in line and "release it" in line for line in lines)
    place = rig.kit.servo(6).position
    bench.tell(m.Targets({GOAL: 900}))
    bench.run(0.5)
    assert rig.kit.servo(6).position == pytest.approx(place, abs=0.01)
    bench.tell(m.Release("a test"), m.Targets({GOAL: 900}, epoch=9))
    assert of(m.Refused, bench.run(0.5)) == []
    assert rig.kit.servo(6).registers.get("goal_position") == 900
    assert not os.path.lexists(latch)
    bench.asked_to_end = True
    bench.engine.run()
    bench.close()


def test_a_release_that_cannot_remove_the_latch_says_so(tmp_path: Path) -> None:
    latch = tmp_path / "c.estop"
    (latch / "full").mkdir(parents=True)
    authority = MotionAuthority(0, latch)
    assert authority.latched == "emergency stop"
    assert authority.release("a test") == ("emergency stop",)
    problem = authority.keep_latches()
    assert str(latch) in problem and "remove it" in problem
    assert authority.latched == ""


def test_an_emergency_stop_with_a_pipe_in_place_of_its_file_holds_and_says_so(tmp_path: Path) -> None:
    authority = MotionAuthority(0, tmp_path / "c.estop")
    os.mkfifo(tmp_path / "c.estop")
    authority.latch("a test")
    assert authority.latched
    assert "is not kept" in authority.keep_latches() == authority.unkept
    assert authority.latched == "a test"


# ---------------------------------------------------------------- the silence of the master


@pytest.mark.parametrize("first", ("master", "worker"))
def test_when_both_were_held_the_robot_stops_whichever_wakes_first(rig: Rig, first: str) -> None:
    bench = Bench(rig, m.Configure(dead_man=1.5))
    bench.tell(m.Watch(6, ("present_position",), 0.0))
    for count in range(20):
        bench.tell(m.Heartbeat(), m.Targets({GOAL: 500 + 20 * (count % 2)}))
        bench.run(0.1)
    # Neither gets any time; the master is the first to write, with the earlier movement.
    rig.clock.sleep_until(rig.clock.now() + 4.0)
    if first == "worker":
        bench.run(0.1)
    bench.tell(m.Targets({GOAL: 900}), m.Heartbeat())
    heard = bench.run(0.1)
    place = rig.kit.servo(6).registers.get("present_position")
    for _ in range(10):
        bench.tell(m.Heartbeat(), m.Targets({GOAL: 900}))
        heard += bench.run(0.1)
    assert rig.kit.servo(6).registers.get("present_position") == pytest.approx(place, abs=2)
    assert len(of(m.Stopped, heard)) == (first == "master")
    bench.tell(m.Heartbeat(), m.Targets({GOAL: 600}, epoch=1))
    bench.run(1.0)
    assert rig.kit.servo(6).registers.get("present_position") == pytest.approx(600, abs=4)
    bench.close()


def test_a_pause_within_the_time_is_no_silence(rig: Rig) -> None:
    bench = Bench(rig, m.Configure(dead_man=1.5))
    bench.tell(m.Watch(6, ("present_position",), 0.0))
    bench.run(0.5)
    for _ in range(5):
        rig.clock.sleep_until(rig.clock.now() + 0.9)
        bench.tell(m.Heartbeat(), m.Targets({GOAL: 900}))
        assert of(m.Stopped, bench.run(0.4)) == []
    assert rig.kit.servo(6).registers.get("goal_position") == 900
    bench.close()


def test_a_slow_search_of_the_worker_is_no_silence_of_the_master(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(rig, m.Configure(dead_man=1.5))
    bench.tell(m.Watch(6, ("present_position",), 0.0))
    bench.run(0.3)
    driver = bench.engine._driver
    request = driver.request

    def slow(message: m.Request) -> list[m.FromWorker]:
        bench.tell(m.Heartbeat())
        rig.clock.sleep_until(rig.clock.now() + 3.0)
        return request(message)

    monkeypatch.setattr(driver, "request", slow)
    bench.tell(m.Targets({GOAL: 900}), m.Request(1, "scan"))
    assert of(m.Stopped, bench.run(3.2)) == []
    assert rig.kit.servo(6).registers.get("goal_position") == 900
    bench.close()


def test_targets_of_before_the_silence_are_not_executed_ahead_of_the_stop(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = Bench(rig, m.Configure(dead_man=1.5))
    bench.tell(m.Heartbeat())
    bench.run(0.6)
    driver = bench.engine._driver
    given: list[m.Targets] = []
    targets = driver.targets

    def record(message: m.Targets) -> list[m.FromWorker]:
        given.append(message)
        return targets(message)

    monkeypatch.setattr(driver, "targets", record)
    rig.clock.sleep_until(rig.clock.now() + 4.0)
    bench.tell(m.Targets({GOAL: 900}), m.Request(1, "write", *GOAL, 901))
    heard = bench.run(0.5)
    assert given == []
    assert [reply.ok for reply in of(m.Reply, heard)] == [False]
    assert len(of(m.Stopped, heard)) == 1
    bench.close()
