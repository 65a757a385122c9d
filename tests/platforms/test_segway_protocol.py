"""Every documented frame, put to the driver's half: what it sends, and what it reads."""

from __future__ import annotations

import math
import random

import pytest

from urbihw.buses.can.frame import CanFrame
from urbihw.platforms.segway import protocol as p
from urbihw.platforms.segway.monitor import Monitor
from urbihw.platforms.segway.usb import UsbReader, packet
from urbihw_fakes import captures

EXCHANGES = captures.read("segway")

SENT: dict[str, bytes | tuple[str, int]] = {
    "heartbeat-stand-still": p.command(0, 0),
    "velocity-plus-332-turn-0": p.command(332, 0),
    "velocity-plus-332-turn-plus-78": p.command(332, 78),
    "velocity-minus-166": p.command(-166, 0),
    "velocity-plus-1176-turn-minus-1024-limits": p.command(20000, -20000),
    "maximum-velocity-scale-16-16": ("velocity_scale", 16),
    "maximum-velocity-scale-8-16": ("velocity_scale", 8),
    "maximum-acceleration-16-16": ("acceleration_scale", 16),
    "maximum-turn-16-16": ("turn_scale", 16),
    "gain-schedule-heavy": ("gain", p.GAINS.index("heavy")),
    "current-limit-256-full": ("current_limit", 256),
    "current-limit-128-half": ("current_limit", 128),
    "balance-lockout-on": ("lockout", 1),
    "balance-lockout-off": ("lockout", 0),
    "mode-disabled": ("mode", p.MODES.index("disabled")),
    "mode-tractor": ("mode", p.MODES.index("tractor")),
    "mode-balance": ("mode", p.MODES.index("balance")),
    "mode-power-down": ("mode", p.MODES.index("power down")),
    "reset-right-wheel-integrator": ("reset", 1),
    "reset-left-wheel-integrator": ("reset", 2),
    "reset-yaw-integrator": ("reset", 4),
    "reset-fore-aft-integrator": ("reset", 8),
    "reset-all-integrators": ("reset", p.ALL_INTEGRATORS),
}
# SI values of the sheets: scaled with the factors of an RMP 200.
DEGREE, SPEED, METRE, TURN, TORQUE = 7.8, 332, 33215, 112644, 1094
READ: dict[str, dict[str, float]] = {
    "log-0400": {"build": 2032},
    "log-0401": {
        "pitch": 0.897 * DEGREE,
        "pitch_rate": 0.256 * DEGREE,
        "roll": 0.256 * DEGREE,
        "roll_rate": 1.026 * DEGREE,
    },
    "log-0402": {"left_speed": 0, "right_speed": 0, "yaw_rate": -4.103 * DEGREE, "servo_frames": 530},
    "log-0403": {"left": -0.4967 * METRE, "right": -0.8707 * METRE},
    "log-0404": {"forward": 0.5685 * METRE, "yaw": 67997},
    "log-0405": {"left_torque": -0.0384 * TORQUE, "right_torque": 0.0229 * TORQUE},
    "log-0406": {"mode": 1, "gain": 0, "box_battery": (6.3625 - 1.4) / 0.0125, "battery": 76.0 * 4},
    "log-0407": {"velocity": 0, "turn": 0},
    "log-0680": {"status1": 0x0080, "status2": 0},
    "log-0688": {},
    "log-0412": {},
    "test-0401": {
        "pitch": -0.897 * DEGREE,
        "pitch_rate": 1.923 * DEGREE,
        "roll": -0.128 * DEGREE,
        "roll_rate": 1.154 * DEGREE,
    },
    "test-0402": {
        "left_speed": 0.0361 * SPEED,
        "right_speed": -0.0422 * SPEED,
        "yaw_rate": 9.615 * DEGREE,
        "servo_frames": 6356,
    },
    "test-0403": {"left": -0.01523 * METRE, "right": 0.002378 * METRE},
    "test-0404": {"forward": -0.03008 * METRE, "yaw": -0.26845 / 360 * TURN},
    "test-0405": {"left_torque": -0.0064 * TORQUE, "right_torque": 0.1527 * TORQUE},
    "test-0406": {"mode": 1, "gain": 0, "box_battery": (9.325 - 1.4) / 0.0125, "battery": 78.0 * 4},
}


def frame_of(data: bytes) -> CanFrame:
    return CanFrame(int.from_bytes(data[:2], "big"), data[2:])


@pytest.mark.parametrize("name", SENT)
def test_commands_are_those_documented(name: str) -> None:
    wanted = SENT[name]
    if isinstance(wanted, tuple):
        number, most = p.CONFIGURATIONS[wanted[0]]
        assert wanted[1] <= most
        wanted = p.command(0, 0, number, wanted[1])
    bus, usb = EXCHANGES[name].sent
    frame = CanFrame(p.COMMAND, wanted)
    assert frame == frame_of(bus)
    assert packet(frame).hex(" ") == usb.hex(" ")


def test_the_shutdown_is_the_one_documented() -> None:
    bus, usb = EXCHANGES["shutdown"].sent
    frame = CanFrame(p.SHUTDOWN, bytes(8))
    assert (frame, packet(frame)) == (frame_of(bus), usb)


