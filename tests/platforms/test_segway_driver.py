"""The worker's half of an RMP against the simulated base: commands and their times, counters, orders, faults."""

from __future__ import annotations

import random
from typing import Any

import pytest
from segway_rig import START, TICK, Rig

from urbihw.buses import messages as m
from urbihw.buses.can.frame import CanFrame
from urbihw.buses.errors import BadValue, LinkGone
from urbihw.platforms.segway import protocol as p
from urbihw.platforms.segway.driver import BASE, SPACING, BaseInfo
from urbihw.platforms.segway.monitor import SETTLING, Monitor, missing_words
from urbihw.settings import BadSetting
from urbihw_fakes.segway import frames as f
from urbihw_fakes.segway.rmp import SegwayRmp


def test_the_base_is_found_when_it_is_heard_and_nothing_is_sent_before() -> None:
    rig = Rig()
    rig.port.deaf = True
    rig.run(0.5)
    assert rig.port.sent == []
    assert rig.news == []
    rig.port.deaf = False
    rig.run(0.1)
    assert rig.take(m.Found) == [m.Found((BaseInfo(2032, False),))]
    assert {frame for _, frame in rig.port.sent} == {CanFrame(0x413, bytes(8))}


def test_a_command_goes_out_every_tick_and_starting_moves_nothing() -> None:
    rig = Rig()
    rig.run(2.0)
    assert len(rig.port.sent) == pytest.approx(100, abs=2)
    assert rig.gaps() == pytest.approx([TICK] * len(rig.gaps()))
    assert rig.base.body.forward == 0.0


def test_targets_go_out_with_the_next_command_and_stay() -> None:
    rig = Rig()
    rig.run(0.1)
    rig.aim(velocity=329, turn=-100)
    rig.run(2.0)
    assert rig.port.sent[-1][1].data == p.command(329, -100)
    values = rig.values()
    assert (values["velocity"], values["turn"]) == (329, -100)
    assert rig.base.body.speed == pytest.approx(1.0, abs=0.01)


def test_what_is_no_target_is_refused() -> None:
    rig = Rig()
    rig.run(0.1)
    rig.aim(sideways=1)
    rig.news += rig.driver.targets(m.Targets({(BASE, "velocity"): 0.5, ("other", "turn"): 1}))
    assert [message.item for message in rig.take(m.Refused)] == ["sideways", "velocity", "turn"]


def test_late_ticks_never_bring_commands_too_close() -> None:
    rig = Rig()
    rig.run(0.1)
    for late in (0.019, 0.001, 0.02, 0.005, 0.015, 0.0, 0.0, 0.02):
        rig.run(late or 0.001, late or 0.001)
    assert min(rig.gaps()) >= SPACING - 1e-9


def test_a_dead_worker_stops_the_base() -> None:
    rig = Rig()
    rig.run(0.1)
    rig.aim(velocity=1176)
    rig.run(2.0)
    assert rig.base.body.speed > 3
    now = rig.clock.now()
    for step in range(300):
        rig.base.tick(now + step / 100)
    assert rig.base.body.speed == 0.0


def test_a_stop_is_a_command_at_once_but_no_burst() -> None:
    rig = Rig()
    rig.run(0.1)
    rig.aim(velocity=1176)
    rig.run(1.0)
    rig.run(0.001, 0.001)
    rig.driver.safe_stop()
    at, frame = rig.port.sent[-1]
    assert frame.data == bytes(8)
    assert at - rig.port.sent[-2][0] == pytest.approx(SPACING)
    rig.run(2.0)
    assert rig.base.body.speed == 0.0
    assert rig.base.motors


def test_a_stop_may_switch_the_motors_off() -> None:
    rig = Rig(SegwayRmp(mode=f.TRACTOR), torque_off_on_stop=True)
    rig.run(0.1)
    rig.driver.safe_stop()
    assert rig.base.mode == f.DISABLED


