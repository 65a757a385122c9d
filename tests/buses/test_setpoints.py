"""What lies between the targets that are asked for and those that a driver is given."""

from __future__ import annotations

import math
from typing import Any

import pytest

from urbihw.buses.driver import Driver
from urbihw.buses.messages import Limit, Limited
from urbihw.buses.setpoints import CATCH_UP_S, LIVE_TIMEOUT_S, LONGEST_STEP_S, Key, SetPoints

KEY: Key = (6, "goal_position")
SPEED: Key = (6, "goal_velocity")
WHEEL: Key = (7, "moving_speed")
TICK = 0.01


class Rig(Driver):
    """Set-points over devices whose places a test says; time goes on by ticks."""

    exclusive = frozenset({"goal_position", "goal_velocity"})

    def __init__(self) -> None:
        self.places: dict[Key, float] = {KEY: 512.0}
        self.points = SetPoints(self)
        self.now = 100.0
        self.leash = math.inf
        self.goal: float | None = None

    def pose(self, device: Any, item: str) -> float | None:
        return self.places.get((device, item))

    def reach(self, device: Any, item: str, pace: float, now: float) -> tuple[float, float] | None:
        """With a leash, the goal is so far ahead of the place at most."""
        return None if self.leash == math.inf else (self.places[KEY] - self.leash, self.places[KEY] + self.leash)

    def joints(self) -> list[Key]:
        return [KEY]

    def standing_goal(self, device: Any, item: str) -> float | None:
        return self.goal if (device, item) == KEY else None

    def signed(self, device: Any, item: str, raw: Any) -> float:
        """A wheel keeps its sign in bit 10, as that of an AX does; a place is what it is."""
        return float(raw) if item != WHEEL[1] else float(-(raw & 1023) if raw & 1024 else raw)

    def raw_of(self, device: Any, item: str, signed: float) -> Any:
        raw = round(abs(signed) if item == WHEEL[1] else signed)
        return raw | 1024 if item == WHEEL[1] and raw and signed < 0 else raw

    def take(self, value: Any, key: Key = KEY) -> Any:
        """Ask for one target: what the driver gets at once, None for nothing."""
        return self.points.accept_targets({key: value}, self.now).get(key)

    def step(self, key: Key = KEY) -> Any:
        self.now += TICK
        return self.points.next_targets(self.now).get(key)

    def steps(self, seconds: float, key: Key = KEY) -> list[Any]:
        """What the driver gets in some time."""
        return [given for _ in range(round(seconds / TICK)) if (given := self.step(key)) is not None]


@pytest.fixture
def rig() -> Rig:
    return Rig()


# ---------------------------------------------------------------- limits


def test_without_limits_all_passes_as_it_is(rig: Rig) -> None:
    for value in (0, 1023, -5, 1.5, True, "text", None, (1, 2)):
        assert rig.points.accept_targets({KEY: value}, rig.now) == {KEY: value}
    assert rig.step() is None
    assert rig.points.pop_limited() == []


def test_a_limit_clamps_and_tells_once_until_it_ends(rig: Rig) -> None:
    rig.points.set_limits({KEY: Limit(300, 700, name="joint range")}, rig.now)
    assert [rig.take(value) for value in (500, 800, 900, 600, 100)] == [500, 700, 700, 600, 300]
    assert rig.points.pop_limited() == [
        Limited(*KEY, 800, 700, "joint range"),
        Limited(*KEY, 600, 600, ""),
        Limited(*KEY, 100, 300, "joint range"),
    ]
    assert rig.points.pop_limited() == []
    rig.points.set_limits({}, rig.now)
    assert rig.take(800) == 800


def test_limits_of_others_do_not_count(rig: Rig) -> None:
    rig.points.set_limits({(5, KEY[1]): Limit(300, 700), (6, "torque_limit"): Limit(300, 700)}, rig.now)
    assert rig.take(900) == 900


