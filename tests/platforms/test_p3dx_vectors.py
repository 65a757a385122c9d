"""Every documented packet, put to the driver's codecs: what it would send, and what it makes of what a robot sends."""

from __future__ import annotations

import math

import pytest

from urbihw.buses.errors import BadFrame, BadValue
from urbihw.navigation.lasers import lms200 as sick
from urbihw.platforms.p3dx import commands, packets, sip
from urbihw.platforms.p3dx.factors import ANGLE, FACTORS, factors_of
from urbihw.platforms.p3dx.protocol import ArcosFramer, command
from urbihw_fakes import captures

EXCHANGES = captures.read("p3dx")

COMMANDS: dict[str, tuple[str, int | bytes | None]] = {
    "cmd-sync0-pulse": ("PULSE", None),
    "cmd-sync1-open-no-argument": ("OPEN", None),
    "cmd-sync2-close-no-argument": ("CLOSE", None),
    "cmd-enable-1": ("ENABLE", 1),
    "cmd-enable-0": ("ENABLE", 0),
    "cmd-seta-plus-300": ("SETA", 300),
    "cmd-seta-minus-300": ("SETA", -300),
    "cmd-setv-500": ("SETV", 500),
    "cmd-seto": ("SETO", None),
    "cmd-move-plus-1000": ("MOVE", 1000),
    "cmd-move-minus-500": ("MOVE", -500),
    "cmd-rotate-plus-10": ("ROTATE", 10),
    "cmd-setrv-100": ("SETRV", 100),
    "cmd-vel-plus-200": ("VEL", 200),
    "cmd-vel-minus-200": ("VEL", -200),
    "cmd-head-90": ("HEAD", 90),
    "cmd-dhead-minus-45": ("DHEAD", -45),
    "cmd-say-500-ms-note-60-500-ms-note-64": ("SAY", bytes((25, 60, 25, 64))),
    "cmd-config-no-argument": ("CONFIG", None),
    "cmd-encoder-1-single": ("ENCODER", 1),
    "cmd-encoder-2-continuous": ("ENCODER", 2),
    "cmd-rvel-plus-30": ("RVEL", 30),
    "cmd-rvel-minus-30": ("RVEL", -30),
    "cmd-setra-plus-100": ("SETRA", 100),
    "cmd-sonar-1": ("SONAR", 1),
    "cmd-sonar-0": ("SONAR", 0),
    "cmd-stop": ("STOP", None),
    "cmd-vel2-left-plus-200-right-plus-200-mm-s-10-10": ("VEL2", commands.wheels(10, 10)),
    "cmd-vel2-left-minus-100-right-plus-100-mm-s-5-5": ("VEL2", commands.wheels(-5, 5)),
    "cmd-iorequest-1": ("IOREQUEST", 1),
    "cmd-bumpstall-3": ("BUMPSTALL", 3),
    "cmd-hostbaud-2-38400": ("HOSTBAUD", 2),
    "cmd-e-stop": ("E_STOP", None),
    "cmd-polling-1-8": ("POLLING", bytes(range(1, 9))),
    "cmd-sim-lrf-enable-1": ("SIM_LRF_ENABLE", 1),
    "cmd-sim-reset": ("SIM_RESET", None),
}
BARE = {"cmd-open-int-1": (1, 1), "cmd-close-int-1": (2, 1), "cmd-config-int-1": (18, 1)}
"""ARIA's forms of commands that we send without an argument."""


def sent(name: str) -> bytes:
    return EXCHANGES[name].sent[0]


def received(name: str) -> bytes:
    return EXCHANGES[name].received[0]


def body(name: str) -> bytes:
    """The body of a packet of the robot."""
    (found,) = ArcosFramer().feed(received(name))
    return found


def test_no_vector_is_left_out() -> None:
    assert {name for name in EXCHANGES if name.startswith("cmd-")} == COMMANDS.keys() | BARE.keys()


@pytest.mark.parametrize("name", COMMANDS)
def test_commands(name: str) -> None:
    assert commands.encode(*COMMANDS[name]).hex(" ") == sent(name).hex(" ")


@pytest.mark.parametrize("name", BARE)
def test_commands_as_aria_sends_them(name: str) -> None:
    assert command(*BARE[name]).hex(" ") == sent(name).hex(" ")


@pytest.mark.parametrize("name", [name for name in EXCHANGES if not name.startswith("sick-")])
def test_every_packet_comes_through_the_framer(name: str) -> None:
    exchange = EXCHANGES[name]
    framer = ArcosFramer()
    (found,) = framer.feed((exchange.sent + exchange.received)[0])
    assert framer.damaged == 0
    assert found == (exchange.sent + exchange.received)[0][3:-2]


def test_answer_to_sync2() -> None:
    assert packets.parse_names(body("reply-sync2")[1:]) == ("MyRobot", "Pioneer", "p3dx-sh")


