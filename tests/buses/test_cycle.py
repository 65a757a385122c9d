"""The cycle against the fake kit in simulated time: what is on the wire, what the dead cost, who is lost and back."""

from __future__ import annotations

import pytest

from urbihw.buses.errors import BadValue
from urbihw.buses.servos.cycle import Cycle, Tick
from urbihw.buses.servos.scan import scan
from urbihw.buses.ticker import LEAST_GAP_S, Ticker

from .conftest import Rig, both_back_ends

FAST_ITEMS = ("present_position", "present_speed", "present_load")
X_ITEMS = ("present_load", "present_velocity", "present_position")
PERIOD = 0.01


def start(rig: Rig, items: tuple[str, ...] = FAST_ITEMS, period: float = PERIOD, protocol: int = 1) -> Cycle:
    bus = rig.bus(2 if protocol == 2 else 1)
    cycle = Cycle(bus, [device for device in scan(bus).devices if device.id < 100], period)
    for number in cycle.members:
        cycle.watch(number, items, 0.0, rig.clock.now())
    rig.sent()
    return cycle


def run(rig: Rig, cycle: Cycle, seconds: float) -> tuple[list[tuple[float, Tick]], int]:
    """Tick for `seconds`; return (time, tick) of each and how many were skipped."""
    begin = rig.clock.now()
    ticker = Ticker(cycle.period, begin)
    ticks, late = [], 0
    while ticker.due < begin + seconds:
        rig.clock.sleep_until(ticker.due)
        now = rig.clock.now()
        ticks.append((now, cycle.tick(now)))
        late += ticker.advance(rig.clock.now())
    return ticks, late


def test_neighbours_share_a_sync_write_that_travels_with_the_first_read(rig: Rig) -> None:
    cycle = start(rig)
    now = rig.clock.now()
    cycle.set_target(1, "goal_position", 512)
    cycle.set_target(1, "moving_speed", 100)
    cycle.set_target(2, "moving_speed", 200)
    cycle.set_target(2, "goal_position", 300)
    cycle.set_target(3, "torque_limit", 1000)
    cycle.tick(now)
    sent = rig.sent()
    assert sent[0] == (
        "FF FF FE 0E 83 1E 04 01 00 02 64 00 02 2C 01 C8 00 F0 FF FF FE 07 83 22 02 03 E8 03 65 FF FF 01 04 02 20 0A CE"
    )
    assert len(sent) == 18
    cycle.tick(rig.clock.now() + PERIOD)
    assert rig.sent()[0] == "FF FF 01 04 02 24 06 CE"


@both_back_ends
def test_a_target_that_is_already_there_is_not_sent_again(rig: Rig) -> None:
    cycle = start(rig)
    for _ in range(2):
        cycle.set_target(1, "goal_position", 512)
        cycle.tick(rig.clock.now())
    assert sum("83 1E 02" in line for line in rig.sent()) == 1


@both_back_ends
def test_torque_off_is_written_last(rig: Rig) -> None:
    cycle = start(rig)
    cycle.set_target(1, "torque_enable", 0)
    cycle.set_target(1, "goal_position", 512)
    now = rig.clock.now()
    cycle.tick(now)
    assert " ".join(rig.sent()).startswith("FF FF FE 07 83 1E 02 01 00 02 54 FF FF FE 06 83 18 01 01 00 5E")


@both_back_ends
def test_a_write_needs_no_read_to_travel_with(rig: Rig) -> None:
    bus = rig.bus()
    cycle = Cycle(bus, scan(bus, [6]).devices, PERIOD)
    rig.sent()
    cycle.set_target(6, "led", 1)
    now = rig.clock.now()
    assert cycle.tick(now).values == {}
    assert rig.sent() == ["FF FF FE 06 83 19 01 06 01 57"]
    assert bus.read(6, 25, 1) == b"\x01"


@both_back_ends
@pytest.mark.parametrize(
    ("device", "item", "raw"),
    [(99, "goal_position", 1), (1, "nose", 1), (1, "goal_position", 1024), (1, "present_position", 1), (1, "id", 7)],
)
def test_impossible_targets_are_refused(rig: Rig, device: int, item: str, raw: int) -> None:
    cycle = start(rig)
    with pytest.raises(BadValue, match=r"device 99|nose|1023|cannot be a target"):
        cycle.set_target(device, item, raw)


@both_back_ends
def test_one_read_brings_all_fast_items_with_the_time_they_were_taken(rig: Rig) -> None:
    cycle = start(rig)
    now = rig.clock.now()
    tick = cycle.tick(now)
    assert sorted(tick.values) == list(range(1, 19))
    assert tick.values[7] == {"present_position": 512, "present_speed": 0, "present_load": 0}
    one = (8 + 12) * 10e-6
    assert [tick.times[n] - now for n in (1, 2, 18)] == pytest.approx([one, 2 * one, 18 * one])


