"""The control tables against rows typed by hand from the data sheets, documented packets, and the maker's own files.

The rows and packets here are independent of the data files: typed from ROBOTIS' e-manual (the page of each model) and
the test vectors of its protocol pages. The maker's files are those of the package dynamixel-sdk
(`dynamixel_easy_sdk`); they know the models of protocol 2.0 only.
"""

from __future__ import annotations

import math
import re
from importlib import resources
from pathlib import Path

import pytest

from urbihw.buses.servos import packet, tables, units
from urbihw.buses.servos.item import ControlTable, Item

# Model number, name, then item: (address, size, default or None).
Rows = dict[str, tuple[int, int, int | None]]
_OLD: Rows = {
    "model_number": (0, 2, None),
    "firmware_version": (2, 1, None),
    "id": (3, 1, 1),
    "return_delay_time": (5, 1, 250),
    "cw_angle_limit": (6, 2, 0),
    "min_voltage_limit": (12, 1, 60),
    "max_torque": (14, 2, 1023),
    "status_return_level": (16, 1, 2),
    "shutdown": (18, 1, 36),
    "torque_enable": (24, 1, 0),
    "goal_position": (30, 2, None),
    "moving_speed": (32, 2, None),
    "torque_limit": (34, 2, None),
    "present_position": (36, 2, None),
    "present_speed": (38, 2, None),
    "present_load": (40, 2, None),
    "present_voltage": (42, 1, None),
    "present_temperature": (43, 1, None),
    "moving": (46, 1, 0),
    "lock": (47, 1, 0),
}
_RX: Rows = _OLD | {
    "baud_rate": (4, 1, 34),
    "ccw_angle_limit": (8, 2, 1023),
    "temperature_limit": (11, 1, 80),
    "max_voltage_limit": (13, 1, 190),
    "cw_compliance_margin": (26, 1, 1),
    "ccw_compliance_slope": (29, 1, 32),
    "punch": (48, 2, 32),
}
_MX: Rows = _OLD | {
    "baud_rate": (4, 1, 34),
    "ccw_angle_limit": (8, 2, 4095),
    "temperature_limit": (11, 1, 80),
    "max_voltage_limit": (13, 1, 160),
    "multi_turn_offset": (20, 2, 0),
    "resolution_divider": (22, 1, 1),
    "d_gain": (26, 1, 0),
    "i_gain": (27, 1, 0),
    "p_gain": (28, 1, 32),
    "punch": (48, 2, 0),
    "realtime_tick": (50, 2, None),
    "goal_acceleration": (73, 1, 0),
}
_MX_TORQUE: Rows = {"present_current": (68, 2, None), "torque_control": (70, 1, 0), "goal_torque": (71, 2, 0)}
_X: Rows = {
    "model_number": (0, 2, None),
    "firmware_version": (6, 1, None),
    "id": (7, 1, 1),
    "baud_rate": (8, 1, 1),
    "operating_mode": (11, 1, 3),
    "homing_offset": (20, 4, 0),
    "max_position_limit": (48, 4, 4095),
    "min_position_limit": (52, 4, 0),
    "torque_enable": (64, 1, 0),
    "status_return_level": (68, 1, 2),
    "hardware_error": (70, 1, 0),
    "position_p_gain": (84, 2, None),
    "bus_watchdog": (98, 1, 0),
    "goal_pwm": (100, 2, None),
    "goal_velocity": (104, 4, None),
    "goal_position": (116, 4, None),
    "moving": (122, 1, 0),
    "present_velocity": (128, 4, None),
    "present_position": (132, 4, None),
    "present_voltage": (144, 2, None),
    "present_temperature": (146, 1, None),
}
_P: Rows = {
    "model_number": (0, 2, None),
    "id": (7, 1, 1),
    "operating_mode": (11, 1, 3),
    "homing_offset": (20, 4, 0),
    "pwm_limit": (36, 2, 2009),
    "max_position_limit": (48, 4, None),
    "torque_enable": (512, 1, 0),
    "status_return_level": (516, 1, 2),
    "hardware_error": (518, 1, 0),
    "bus_watchdog": (546, 1, 0),
    "goal_pwm": (548, 2, None),
    "goal_current": (550, 2, None),
    "goal_velocity": (552, 4, None),
    "profile_velocity": (560, 4, None),
    "goal_position": (564, 4, None),
    "moving": (570, 1, 0),
    "present_current": (574, 2, None),
    "present_velocity": (576, 4, None),
    "present_position": (580, 4, None),
    "present_voltage": (592, 2, None),
    "present_temperature": (594, 1, None),
}
_PRO: Rows = {
    "model_number": (0, 2, None),
    "firmware_version": (6, 1, None),
    "id": (7, 1, 1),
    "operating_mode": (11, 1, 3),
    "homing_offset": (13, 4, 0),
    "max_voltage_limit": (22, 2, 400),
    "torque_limit": (30, 2, None),
    "max_position_limit": (36, 4, None),
    "min_position_limit": (40, 4, None),
    "torque_enable": (562, 1, 0),
    "goal_position": (596, 4, None),
    "goal_velocity": (600, 4, 0),
    "goal_torque": (604, 2, 0),
    "moving": (610, 1, None),
    "present_position": (611, 4, None),
    "present_velocity": (615, 4, None),
    "present_current": (621, 2, None),
    "present_voltage": (623, 2, None),
    "present_temperature": (625, 1, None),
    "status_return_level": (891, 1, 2),
    "hardware_error": (892, 1, 0),
}
SHEETS: dict[int, tuple[str, Rows]] = {
    12: ("AX-12A", _OLD | {"baud_rate": (4, 1, 1), "ccw_angle_limit": (8, 2, 1023), "max_voltage_limit": (13, 1, 140)}),
    18: ("AX-18A", _OLD),
    300: ("AX-12W", _OLD),
    24: ("RX-24F", _RX),
    28: ("RX-28", _RX),
    64: ("RX-64", _RX),
    117: ("DX-117", _RX),
    107: (
        "EX-106+",
        _RX
        | {
            "ccw_angle_limit": (8, 2, 4095),
            "drive_mode": (10, 1, 0),
            "max_voltage_limit": (13, 1, 240),
            "punch": (48, 2, 0),
            "sensed_current": (56, 2, None),
        },
    ),
    104: ("MX-12W", _MX | {"baud_rate": (4, 1, 1), "d_gain": (26, 1, 8), "p_gain": (28, 1, 8), "punch": (48, 2, 32)}),
    29: ("MX-28", _MX),
    310: ("MX-64", _MX | _MX_TORQUE | {"max_voltage_limit": (13, 1, 240)}),
    320: ("MX-106", _MX | _MX_TORQUE | {"drive_mode": (10, 1, 0)}),
    30: ("MX-28(2.0)", _X | {"velocity_limit": (44, 4, 380), "present_load": (126, 2, None)}),
    311: ("MX-64(2.0)", _X | {"current_limit": (38, 2, 1941), "velocity_limit": (44, 4, 435)}),
    321: ("MX-106(2.0)", _X | {"current_limit": (38, 2, 2047), "velocity_limit": (44, 4, 360)}),
    350: (
        "XL-320",
        {
            "id": (3, 1, 1),
            "baud_rate": (4, 1, 3),
            "ccw_angle_limit": (8, 2, 1023),
            "control_mode": (11, 1, 2),
            "temperature_limit": (12, 1, 65),
            "min_voltage_limit": (13, 1, 60),
            "max_voltage_limit": (14, 1, 90),
            "max_torque": (15, 2, 1023),
            "status_return_level": (17, 1, 2),
            "shutdown": (18, 1, 3),
            "torque_enable": (24, 1, 0),
            "d_gain": (27, 1, 0),
            "p_gain": (29, 1, 32),
            "goal_position": (30, 2, None),
            "moving_speed": (32, 2, None),
            "torque_limit": (35, 2, None),
            "present_position": (37, 2, None),
            "present_speed": (39, 2, None),
            "present_load": (41, 2, None),
            "present_voltage": (45, 1, None),
            "present_temperature": (46, 1, None),
            "moving": (49, 1, 0),
            "hardware_error": (50, 1, 0),
            "punch": (51, 2, 32),
        },
    ),
    1200: ("XL330-M288", _X | {"current_limit": (38, 2, 1750), "max_voltage_limit": (32, 2, 70)}),
    1220: ("XC330-T288", _X | {"current_limit": (38, 2, 910), "max_voltage_limit": (32, 2, 140)}),
    1060: ("XL430-W250", _X | {"velocity_limit": (44, 4, 265), "present_load": (126, 2, None)}),
    1090: ("2XL430-W250", _X | {"present_load": (126, 2, None)}),
    1020: ("XM430-W350", _X | {"current_limit": (38, 2, 1193), "goal_current": (102, 2, None)}),
    1120: ("XM540-W270", _X | {"current_limit": (38, 2, 2047), "external_port_data_1": (152, 2, None)}),
    1100: ("XH540-W270", _X | {"current_limit": (38, 2, 2047), "external_port_mode_1": (56, 1, 3)}),
    1040: ("XH430-V350", _X | {"current_limit": (38, 2, 689), "max_voltage_limit": (32, 2, 300)}),
    1150: ("XH540-V150", _X | {"current_limit": (38, 2, 1188), "min_voltage_limit": (34, 2, 110)}),
    1010: ("XH430-W210", _X | {"current_limit": (38, 2, 648), "position_p_gain": (84, 2, 900)}),
    1170: ("XW540-T260", _X | {"goal_current": (102, 2, None)}),
    1310: ("XW540-H260", _X | {"current_limit": (38, 2, 1188), "velocity_limit": (44, 4, 145)}),
    2020: ("PH54-200-S500-R", _P),
    2100: ("PM42-010-S260-R", _P),
    54025: ("H54-200-S500-R(A)", _P),
    54024: ("H54-200-S500-R", _PRO),
    43288: ("M42-10-S260-R", _PRO),
    35072: ("L42-10-S300-R", _PRO),
    4030: (
        "YM070-210-R099",
        {
            "id": (7, 1, 1),
            "bus_watchdog": (8, 2, 0),
            "status_return_level": (15, 1, 2),
            "operating_mode": (33, 1, 3),
            "max_position_limit": (76, 4, 262144),
            "min_position_limit": (84, 4, -262144),
            "torque_enable": (512, 1, 0),
            "goal_current": (526, 2, 0),
            "goal_velocity": (528, 4, 0),
            "goal_position": (532, 4, 0),
            "present_current": (546, 2, None),
            "present_velocity": (548, 4, None),
            "present_position": (552, 4, None),
            "present_voltage": (568, 2, None),
        },
    ),
}


