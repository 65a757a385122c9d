"""The simulated RMP: how it moves, what it supervises, what it says."""

from __future__ import annotations

import math

import pytest

from urbihw_fakes.can.node import CanFrame
from urbihw_fakes.errors import UnknownRequest
from urbihw_fakes.segway import frames as f
from urbihw_fakes.segway.body import FALLEN
from urbihw_fakes.segway.rmp import SegwayRmp

COMMAND = 0x413


def command(velocity: int = 0, turn: int = 0, word: int = 0, parameter: int = 0) -> CanFrame:
    return f.frame(COMMAND, velocity, turn, word, parameter)


def drive(base: SegwayRmp, start: float, seconds: float, velocity: int = 0, turn: int = 0) -> float:
    """Command it every 50 ms for so long; the time afterwards."""
    for count in range(round(seconds / 0.05)):
        base.receive_frame(command(velocity, turn), start + count * 0.05)
        base.tick(start + (count + 1) * 0.05)
    return start + seconds


def words(base: SegwayRmp, identifier: int, now: float) -> tuple[int, ...]:
    """The last frame of this kind by then, as words."""
    found = [frame for _, frame in base.tick(now) if frame.id == identifier]
    return f.words(found[-1].data)


def test_it_says_eight_frames_and_its_states_every_10_ms() -> None:
    base = SegwayRmp()
    assert base.due() == 0.0
    assert [frame.id for _, frame in base.tick(1.0)] == [*range(0x400, 0x408), 0x680, 0x688]
    assert base.due() == pytest.approx(1.01)
    assert base.tick(1.009) == []
    times = {at for at, _ in base.tick(1.055)}
    assert sorted(times) == pytest.approx([1.01, 1.02, 1.03, 1.04, 1.05])


def test_the_oldest_firmware_says_five() -> None:
    base = SegwayRmp(old_firmware=True)
    assert [frame.id for _, frame in base.tick(1.0)] == [*range(0x400, 0x405)]


def test_a_long_pause_of_the_server_is_not_made_up_for() -> None:
    base = SegwayRmp()
    base.tick(0.0)
    assert len({at for at, _ in base.tick(100.0)}) == 101


@pytest.mark.parametrize(("model", "per_speed", "per_metre"), [("50", 401, 40181), ("200", 332, 33215)])
def test_it_ramps_to_the_commanded_speed_in_the_scale_of_its_firmware(
    model: str, per_speed: float, per_metre: float
) -> None:
    base = SegwayRmp(model)
    base.tick(0.0)
    now = drive(base, 0.0, 0.25, velocity=329)
    speed = f.signed(words(base, 0x402, now + 0.01)[0]) / per_speed
    assert 0.4 < speed < 0.6
    now = drive(base, now, 2.0, velocity=329)
    left, right, yaw, _ = words(base, 0x402, now + 0.01)
    assert left == right == round(per_speed * 329 / 1176 * 3.576)
    assert yaw == 0
    before = base.reading().forward_count
    drive(base, now, 1.0, velocity=329)
    assert (base.reading().forward_count - before) / per_metre == pytest.approx(1.0, abs=0.02)


def test_a_positive_turn_is_to_the_left() -> None:
    base = SegwayRmp()
    base.tick(0.0)
    now = drive(base, 0.0, 1.0, turn=447)
    left, right, rate, _ = (f.signed(word) for word in words(base, 0x402, now + 0.01))
    assert left < 0 < right
    assert rate / f.PER_RADIAN == pytest.approx(1.0, abs=0.01)
    assert (right - left) / 332 / 0.54 == pytest.approx(1.0, abs=0.02)


def test_a_command_lasts_for_400_ms_then_it_ramps_to_zero_and_goes_on_in_its_mode() -> None:
    base = SegwayRmp()
    base.tick(0.0)
    now = drive(base, 0.0, 2.0, velocity=329)
    last = now - 0.05
    base.tick(last + 0.39)
    assert base.body.speed == pytest.approx(1.0, abs=0.01)
    base.tick(last + 0.45)
    assert base.body.speed < 1.0
    base.tick(last + 1.5)
    assert base.body.speed == 0.0
    assert (base.mode, base.motors) == (f.BALANCE, True)
    drive(base, last + 1.5, 1.0, velocity=329)
    assert base.body.speed == pytest.approx(1.0, abs=0.01)


def test_commands_beyond_the_limits_are_cut() -> None:
    base = SegwayRmp()
    base.receive_frame(command(30000, -30000), 0.0)
    base.tick(0.0)
    assert f.words(base.tick(0.01)[7].frame.data)[:2] == (1176, 0x10000 - 1024)


def test_it_leans_into_an_acceleration_and_comes_upright_again() -> None:
    base = SegwayRmp()
    base.tick(0.0)
    now = drive(base, 0.0, 0.4, velocity=1176)
    assert math.radians(5) < base.body.pitch < math.radians(25)
    now = drive(base, now, 4.0, velocity=1176)
    assert abs(base.body.pitch) < math.radians(0.5)
    base.body.push(math.radians(5))
    drive(base, now, 2.0, velocity=1176)
    assert abs(base.body.pitch) < math.radians(0.5)


