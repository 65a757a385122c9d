"""Control tables, units and the plans made from them."""

from __future__ import annotations

import math

import pytest

from urbihw.buses.errors import BadValue
from urbihw.buses.servos import plan, tables, units
from urbihw.buses.servos.item import Item, Table, by_name

ITEMS = [(table, item) for table in tables.TABLES for item in table.items.values()]
IDS = [f"{table.name}.{item.name}" for table, item in ITEMS]
# These say "no limit" or an index in words of their own, so counts and SI values do not match one to one.
COARSE = {"buzzer_time"}


@pytest.mark.parametrize("table", tables.TABLES, ids=lambda table: table.name)
def test_no_two_items_overlap(table: Table) -> None:
    items = list(table.items.values())
    assert [item.address for item in items] == sorted(item.address for item in items)
    assert all(a.end <= b.address for a, b in zip(items, items[1:], strict=False))
    for mode in table.modes.values():
        assert table.item(mode.effector).access == "RW"
        assert all(name in table.items for name in mode.limits)


@pytest.mark.parametrize(("table", "item"), ITEMS, ids=IDS)
def test_an_item_packs_its_whole_range(table: Table, item: Item) -> None:
    assert item.default is None or item.low <= item.default <= item.high
    for raw in {item.low, item.high, (item.low + item.high) // 2}:
        assert item.unpack(item.pack(raw)) == raw
        assert len(item.pack(raw)) == item.size
    with pytest.raises(BadValue, match=item.name):
        item.pack(item.high + 1)


@pytest.mark.parametrize(("table", "item"), ITEMS, ids=IDS)
def test_every_item_converts_both_ways(table: Table, item: Item) -> None:
    if item.unit in COARSE:
        return
    high = item.high if item.unit != "ax_goal_speed" else 1023
    step = max((high - item.low) // 500, 1)
    for raw in range(item.low, high + 1, step):
        if item.unit in {"ax_speed", "ax_load"} and raw == 1024:
            continue  # minus zero
        assert units.from_si(item, units.to_si(item, raw)) == raw


@pytest.mark.parametrize(
    ("table", "name", "raw", "value", "symbol"),
    [
        (tables.AX12, "goal_position", 1023, math.radians(150), "rad"),
        (tables.AX12, "present_position", 0, math.radians(-150), "rad"),
        (tables.AX12, "present_position", 800, 800 * 0.0051183 - math.radians(150), "rad"),
        (tables.AX12, "moving_speed", 100, 1.1624, "rad/s"),
        (tables.AX12, "moving_speed", 0, math.inf, "rad/s"),
        (tables.AX12, "present_speed", 1024 + 100, -1.1624, "rad/s"),
        (tables.AX12, "present_load", 1024 + 200, -200 / 1023, ""),
        (tables.AX12, "present_voltage", 111, 11.1, "V"),
        (tables.AX12, "present_temperature", 43, 43.0, "degC"),
        (tables.AX12, "return_delay_time", 250, 0.0005, "s"),
        (tables.AX12, "baud_rate", 1, 1e6, "bit/s"),
        (tables.AX12, "baud_rate", 34, 57142.857, "bit/s"),
        (tables.AXS1, "buzzer_time", 10, 1.0, "s"),
        (tables.AXS1, "buzzer_time", 254, math.inf, "s"),
        (tables.XL330, "present_position", 2048 + 1024, math.pi / 2, "rad"),
        (tables.XL330, "present_current", -25, -0.025, "A"),
        (tables.XM430, "present_current", 100, 0.269, "A"),
        (tables.XL430, "present_load", -500, -0.5, ""),
        (tables.XL430, "present_velocity", 100, 2.3981, "rad/s"),
        (tables.XL430, "profile_acceleration", 10, 3.7451, "rad/s2"),
        (tables.XL430, "goal_pwm", 885, 1.0, ""),
        (tables.XL430, "baud_rate", 3, 1e6, "bit/s"),
    ],
)
def test_conversions_of_the_sheet(table: Table, name: str, raw: int, value: float, symbol: str) -> None:
    item = table.item(name)
    assert units.to_si(item, raw) == pytest.approx(value, rel=1e-4)
    assert units.unit_of(item).symbol == symbol


def test_wheel_mode_reads_speeds_as_drive() -> None:
    speed = tables.AX12.item("moving_speed")
    assert units.from_si(speed, -0.5, wheel=True) == 1024 + 512
    assert units.to_si(speed, 1024 + 512, wheel=True) == pytest.approx(-512 / 1023)
    assert units.from_si(speed, 0.0, wheel=True) == 0
    assert units.limits_si(speed, wheel=True) == (-1.0, 1.0)


def test_a_slow_joint_never_becomes_an_unlimited_one() -> None:
    speed = tables.AX12.item("moving_speed")
    assert units.from_si(speed, 0.0) == 1
    assert units.from_si(speed, 0.001) == 1
    assert units.from_si(speed, math.inf) == 0
    low, high = units.limits_si(speed)
    assert low == pytest.approx(0.011624, rel=1e-4)
    assert high == math.inf


@pytest.mark.parametrize("value", [math.nan, 3.0, -math.inf])
def test_values_out_of_range_are_refused_in_si(value: float) -> None:
    with pytest.raises(BadValue, match=r"goal_position (takes -2.61799..2.61799 rad, not 3|cannot be)"):
        units.from_si(tables.AX12.item("goal_position"), value)


def test_models() -> None:
    assert {model: table.name for model, table in tables.MODELS.items()}[1060] == "XL430"
    assert tables.table_of(4711) is None
    with pytest.raises(BadValue, match="AX-12 has no item 'nose'"):
        tables.AX12.item("nose")
    with pytest.raises(BadValue, match="twice"):
        by_name([tables.AX12.item("led")] * 2)


def blocks(table: Table, *names: str) -> list[tuple[int, int]]:
    return [(block.address, block.size) for block in plan.read_blocks(table, names, table.protocol)]


def test_blocks() -> None:
    fast = ("present_temperature", "present_position", "present_speed", "present_load", "present_voltage")
    assert blocks(tables.AX12, *fast) == [(36, 8)]
    assert blocks(tables.AX12, "torque_enable", "present_position") == [(24, 14)]
    assert blocks(tables.AX12, "id", "present_position") == [(3, 1), (36, 2)]
    assert blocks(tables.XL430, "present_load", "present_velocity", "present_position") == [(126, 10)]
    assert blocks(tables.XL430, "present_position", "present_voltage") == [(132, 14)]
    assert blocks(tables.AXS1, "remocon_arrived", "remocon_rx", "light_compare") == [(46, 8)]
    (block,) = plan.read_blocks(tables.XM430, ["present_current", "present_position"], 2)
    data = bytes.fromhex("E7 FF 64 00 00 00 24 FA FF FF")
    assert block.unpack(data) == {"present_current": -25, "present_position": -1500}


def test_long_sync_writes_are_split_to_what_an_ax_can_hold() -> None:
    values = {"goal_position": 512, "moving_speed": 100}
    runs = plan.write_runs(tables.AX12, values)
    packets = plan.sync_writes(1, [(runs, [(number, values) for number in range(40)])])
    assert [len(packet) for packet in packets] == [8 + 27 * 5, 8 + 13 * 5]
    led = plan.write_runs(tables.XL430, ["led"])
    assert len(plan.sync_writes(2, [(led, [(number, {"led": 1}) for number in range(100)])])) == 1


def test_neighbours_are_written_together_but_torque_keeps_to_itself() -> None:
    names = ["moving_speed", "goal_position", "led", "torque_enable", "punch"]
    runs = plan.write_runs(tables.AX12, names)
    assert [run.names for run in runs] == [("torque_enable",), ("led",), ("goal_position", "moving_speed"), ("punch",)]
