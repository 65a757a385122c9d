"""The fake brick against the captures, and where they end."""

from __future__ import annotations

import struct
from collections.abc import Callable

import pytest

from urbihw_fakes import captures
from urbihw_fakes.nxt import codes
from urbihw_fakes.nxt.brick import Brick
from urbihw_fakes.nxt.inputs import Colour, Light, Plugged, Sound, Touch, normalise, raw_of
from urbihw_fakes.nxt.lowspeed import Ultrasonic
from urbihw_fakes.nxt.stream import NxtDevice
from urbihw_fakes.nxt.tribot import TriBot

EXCHANGES = captures.read("nxt")


def ask(brick: Brick, text: str, now: float = 1.0) -> bytes | None:
    return brick.telegram(bytes.fromhex(text), now)


def light_on_s3(brick: Brick) -> None:
    brick.plug(2, Light(reflected=400))
    ask(brick, "00 05 02 05 80", 0.0)


def turned_b(brick: Brick) -> None:
    ask(brick, "80 04 01 4b 07 01 00 20 00 00 00 00", 1.0)
    brick.motor("B").count(-1234, -10, 720)


def running(brick: Brick) -> None:
    ask(brick, EXCHANGES["start-program"].sent[0].hex(), 0.0)


def sonar_on_s4(brick: Brick) -> None:
    brick.plug(3, Ultrasonic(lambda: 37))
    ask(brick, "00 05 03 0b 00", 0.0)


def sonar_asked(brick: Brick) -> None:
    sonar_on_s4(brick)
    ask(brick, EXCHANGES["sonar-ask"].sent[0].hex(), 1.0)


def sonar_answered(brick: Brick) -> None:
    sonar_on_s4(brick)
    ask(brick, EXCHANGES["sonar-ask"].sent[0].hex(), 0.9)


def nothing_on_s4(brick: Brick) -> None:
    sonar_answered(brick)
    brick.plug(3, Plugged())
    ask(brick, EXCHANGES["sonar-ask"].sent[0].hex(), 0.95)


BEFORE: dict[str, Callable[[Brick], None]] = {
    "light-values": light_on_s3,
    "output-state": turned_b,
    "message": running,
    "sonar-ask": sonar_on_s4,
    "sonar-pending": sonar_asked,
    "sonar-ready": sonar_answered,
    "sonar-read": sonar_answered,
    "sonar-missing": nothing_on_s4,
}


@pytest.mark.parametrize("name", [name for name in EXCHANGES if not name.startswith("bluetooth")])
def test_the_brick_answers_as_captured(name: str) -> None:
    exchange = EXCHANGES[name]
    brick = Brick()
    if name in BEFORE:
        BEFORE[name](brick)
    replies = [brick.telegram(telegram, 1.0) for telegram in exchange.sent]
    assert [reply for reply in replies if reply is not None] == exchange.received


def test_bluetooth_puts_the_length_in_front_and_takes_frames_in_pieces() -> None:
    exchange = EXCHANGES["bluetooth-battery"]
    device = NxtDevice()
    assert device.feed(exchange.sent[0][:3], 0.0) == []
    (answer,) = device.feed(exchange.sent[0][3:] + exchange.sent[0][:1], 0.0)
    assert answer.data == exchange.received[0]
    assert 0 < answer.at <= 0.001


def test_what_is_no_telegram_is_dropped_in_silence() -> None:
    brick = Brick()
    for text in ("", "00", "05 0b", "01 97", "00 0b" + 63 * " 00"):
        assert ask(brick, text) is None
    assert NxtDevice().feed(b"\xff\xff" + bytes(300), 0.0) == []


def test_a_telegram_cut_short_is_insane() -> None:
    assert ask(Brick(), "00 04 00 4b") == bytes.fromhex("02 04 bf")


def test_values_right_after_a_change_of_the_type_are_not_valid() -> None:
    brick = Brick()
    ask(brick, "00 05 00 01 20")
    reply = ask(brick, "00 07 00")
    assert reply is not None and reply[:8] == bytes.fromhex("02 07 00 00 00 00 01 20")
    reply = ask(brick, "00 07 00", 1.03)
    assert reply is not None and reply[4] == 1