def table(model: int) -> ControlTable:
    found = tables.table_of(model)
    assert found is not None
    return found


@pytest.mark.parametrize("model", SHEETS)
def test_rows_are_those_of_the_sheet(model: int) -> None:
    name, rows = SHEETS[model]
    made = table(model)
    assert made.models[model] == name
    found = {item: (made.items[item].address, made.items[item].size, made.items[item].default) for item in rows}
    wanted = {item: (*row[:2], found[item][2] if row[2] is None else row[2]) for item, row in rows.items()}
    assert found == wanted


# Packets of the e-manual's protocol pages and of the project's sheet.
@pytest.mark.parametrize(
    ("model", "item", "raw", "bytes_"),
    [
        (12, "present_temperature", None, "FF FF 01 04 02 2B 01 CC"),
        (28, "present_temperature", None, "FF FF 01 04 02 2B 01 CC"),
        (29, "torque_limit", 512, "FF FF 01 05 03 22 00 02 D2"),
        (1060, "present_position", None, "FF FF FD 00 01 07 00 02 84 00 04 00 1D 15"),
        (30, "present_position", None, "FF FF FD 00 01 07 00 02 84 00 04 00 1D 15"),
        (1020, "goal_position", 512, "FF FF FD 00 01 09 00 03 74 00 00 02 00 00 CA 89"),
        (1120, "torque_enable", 1, "FF FF FD 00 01 06 00 03 40 00 01 DB 66"),
    ],
)
def test_documented_packets(model: int, item: str, raw: int | None, bytes_: str) -> None:
    made = table(model)
    row = made.item(item)
    if raw is None:
        sent = packet.read_packet(made.protocol, 1, row.address, row.size)
    else:
        sent = packet.write_packet(made.protocol, 1, row.address, row.pack(raw))
    assert sent == bytes.fromhex(bytes_)