def test_a_stop_is_sent_although_the_clock_wakes_the_driver_too_early(monkeypatch: pytest.MonkeyPatch) -> None:
    """The real clock sleeps a little less than it is asked to, as a wake-up is late on most machines."""
    rig = Rig()
    rig.run(1)
    rig.aim(velocity=500)
    rig.run(0.1)
    rig.run(0.001, 0.001)
    assert rig.base.last_command == (500, 0)
    sleep = rig.clock.sleep_until
    monkeypatch.setattr(rig.clock, "sleep_until", lambda when: sleep(when - 0.00005))
    rig.driver.safe_stop()
    assert rig.base.last_command == (0, 0)


# ---------------------------------------------------------------- losing the base and the link


def test_a_silent_base_is_lost_and_comes_back_without_moving() -> None:
    rig = Rig()
    rig.run(0.1)
    rig.aim(velocity=329)
    rig.run(1.0)
    rig.take(m.DeviceState)
    rig.port.deaf = True
    rig.run(0.5)
    assert rig.take(m.DeviceState) == [m.DeviceState(BASE, "ok", "lost", "it says nothing")]
    rig.aim(velocity=329)
    rig.run(1.0)
    assert rig.port.sent[-1][1].data == bytes(8)
    rig.port.deaf = False
    rig.run(0.1)
    assert [state.new for state in rig.take(m.DeviceState)] == ["back", "ok"]
    rig.run(1.0)
    assert rig.base.body.speed == 0.0
    assert rig.take(m.DeviceReport) == []


def test_a_base_that_was_switched_off_says_so_and_its_counters_go_on() -> None:
    rig = Rig()
    rig.run(0.1)
    rig.aim(velocity=329)
    rig.run(3.0)
    rig.aim(velocity=0)
    rig.run(1.0)
    way = rig.values()["forward"]
    assert way > 33215 * 2.5
    rig.base.power_off(rig.clock.now())
    rig.run(1.0)
    (state,) = rig.take(m.DeviceState)
    assert state.reason == "it is switched off, says its user interface box"
    rig.run(5.0)
    rig.base.power_on(rig.clock.now())
    rig.run(0.5)
    assert rig.base.reading().forward_count == 0
    assert rig.values()["forward"] == way
    assert rig.take(m.DeviceReport) == [m.DeviceReport(BASE, "restarted")]


def test_a_link_that_was_away_loses_no_way() -> None:
    rig = Rig()
    rig.run(0.1)
    rig.aim(velocity=329)
    rig.run(2.0)
    rig.port.dead = True
    with pytest.raises(LinkGone):
        rig.run(TICK)
    rig.driver.detach()
    for _ in range(150):
        rig.run(TICK)
        rig.base.tick(rig.clock.now())
    rig.attach()
    rig.run(0.5)
    assert rig.base.body.speed == 0.0
    assert rig.values()["forward"] == rig.base.reading().forward_count
    assert rig.take(m.DeviceReport) == []


def test_nobody_there_is_said_after_a_second() -> None:
    rig = Rig()
    rig.port.deaf = True
    rig.run(1.2)
    assert rig.take(m.DeviceState) == [m.DeviceState(BASE, "ok", "lost", "it says nothing")]
    assert rig.port.sent == []


def test_a_bus_on_which_nobody_acknowledges_is_counted() -> None:
    rig = Rig()
    rig.run(0.1)
    rig.port.full = True
    rig.run(0.2)
    assert rig.driver.errors() == {"damaged": 0, "unsent": 10}


def test_the_oldest_firmware_is_understood() -> None:
    rig = Rig(SegwayRmp(old_firmware=True))
    rig.run(0.3)
    assert rig.take(m.Found) == [m.Found((BaseInfo(2032, True),))]
    rig.run(0.1)
    assert rig.values()["battery"] / 4 == pytest.approx(77.5, abs=0.25)
    assert "mode" not in rig.values()