def scaled(brick: Brick, port: int, kind: int, mode: int) -> int:
    ask(brick, f"00 05 {port:02x} {kind:02x} {mode:02x}")
    reply = ask(brick, f"00 07 {port:02x}", 3.0)
    assert reply is not None
    return int(struct.unpack_from("<h", reply, 12)[0])


def test_sensors() -> None:
    brick = Brick()
    touch = Touch()
    for port, thing in enumerate((touch, Sound(0.6, 0.2), Light(raw_of(5, 0.7), raw_of(6, 0.1)), Colour(5))):
        brick.plug(port, thing)
    assert scaled(brick, 0, codes.SWITCH, codes.BOOLEAN) == 0
    touch.pressed = True
    assert scaled(brick, 0, codes.SWITCH, codes.BOOLEAN) == 1
    assert scaled(brick, 1, codes.SOUND_DB, codes.PERCENT) == pytest.approx(60, abs=1)
    assert scaled(brick, 1, codes.SOUND_DBA, codes.PERCENT) == pytest.approx(20, abs=1)
    assert scaled(brick, 2, codes.LIGHT_ACTIVE, codes.PERCENT) == pytest.approx(70, abs=1)
    assert scaled(brick, 2, codes.LIGHT_INACTIVE, codes.RAW) == pytest.approx(102, abs=2)
    assert scaled(brick, 3, codes.COLOUR_FULL, codes.RAW) == 5
    assert normalise(codes.LIGHT_ACTIVE, 0) == 1023 and normalise(codes.LIGHT_ACTIVE, 1023) == 0


def test_a_switch_counts_its_presses() -> None:
    brick, touch = Brick(), Touch()
    brick.plug(0, touch)
    ask(brick, "00 05 00 01 40", 0.0)
    for number in range(4):
        touch.pressed = number % 2 == 0
        brick.advance(0.1 + number / 10)
    reply = ask(brick, "00 07 00", 1.0)
    assert reply is not None and reply[12] == 4
    ask(brick, "00 08 00", 1.0)
    reply = ask(brick, "00 07 00", 1.1)
    assert reply is not None and reply[12] == 0


def test_a_motor_turns_and_stops_at_its_limit() -> None:
    brick = Brick()
    motor = brick.motor("A")
    ask(brick, "80 04 00 32 07 01 00 20 00 00 00 00", 0.0)
    brick.advance(2.0)
    assert motor.speed == pytest.approx(450, abs=1)
    assert motor.rotation == pytest.approx(900, abs=30)
    ask(brick, "80 04 00 00 07 01 00 20 00 00 00 00", 2.0)
    brick.advance(3.0)
    assert motor.speed == pytest.approx(0, abs=0.1)
    before = motor.rotation
    ask(brick, EXCHANGES["motor-limit"].sent[0].hex(), 3.0)
    brick.advance(5.0)
    assert motor.rotation == before + 360
    assert (motor.power, motor.run_state) == (0, codes.IDLE)


def test_coasting_takes_longer_than_braking() -> None:
    ways = []
    for stop in ("80 04 00 00 07 01 00 20 00 00 00 00", "80 04 00 00 00 00 00 00 00 00 00 00"):
        brick = Brick()
        ask(brick, "80 04 00 64 07 01 00 20 00 00 00 00", 0.0)
        brick.advance(1.0)
        start = brick.motor("A").position
        ask(brick, stop, 1.0)
        brick.advance(4.0)
        ways.append(brick.motor("A").position - start)
    assert ways[1] > 4 * ways[0] > 0


def test_a_program_that_stops_resets_motors_and_sensors() -> None:
    brick = Brick()
    running(brick)
    ask(brick, "80 04 00 64 07 01 00 20 00 00 00 00")
    ask(brick, "00 05 00 01 20")
    assert ask(brick, "00 01") == bytes.fromhex("02 01 00")
    assert brick.motor("A").power == 0
    assert brick.inputs[0].kind == codes.NO_SENSOR