@pytest.mark.parametrize(
    ("model", "item", "raw", "value", "symbol"),
    [
        (28, "present_position", 1023, 2.61799, "rad"),
        (28, "moving_speed", 300, 3.4872, "rad/s"),
        (107, "present_position", 4095, 2.19039, "rad"),
        (107, "sensed_current", 312, 2.0, "A"),
        (29, "present_position", 1024, -1.570796, "rad"),
        (29, "goal_position", 28672, 40.8407, "rad"),
        (29, "present_speed", 1024 + 300, -3.5814, "rad/s"),
        (104, "present_speed", 300, 28.777, "rad/s"),
        (29, "goal_acceleration", 254, 38.0499, "rad/s2"),
        (29, "baud_rate", 34, 57142.86, "bit/s"),
        (29, "baud_rate", 252, 3e6, "bit/s"),
        (310, "present_current", 2148, 0.45, "A"),
        (310, "goal_torque", 1024 + 100, -0.45, "A"),
        (350, "present_position", 0, -2.61799, "rad"),
        (350, "baud_rate", 3, 1e6, "bit/s"),
        (311, "present_current", -100, -0.336, "A"),
        (1040, "goal_current", 100, 0.134, "A"),
        (1220, "pwm_slope", 255, 1008.525, "V/s"),
        (2020, "present_position", 501923, 3.14159, "rad"),
        (2020, "goal_velocity", 2900, 3.03687, "rad/s"),
        (2020, "goal_pwm", 2009, 1.0, ""),
        (2020, "present_current", -1500, -1.5, "A"),
        (2020, "baud_rate", 9, 10.5e6, "bit/s"),
        (54024, "present_position", -250961, -3.14158, "rad"),
        (54024, "goal_velocity", 17000, 3.54679, "rad/s"),
        (54024, "goal_torque", 620, 9.99023, "A"),
        (43288, "present_current", 300, 1.208496, "A"),
        (4030, "present_position", 262144, 3.14159, "rad"),
        (4030, "goal_current", 2080, 20.8, "A"),
        (4030, "present_voltage", 240, 24.0, "V"),
    ],
)
def test_units_of_the_sheet(model: int, item: str, raw: int, value: float, symbol: str) -> None:
    row = table(model).item(item)
    assert units.to_si(row, raw, wheel=False) == pytest.approx(value, rel=1e-4)
    assert units.unit_of(row).symbol == symbol