@pytest.mark.parametrize("name", READ)
def test_readings_are_read(name: str) -> None:
    bus, usb = EXCHANGES[name].received
    frame = frame_of(bus)
    assert UsbReader().feed(usb) == [frame]
    # The sheets round: half a count, or the last digit they print.
    assert p.decode(frame.id, frame.data) == pytest.approx(READ[name], abs=2.5)


def test_every_exchange_is_looked_at() -> None:
    assert {*SENT, *READ, "shutdown"} == set(EXCHANGES)


# ---------------------------------------------------------------- what is no frame

GOOD = EXCHANGES["log-0401"].received[1]
FRAME = frame_of(EXCHANGES["log-0401"].received[0])


def test_a_wrong_sum_is_dropped_and_the_next_packet_is_found() -> None:
    reader = UsbReader()
    assert reader.feed(GOOD[:-1] + bytes([GOOD[-1] + 1])) == []
    assert reader.feed(GOOD) == [FRAME]
    assert reader.damaged == 1


def test_channel_b_and_the_old_heartbeat_are_ignored() -> None:
    reader = UsbReader()
    channel_b = GOOD[:2] + b"\xbb" + GOOD[3:-1]
    heartbeat = b"\xf0\x00" + bytes(15)
    for body in (channel_b, heartbeat):
        total = sum(body)
        total = (total & 0xFF) + (total >> 8)
        assert reader.feed(body + bytes([-((total & 0xFF) + (total >> 8)) & 0xFF])) == []
    assert reader.damaged == 0


@pytest.mark.parametrize("junk", [b"1234567", b"\xf0" * 7, b"\xf0\x55\xaa", GOOD[:11], bytes(1000), b"\xf0" * 1000])
def test_garbage_before_a_packet_counts_for_its_length(junk: bytes) -> None:
    reader = UsbReader()
    assert reader.feed(junk + GOOD + GOOD)[-1:] == [FRAME]
    assert reader.damaged == math.ceil(len(junk) / len(GOOD))


def test_packets_cut_short_are_counted_as_they_come() -> None:
    reader = UsbReader()
    for count in range(1, 11):
        # Packets cut short: each is followed by the next.
        for _ in range(18):
            reader.feed(bytes.fromhex("F0 55 AA 00 80 00 00"))
        assert 7 * count - 3 <= reader.damaged <= 7 * count


def test_packets_come_in_pieces() -> None:
    reader = UsbReader()
    found = [frame for byte in GOOD + GOOD for frame in reader.feed(bytes([byte]))]
    assert found == [FRAME, FRAME]
    assert reader.damaged == 0


def test_endless_garbage_does_not_fill_the_memory() -> None:
    reader = UsbReader()
    for _ in range(1000):
        assert reader.feed(b"\xf0\x55" * 500) == []
    assert len(reader._rest) < 300


def test_whatever_comes_nothing_breaks() -> None:
    chance = random.Random(1)
    reader, monitor = UsbReader(), Monitor()
    for step in range(300):
        piece = bytes(chance.choice(b"\xf0\x55\xaa\x00\x80\xff") for _ in range(chance.randrange(200)))
        for frame in reader.feed(piece + GOOD[: chance.randrange(len(GOOD) + 1)]):
            monitor.add_frame(frame, step / 100)
        monitor.add_frame(CanFrame(chance.randrange(0x800), chance.randbytes(chance.randrange(9))), step / 100)
    for identifier in range(0x400, 0x408):
        monitor.add_frame(CanFrame(identifier, chance.randbytes(8)), 4.0)
    assert monitor.heard_at == 4.0


@pytest.mark.parametrize(("identifier", "data"), [(0x401, b""), (0x401, bytes(7)), (0x123, bytes(8)), (0x7FF, b"")])
def test_frames_that_are_none_of_it_hold_nothing(identifier: int, data: bytes) -> None:
    assert p.decode(identifier, data) == {}


# ---------------------------------------------------------------- numbers


def test_long_values_have_their_low_word_first() -> None:
    assert p.decode(0x403, bytes.fromhex("1234 0001 0000 8000"))["left"] == 0x00011234
    assert p.decode(0x403, bytes.fromhex("1234 0001 0000 8000"))["right"] == -0x80000000


@pytest.mark.parametrize(
    ("new", "old", "bits", "way"),
    [
        (5, 3, 32, 2),
        (-0x80000000, 0x7FFFFFFF, 32, 1),
        (0x7FFFFFFF, -0x80000000, 32, -1),
        (2, 0xFFFF, 16, 3),
        (0, 0x8000, 16, -0x8000),
    ],
)
def test_differences_of_counters_that_wrap(new: int, old: int, bits: int, way: int) -> None:
    assert p.difference(new, old, bits) == way


def test_status_words_in_words() -> None:
    assert p.fault_words(0x0080, 0) == ""
    assert p.fault_words(0x0180, 0) == ""
    assert p.motors_on(0x0180) and not p.motors_on(0x0100)
    assert p.fault_words(0x4008, 0x0202) == "motors disabled on request, battery low, emergency stop switch open"
    assert p.fault_words(0x0001, 0x0100) == "safety shutdown, pitch angle limit"


def test_the_full_scales() -> None:
    assert math.isclose(p.MOST_VELOCITY / 3.576, 328.8, rel_tol=1e-3)
    assert p.command(-5000, 5000) == bytes.fromhex("FB68 0400 0000 0000")