def test_without_motors_it_falls_and_says_so() -> None:
    base = SegwayRmp()
    base.tick(0.0)
    base.receive_frame(command(0, 0, 16, 0), 0.0)
    for now in range(1, 6):
        base.tick(now)
    assert base.body.fallen
    assert abs(base.body.pitch) == FALLEN
    assert base.status_words() == (0x0001, 0x0101)
    base.receive_frame(command(0, 0, 16, 2), 5.0)
    assert base.mode == f.DISABLED
    base.body.lift()
    base.receive_frame(command(0, 0, 16, 2), 5.1)
    assert base.status_words() == (0x0180, 0)


def test_it_falls_as_soon_after_minutes_upright() -> None:
    base = SegwayRmp()
    drive(base, 0.0, 2.0, velocity=300)
    drive(base, 2.0, 120.0)
    base.estop = True
    drive(base, 122.0, 3.0)
    assert base.body.fallen


def test_on_casters_it_does_not_fall() -> None:
    base = SegwayRmp(mode=f.TRACTOR)
    base.tick(0.0)
    assert base.status_words() == (0x0080, 0)
    base.receive_frame(command(0, 0, 16, 0), 0.0)
    base.tick(5.0)
    assert not base.body.fallen


def test_the_emergency_stop_switches_the_motors_off_for_good() -> None:
    base = SegwayRmp(mode=f.TRACTOR)
    base.tick(0.0)
    now = drive(base, 0.0, 1.0, velocity=329)
    base.estop = True
    now = drive(base, now, 2.0, velocity=329)
    assert base.body.speed == 0.0
    assert base.status_words() == (0x0008, 0x0202)
    base.receive_frame(command(0, 0, 16, 1), now)
    assert base.mode == f.DISABLED
    base.estop = False
    base.receive_frame(command(0, 0, 16, 1), now)
    assert base.motors


def test_a_low_and_an_empty_battery() -> None:
    base = SegwayRmp()
    base.tick(0.0)
    base.body.volts = 65.0
    assert base.status_words()[0] & 0x4000
    base.body.volts = 50.0
    drive(base, 0.0, 1.0, velocity=329)
    assert base.body.speed == 0.0
    assert base.status_words() == (0x05A0, 0x1010)


def test_the_battery_is_used_up() -> None:
    base = SegwayRmp()
    base.tick(0.0)
    before = base.body.volts
    drive(base, 0.0, 5.0, velocity=329)
    assert before - 0.1 < base.body.volts < before


def test_scales_limit_it() -> None:
    base = SegwayRmp()
    base.tick(0.0)
    for word in (10, 12):
        base.receive_frame(command(0, 0, word, 8), 0.0)
    drive(base, 0.0, 3.0, velocity=1176, turn=447)
    assert base.body.speed == pytest.approx(3.576 / 2, abs=0.01)
    assert base.body.turn == pytest.approx(0.5, abs=0.01)


def test_lockout_refuses_to_balance() -> None:
    base = SegwayRmp(mode=f.TRACTOR)
    base.receive_frame(command(0, 0, 15, 1), 0.0)
    base.receive_frame(command(0, 0, 16, 2), 0.0)
    assert (base.mode, base.refused) == (f.TRACTOR, 1)


def test_integrators_are_reset_one_by_one_and_wrap() -> None:
    base = SegwayRmp()
    base.preset_integrators(left=0x7FFFFFFF, right=5, forward=-3, yaw=9)
    base.tick(0.0)
    low, high = words(base, 0x403, 0.01)[:2]
    assert (low, high) == (0xFFFF, 0x7FFF)
    base.preset_integrators(left=0x80000000)
    assert words(base, 0x403, 0.02)[:2] == (0, 0x8000)
    base.preset_integrators(left=4, right=5, forward=-3, yaw=9)
    base.receive_frame(command(0, 0, 50, 0x02), 0.02)
    reading = base.reading()
    assert (reading.left_count, reading.right_count, reading.forward_count, reading.yaw_count) == (0, 5, -3, 9)
    base.receive_frame(command(0, 0, 50, 0x0F), 0.02)
    reading = base.reading()
    assert (reading.left_count, reading.right_count, reading.forward_count, reading.yaw_count) == (0, 0, 0, 0)


def test_the_frame_counter_wraps() -> None:
    base = SegwayRmp()
    base.frames = 0xFFFF
    base.tick(0.0)
    assert base.frames == 0


def test_off_and_on_again() -> None:
    base = SegwayRmp()
    base.tick(0.0)
    drive(base, 0.0, 1.0, velocity=329)
    base.receive_frame(CanFrame(0x412, bytes(8)), 1.0)
    assert [frame.id for _, frame in base.tick(1.01)] == [0x412, 0x414]
    base.receive_frame(command(1176), 1.02)
    base.power_on(5.0)
    base.tick(5.0)
    assert base.frames == 101
    assert base.reading().velocity == 0


def test_nonsense_is_counted_and_changes_nothing() -> None:
    base = SegwayRmp()
    for word, parameter in ((13, 3), (15, 2), (16, 4), (99, 0)):
        base.receive_frame(command(0, 0, word, parameter), 0.0)
    assert base.refused == 4
    base.receive_frame(CanFrame(COMMAND, b"\x01\x02"), 0.0)
    base.receive_frame(CanFrame(0x123, bytes(8)), 0.0)
    assert base.heard == 4


def test_there_is_no_rmp_300() -> None:
    with pytest.raises(UnknownRequest, match="50, 100, 200, 400"):
        SegwayRmp("300")