FRAMES = (*range(0x400, 0x408), 0x680)


def without(rig: Rig, *identifiers: int, seconds: float = 1.0) -> None:
    """Let time pass in which the base's frames of these numbers are lost."""
    rig.port.lost = lambda frame: frame.id in identifiers
    rig.run(seconds)


@pytest.mark.parametrize("identifier", FRAMES)
def test_a_frame_that_stays_out_takes_its_own_values_and_no_others(identifier: int) -> None:
    rig = Rig()
    rig.run(0.1)
    rig.aim(velocity=329)
    rig.run(1.0)
    everything = set(rig.values())
    rig.take(m.DeviceState)
    without(rig, identifier)
    own = {name for name, _, _ in p.MONITOR[identifier]}
    assert set(rig.values()) == everything - own
    assert missing_words(rig.values()["missing"]) == f"0x{identifier:04X}"
    # The others are the present ones.
    assert rig.values().get("velocity", 329) == 329
    assert rig.values().get("servo_frames", rig.base.frames) == pytest.approx(rig.base.frames, abs=3)
    assert rig.values().get("forward", rig.base.reading().forward_count) == pytest.approx(
        rig.base.reading().forward_count, abs=2500
    )
    assert rig.base.body.speed == pytest.approx(1.0, abs=0.01)
    without(rig, seconds=0.1)
    assert set(rig.values()) == everything
    assert rig.values()["missing"] == 0
    assert [message for message in rig.news if isinstance(message, m.DeviceState | m.DeviceReport)] == []
    assert rig.driver.halted == ""


def test_a_frame_missing_now_and_then_takes_nothing() -> None:
    rig = Rig()
    rig.run(0.1)
    rig.aim(velocity=329)
    rig.run(0.5)
    everything = set(rig.values())
    rig.take(m.DeviceState)
    chance = random.Random(1)
    cycle = [0, 0]

    def lost(frame: CanFrame) -> bool:
        # One frame of every third cycle, at random.
        if frame.id == 0x400:
            cycle[:] = [cycle[0] + 1, chance.choice(FRAMES)]
        return cycle[0] % 3 == 0 and frame.id == cycle[1]

    rig.port.lost = lost
    rig.run(5.0)
    samples = [message for message in rig.news if isinstance(message, m.Samples)]
    assert len(samples) == pytest.approx(250, abs=2)
    assert all(set(sample.values[BASE]) == everything for sample in samples)
    assert {sample.values[BASE]["missing"] for sample in samples} == {0}
    frames = [sample.values[BASE]["servo_frames"] for sample in samples]
    assert max(later - earlier for earlier, later in zip(frames, frames[1:], strict=False)) <= 4
    assert rig.take(m.DeviceState) == []
    assert rig.base.body.speed == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("only", FRAMES)
def test_one_kind_of_frame_alone_keeps_the_base_there(only: int) -> None:
    rig = Rig()
    rig.run(0.5)
    rig.take(m.DeviceState)
    without(rig, *(identifier for identifier in FRAMES if identifier != only), seconds=2.0)
    own = {name for name, _, _ in p.MONITOR[only]}
    assert set(rig.values()) == {*own, "resets", "missing"}
    assert rig.take(m.DeviceState) == []


@pytest.mark.parametrize("identifier", FRAMES)
def test_a_base_that_never_sends_a_frame_is_found(identifier: int) -> None:
    rig = Rig()
    without(rig, identifier)
    (found,) = [message for message in rig.news if isinstance(message, m.Found)]
    assert found == m.Found((BaseInfo(0 if identifier == 0x400 else 2032, False),))
    assert rig.take(m.DeviceState) == []