def test_protocol_2_reads_all_in_one_group(x_rig: Rig) -> None:
    cycle = start(x_rig, X_ITEMS, protocol=2)
    cycle.set_target(1, "goal_position", 100)
    now = x_rig.clock.now()
    tick = cycle.tick(now)
    assert sorted(tick.values) == list(range(1, 19))
    assert set(tick.values[7]) == set(X_ITEMS)
    (line,) = x_rig.sent()
    assert line.startswith("FF FF FD 00 FE 0C 00 83 74 00 04 00 01 64 00 00 00")
    assert "FF FF FD 00 FE 19 00 82 7E 00 0A 00 01 02 03" in line


def test_fast_sync_read_where_the_firmware_has_it(x_rig: Rig) -> None:
    for unit in x_rig.kit:
        unit.registers.put("firmware", 45)
    cycle = start(x_rig, X_ITEMS, protocol=2)
    now = x_rig.clock.now()
    assert sorted(cycle.tick(now).values) == list(range(1, 19))
    assert x_rig.sent()[0].startswith("FF FF FD 00 FE 19 00 8A")
    cycle.fast = False
    cycle.tick(now + 0.1)
    assert x_rig.sent()[0].startswith("FF FF FD 00 FE 19 00 82")


@both_back_ends
def test_slow_items_keep_their_period_and_are_spread(rig: Rig) -> None:
    cycle = start(rig)
    for number in cycle.members:
        cycle.watch(number, ("present_voltage", "present_temperature"), 1.0, rig.clock.now())
    ticks, late = run(rig, cycle, 3.0)
    assert late == 0
    when = [now for now, tick in ticks if "present_voltage" in tick.values[5]]
    assert [b - a for a, b in zip(when, when[1:], strict=False)] == pytest.approx([1.0, 1.0])
    assert max(sum("present_voltage" in values for values in tick.values.values()) for _, tick in ticks) <= 2
    assert all("present_position" in values for _, tick in ticks for values in tick.values.values())


@both_back_ends
def test_a_watch_ends_and_changes(rig: Rig) -> None:
    cycle = start(rig)
    now = rig.clock.now()
    cycle.watch(5, FAST_ITEMS, None, now)
    cycle.watch(6, ("present_load",), None, now)
    tick = cycle.tick(now)
    assert 5 not in tick.values
    assert set(tick.values[6]) == {"present_position", "present_speed"}
    with pytest.raises(BadValue, match="AX-12 has no item 'nose'"):
        cycle.watch(6, ("nose",), 0.0, now)


@both_back_ends
def test_reading_in_passing_spares_what_reading_clears(rig: Rig) -> None:
    bus = rig.bus()
    cycle = Cycle(bus, scan(bus, [100]).devices, PERIOD)
    rig.sent()
    now = rig.clock.now()
    cycle.watch(100, ("remocon_arrived", "obstacle_compare"), 0.0, now)
    cycle.tick(now)
    assert rig.sent() == ["FF FF 64 04 02 2E 01 66", "FF FF 64 04 02 34 01 60"]


@both_back_ends
@pytest.mark.parametrize("protocol", [1, 2])
@pytest.mark.parametrize("dead", [(6,), (3, 6), (1, 2, 6, 17, 18)])
def test_the_silent_are_found_lost_and_cost_the_living_nothing(
    rig: Rig, x_rig: Rig, protocol: int, dead: tuple[int, ...]
) -> None:
    used = rig if protocol == 1 else x_rig
    cycle = start(used, FAST_ITEMS if protocol == 1 else X_ITEMS, protocol=protocol)
    run(used, cycle, 0.2)
    for number in dead:
        used.kit.faults.start("silence", number)
    begin = used.clock.now()
    ticks, _ = run(used, cycle, 1.0)
    living = set(cycle.members) - set(dead)
    assert all(set(tick.values) == living for _, tick in ticks)
    lost = {n: now - begin for now, tick in ticks for n, change in tick.changes if change.new == "lost"}
    assert set(lost) == set(dead)
    assert max(lost.values()) <= 0.1
    settled = [now for now, _ in ticks if now > begin + 0.1]
    assert len(settled) == pytest.approx(90, abs=1)

    used.kit.faults.stop()
    begin = used.clock.now()
    ticks, late = run(used, cycle, 0.6)
    back = {n: now - begin for now, tick in ticks for n, change in tick.changes if change.new == "back"}
    assert set(back) == set(dead)
    assert max(back.values()) <= 0.5
    assert late == 0
    assert set(ticks[-1][1].values) == set(cycle.members)
    assert {member.health.state for member in cycle.members.values()} == {"ok"}