def test_old_bytes_stay_on_the_bus_until_they_are_read() -> None:
    brick = Brick()
    sonar_answered(brick)
    ask(brick, EXCHANGES["sonar-ask"].sent[0].hex(), 1.0)
    assert ask(brick, "00 0e 03", 1.1) == bytes.fromhex("02 0e 00 02")


def test_the_bus_wants_time_after_the_type_was_set() -> None:
    brick = Brick()
    brick.plug(3, Ultrasonic(lambda: 37))
    ask(brick, "00 05 03 0b 00", 1.0)
    assert ask(brick, EXCHANGES["sonar-ask"].sent[0].hex(), 1.05) == bytes.fromhex("02 0f e0")
    assert ask(brick, EXCHANGES["sonar-ask"].sent[0].hex(), 1.11) == bytes.fromhex("02 0f 00")


def test_it_switches_itself_off_unless_kept_awake() -> None:
    brick = Brick()
    ask(brick, "00 0b", 0.0)
    ask(brick, "80 0d", 500.0)
    assert ask(brick, "00 0b", 1099.0) is not None
    assert ask(brick, "00 0b", 1101.0) is None
    brick.switch_on(1102.0)
    assert ask(brick, "00 0b", 1103.0) is not None


def test_sound() -> None:
    brick = Brick()
    ask(brick, "80 03 c8 00 00 00", 0.0)
    assert brick.sound.frequency == 220
    assert brick.sound.sounding(0.009) and not brick.sound.sounding(0.011)
    ask(brick, "80 03 b8 01 f4 01", 1.0)
    ask(brick, "80 0c", 1.1)
    assert not brick.sound.sounding(1.2)


def test_files_are_written_found_read_and_deleted() -> None:
    brick = Brick()
    name = b"notes.txt".ljust(20, b"\0").hex()
    assert ask(brick, f"01 81 {name} 05000000") == bytes.fromhex("02 81 00 00")
    assert ask(brick, "01 83 00 68656c6c6f21") == bytes.fromhex("02 83 8e 00 05 00")
    assert ask(brick, "01 84 00") == bytes.fromhex("02 84 00 00")
    assert ask(brick, f"01 81 {name} 05000000") == bytes.fromhex("02 81 8f 00")
    found = ask(brick, "01 86" + b"*.txt".ljust(20, b"\0").hex())
    assert found == bytes.fromhex(f"02 86 00 00 {name} 05000000")
    assert (ask(brick, "01 87 00") or b"")[2] == codes.FILE_NOT_FOUND
    assert ask(brick, f"01 80 {name}") == bytes.fromhex("02 80 00 01 05000000")
    assert ask(brick, "01 82 01 0800") == bytes.fromhex("02 82 85 01 0800") + b"hello\0\0\0"
    assert ask(brick, f"01 85 {name}") == bytes.fromhex(f"02 85 00 {name}")


def test_there_are_sixteen_handles() -> None:
    brick = Brick()
    name = b"Demo.rxe".ljust(20, b"\0").hex()
    statuses = [(ask(brick, f"01 80 {name}") or b"")[2] for _ in range(17)]
    assert statuses == [0] * 16 + [codes.NO_MORE_HANDLES]


def test_the_tribot_drives_to_the_wall_and_presses_its_bumper() -> None:
    robot = TriBot(1.0)
    brick = robot.brick
    ask(brick, "00 05 03 01 20", 0.0)
    for port in ("00", "02"):
        ask(brick, f"80 04 {port} 64 07 01 00 20 00 00 00 00", 0.0)
    brick.advance(1.0)
    assert 0.5 < robot.distance() < 0.7
    assert not robot.touch.pressed
    brick.advance(4.0)
    assert robot.distance() == 0 and robot.touch.pressed
    turned = TriBot(1.0)
    turned.brick.telegram(bytes.fromhex("80 04 00 64 07 01 00 20 00 00 00 00"), 0.0)
    turned.brick.advance(0.5)
    assert turned.heading > 0 and turned.distance() > 1.0