def test_a_line_opened_in_the_middle_of_a_cycle_waits_for_a_beginning() -> None:
    monitor = Monitor()
    base = SegwayRmp()
    frames = [CanFrame(*frame) for step in range(3) for _, frame in base.tick(step / 100)]
    for frame in frames[3:8]:
        monitor.add_frame(frame, 0.0)
    assert monitor.cycle_at is None
    assert monitor.latest == {}
    for frame in frames[8:]:
        monitor.add_frame(frame, 0.01)
    assert monitor.cycle_at == 0.01
    assert not monitor.old


def test_the_way_goes_on_over_counters_that_were_missing() -> None:
    rig = Rig()
    rig.run(0.1)
    rig.aim(velocity=329)
    rig.run(1.0)
    without(rig, 0x404, seconds=2.0)
    assert "forward" not in rig.values()
    rig.aim(velocity=0)
    without(rig, seconds=2.0)
    assert rig.values()["forward"] == rig.base.reading().forward_count


def test_the_oldest_firmware_may_lose_a_frame_too() -> None:
    rig = Rig(SegwayRmp(old_firmware=True))
    rig.run(0.5)
    rig.take(m.DeviceState)
    without(rig, 0x400)
    assert missing_words(rig.values()["missing"]) == "0x0400"
    assert "battery" not in rig.values() and "forward" in rig.values()
    assert rig.take(m.DeviceState) == []


# ---------------------------------------------------------------- motors that were off


def driving(base: SegwayRmp | None = None, **settings: Any) -> Rig:
    """A rig whose base goes 1 m/s."""
    rig = Rig(base if base is not None else SegwayRmp(mode=f.TRACTOR), **settings)
    rig.run(0.1)
    rig.aim(velocity=329)
    rig.run(1.0)
    assert rig.base.body.speed == pytest.approx(1.0, abs=0.01)
    return rig


def stays(rig: Rig) -> bool:
    """Whether the base, its motors on, does not move for two seconds."""
    assert rig.base.motors
    place = rig.base.body.forward
    rig.run(2.0)
    return rig.base.motors and rig.base.body.forward == pytest.approx(place, abs=0.001)


def test_motors_switched_off_by_hand_come_back_at_zero() -> None:
    rig = driving()
    rig.base.estop = True
    rig.run(2.0)
    assert rig.halts == ["the motors of the base were switched off"]
    rig.base.estop = False
    assert rig.ask("write", "mode", f.TRACTOR).ok
    assert stays(rig)


def test_a_base_that_fell_stands_when_it_is_lifted() -> None:
    rig = driving(SegwayRmp())
    rig.base.body.fallen = True
    rig.run(2.0)
    rig.base.body.lift()
    rig.run(0.02)
    assert stays(rig)
    assert rig.ask("write", "mode", f.BALANCE).ok
    assert stays(rig)


@pytest.mark.parametrize("phase", [0.0, 0.01])
@pytest.mark.parametrize("behind", [0.0, 0.01, 0.02])
@pytest.mark.parametrize("fault", ["estop", "fallen", "mode"])
def test_a_switch_off_of_one_cycle_is_noticed(fault: str, behind: float, phase: float) -> None:
    rig = driving()
    for _, frame in rig.base.tick(rig.clock.now() + phase):
        rig.port.others.append(CanFrame(*frame))
    if fault == "estop":
        rig.base.estop = True
    elif fault == "fallen":
        rig.base.body.fallen = True
    else:
        rig.base.mode = f.DISABLED
    said = rig.base.tick(rig.clock.now() + phase + 0.01)
    rig.port.others += [CanFrame(*frame) for _, frame in said]
    assert {frame.id for _, frame in said} >= {0x400, 0x680}
    rig.base.estop = rig.base.body.fallen = False
    rig.base.mode = f.TRACTOR
    # The cycles behind it, in which all is well again, are read in the same tick.
    rig.clock.sleep_until(rig.clock.now() + phase + 0.01 + behind)
    rig.run(TICK)
    assert rig.halts == ["the motors of the base were switched off"]
    rig.run(1.0)
    assert rig.base.body.speed == 0.0
    assert stays(rig)


