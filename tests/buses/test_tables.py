"""Control tables, units and the plans made from them."""

from __future__ import annotations

import math
import subprocess
import sys
import tomllib
from importlib import resources

import pytest

from urbihw.buses.errors import BadValue
from urbihw.buses.servos import plan, tables, units
from urbihw.buses.servos.item import ControlTable, Item, ShaftMotion, by_name

AX12, AXS1, XL330, XL430, XM430 = map(tables.table_named, ("AX-12", "AX-S1", "XL330", "XL430", "XM430"))

EVERY_TABLE = pytest.mark.parametrize("table", tables.all_tables(), ids=lambda table: table.name)
# These say "no limit" or an index in words of their own, so counts and SI values do not match one to one.
COARSE = {"buzzer_time"}


@EVERY_TABLE
def test_no_two_items_overlap(table: ControlTable) -> None:
    items = list(table.items.values())
    assert [item.address for item in items] == sorted(item.address for item in items)
    assert all(a.end <= b.address for a, b in zip(items, items[1:], strict=False))
    for mode in table.modes:
        assert table.item(mode.effector).access == "RW"
        assert all(name in table.items for name in mode.limits)


@EVERY_TABLE
def test_rows_of_the_driver_have_their_names(table: ControlTable) -> None:
    if not table.modes:
        return
    for name in ("torque_enable", "goal_position"):
        assert (table.item(name).access, table.item(name).area) == ("RW", "R")
    assert table.item("present_position").access == "R"
    watchdog = table.items.get("bus_watchdog")
    assert watchdog is None or (watchdog.low, units.from_si(watchdog, 0.5)) == (-1, 25)
    for mode in table.modes:
        assert mode.motion is ShaftMotion.RATE or mode.effector == "goal_position"
        assert mode.motion is ShaftMotion.POSITION or mode.effector.startswith(("goal_", "moving_speed"))