@both_back_ends
def test_states_of_a_servo_that_goes_and_returns(rig: Rig) -> None:
    cycle = start(rig)
    rig.kit.power_off(rig.clock.now(), 6)
    ticks, _ = run(rig, cycle, 0.3)
    rig.kit.power_on(rig.clock.now(), 6)
    ticks += run(rig, cycle, 0.5)[0]
    changes = [(n, change.old, change.new) for _, tick in ticks for n, change in tick.changes]
    assert changes == [(6, "ok", "suspect"), (6, "suspect", "lost"), (6, "lost", "back"), (6, "back", "ok")]


@both_back_ends
def test_a_single_miss_is_tried_again_in_the_same_tick(rig: Rig) -> None:
    cycle = start(rig)
    run(rig, cycle, 0.1)
    rig.kit.faults.start("silence", 6, times=1)
    ticks, late = run(rig, cycle, 0.1)
    assert all(len(tick.values) == 18 and not tick.changes for _, tick in ticks)
    assert late == 0
    assert cycle.bus.counters.retried == 1


@both_back_ends
def test_a_damaged_answer_in_a_group_is_asked_for_again_and_no_miss(x_rig: Rig) -> None:
    cycle = start(x_rig, X_ITEMS, protocol=2)
    run(x_rig, cycle, 0.1)
    x_rig.sent()
    x_rig.kit.faults.start("checksum", 6, times=1)
    tick = cycle.tick(x_rig.clock.now())
    assert set(tick.values) == set(cycle.members)
    assert tick.changes == []
    # The group and one READ, to the one whose answer was damaged.
    group, single = x_rig.sent()
    assert single.startswith("FF FF FD 00 06 07 00 02 7E 00 0A 00")


@both_back_ends
def test_a_silence_in_a_group_is_a_miss_of_the_first_and_a_question_to_those_behind_it(x_rig: Rig) -> None:
    cycle = start(x_rig, X_ITEMS, protocol=2)
    run(x_rig, cycle, 0.1)
    x_rig.sent()
    x_rig.kit.faults.start("silence", 16, times=1)
    tick = cycle.tick(x_rig.clock.now())
    assert set(tick.values) == set(cycle.members) - {16}
    assert [(number, change.new) for number, change in tick.changes] == [(16, "suspect")]
    assert [line.split()[4] for line in x_rig.sent()] == ["FE", "11", "12"]


@both_back_ends
def test_targets_of_a_lost_servo_are_forgotten(rig: Rig) -> None:
    cycle = start(rig)
    cycle.set_target(6, "goal_position", 300)
    rig.kit.faults.start("silence", 6)
    run(rig, cycle, 0.1)
    cycle.set_target(6, "goal_position", 400)
    rig.kit.faults.stop()
    rig.sent()
    run(rig, cycle, 0.5)
    assert not any("83 1E" in line for line in rig.sent())
    cycle.set_target(6, "goal_position", 300)
    rig.sent()
    cycle.tick(rig.clock.now())
    assert rig.sent()[0].startswith("FF FF FE 07 83 1E 02 06 2C 01")


@both_back_ends
def test_late_ticks_begin_at_once_and_missed_ones_are_never_replayed(rig: Rig) -> None:
    cycle = start(rig, period=0.002)
    begin = rig.clock.now()
    ticks, late = run(rig, cycle, 0.2)
    # 18 reads of 20 bytes take 3.6 ms.
    step = 0.0036 + LEAST_GAP_S
    assert [now - begin for now, _ in ticks[:4]] == pytest.approx([0.0, step, 2 * step, 3 * step])
    assert late + len(ticks) == pytest.approx(0.2 / 0.002, abs=1)


@both_back_ends
def test_state_bits_are_reported_when_they_change_and_the_data_is_kept(rig: Rig) -> None:
    cycle = start(rig)
    assert "state" not in cycle.tick(rig.clock.now()).values[6]
    rig.kit.servo(6).heat(90.0)
    hot = [tick.values[6] for _, tick in run(rig, cycle, 0.05)[0]]
    rig.kit.servo(6).heat(30.0)
    cool = [tick.values[6] for _, tick in run(rig, cycle, 0.05)[0]]
    assert all(set(FAST_ITEMS) <= set(values) for values in hot + cool)
    assert [values["state"] for values in hot + cool if "state" in values] == [0x04, 0]


@both_back_ends
def test_data_beside_an_angle_limit_error_is_taken(rig: Rig) -> None:
    servo = rig.kit.servo(6)
    servo.registers.put("goal_position", 1000)
    servo.registers.put("ccw_limit", 700)
    bus = rig.bus()
    assert bus.read(6, 8, 2) == bytes.fromhex("BC02")
    cycle = Cycle(bus, scan(bus, [6]).devices, 0.01)
    cycle.watch(6, ("present_position",), 0.0, rig.clock.now())
    assert cycle.tick(rig.clock.now()).values[6] == {"present_position": 512}
