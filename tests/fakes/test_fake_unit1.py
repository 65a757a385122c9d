"""Protocol 1.0: what a unit does with each instruction."""

from __future__ import annotations

import pytest
from fake_talk import Talk, packet1

from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.dynamixel.ax12 import Ax12
from urbihw_fakes.dynamixel.bus import ServoBus
from urbihw_fakes.dynamixel.registers import Register, RegisterFile
from urbihw_fakes.errors import UnknownRequest


@pytest.fixture
def kit() -> Bioloid:
    return Bioloid()


@pytest.fixture
def wire(kit: Bioloid) -> Talk:
    return Talk(kit)


def test_factory_values(wire: Talk) -> None:
    assert wire.p1(7, "02 00 0A") == "00 0C 00 18 07 01 FA 00 00 FF 03"
    assert wire.p1(7, "02 0B 08") == "00 46 3C 8C FF 03 02 24 24"
    assert wire.p1(7, "02 18 0C") == "00 00 00 01 01 20 20 00 02 00 00 FF 03"
    assert wire.p1(7, "02 2C 06") == "00 00 00 00 00 20 00"


def test_nobody_answers_for_a_missing_id(wire: Talk) -> None:
    assert wire.p1(19, "01") == ""


def test_reading_past_the_table_is_a_range_error(wire: Talk) -> None:
    assert wire.p1(1, "02 31 01") == "00 00"
    assert wire.p1(1, "02 31 02") == "08"
    assert wire.p1(1, "02 00 00") == "08"


@pytest.mark.parametrize(
    "write",
    [
        "03 04 FF",  # baud 255
        "03 06 00 04",  # CW limit 1024
        "03 24 00 00",  # present position is read only
        "03 0A 00",  # reserved
        "03 1E 00",  # half a goal
        "03 1F 00",  # the other half
        "03 1E 00 02 00",  # a goal and half a speed
        "03 18 02",  # torque enable 2
        "03 1C 00",  # slope 0
        "03 0C 31",  # minimum voltage 4.9 V
        "03 20 00 04",  # speed 1024 in joint mode
        "03 2F 00",  # lock 0
        "03 31 00 00",  # punch and beyond
    ],
)
def test_refused_writes_change_nothing(wire: Talk, write: str) -> None:
    before = wire.p1(1, "02 00 32")
    assert wire.p1(1, write) == "08"
    assert wire.p1(1, "02 00 32") == before


def test_a_write_is_done_whole_or_not_at_all(wire: Talk, kit: Bioloid) -> None:
    # The torque is fine, the LED 2 is not.
    assert wire.p1(1, "03 18 01 02") == "08"
    assert kit[1].registers.get("torque_enable") == 0


def test_the_lock_closes_the_eeprom_until_power_off(wire: Talk, kit: Bioloid) -> None:
    assert wire.p1(1, "03 2F 01") == "00"
    assert wire.p1(1, "03 05 00") == "08"
    assert wire.p1(1, "03 19 01") == "00"
    kit.power_off(0.0)
    kit.power_on(0.0)
    assert wire.p1(1, "03 05 00") == "00"


def test_unknown_instruction(wire: Talk) -> None:
    assert wire.p1(1, "55") == "40"
    assert wire.p1(1, "02 00") == "40"


def test_wrong_checksum(wire: Talk) -> None:
    assert wire.raw("FF FF 01 02 01 FF") == ["FF FF 01 02 10 EC"]
    # A broadcast is not answered.
    assert wire.raw("FF FF FE 04 03 18 00 00") == []


def test_reg_write_waits_for_action(wire: Talk, kit: Bioloid) -> None:
    assert wire.p1(1, "05") == "40"
    assert wire.p1(1, "04 1E F4 01") == "00"
    assert wire.p1(1, "02 2C 01") == "00 01"
    assert kit[1].registers.get("goal_position") == 512
    assert wire.p1(1, "05") == "00"
    assert wire.p1(1, "02 2C 01") == "00 00"
    assert kit[1].registers.get("goal_position") == 500
    assert wire.p1(1, "04 04 FF") == "08"
    assert wire.p1(1, "05") == "40"