@pytest.mark.parametrize("mode", [f.TRACTOR, f.BALANCE])
def test_a_mode_without_motors_and_back_on_request(mode: int) -> None:
    rig = driving()
    assert rig.ask("write", "mode", f.DISABLED).ok
    # The command that asks for it carries no speed any more.
    assert p.command(0, 0, 16, f.DISABLED) in [frame.data for _, frame in rig.port.sent]
    rig.run(1.0)
    assert rig.ask("write", "mode", mode).ok
    assert stays(rig)


def test_a_mode_without_motors_and_back_in_one_breath() -> None:
    rig = driving()
    rig.driver.request(m.Request(1, "write", BASE, "mode", f.DISABLED))
    rig.driver.request(m.Request(2, "write", BASE, "gain", 1))
    rig.driver.request(m.Request(3, "write", BASE, "mode", f.TRACTOR))
    rig.run(1.5)
    # The stop does not take the orders with it that were given beside it.
    assert [(reply.reply_id, reply.ok) for reply in rig.take(m.Reply)] == [(1, True), (2, True), (3, True)]
    assert stays(rig)


def test_a_stop_that_also_switches_off_leaves_a_mode_that_was_asked_for() -> None:
    rig = driving(torque_off_on_stop=True)
    assert rig.ask("write", "mode", f.DISABLED).ok
    assert rig.ask("write", "mode", f.TRACTOR).ok
    assert stays(rig)


def test_speeds_for_motors_that_are_off_are_refused_once_and_forgotten() -> None:
    rig = driving()
    rig.base.estop = True
    rig.run(0.1)
    for _ in range(10):
        rig.aim(velocity=329)
        rig.run(TICK)
    assert rig.take(m.Refused) == [m.Refused(BASE, "velocity", "the motors of the base are off")]
    rig.base.estop = False
    assert rig.ask("write", "mode", f.TRACTOR).ok
    # What still ramps towards a speed that was refused ends too.
    assert rig.halts == ["the motors of the base were switched off", "the motors of the base were switched on"]
    assert stays(rig)
    rig.aim(velocity=329)
    rig.run(1.0)
    assert rig.base.body.speed == pytest.approx(1.0, abs=0.01)


def test_from_one_mode_with_motors_to_the_other_it_goes_on_if_it_was_asked_for() -> None:
    rig = driving()
    assert rig.ask("write", "mode", f.BALANCE).ok
    assert rig.base.body.speed == pytest.approx(1.0, abs=0.01)
    assert rig.halts == []
    rig.base.mode = f.TRACTOR
    rig.run(2.0)
    assert rig.halts == ["the base went into another mode"]
    assert rig.base.body.speed == 0.0


def test_a_base_that_was_off_for_a_moment_stands() -> None:
    rig = driving()
    rig.run(2.0)
    rig.base.power_off(rig.clock.now())
    rig.base.power_on(rig.clock.now())
    rig.base.frames = 0
    rig.run(0.1)
    assert rig.take(m.DeviceState) == []
    rig.run(1.0)
    assert stays(rig)


def test_commands_of_somebody_else_are_noticed_and_our_own_echo_is_not() -> None:
    rig = Rig()
    rig.run(0.1)
    rig.aim(velocity=100)
    rig.run(0.1)
    rig.port.others = [frame for _, frame in rig.port.sent]
    rig.run(0.1)
    assert rig.take(m.DeviceReport) == []
    for _ in range(100):
        rig.port.others = [CanFrame(0x413, p.command(700, 0))]
        rig.run(TICK)
    assert rig.take(m.DeviceReport) == [m.DeviceReport(BASE, "commanded by another")]


@pytest.mark.parametrize("data", [b"", b"\xff", b"\xff" * 8])
def test_frames_without_sense_do_no_harm(data: bytes) -> None:
    rig = Rig()
    rig.run(0.1)
    rig.aim(velocity=100)
    for identifier in range(0x800):
        if not 0x400 <= identifier <= 0x407 and identifier not in (0x412, 0x680):
            rig.port.others.append(CanFrame(identifier, data))
    rig.run(1.0)
    assert rig.base.body.speed == pytest.approx(100 / 1176 * 3.576, abs=0.01)