@EVERY_TABLE
def test_every_item_packs_its_whole_range(table: ControlTable) -> None:
    for item in table.items.values():
        assert item.access in {"R", "RW"} and item.area in {"E", "R"}
        assert item.default is None or item.low <= item.default <= item.high
        for raw in {item.low, item.high, (item.low + item.high) // 2}:
            assert item.unpack(item.pack(raw)) == raw
            assert len(item.pack(raw)) == item.size
        with pytest.raises(BadValue, match=item.name):
            item.pack(item.high + 1)


@EVERY_TABLE
def test_every_item_converts_both_ways(table: ControlTable) -> None:
    for item in table.items.values():
        for wheel in (False, True):
            if item.unit not in COARSE:
                check_conversion(item, wheel)


def check_conversion(item: Item, wheel: bool) -> None:
    unit = units.unit_of(item, wheel)
    high = item.high if unit.high is None else min(item.high, unit.high)
    step = max((high - item.low) // 100, 1)
    for raw in range(item.low, high + 1, step):
        if unit.both_ways and raw == 1024:
            continue  # minus zero
        assert units.from_si(item, units.to_si(item, raw, wheel), wheel) == raw, item.name


def test_the_files_agree_with_the_index() -> None:
    folder = resources.files("urbihw.buses.servos") / "models"
    index = tomllib.loads((folder / "index.toml").read_text(encoding="utf-8"))
    files = {entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml")}
    assert files == {*index, "index"}
    for file, listed in index.items():
        data = tomllib.loads((folder / f"{file}.toml").read_text(encoding="utf-8"))
        assert sorted(table["name"] for table in data["table"]) == sorted(listed), file
        assert data["source"]
    numbers = [number for listed in index.values() for models in listed.values() for number in models]
    assert len(numbers) == len(set(numbers))


def test_a_device_loads_only_the_files_of_its_family() -> None:
    program = (
        "from urbihw.buses.servos import tables\n"
        "assert not tables._read.cache_info().currsize\n"
        "tables.table_of(350)\n"
        "assert tables._read.cache_info().currsize == 2\n"  # the index and xl320
    )
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)


def test_sign_and_magnitude_and_high_byte_first() -> None:
    speed = Item("speed", 46, 2, "RW", "R", -32767, 32767, 0, sign_bit=15)
    assert [speed.pack(raw).hex() for raw in (1000, -1000)] == ["e803", "e883"]
    assert [speed.unpack(bytes.fromhex(data)) for data in ("e803", "e883", "0080")] == [1000, -1000, 0]
    load = Item("load", 60, 2, "R", "R", -1023, 1023, None, sign_bit=10, big_endian=True)
    assert load.unpack(bytes.fromhex("0464")) == -100
    goal = Item("goal", 42, 2, "RW", "R", 0, 1023, 0, big_endian=True)
    assert goal.pack(0x0123).hex() == "0123"
    table = ControlTable("T", 1, {1: "T"}, by_name([speed, Item("time", 44, 2, "RW", "R", 0, 1000, 0)]))
    (block,) = plan.read_blocks(table, ["time", "speed"], 1)
    assert block.unpack(bytes.fromhex("0100e883")) == {"time": 1, "speed": -1000}
    (run,) = plan.write_runs(table, ["time", "speed"])
    assert run.pack({"time": 1, "speed": -1000}).hex() == "0100e883"
    big = ControlTable("B", 1, {2: "B"}, by_name([goal, Item("time", 44, 2, "RW", "R", 0, 1000, 0, big_endian=True)]))
    (block,) = plan.read_blocks(big, ["goal", "time"], 1)
    assert block.unpack(bytes.fromhex("01230004")) == {"goal": 0x0123, "time": 4}


@pytest.mark.parametrize(
    ("table", "name", "raw", "value", "symbol"),
    [
        (AX12, "goal_position", 1023, math.radians(150), "rad"),
        (AX12, "present_position", 0, math.radians(-150), "rad"),
        (AX12, "present_position", 800, 800 * 0.0051183 - math.radians(150), "rad"),
        (AX12, "moving_speed", 100, 1.1624, "rad/s"),
        (AX12, "moving_speed", 0, math.inf, "rad/s"),
        (AX12, "present_speed", 1024 + 100, -1.1624, "rad/s"),
        (AX12, "present_load", 1024 + 200, -200 / 1023, ""),
        (AX12, "present_voltage", 111, 11.1, "V"),
        (AX12, "present_temperature", 43, 43.0, "degC"),
        (AX12, "return_delay_time", 250, 0.0005, "s"),
        (AX12, "baud_rate", 1, 1e6, "bit/s"),
        (AX12, "baud_rate", 34, 57142.857, "bit/s"),
        (AXS1, "buzzer_time", 10, 1.0, "s"),
        (AXS1, "buzzer_time", 254, math.inf, "s"),
        (XL330, "present_position", 2048 + 1024, math.pi / 2, "rad"),
        (XL330, "present_current", -25, -0.025, "A"),
        (XM430, "present_current", 100, 0.269, "A"),
        (XL430, "present_load", -500, -0.5, ""),
        (XL430, "present_velocity", 100, 2.3981, "rad/s"),
        (XL430, "profile_acceleration", 10, 3.7451, "rad/s2"),
        (XL430, "goal_pwm", 885, 1.0, ""),
        (XL430, "baud_rate", 3, 1e6, "bit/s"),
    ],
)
def test_conversions_of_the_sheet(table: ControlTable, name: str, raw: int, value: float, symbol: str) -> None:
    item = table.item(name)
    assert units.to_si(item, raw) == pytest.approx(value, rel=1e-4)
    assert units.unit_of(item).symbol == symbol


def test_wheel_mode_reads_speeds_as_drive() -> None:
    speed = AX12.item("moving_speed")
    assert units.from_si(speed, -0.5, wheel=True) == 1024 + 512
    assert units.to_si(speed, 1024 + 512, wheel=True) == pytest.approx(-512 / 1023)
    assert units.from_si(speed, 0.0, wheel=True) == 0
    assert units.limits_si(speed, wheel=True) == (-1.0, 1.0)


def test_a_slow_joint_never_becomes_an_unlimited_one() -> None:
    speed = AX12.item("moving_speed")
    assert units.from_si(speed, 0.0) == 1
    assert units.from_si(speed, 0.001) == 1
    assert units.from_si(speed, math.inf) == 0
    low, high = units.limits_si(speed)
    assert low == pytest.approx(0.011624, rel=1e-4)
    assert high == math.inf


@pytest.mark.parametrize("value", [math.nan, 3.0, -math.inf])
def test_values_out_of_range_are_refused_in_si(value: float) -> None:
    with pytest.raises(BadValue, match=r"goal_position (takes -2.61799..2.61799 rad, not 3|cannot be)"):
        units.from_si(AX12.item("goal_position"), value)


def test_models() -> None:
    assert tables.table_of(1060) is XL430
    assert tables.table_of(4711) is None
    with pytest.raises(BadValue, match="AX-12 has no item 'nose'"):
        AX12.item("nose")
    with pytest.raises(BadValue, match="twice"):
        by_name([AX12.item("led")] * 2)


def blocks(table: ControlTable, *names: str) -> list[tuple[int, int]]:
    return [(block.address, block.size) for block in plan.read_blocks(table, names, table.protocol)]


def test_blocks() -> None:
    fast = ("present_temperature", "present_position", "present_speed", "present_load", "present_voltage")
    assert blocks(AX12, *fast) == [(36, 8)]
    assert blocks(AX12, "torque_enable", "present_position") == [(24, 14)]
    assert blocks(AX12, "id", "present_position") == [(3, 1), (36, 2)]
    assert blocks(XL430, "present_load", "present_velocity", "present_position") == [(126, 10)]
    assert blocks(XL430, "present_position", "present_voltage") == [(132, 14)]
    assert blocks(AXS1, "remocon_arrived", "remocon_rx", "light_compare") == [(46, 8)]
    (block,) = plan.read_blocks(XM430, ["present_current", "present_position"], 2)
    data = bytes.fromhex("E7 FF 64 00 00 00 24 FA FF FF")
    assert block.unpack(data) == {"present_current": -25, "present_position": -1500}


def test_long_sync_writes_are_split_to_what_an_ax_can_hold() -> None:
    values = {"goal_position": 512, "moving_speed": 100}
    runs = plan.write_runs(AX12, values)
    packets = plan.sync_writes(1, [(runs, [(number, values) for number in range(40)])])
    assert [len(packet) for packet in packets] == [8 + 27 * 5, 8 + 13 * 5]
    led = plan.write_runs(XL430, ["led"])
    assert len(plan.sync_writes(2, [(led, [(number, {"led": 1}) for number in range(100)])])) == 1


def test_neighbours_are_written_together_but_torque_keeps_to_itself() -> None:
    names = ["moving_speed", "goal_position", "led", "torque_enable", "punch"]
    runs = plan.write_runs(AX12, names)
    assert [run.names for run in runs] == [("torque_enable",), ("led",), ("goal_position", "moving_speed"), ("punch",)]