def test_action_of_all_is_not_answered(wire: Talk, kit: Bioloid) -> None:
    wire.p1(1, "04 19 01")
    wire.p1(2, "04 19 01")
    assert wire.p1(254, "05") == ""
    assert [kit[i].registers.get("led") for i in (1, 2, 3)] == [1, 1, 0]


@pytest.mark.parametrize(
    ("level", "answers"), [(0, ["00", "", ""]), (1, ["00", "00 00", ""]), (2, ["00", "00 00", "00"])]
)
def test_status_return_level(wire: Talk, level: int, answers: list[str]) -> None:
    wire.p1(1, f"03 10 {level:02X}")
    assert [wire.p1(1, "01"), wire.p1(1, "02 19 01"), wire.p1(1, "03 19 00")] == answers


def test_broadcast_is_obeyed_and_not_answered(wire: Talk, kit: Bioloid) -> None:
    assert wire.p1(254, "03 19 01") == ""
    assert wire.p1(254, "02 19 01") == ""
    assert [unit.registers.get("led") for unit in kit if isinstance(unit, Ax12)] == [1] * 18


def test_reset_goes_back_to_the_factory_id_and_speed(wire: Talk) -> None:
    wire.p1(7, "03 04 09")
    wire.p1(1, "03 03 1E")
    assert wire.p1(7, "06") == "00"
    assert wire.p1(7, "01") == ""
    assert wire.p1(1, "02 03 03") == "00 01 01 FA"


def test_reset_of_all_is_not_obeyed(wire: Talk) -> None:
    assert wire.p1(254, "06") == ""
    assert wire.p1(7, "01") == "00"


def test_a_new_id_answers_from_the_next_request_on(wire: Talk) -> None:
    assert wire.p1(7, "03 03 1E") == "00"
    assert wire.p1(7, "01") == ""
    assert wire.p1(30, "01") == "00"


def test_sync_write_skips_the_missing_and_the_cut(wire: Talk, kit: Bioloid) -> None:
    assert wire.p1(254, "83 19 01 01 01 63 01 02 01 03") == ""
    assert [kit[i].registers.get("led") for i in (1, 2, 3)] == [1, 1, 0]


def test_an_ax_ignores_bulk_read(wire: Talk) -> None:
    assert wire.p1(254, "92 00 01 01 19") == ""


def test_bulk_read_where_the_firmware_knows_it(wire: Talk, kit: Bioloid) -> None:
    for unit in kit:
        if isinstance(unit, Ax12):
            unit.answers_bulk_read = True
    request = "92 00 01 01 03 02 02 24 01 01 04"
    # The repeated ID 1 is ignored.
    assert wire.raw(_packet(254, request)) == ["FF FF 01 03 00 01 FA", "FF FF 02 04 00 00 02 F7"]


def _packet(unit: int, body: str) -> str:
    return packet1(unit, body).hex()


def test_register_names_and_sizes_are_checked() -> None:
    table = RegisterFile([Register("small", 0, 1), Register("signed", 1, 2, low=-5, high=5, signed=True)])
    table.put("signed", -2)
    assert table.read(0, 3) == bytes.fromhex("00 FE FF")
    with pytest.raises(UnknownRequest, match="'big'"):
        table.get("big")
    with pytest.raises(UnknownRequest, match="300 does not fit"):
        table.put("small", 300)


def test_a_held_register_stays_until_released(wire: Talk, kit: Bioloid) -> None:
    kit[1].pin_register("present_temperature", 99)
    assert wire.p1(1, "02 2B 01") == "00 63"
    kit[1].unpin_register("present_temperature")
    assert wire.p1(1, "02 2B 01") == "00 20"


def test_two_units_of_one_id_spoil_each_others_answer() -> None:
    wire = Talk(ServoBus([Ax12(1), Ax12(1)]))
    (answer,) = wire.raw("FF FF 01 02 01 FB")
    assert answer == "FF FF 01 00 00 00 FC"


def test_ping_of_all_collides(wire: Talk) -> None:
    (answer,) = wire.raw("FF FF FE 02 01 FE")
    assert answer != "FF FF 01 02 00 FC"
    alone = Talk(ServoBus([Ax12(5)]))
    assert alone.raw("FF FF FE 02 01 FE") == ["FF FF 05 02 00 F8"]