def test_a_limit_of_a_speed_knows_the_sign_bit(rig: Rig) -> None:
    rig.points.set_limits({WHEEL: Limit(-100, 100, name="speed")}, rig.now)
    assert [rig.take(value, WHEEL) for value in (50, 500, 1024 + 50, 1024 + 500)] == [50, 100, 1024 + 50, 1024 + 100]


# ---------------------------------------------------------------- rates


def test_a_rate_is_kept_from_where_the_device_is(rig: Rig) -> None:
    rig.points.set_limits({KEY: Limit(rate=1000.0)}, rig.now)
    assert rig.take(612) is None
    given = rig.steps(0.2)
    assert given == [522, 532, 542, 552, 562, 572, 582, 592, 602, 612]


def test_a_new_target_under_way_turns_it_round(rig: Rig) -> None:
    rig.points.set_limits({KEY: Limit(rate=1000.0)}, rig.now)
    rig.take(612)
    rig.steps(0.05)
    assert rig.take(512) is None
    assert rig.steps(0.2) == [552, 542, 532, 522, 512]


def test_a_target_that_is_reached_already_goes_at_once(rig: Rig) -> None:
    rig.points.set_limits({KEY: Limit(rate=1000.0)}, rig.now)
    assert rig.take(512) == 512
    assert rig.step() is None


def test_a_speed_begins_at_rest_and_passes_zero_at_its_rate(rig: Rig) -> None:
    rig.points.set_limits({WHEEL: Limit(rate=1000.0)}, rig.now)
    rig.take(20, WHEEL)
    assert rig.steps(0.1, WHEEL) == [10, 20]
    rig.take(1024 + 20, WHEEL)
    assert rig.steps(0.1, WHEEL) == [10, 0, 1024 + 10, 1024 + 20]


def test_a_late_tick_makes_no_large_step(rig: Rig) -> None:
    rig.points.set_limits({KEY: Limit(rate=1000.0)}, rig.now)
    rig.take(1000)
    rig.now += 0.3
    assert rig.step() == 512 + round(1000 * LONGEST_STEP_S)


def test_a_movement_keeps_its_rate_where_each_tick_is_slow(rig: Rig) -> None:
    rig.points.set_limits({KEY: Limit(rate=1000.0)}, rig.now)
    rig.take(1000)
    given = 0
    for _ in range(4):
        rig.now += 0.09
        given = rig.step()
    assert given == 512 + round(1000 * (LONGEST_STEP_S + 3 * 0.1))


def test_a_stop_ends_what_is_under_way(rig: Rig) -> None:
    rig.points.set_limits({KEY: Limit(rate=1000.0)}, rig.now)
    rig.take(1000)
    rig.steps(0.05)
    rig.points.drop_courses((5, 7))
    assert rig.step() is not None
    rig.points.drop_courses((6,))
    assert rig.steps(0.1) == []
    rig.take(1000)
    rig.points.drop_courses()
    assert rig.steps(0.1) == []


# ---------------------------------------------------------------- devices that come back


def swing(rig: Rig, seconds: float, amplitude: float = 100.0, period: float = 2.0) -> list[Any]:
    """Ask for a swing, a target a tick; what the driver gets in the ticks themselves."""
    given = []
    for _ in range(round(seconds / TICK)):
        step = rig.step()
        at_once = rig.take(round(512 + amplitude * math.sin(2 * math.pi * rig.now / period)))
        given += [each for each in (step, at_once) if each is not None]
    return given


def test_a_device_that_is_back_is_led_to_its_course_no_faster_than_that_goes(rig: Rig) -> None:
    swing(rig, 4.0)
    fastest = 100 * math.pi
    rig.places[KEY] = 300.0
    rig.points.resume_courses(6, rig.now)
    given = swing(rig, 2.0)
    assert given[0] == pytest.approx(300, abs=fastest * TICK + 2)
    steps = [abs(later - earlier) for earlier, later in zip(given, given[1:], strict=False)]
    assert max(steps) <= 1.2 * fastest * TICK + 1
    assert rig.points.next_targets(rig.now + TICK) == {}


