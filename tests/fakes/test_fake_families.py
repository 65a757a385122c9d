"""Servos of the families RX, EX, MX, XL-320, P, PRO and Y: bytes in, bytes out, and where the horn stands.

The packets are those of the e-manual and of the project's sheet wherever one exists.
"""

from __future__ import annotations

import pytest

from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.dynamixel.catalogue import make_servo, make_servos
from urbihw_fakes.dynamixel.servo import Shaft
from urbihw_fakes.errors import UnknownRequest


def bus(text: str) -> Bioloid:
    made = Bioloid(units=make_servos(text))
    for unit in made:
        unit.registers.put("return_delay", 0)
    return made


def say(kit: Bioloid, packet: str, now: float = 0.0) -> str:
    kit.tick(now)
    return b"".join(answer.data for answer in kit.feed(bytes.fromhex(packet), now)).hex(" ").upper()


def shaft(kit: Bioloid, number: int = 1) -> Shaft:
    unit = kit[number]
    assert isinstance(unit, Shaft)
    return unit


@pytest.mark.parametrize("model", ["RX-28", "EX-106+", "MX-28", "MX-106"])
def test_protocol_1_answers_as_documented(model: str) -> None:
    kit = bus(f"{model}:1")
    assert say(kit, "FF FF 01 02 01 FB") == "FF FF 01 02 00 FC"
    assert say(kit, "FF FF 01 04 02 2B 01 CC") == "FF FF 01 03 00 20 DB"  # 32 degC
    # A goal waits for ACTION; speeds beyond 1023 are for wheels: range error.
    assert say(kit, "FF FF 01 05 04 1E F4 01 E2") == "FF FF 01 02 00 FC"
    assert say(kit, "FF FF FE 02 05 FA") == ""
    assert kit[1].registers.get("goal_position") == 500
    assert say(kit, "FF FF 01 05 03 20 00 06 D0") == "FF FF 01 02 08 F4"


def test_an_mx_answers_a_bulk_read_and_an_rx_turns_by_shares() -> None:
    kit = bus("MX-28:1,MX-28:2")
    answer = say(kit, "FF FF FE 09 92 00 02 01 1E 02 02 24 1D")
    assert answer == "FF FF 01 04 00 00 08 F2 FF FF 02 04 00 00 08 F1"  # goal and place 2048
    kit = bus("RX-28:1")
    assert say(kit, "FF FF 01 07 03 06 00 00 00 00 EE") == "FF FF 01 02 00 FC"  # wheel mode
    assert say(kit, "FF FF 01 05 03 20 00 06 D0") == "FF FF 01 02 00 FC"  # 50 % clockwise
    kit[1].registers.put("torque_enable", 1)
    begin = shaft(kit).position
    kit.tick(1.0)
    turned = (shaft(kit).position - begin) / shaft(kit).family.counts
    assert turned == pytest.approx(-67 / 60 * 512 / 1023, rel=0.01)


def test_a_goal_outside_the_angle_limits_is_refused() -> None:
    kit = bus("MX-28:1")
    kit[1].registers.put("high_limit", 3000)
    assert say(kit, "FF FF 01 05 03 1E A0 0F 29") == "FF FF 01 02 02 FA"  # 4000: angle limit error
    assert kit[1].registers.get("goal_position") == 2048


@pytest.mark.parametrize("model", ["PH54-200-S500-R", "H54-200-S500-R"])
def test_large_servos_refuse_the_eeprom_while_the_torque_is_on(model: str) -> None:
    kit = bus(f"{model}:1")
    kit[1].registers.put("torque_enable", 1)
    # Write 1 to address 7 (id); the answer is the access error of the sheet.
    assert say(kit, "FF FF FD 00 01 06 00 03 07 00 01 B7 63") == "FF FF FD 00 01 04 00 55 07 B0 8C"
    kit[1].registers.put("torque_enable", 0)
    kit[1].pin_register("hardware_error", 1)
    assert say(kit, "FF FF FD 00 01 06 00 03 07 00 01 B7 63") == "FF FF FD 00 01 04 00 55 80 A2 8F"  # alert


@pytest.mark.parametrize(
    ("model", "goal", "seconds", "speed"),
    [
        ("MX-28", 3000, 1.0, None),
        ("XL-320", 900, 1.0, None),
        ("PH54-200-S500-R", 100_000, 1.0, 2900),
        ("H54-200-S500-R", 100_000, 1.0, None),
        ("YM070-210-R099-RH", 50_000, 1.0, 2020),
    ],
)
def test_joints_arrive_and_limp_ones_stay(model: str, goal: int, seconds: float, speed: int | None) -> None:
    kit = bus(f"{model}:1")
    unit = shaft(kit)
    begin = unit.position
    kit.tick(0.0)
    unit.registers.put("goal_position", goal)
    kit.tick(seconds)
    assert unit.position == begin
    unit.registers.put("torque_enable", 1)
    kit.tick(2 * seconds)
    assert unit.position == goal and unit.speed == 0.0
    unit.held = True
    unit.registers.put("goal_position", round(begin))
    kit.tick(3 * seconds)
    assert unit.position == goal


def test_a_torque_limit_of_0_takes_the_torque_as_after_an_alarm() -> None:
    kit = bus("MX-28:1")
    kit[1].registers.put("torque_enable", 1)
    kit[1].registers.put("torque_limit", 0)
    kit[1].registers.put("goal_position", 3000)
    kit.tick(0.0)
    kit.tick(1.0)
    assert shaft(kit).position == 2048


@pytest.mark.parametrize(("text", "error"), [("MX-28", "MODEL:ID"), ("MX-28:300", "MODEL:ID"), ("NX-1:3", "no")])
def test_a_chain_that_makes_no_sense_is_refused(text: str, error: str) -> None:
    with pytest.raises(UnknownRequest, match=error):
        make_servos(text)


def test_names_may_be_cut_short() -> None:
    assert make_servo("XL330", 5).registers.get("model") == 1200
    assert make_servo("PH54", 5).registers.get("model") == 2020
