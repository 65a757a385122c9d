"""Limits, thresholds and stops between a master and a servo, judged at the servo: its registers and its body."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from urbihw.buses import messages as m
from urbihw.buses.authority import MotionAuthority
from urbihw.buses.errors import BusTimeout, DeviceRefused, LinkGone
from urbihw.buses.gate import NO_ORIGIN

from .conftest import Rig
from .test_worker import Bench, of

ITEM = (6, "torque_limit")
GOAL = (6, "goal_position")
SPEED, CW, CCW = "moving_speed", "cw_angle_limit", "ccw_angle_limit"


@pytest.fixture
def bench(rig: Rig) -> Iterator[Bench]:
    """A worker that has found its servos and reads the position of one."""
    made = Bench(rig, m.Configure(dead_man=0))
    made.tell(m.Watch(6, ("present_position", "present_temperature"), 0.0))
    made.run(0.8)
    yield made
    made.close()


def place(bench: Bench) -> float:
    return bench.rig.kit.servo(6).position


def hot(restored: int) -> m.Threshold:
    return m.Threshold(
        6, "present_temperature", 10.0, "limits.motor6.temperature", targets=((ITEM[1], 200),),
        restored=((ITEM[1], restored),),
    )  # fmt: skip


@pytest.mark.parametrize(("limit", "becomes"), ((m.Limit(0, 500), 500), (m.Limit(0, 1023), 900), (None, 900)))
def test_what_a_removed_threshold_had_changed_is_restored_within_the_new_limits(
    rig: Rig, limit: m.Limit | None, becomes: int
) -> None:
    bench = Bench(rig, m.Configure(dead_man=0))
    bench.tell(m.Limits({}, (hot(900),)), m.Watch(6, ("present_temperature",), 0.0))
    bench.run(0.8)
    registers = rig.kit.servo(6).registers
    assert registers.get("torque_limit") == 200
    bench.tell(m.Limits({} if limit is None else {ITEM: limit}))
    bench.run(0.3)
    assert registers.get("torque_limit") == becomes
    bench.close()


def test_a_stop_ends_a_slow_movement_which_the_worker_itself_leads(bench: Bench) -> None:
    bench.tell(m.Limits({GOAL: m.Limit(0, 1023, 100.0, "limits")}), m.Targets({GOAL: 900}))
    bench.run(1.0)
    assert 560 < place(bench) < 640
    bench.tell(m.Stop(1))
    bench.run(0.3)
    stood = place(bench)
    bench.run(2.0)
    assert place(bench) == pytest.approx(stood, abs=2)


def test_a_stop_of_another_device_leaves_a_slow_movement(bench: Bench) -> None:
    bench.tell(m.Limits({GOAL: m.Limit(0, 1023, 100.0, "limits")}), m.Targets({GOAL: 900}))
    bench.run(1.0)
    bench.tell(m.Stop(0, "a test", (7,)))
    bench.run(5.0)
    assert place(bench) == pytest.approx(900, abs=2)


def test_a_request_that_a_stop_overtakes_within_a_tick_is_refused(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    driver = bench.engine._driver
    tick = driver.tick

    def tick_with_a_stop(
        now: float, meanwhile: Callable[[], None], urgent: Callable[[], bool] = lambda: False
    ) -> list[m.FromWorker]:
        bench.tell(m.Stop(1))
        monkeypatch.undo()
        assert urgent()
        return tick(now, meanwhile, urgent)

    stood = place(bench)
    bench.tell(m.Request(1, "write", *GOAL, 900))
    monkeypatch.setattr(driver, "tick", tick_with_a_stop)
    heard = bench.run(1.0)
    assert [reply.ok for reply in of(m.Reply, heard)] == [False]
    assert place(bench) == pytest.approx(stood, abs=1)


@pytest.mark.parametrize("verb", ("write", "write_all"))
def test_a_request_is_clamped_as_a_target(bench: Bench, verb: str) -> None:
    bench.tell(m.Limits({GOAL: m.Limit(400, 600)}))
    written = m.Request(1, "write", *GOAL, 900)
    if verb == "write_all":
        written = m.Request(1, "write_all", 6, value=((GOAL[1], 900),))
    bench.tell(written)
    heard = bench.run(2.0)
    assert [reply.ok for reply in of(m.Reply, heard)] == [True]
    assert place(bench) == pytest.approx(600, abs=2)


def holding(level: float, hysteresis: float = 0.0) -> m.Threshold:
    return m.Threshold(6, "present_temperature", level, "limits.motor6.temperature", hysteresis=hysteresis, holds=True)


def test_a_device_that_is_too_hot_stops_and_stays_until_it_is_colder_by_the_hysteresis(bench: Bench) -> None:
    servo = bench.rig.kit.servo(6)
    servo.heat(40.0)
    bench.tell(m.Limits({GOAL: m.Limit(0, 1023, 100.0, "limits")}, (holding(60.0, 5.0),)), m.Targets({GOAL: 900}))
    bench.run(1.0)
    assert place(bench) > 560
    servo.heat(61.0)
    bench.run(0.2)
    stood = place(bench)
    heard = bench.run(1.0)
    assert place(bench) == pytest.approx(stood, abs=2)
    servo.heat(57.0)
    bench.run(0.2)
    bench.tell(m.Targets({GOAL: 900}), m.Request(1, "write", *GOAL, 900))
    heard = bench.run(1.0)
    assert [refused.item for refused in of(m.Refused, heard)] == [GOAL[1]]
    assert [reply.ok for reply in of(m.Reply, heard)] == [False]
    assert place(bench) == pytest.approx(stood, abs=2)
    servo.heat(54.0)
    bench.run(0.2)
    bench.tell(m.Targets({GOAL: 900}))
    bench.run(1.0)
    assert place(bench) > stood + 50


def test_an_emergency_stop_stops_again_what_another_master_moves(bench: Bench) -> None:
    for item in ("cw_limit", "ccw_limit"):
        bench.rig.kit.servo(6).registers.put(item, 0)
    bench.tell(m.Request(1, "scan"))
    bench.run(1.0)
    bench.tell(m.EmergencyStop("a test"))
    bench.run(0.5)
    bench.rig.kit.servo(6).registers.put("moving_speed", 500)
    bench.run(0.5)
    assert bench.rig.kit.servo(6).registers.get("moving_speed") == 0


def test_the_epoch_never_goes_back() -> None:
    authority = MotionAuthority(5)
    authority.advance(3)
    assert authority.epoch == 5
    assert authority.refusal(4) and not authority.refusal(5)
    authority.advance()
    assert authority.epoch == 6 and authority.refusal(5)


def wheel(rig: Rig, number: int, speed: int) -> None:
    """Let a servo turn, as somebody else has told it."""
    for item in ("cw_limit", "ccw_limit"):
        rig.kit.servo(number).registers.put(item, 0)
    rig.kit.servo(number).registers.put("torque_enable", 1)
    rig.kit.servo(number).registers.put("moving_speed", speed)


def test_a_wheel_that_turns_when_the_worker_comes_is_stopped(rig: Rig) -> None:
    wheel(rig, 3, 500)
    bench = Bench(rig, m.Configure(dead_man=0))
    heard = bench.run(1.0)
    assert rig.kit.servo(3).registers.get("moving_speed") == 0
    assert [stopped.reason for stopped in of(m.Stopped, heard)] == ["3 moved when the link was opened"]
    bench.close()


def test_another_robot_at_the_same_link_does_not_go_on_with_what_was_begun(bench: Bench) -> None:
    bench.tell(m.Limits({GOAL: m.Limit(0, 1023, 100.0, "limits")}), m.Targets({GOAL: 900}))
    bench.run(1.0)
    bench.rig.end.unplug()
    bench.run(0.3)
    bench.engine._driver.identity = "another"
    bench.engine._identity = "the first"
    bench.rig.end.replug()
    heard: list[m.FromWorker] = []
    for _ in range(20):
        bench.tell(m.Targets({GOAL: 900}))
        heard += bench.run(0.1)
    (stopped,) = of(m.Stopped, heard)
    assert stopped.reason.startswith("another robot answers")
    stood = place(bench)
    bench.tell(m.Targets({GOAL: 900}))
    bench.run(1.0)
    assert place(bench) == pytest.approx(stood, abs=2)


@pytest.mark.parametrize("silent_s", (0.02, 1.0))
def test_a_joint_that_answers_again_holds_where_it_is(bench: Bench, silent_s: float) -> None:
    """It was stopped while it was silent for a moment, or it was lost."""
    bench.tell(m.Targets({(6, "moving_speed"): 60, GOAL: 900}))
    bench.run(0.5)
    assert place(bench) < 700
    bench.rig.kit.faults.start("silence", 6)
    if silent_s < 0.1:
        bench.run(0.02)
        bench.tell(m.Stop(1))
    bench.run(silent_s)
    bench.rig.kit.faults.stop("silence", 6)
    bench.run(1.5)
    stood = place(bench)
    bench.run(1.0)
    assert place(bench) == pytest.approx(stood, abs=2) and stood < 850


def test_a_joint_that_gets_too_hot_on_its_way_stops_there(bench: Bench) -> None:
    servo = bench.rig.kit.servo(6)
    servo.heat(40.0)
    bench.tell(m.Limits({}, (holding(60.0),)), m.Targets({(6, "moving_speed"): 60, GOAL: 900}))
    bench.run(0.5)
    servo.heat(61.0)
    bench.run(0.2)
    stood = place(bench)
    bench.run(1.0)
    assert place(bench) == pytest.approx(stood, abs=2) and stood < 850


def test_targets_of_before_a_stop_stay_refused(bench: Bench) -> None:
    bench.tell(m.Targets({GOAL: 900}), m.Stop(1))
    bench.run(0.1)
    stood = place(bench)
    bench.tell(m.Targets({GOAL: 900}))
    bench.run(1.0)
    assert place(bench) == pytest.approx(stood, abs=2)


@pytest.mark.parametrize(
    ("before", "meanwhile", "after"),
    [
        pytest.param(0, None, 0, id="off before"),
        pytest.param(150, None, 150, id="lower before"),
        pytest.param(600, None, 600, id="between"),
        pytest.param(1023, None, 900, id="full"),
        pytest.param(600, 0, 0, id="off meanwhile"),
    ],
)
def test_a_threshold_gives_back_what_it_has_taken_and_no_more(
    bench: Bench, before: int, meanwhile: int | None, after: int
) -> None:
    servo = bench.rig.kit.servo(6)
    servo.heat(40.0)
    reduces = m.Threshold(
        6, "present_temperature", 60.0, "limits.motor6.temperature", hysteresis=5.0, targets=((ITEM[1], 200),),
        restored=((ITEM[1], 900),),
    )  # fmt: skip
    bench.tell(m.Limits({}, (reduces,)), m.Targets({ITEM: before}))
    bench.run(0.1)
    servo.heat(61.0)
    bench.run(0.1)
    assert servo.registers.get("torque_limit") == min(before, 200)
    if meanwhile is not None:
        bench.tell(m.Request(1, "write", 6, ITEM[1], meanwhile))
        bench.run(0.1)
    servo.heat(40.0)
    bench.run(0.2)
    assert servo.registers.get("torque_limit") == after


@pytest.mark.parametrize("error", [LinkGone("unplugged"), BusTimeout("no answer"), DeviceRefused(6, 1, "no")])
def test_a_failure_that_a_driver_lets_out_opens_the_link_anew_and_the_worker_goes_on(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    def fail(*_: object) -> list[m.FromWorker]:
        monkeypatch.undo()
        raise error

    monkeypatch.setattr(bench.engine._driver, "tick", fail)
    heard = bench.run(1.5)
    states = [(each.up, each.reason) for each in of(m.LinkState, heard)]
    assert states == [(False, str(error)), (True, "")]


def test_a_target_that_would_move_the_robot_and_that_no_client_has_asked_for_is_refused(bench: Bench) -> None:
    before = place(bench)
    bench.tell(m.Targets({GOAL: 900, ITEM: 700}, settings=frozenset({GOAL, ITEM})))
    heard = bench.run(1.0)
    assert place(bench) == pytest.approx(before, abs=2)
    # A setting is written, whoever asks.
    assert bench.rig.kit.servo(6).registers.get("torque_limit") == 700
    assert [(each.device, each.item, each.reason) for each in of(m.Refused, heard)] == [(*GOAL, NO_ORIGIN)]


def test_a_request_that_would_move_the_robot_and_that_no_client_has_asked_for_is_refused(bench: Bench) -> None:
    before = place(bench)
    bench.tell(
        m.Request(1, "write", *GOAL, 900, setting=True), m.Request(2, "write", *ITEM, 700, setting=True),
        m.Request(3, "read", *GOAL, setting=True),
    )  # fmt: skip
    replies = {each.reply_id: each.error for each in of(m.Reply, bench.run(1.0))}
    assert replies == {1: NO_ORIGIN, 2: "", 3: ""}
    assert place(bench) == pytest.approx(before, abs=2)


@pytest.mark.parametrize(
    ("steps", "speed"),
    [
        (((SPEED, 0), (CW, 0), (CCW, 0)), 100),
        (((SPEED, 0),), 100),
        (((CW, 0), (CCW, 0), (SPEED, 0)), 0),
        (((CW, 0), (CCW, 0), (SPEED, 0), (CCW, 1023)), 100),
    ],
)
def test_a_0_is_rest_only_behind_the_writes_that_make_a_wheel(
    bench: Bench, steps: tuple[tuple[str, int], ...], speed: int
) -> None:
    bench.tell(m.Limits({(6, SPEED): m.Limit(1, 100)}), m.Request(1, "write_all", 6, value=steps))
    assert [reply.error for reply in of(m.Reply, bench.run(0.3))] == [""]
    assert bench.rig.kit.servo(6).registers.get(SPEED) == speed


def test_a_driver_is_told_the_pace_of_a_target_that_new_limits_change(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.tell(m.Limits({GOAL: m.Limit(0, 1023, 100.0)}), m.Targets({GOAL: 900}))
    bench.run(1.0)
    told: list[m.Targets] = []

    def take(message: m.Targets) -> list[m.FromWorker]:
        told.append(message)
        return []

    monkeypatch.setattr(bench.engine._driver, "targets", take)
    bench.tell(m.Limits({GOAL: m.Limit(0, 530, 50.0)}))
    bench.run(0.1)
    assert (told[0].values, told[0].rates) == ({GOAL: 530}, {GOAL: 50.0})