def test_a_device_whose_course_has_no_speed_is_led_there_in_about_a_second(rig: Rig) -> None:
    rig.take(612)
    rig.places[KEY] = 512.0
    rig.points.resume_courses(6, rig.now)
    given = []
    for _ in range(round(3 * CATCH_UP_S / TICK)):
        given += [each for each in (rig.step(), rig.take(612)) if each is not None]
    assert given[0] == pytest.approx(513, abs=1)
    assert given == sorted(given)
    assert max(later - earlier for earlier, later in zip(given, given[1:], strict=False)) <= 2


def test_a_course_that_is_no_longer_live_ends(rig: Rig) -> None:
    swing(rig, 1.0)
    rig.places[KEY] = 300.0
    rig.points.resume_courses(6, rig.now)
    # There are no more requests: it is led on as long as the movement may still go on, then it stays where it is.
    given = rig.steps(2.0)
    assert 1 <= len(given) <= round(LIVE_TIMEOUT_S / TICK) + 1
    assert given[-1] < 512
    assert rig.take(600) == 600


def test_a_course_that_ended_before_is_not_taken_up(rig: Rig) -> None:
    rig.take(612)
    rig.now += LIVE_TIMEOUT_S + 2 * TICK
    rig.points.resume_courses(None, rig.now)
    assert rig.steps(1.0) == []


def test_what_is_no_place_is_not_led_anywhere(rig: Rig) -> None:
    rig.take(200, WHEEL)
    rig.points.resume_courses(7, rig.now)
    assert rig.steps(0.2, WHEEL) == []


def test_a_speed_that_was_still_rising_when_its_device_was_lost_is_not_taken_up_by_itself(rig: Rig) -> None:
    rig.points.set_limits({WHEEL: Limit(rate=100.0)}, rig.now)
    rig.take(1000, WHEEL)
    assert rig.steps(0.5, WHEEL)
    rig.points.resume_courses(WHEEL[0], rig.now)
    assert rig.steps(0.5, WHEEL) == []


def test_a_movement_whose_writer_was_held_up_is_led_back_to_its_course(rig: Rig) -> None:
    swing(rig, 3.0)
    rig.now += 1.0
    rig.places[KEY] = 512.0
    assert rig.points.accept_targets({KEY: 600}, rig.now, rig.now, {KEY}) == {}
    first, second, *_ = rig.steps(0.1)
    assert 512 < first < second < 540


def test_a_program_that_writes_now_and_then_is_never_held_up(rig: Rig) -> None:
    for value in (500, 600, 500):
        rig.now += 1.0
        assert rig.points.accept_targets({KEY: value}, rig.now, rig.now, {KEY}) == {KEY: value}


def test_only_the_device_that_is_back_is_led(rig: Rig) -> None:
    other: Key = (5, KEY[1])
    rig.places[other] = 100.0
    rig.take(612)
    rig.take(300, other)
    rig.points.resume_courses(5, rig.now)
    rig.now += TICK
    assert set(rig.points.next_targets(rig.now)) == {other}


def test_the_rate_of_the_settings_counts_on_the_way_back_too(rig: Rig) -> None:
    rig.points.set_limits({KEY: Limit(rate=50.0)}, rig.now)
    rig.take(512)
    rig.places[KEY] = 300.0
    rig.points.resume_courses(6, rig.now)
    given = []
    for _ in range(100):
        given.append(rig.step())
        rig.take(512)
    assert given[-1] == pytest.approx(350, abs=1)


# ---------------------------------------------------------------- positions that are not known yet


def test_a_way_waits_for_the_position_and_then_leads_to_the_newest_target(rig: Rig) -> None:
    rig.places[KEY] = math.nan
    rig.points.set_limits({KEY: Limit(300, 700, 1000.0)}, rig.now)
    assert rig.take(800) is None
    assert rig.steps(0.5) == []
    assert rig.take(550) is None
    assert rig.steps(0.1) == []
    rig.places[KEY] = 512
    given = rig.steps(0.2)
    assert given == [522, 532, 542, 550]