def test_sip_a() -> None:
    seen = sip.parse(body("reply-sip-a"))
    assert (seen.moving, seen.x, seen.y, seen.theta, seen.left, seen.right) == (False, 0, 0, 0, 0, 0)
    assert (seen.battery, seen.stall, seen.flags) == (125, 0, 0x1F)
    assert seen.sonars == ((0, 5000), (8, 1234))
    assert (seen.digital_in, seen.digital_out) == (0xFF, 0xFF)
    assert seen.tail == {"battery_x10": 125, "charge_state": 0, "rotation": 0, "faults": 0}


def test_sip_b() -> None:
    seen = sip.parse(body("reply-sip-b"))
    assert seen.moving
    assert (seen.x, seen.y, seen.theta * ANGLE) == (0x7FFE, 100, -math.pi / 2)
    assert (seen.left, seen.right, seen.battery, seen.compass) == (150, 250, 121, 90)
    assert seen.stall & 1 and seen.stall >> 8 & 1
    assert sip.front_bumpers(seen.stall, 5) == (False, True, False, False, False)
    assert sip.rear_bumpers(seen.stall, 5) == (False, False, True, False, False)
    assert seen.flags == sip.MOTORS_ON | sip.STOP_BUTTON
    assert seen.sonars == ()
    assert seen.tail["rotation"] == 160


def test_sip_c_ends_where_old_firmware_ends() -> None:
    seen = sip.parse(body("reply-sip-c"))
    assert seen.x * FACTORS["p3dx"].distance == pytest.approx(0.485)
    assert seen.x * FACTORS["p3dx-sh"].distance == 1.0
    assert seen.theta * ANGLE == math.pi / 2
    assert seen.tail == {}


def test_position_wraps_the_short_way() -> None:
    odometer = sip.Odometer()
    odometer.add_sip(sip.parse(body("reply-sip-a")))
    odometer.add_sip(sip.parse(body("reply-sip-b")))
    assert (odometer.x, odometer.y, odometer.theta) == (-2, 100, -1024)
    odometer.restart()
    odometer.add_sip(sip.parse(body("reply-sip-c")))
    assert (odometer.x, odometer.y, odometer.theta) == (-2, 100, -1024)


def test_encoders() -> None:
    assert packets.PACKETS[0x90].read(body("reply-encoder")[1:]) == {"left": 123456, "right": -2}


def test_inputs_and_outputs() -> None:
    values = packets.PACKETS[0xF0].read(body("reply-io")[1:])
    assert values == {"digital_in": [255] * 3, "digital_out": [0], "analog": [0] * 8 + [512]}


def test_configuration_ends_early_and_the_rest_is_zero() -> None:
    values = packets.parse_config(body("reply-config")[1:])
    expected = {
        "class": "Pioneer", "subclass": "p3dx-sh", "serial": "SIM1", "rot_vel_top": 360, "trans_vel_top": 1500,
        "rot_accel_top": 300, "trans_accel_top": 2000, "pwm_max": 400, "name": "fake", "sip_cycle": 100,
        "front_sonar": 1, "rear_sonar": 1, "low_battery": 115, "rev_count": 16570, "watchdog": 2000,
        "stall_val": 200, "stall_count": 200, "joy_vel": 400, "joy_rvel": 100, "rot_vel_max": 100,
        "trans_vel_max": 750, "rot_accel": 100, "rot_decel": 100, "rot_kp": 40, "rot_kv": 20, "rot_ki": 0,
        "trans_accel": 300, "trans_decel": 300, "trans_kp": 40, "trans_kv": 30, "trans_ki": 0, "sonar_cycle": 40,
        "auto_baud": 2, "ticks_mm": 138, "shutdown_volts": 110, "firmware": "2.0",
        "kinematics_delay": 0, "bootloader": "",
    }  # fmt: skip
    assert {name: values[name] for name in expected} == expected


# --- what must not be taken for a packet ------------------------------------------------------------------------------


def test_a_flipped_bit_is_seen_and_the_next_packet_is_not_lost() -> None:
    good = received("reply-sip-a")
    framer = ArcosFramer()
    assert framer.feed(good[:-1] + bytes((good[-1] ^ 1,)) + good) == [good[3:-2]]
    assert framer.damaged == 1


def test_a_truncated_packet_does_not_swallow_the_next() -> None:
    good = received("reply-sip-b")
    framer = ArcosFramer()
    found = [found for _ in range(3) for found in framer.feed(good)]
    cut = framer.feed(good[:20] + good + good)
    assert found == [good[3:-2]] * 3
    assert cut == [good[3:-2]] * 2


def test_a_doubled_first_byte_loses_nothing() -> None:
    assert ArcosFramer().feed(bytes.fromhex("FA FA FB 03 00 00 00")) == [b"\0"]


def test_a_count_below_three_is_skipped() -> None:
    assert ArcosFramer().feed(bytes.fromhex("FA FB 02 00 00 FA FB 03 01 00 01")) == [b"\1"]


def test_bytes_may_come_one_by_one_between_garbage() -> None:
    framer = ArcosFramer()
    stream = b"\xfa\x00\xfa" + sent("cmd-vel-plus-200") + b"\xfb\xfa" + sent("cmd-stop")
    assert [found for byte in stream for found in framer.feed(bytes((byte,)))] == [b"\x0b\x3b\xc8\x00", b"\x1d"]