# ---------------------------------------------------------------- reporting


def test_cycles_are_reported_as_often_as_wanted() -> None:
    rig = Rig()
    rig.run(0.1)
    for period, count in ((0.0, 50), (0.1, 10), (0.5, 2)):
        rig.driver.watch(m.Watch(BASE, (), period), rig.clock.now())
        rig.take(m.Samples)
        rig.run(1.0)
        assert len(rig.take(m.Samples)) == pytest.approx(count, abs=1)
    rig.driver.watch(m.Watch(BASE, (), None), rig.clock.now())
    rig.run(1.0)
    assert rig.take(m.Samples) == []


def test_ticks_that_are_a_little_late_or_early_lose_no_report() -> None:
    rig = Rig()
    rig.run(0.1)
    rig.take(m.Samples)
    for late in (0.003, -0.003, 0.0, 0.004, -0.004, 0.001, -0.001) * 10:
        rig.run(TICK + late, TICK + late)
    assert len(rig.take(m.Samples)) == pytest.approx(70, abs=1)


def test_samples_carry_the_time_of_the_worker() -> None:
    rig = Rig()
    rig.run(0.1)
    last = rig.take(m.Samples)[-1]
    assert last.time == last.times[BASE] == pytest.approx(START + 0.08)


# ---------------------------------------------------------------- counters


def test_counters_run_through_their_wrap() -> None:
    rig = Rig()
    rig.base.preset_integrators(forward=0x7FFFFFFF - 1000, left=-5)
    rig.run(0.1)
    assert rig.values()["left"] == -5
    before = rig.values()["forward"]
    assert before == 0x7FFFFFFF - 1000
    rig.aim(velocity=329)
    rig.run(1.0)
    travelled = round(rig.base.body.forward * 33215)
    assert rig.values()["forward"] == pytest.approx(before + travelled, abs=2000)
    assert rig.values()["forward"] > 0x80000000


def test_a_reset_is_believed_after_it_has_settled() -> None:
    rig = Rig()
    rig.base.preset_integrators(forward=1000, yaw=2000, left=3000, right=4000)
    rig.run(0.1)
    assert rig.ask("write", "reset", p.ALL_INTEGRATORS, SETTLING + 0.1).ok
    rig.run(0.1)
    assert [rig.values()[name] for name in p.COUNTERS] == [0, 0, 0, 0]
    rig.aim(velocity=329)
    rig.run(1.0)
    assert rig.values()["forward"] > 10000


def test_counters_that_the_base_does_not_reset_begin_anew_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig()
    monkeypatch.setattr(rig.base, "_reset_integrators", lambda mask: None)
    rig.base.preset_integrators(forward=1000, yaw=2000)
    rig.run(0.1)
    rig.ask("write", "reset", 8)
    rig.run(0.1)
    assert (rig.values()["forward"], rig.values()["yaw"]) == (0, 2000)


# ---------------------------------------------------------------- orders


def test_an_order_is_sent_once_with_the_speeds_of_the_moment() -> None:
    rig = Rig()
    rig.run(0.1)
    rig.aim(velocity=329, turn=50)
    reply = rig.ask("write", "velocity_scale", 8)
    assert reply == m.Reply(7, True, 8)
    orders = [frame.data for _, frame in rig.port.sent if frame.data[4:] != bytes(4)]
    assert orders == [p.command(329, 50, 10, 8)]
    assert rig.base.velocity_scale == 8


def test_the_mode_is_looked_for() -> None:
    rig = Rig(SegwayRmp(mode=f.TRACTOR))
    rig.run(0.1)
    assert rig.ask("write", "mode", 2) == m.Reply(7, True, 2)
    assert rig.base.mode == f.BALANCE
    assert rig.ask("write", "gain", 2).ok
    assert rig.base.gain == 2