def test_a_single_write_waits_for_the_position_too_and_a_stop_ends_the_wait(rig: Rig) -> None:
    rig.places[KEY] = math.nan
    rig.points.set_limits({KEY: Limit(rate=1000.0)}, rig.now)
    assert rig.points.start_ramp(*KEY, 532, rig.now) == 532
    assert rig.steps(0.1) == []
    rig.points.drop_courses()
    rig.places[KEY] = 512
    assert rig.steps(0.1) == []
    assert rig.points.start_ramp(*KEY, 532, rig.now) == 532
    assert rig.steps(0.1) == [522, 532]


def test_a_movement_whose_device_is_back_waits_for_its_position(rig: Rig) -> None:
    rig.points.set_limits({KEY: Limit(rate=1000.0)}, rig.now)
    rig.take(700)
    rig.steps(0.05)
    rig.places[KEY] = math.nan
    rig.points.resume_courses(KEY[0], rig.now)
    assert rig.steps(0.1) == []
    rig.places[KEY] = 400
    assert rig.take(420) is None
    given = rig.steps(0.2)
    assert min(given) >= 400 and max(given) == 420 == given[-1]


def test_new_limits_move_no_joint_that_stands_since_its_device_came_back(rig: Rig) -> None:
    rig.leash = 20.0
    rig.points.set_limits({KEY: Limit(rate=1000.0)}, rig.now)
    rig.take(900)
    rig.steps(0.1)
    rig.now += LIVE_TIMEOUT_S + 0.1
    rig.points.resume_courses(KEY[0], rig.now)
    assert rig.steps(0.5) == []
    for rate in (500.0, math.inf, 200.0):
        rig.points.set_limits({KEY: Limit(rate=rate)}, rig.now)
        assert rig.steps(0.5) == []


def test_a_speed_ends_the_way_to_a_place(rig: Rig) -> None:
    rig.points.set_limits({KEY: Limit(rate=1000.0)}, rig.now)
    rig.take(900)
    assert len(rig.steps(0.1)) > 5
    assert rig.take(0, SPEED) == 0
    assert rig.steps(0.5) == []
    rig.points.set_limits({KEY: Limit(rate=500.0)}, rig.now)
    assert rig.steps(0.5) == []


def test_what_is_no_number_ends_the_way_to_a_place_too(rig: Rig) -> None:
    rig.points.set_limits({KEY: Limit(rate=1000.0)}, rig.now)
    rig.take(900)
    assert rig.take(True, SPEED) is True
    assert rig.steps(0.5) == []


def test_a_speed_that_is_written_once_ends_the_way_to_a_place(rig: Rig) -> None:
    rig.points.set_limits({KEY: Limit(rate=1000.0)}, rig.now)
    rig.take(900)
    assert rig.points.clamp_value(*SPEED, 0) == 0
    assert rig.steps(0.5) == []


def test_a_new_limit_acts_on_a_joint_that_is_on_its_way(rig: Rig) -> None:
    assert rig.take(900) == 900
    rig.places[KEY] = 550.0
    assert rig.points.set_limits({KEY: Limit(rate=100.0)}, rig.now) == {}
    way = rig.steps(1.0)
    assert 550 <= way[0] <= 550 + 100 * LIVE_TIMEOUT_S + 1
    assert way[-1] == pytest.approx(way[0] + 100, abs=3)
    # One that has arrived stays.
    rig.points.drop_courses()
    assert rig.take(700) is None
    rig.steps(9.0)
    rig.places[KEY] = 699.0
    rig.points.set_limits({KEY: Limit(rate=90.0)}, rig.now)
    assert rig.steps(0.5) == []


def test_a_wait_for_a_position_ends_with_its_writer_when_the_device_comes_back(rig: Rig) -> None:
    rig.places[KEY] = math.nan
    rig.points.set_limits({KEY: Limit(rate=1000.0)}, rig.now)
    rig.take(700)
    rig.steps(1.0)
    rig.points.resume_courses(KEY[0], rig.now)
    rig.places[KEY] = 512
    assert rig.steps(0.5) == []