@pytest.mark.parametrize("cut", [5, 19, 22, 24])
def test_a_sip_that_is_too_short_is_no_sip(cut: int) -> None:
    with pytest.raises(BadFrame):
        sip.parse(body("reply-sip-a")[:cut])


@pytest.mark.parametrize("kind", sorted(packets.PACKETS))
def test_packets_that_end_early_are_refused_or_empty(kind: int) -> None:
    try:
        assert packets.PACKETS[kind].read(b"") in ({}, {"data": b""})
    except BadFrame as error:
        assert "ends early" in str(error)


@pytest.mark.parametrize(
    "name, value, why",
    [("FLY", None, "no command"), ("VEL", None, "a number"), ("STOP", 1, "nothing"), ("SAY", 3, "bytes"),
     ("VEL", 40000, "32767"), ("MAINTENANCE", None, "no command"), ("DIGOUT", -1, "65535"),
     ("SAY", bytes(200), "too long")],
)  # fmt: skip
def test_what_cannot_be_sent(name: str, value: int | bytes | None, why: str) -> None:
    with pytest.raises(BadValue, match=why):
        commands.encode(name, value)


def test_wheels_are_limited() -> None:
    with pytest.raises(BadValue, match="left wheel 127"):
        commands.wheels(127, 0)


def test_factors_by_subclass() -> None:
    assert factors_of("P3DX-SH") == (FACTORS["p3dx-sh"], True)
    assert factors_of("p3dx-sh-lms500") == (FACTORS["p3dx-sh"], True)
    assert factors_of("roomba") == (FACTORS["p3dx-sh"], False)
    assert factors_of("p3at-new") == (FACTORS["p3at-sh"], False)
    assert 2 * FACTORS["p3dx"].half_track == pytest.approx(0.357, abs=0.001)


# --- the laser --------------------------------------------------------------------------------------------------------

TELEGRAMS = {
    "sick-baud-38400": sick.baud(38400),
    "sick-baud-19200": sick.baud(19200),
    "sick-baud-9600": sick.baud(9600),
    "sick-baud-500000": sick.baud(500000),
    "sick-start-continuous": sick.START,
    "sick-stop": sick.STOP,
    "sick-variant-180-deg-1-0-deg": sick.variant(180, 100),
    "sick-variant-180-deg-0-5-deg": sick.variant(180, 50),
}


@pytest.mark.parametrize("name", TELEGRAMS)
def test_telegrams(name: str) -> None:
    assert sick.telegram(TELEGRAMS[name]).hex(" ") == sent(name).hex(" ")


def test_replies_of_the_laser() -> None:
    stream = b"\x06" + received("sick-reply-a0-ok-status-0x10") + b"\x06" + received(
        "sick-reply-bb-ok-180-1-0-status-0x10"
    )
    mode, angles = sick.SickFramer().feed(stream)
    assert mode == sick.SickReply(sick.MODE_REPLY, b"\0", 0x10)
    assert angles == sick.SickReply(sick.VARIANT_REPLY, bytes.fromhex("01 B4 00 64 00"), 0x10)


def test_scan() -> None:
    (reply,) = sick.SickFramer().feed(received("sick-scan"))
    scan = sick.parse_scan(reply)
    assert scan.ranges == tuple((1000 + index) * 0.001 for index in range(181))
    assert scan.farthest == 8.182 and not scan.dirty


def test_readings_that_are_no_distances() -> None:
    data = bytes.fromhex("03 40 FF 1F F7 1F F6 FF")
    scan = sick.parse_scan(sick.SickReply(sick.SCAN, data, 0x80))
    assert list(scan.ranges) == pytest.approx([math.inf, math.inf, 8.182])
    assert scan.dirty


@pytest.mark.parametrize("data", ["", "01", "02 40 00 00", "01 C0 00 00"])
def test_scans_without_sense(data: str) -> None:
    with pytest.raises(BadFrame):
        sick.parse_scan(sick.SickReply(sick.SCAN, bytes.fromhex(data), 0))


def test_damage_costs_one_telegram() -> None:
    good = received("sick-scan")
    framer = sick.SickFramer()
    replies = framer.feed(b"\x02\x02" + good[:200] + good + good[:-1] + b"\x00" + good)
    assert len(replies) == 2
    assert framer.damaged >= 1


def test_scans_of_the_simulator_come_in_pieces() -> None:
    laser = packets.SimLaser()

    def piece(first: int, number: int, total: int = 40) -> bytes:
        head = bytes(6) + total.to_bytes(2, "little", signed=True) + first.to_bytes(2, "little") + bytes((number,))
        return head + b"".join((100 + index).to_bytes(2, "little") for index in range(first, first + number))

    assert laser.feed(0x60, piece(0, 32)) is None
    assert laser.feed(0x60, piece(32, 8)) == [100 + index for index in range(40)]
    assert laser.feed(0x60, piece(32, 8)) is None
    for bad in (piece(32, 9), piece(0, 1, -1), piece(0, 5)[:-1]):
        with pytest.raises(BadFrame):
            laser.feed(0x60, bad)