@pytest.mark.parametrize(
    ("model", "modes"),
    [
        (29, ["wheel", "multi-turn", "joint"]),
        (310, ["torque", "wheel", "multi-turn", "joint"]),
        (117, ["joint"]),
        (350, ["wheel", "joint"]),
        (1020, ["current", "velocity", "position", "extended position", "current-based position", "pwm"]),
        (30, ["velocity", "position", "extended position", "pwm"]),
        (2020, ["current", "velocity", "position", "extended position", "pwm"]),
        (54024, ["torque", "velocity", "position", "extended position"]),
        (35072, ["velocity", "position"]),
        (4030, ["current", "velocity", "position"]),
    ],
)
def test_modes(model: int, modes: list[str]) -> None:
    assert [mode.name for mode in table(model).modes] == modes


def test_the_bits_of_the_hardware_error() -> None:
    assert table(1020).hardware_errors[5] == "overload"
    assert table(350).hardware_errors == {0: "overload", 1: "overheating", 2: "input voltage"}
    assert table(35072).hardware_errors[1] == "hall sensor"
    assert table(4030).hardware_errors == {}


def test_the_angle_limits_of_an_mx_tell_its_mode() -> None:
    mx = table(310)

    def mode(low: int, high: int, torque: int = 0) -> str:
        found = mx.mode_of({"cw_angle_limit": low, "ccw_angle_limit": high, "torque_control": torque})
        return "" if found is None else found.name

    assert [mode(0, 4095), mode(0, 0), mode(4095, 4095), mode(0, 0, 1)] == ["joint", "wheel", "multi-turn", "torque"]