def test_what_is_not_a_number_is_left_to_the_driver_to_refuse(rig: Rig) -> None:
    rig.points.set_limits({KEY: Limit(300, 700, 1000.0)}, rig.now)
    rig.take(600)
    assert math.isnan(rig.take(math.nan))
    assert rig.steps(0.2)[-1] == 600


def test_two_ticks_at_one_time_after_the_limits_have_gone(rig: Rig) -> None:
    rig.points.set_limits({KEY: Limit(rate=1000.0)}, rig.now)
    rig.take(600)
    rig.step()
    rig.points.set_limits({}, rig.now)
    assert rig.points.next_targets(rig.now) == {KEY: 522}
    assert rig.steps(0.1) == [600]


def test_a_ramp_begins_where_the_device_is_when_a_hand_has_moved_it(rig: Rig) -> None:
    rig.points.set_limits({KEY: Limit(rate=100.0)}, rig.now)
    rig.take(522)
    rig.steps(1.0)
    rig.places[KEY] = 800.0
    assert rig.take(530) is None
    given = rig.steps(0.1)
    assert max(given) == pytest.approx(799, abs=1) and min(given) >= 788


# ---------------------------------------------------------------- joints that stand


def led(rig: Rig, still: bool = False) -> Any:
    rig.now += TICK
    return rig.points.led_goals(rig.now, still).get(KEY)


def test_the_goal_of_a_joint_that_is_forced_away_goes_along_and_is_led_back_at_the_pace(rig: Rig) -> None:
    rig.points.set_limits({KEY: Limit(rate=1000.0)}, rig.now)
    rig.leash, rig.goal = 10.0, 512.0
    assert led(rig) is None
    for place in (540.0, 580.0):
        rig.places[KEY] = place
        rig.goal = led(rig)
        assert rig.goal == place - 10
    goals = []
    rig.leash = 50.0
    for _ in range(7):
        rig.places[KEY] = rig.goal
        rig.goal = led(rig) or rig.goal
        goals.append(rig.goal)
    assert goals == [560, 550, 540, 530, 520, 512, 512]


def test_while_nothing_may_move_the_goal_goes_along_and_stays(rig: Rig) -> None:
    rig.leash, rig.goal = 10.0, 512.0
    rig.places[KEY] = 580.0
    rig.goal = led(rig, still=True)
    assert rig.goal == 570
    assert [led(rig, still=True) for _ in range(5)] == [None] * 5
    rig.points.set_limits({KEY: Limit(rate=1000.0)}, rig.now)
    assert [led(rig) for _ in range(5)] == [None] * 5


@pytest.mark.parametrize("goal", [None, math.nan])
def test_a_joint_that_is_limp_or_of_unknown_goal_gets_no_goal(rig: Rig, goal: float | None) -> None:
    rig.points.set_limits({KEY: Limit(rate=1000.0)}, rig.now)
    rig.leash, rig.goal = 10.0, goal
    rig.places[KEY] = 580.0
    assert led(rig) is None
    assert led(rig, still=True) is None


def test_a_joint_without_a_pace_is_left_to_its_servo(rig: Rig) -> None:
    rig.leash, rig.goal = 10.0, 512.0
    rig.places[KEY] = 580.0
    assert led(rig) is None
    rig.points.accept_targets({KEY: 512}, rig.now, rates={KEY: 100.0})
    rig.steps(1.0)
    rig.goal = 570.0
    assert led(rig) is not None or rig.points._under_way
    rig.points.drop_courses()
    assert led(rig) is None


def test_a_stop_ends_the_way_back(rig: Rig) -> None:
    rig.points.set_limits({KEY: Limit(rate=1000.0)}, rig.now)
    rig.leash, rig.goal = 10.0, 512.0
    rig.places[KEY] = 580.0
    rig.goal = led(rig)
    rig.points.drop_courses((KEY[0],))
    rig.places[KEY] = rig.goal
    assert led(rig) is None