def test_a_mode_that_is_not_taken_is_asked_for_three_times_and_then_refused() -> None:
    rig = Rig(SegwayRmp(mode=f.TRACTOR))
    rig.base.estop = True
    rig.run(0.1)
    reply = rig.ask("write", "mode", 2, seconds=2.0)
    assert reply == m.Reply(7, False, None, "the base stays in mode disabled (motors disabled on request, emergency "
                                            "stop switch open)")
    assert rig.base.refused == 3


def test_the_oldest_firmware_takes_orders_unseen() -> None:
    rig = Rig(SegwayRmp(old_firmware=True, mode=f.TRACTOR))
    rig.run(0.1)
    assert rig.ask("write", "mode", 2) == m.Reply(7, True, 2)
    assert rig.base.mode == f.BALANCE


def test_several_orders_go_one_by_one() -> None:
    rig = Rig()
    rig.run(0.1)
    for number, (name, value) in enumerate([("velocity_scale", 8), ("turn_scale", 4), ("lockout", 1)], 1):
        rig.driver.request(m.Request(number, "write", BASE, name, value))
    rig.run(0.2)
    assert [reply.reply_id for reply in rig.take(m.Reply)] == [1, 2, 3]
    assert (rig.base.velocity_scale, rig.base.turn_scale, rig.base.lockout) == (8, 4, True)


@pytest.mark.parametrize(
    ("verb", "item", "value", "words"),
    [
        ("write", "velocity_scale", 17, "velocity_scale must be a number from 0 to 16"),
        ("write", "gain", 1.5, "from 0 to 2"),
        ("write", "colour", 1, "no such setting 'colour'"),
        ("read", "colour", 0, "says nothing of 'colour'"),
        ("sing", "", 0, "does not know 'sing'"),
    ],
)
def test_requests_without_sense(verb: str, item: str, value: float, words: str) -> None:
    rig = Rig()
    rig.run(0.1)
    reply = rig.ask(verb, item, value, TICK)
    assert not reply.ok
    assert words in reply.error


def test_reading_and_switching_off() -> None:
    rig = Rig()
    rig.run(0.1)
    assert rig.ask("read", "mode") == m.Reply(7, True, 2)
    assert rig.ask("shutdown").ok
    assert not rig.base.powered


def test_orders_end_with_the_base_the_link_and_a_stop() -> None:
    rig = Rig()
    assert not rig.ask("write", "mode", 2, TICK).ok
    rig.run(0.1)
    rig.news += rig.driver.request(m.Request(1, "write", BASE, "mode", 1))
    rig.driver.safe_stop()
    rig.news += rig.driver.request(m.Request(2, "write", BASE, "mode", 1))
    rig.driver.detach()
    rig.run(TICK)
    assert [(reply.reply_id, reply.error) for reply in rig.take(m.Reply)] == [
        (1, "the robot was stopped"),
        (2, "the link went down"),
    ]
    rig.attach()
    rig.run(0.1)
    rig.news += rig.driver.request(m.Request(3, "write", BASE, "mode", 1))
    rig.port.deaf = True
    rig.run(1.0)
    (reply,) = rig.take(m.Reply)
    assert not reply.ok


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"rate": 100.0}, "every 20 to 50 ms"),
        ({"rate": 10.0}, "every 20 to 50 ms"),
        ({"rate": 50.0, "options": {"model": "300"}}, "one of 50, 100, 200, 400"),
        ({"rate": 50.0, "options": {"colour": 1}}, "options.colour: no such option; there are: .*, model"),
    ],
)
def test_settings_without_sense(settings: dict[str, float], words: str) -> None:
    with pytest.raises((BadValue, BadSetting), match=words):
        Rig().driver.configure(m.Configure(**settings))  # type: ignore[arg-type]
