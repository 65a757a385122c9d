"""AX-S1: distances, light, claps, buzzer, remote control."""

from __future__ import annotations

import pytest
from fake_talk import Talk

from urbihw_fakes.dynamixel.axs1 import AxS1
from urbihw_fakes.dynamixel.bus import ServoBus


@pytest.fixture
def sensor() -> AxS1:
    return AxS1()


@pytest.fixture
def wire(sensor: AxS1) -> Talk:
    return Talk(ServoBus([sensor]))


def test_factory_values(wire: Talk) -> None:
    assert wire.p1(100, "02 00 06") == "00 0D 00 10 64 01 FA"


def test_flags_compare_with_52_and_53(sensor: AxS1, wire: Talk) -> None:
    sensor.ir(99, 100, 101)
    sensor.light(5, 255, 0)
    assert wire.p1(100, "03 34 64 04") == "00"
    assert wire.p1(100, "02 1A 08") == "00 63 64 65 05 FF 00 04 03"


def test_compare_values_come_from_the_eeprom_at_power_on(sensor: AxS1, wire: Talk) -> None:
    wire.p1(100, "03 14 0A 0B")
    assert wire.p1(100, "02 34 02") == "00 20 80"
    sensor.power_off(0.0)
    sensor.power_on(0.0)
    assert wire.p1(100, "02 34 02") == "00 0A 0B"


def test_the_largest_sample_sticks_until_0_is_written(sensor: AxS1, wire: Talk) -> None:
    assert wire.p1(100, "02 23 02") == "00 80 00"
    sensor.sound(200)
    sensor.sound(140)
    assert wire.p1(100, "02 23 02") == "00 8C C8"
    wire.p1(100, "03 24 00")
    assert wire.p1(100, "02 24 01") == "00 00"


def test_claps_are_stored_800_ms_after_the_last(sensor: AxS1, wire: Talk) -> None:
    wire.p1(100, "01")
    sensor.clap(1.0, 3)
    # Claps at 1.0, 1.2 and 1.4.
    wire.now = 2.19
    assert wire.p1(100, "02 25 01") == "00 00"
    wire.now = 2.21
    assert wire.p1(100, "02 25 01") == "00 03"
    assert wire.p1(100, "02 24 01") == "00 FF"
    # It stays until it is cleared; one clap more is the size of the last burst.
    wire.p1(100, "03 25 00")
    sensor.clap(3.0)
    wire.now = 5.0
    assert wire.p1(100, "02 25 01") == "00 01"


def test_a_sound_within_80_ms_does_not_count(sensor: AxS1, wire: Talk) -> None:
    wire.p1(100, "01")
    sensor.clap(1.0, 5, spacing=0.05)
    wire.now = 3.0
    # At 0, 50, 100, 150, 200 ms: the second and fourth fall into the deaf time.
    assert wire.p1(100, "02 25 01") == "00 03"


def test_two_bursts_between_two_looks_leave_the_last(sensor: AxS1, wire: Talk) -> None:
    wire.p1(100, "01")
    sensor.clap(1.0, 4)
    sensor.clap(3.0, 2)
    wire.now = 10.0
    assert wire.p1(100, "02 25 01") == "00 02"


def test_sound_time_is_latched_and_restarts_at_a_write(sensor: AxS1, wire: Talk) -> None:
    wire.p1(100, "03 26 00 00")
    sensor.clap(0.001)
    wire.now = 0.5
    # 1 ms at 62.5 ns a tick.
    assert wire.p1(100, "02 26 02") == "00 80 3E"
    assert wire.p1(100, "02 26 02") == "00 80 3E"


@pytest.mark.parametrize(("time", "seconds"), [(0, 0.3), (3, 0.3), (4, 0.4), (50, 5.0), (51, 5.0), (253, 5.0)])
def test_a_note_ends_by_itself(sensor: AxS1, wire: Talk, time: int, seconds: float) -> None:
    assert wire.p1(100, f"03 28 0C {time:02X}") == "00"
    wire.now = seconds - 0.01
    assert wire.p1(100, "02 29 01") == f"00 {time:02X}"
    assert sensor.playing is not None
    wire.now = seconds + 0.01
    assert wire.p1(100, "02 29 01") == "00 00"
    assert sensor.playing is None


def test_254_rings_until_0_is_written(sensor: AxS1, wire: Talk) -> None:
    wire.p1(100, "03 28 00 FE")
    wire.now = 3600.0
    assert wire.p1(100, "02 29 01") == "00 FE"
    wire.p1(100, "03 29 00")
    assert wire.p1(100, "02 29 01") == "00 00"
    assert sensor.playing is None


def test_255_plays_a_melody(sensor: AxS1, wire: Talk) -> None:
    wire.p1(100, "03 28 1A FF")
    assert sensor.playing is not None and sensor.playing.melody and sensor.playing.number == 26
    wire.now = 10.0
    assert wire.p1(100, "02 29 01") == "00 00"
    # 52 notes: 52 is one too many.
    assert wire.p1(100, "03 28 34 0A") == "08"


def test_remote_control_in(sensor: AxS1, wire: Talk) -> None:
    sensor.remocon(0x1234)
    assert wire.p1(100, "02 2E 01") == "00 02"
    assert wire.p1(100, "02 30 02") == "00 34 12"
    assert wire.p1(100, "02 2E 01") == "00 00"


def test_remote_control_out_takes_both_bytes_at_once(sensor: AxS1, wire: Talk) -> None:
    assert wire.p1(100, "03 32 34") == "08"
    assert wire.p1(100, "03 32 34 12") == "00"
    assert sensor.sent == [0x1234]


def test_voltage_and_heat_are_told(sensor: AxS1, wire: Talk) -> None:
    sensor.volts, sensor.celsius = 5.0, 75.0
    assert wire.p1(100, "02 2A 02") == "05 32 4B"


def test_without_power_nothing_is_heard(sensor: AxS1, wire: Talk) -> None:
    wire.p1(100, "03 28 00 FE")
    sensor.power_off(0.0)
    sensor.clap(1.0, 2)
    wire.now = 5.0
    assert wire.p1(100, "01") == ""
    sensor.power_on(5.0)
    assert wire.p1(100, "02 25 05") == "00 00 00 00 00 00"