_ALIASES = {
    "secondary(shadow)_id": "secondary_id",
    "registered_instruction": "registered",
    "hardware_error_status": "hardware_error",
    "present_input_voltage": "present_voltage",
    "baud_rate_(bus)": "baud_rate",
    "present_motor_temperature": "present_temperature",
    "motor_temperature_limit": "temperature_limit",
    "in-position_threshold": "in_position_threshold",
    "electronic_gearratio_numerator": "gear_ratio_numerator",
    "electronic_gearratio_denominator": "gear_ratio_denominator",
}


def _makers_files() -> dict[int, str]:
    folder = resources.files("dynamixel_easy_sdk") / "control_table"
    lines = (folder / "dynamixel.model").read_text().split("\n")[1:]
    pairs = (line.split("\t") for line in lines if line.strip())
    return {int(number): (folder / name.strip()).read_text() for number, name in pairs if _is_ours(int(number))}


def _is_ours(number: int) -> bool:
    return tables.table_of(number) is not None


MAKERS = _makers_files()


@pytest.mark.parametrize("model", MAKERS)
def test_addresses_and_sizes_are_those_of_the_makers_files(model: int) -> None:
    made = table(model)
    rows = MAKERS[model].split("[control table]")[1].strip().split("\n")[1:]
    compared = 0
    for row in rows:
        address, size, name = row.strip().split("\t")[:3]
        key = name.strip().lower().replace(" ", "_")
        key = _ALIASES.get(key, key)
        item: Item | None = made.items.get(key)
        if item is not None:
            compared += 1
            assert (item.address, item.size) == (int(address), int(size)), key
        else:
            assert key.startswith(("indirect", "error_code_history")), key
    assert compared > 20


@pytest.mark.parametrize("model", MAKERS)
def test_scales_are_those_of_the_makers_files(model: int) -> None:
    if model == 350:
        pytest.skip("the file of the XL-320 has the scale of the X series; its page has 300 degrees in 1023 counts")
    made = table(model)
    facts = dict(line.split("\t")[:2] for line in MAKERS[model].split("\n") if line.count("\t"))
    place, speed = made.item("present_position"), made.item("present_velocity")
    half, zero = (int(facts[f"value_of_{name}_radian_position"]) for name in ("max", "zero"))
    assert units.to_si(place, half) == pytest.approx(math.pi, rel=1e-3)
    assert units.to_si(place, zero) == 0.0
    # They round 0.229 rev/min.
    assert units.to_si(speed, 1000) == pytest.approx(1000 * float(facts["Present Velocity"]), rel=1e-3)


def test_the_page_lists_every_model() -> None:
    page = (Path(__file__).parents[2] / "docs" / "servo-models.md").read_text(encoding="utf-8")
    rows = [row for row in page.split("\n") if row.startswith("|")]
    listed = {name.strip() for row in rows for name in re.split(r"[,;|]|sensor", row)}
    ours = {name for made in tables.all_tables() if made.protocol in {1, 2} for name in made.models.values()}
    assert ours - listed == set()


def test_the_makers_files_cover_every_series_of_protocol_2() -> None:
    prefixes = {table(model).models[model][:2] for model in MAKERS}
    assert {"MX", "XL", "XC", "XM", "XH", "XW", "XD", "2X", "PH", "PM", "H5", "M5", "YM"} <= prefixes
