"""What the help of a slot says of its unit and range, which the interfaces and devices declare."""

from __future__ import annotations

import pytest
from bioloid_lab import BAUD
from bioloid_lab import Lab as Bioloid
from nxt_lab import Lab as Nxt

from urbihw_fakes.bioloid import Bioloid as Kit


@pytest.mark.parametrize(
    ("slot", "words"),
    [
        ("val", "Unit: rad. Range: -2.61799 to 2.61799."),
        ("speed", "Unit: rad/s. Range: 0 to 11.8912."),
        ("torque", "Unit: N m."),
        ("voltage", "Unit: V."),
        ("temperature", "Unit: degC."),
        ("load", "Unit: none. Range: 0 to 1."),
        ("model", "Unit: none."),
    ],
)
def test_unit_and_range_of_a_servo(slot: str, words: str) -> None:
    fresh = Bioloid.ready(Kit(servos=(6,), sensors=(), baud=BAUD))
    said = fresh.look(f'System.documentation(motor6, "{slot}")').strip('"')
    meaning, _, measures = said.partition("\\n")
    assert (measures, bool(meaning)) == (words, True)


def test_a_unit_that_only_the_interface_declares() -> None:
    nxt = Nxt.ready()
    assert nxt.look('System.documentation(battery, "current")').endswith('Unit: A."')
    assert nxt.look('System.documentation(wheelL, "speed")').endswith('Unit: %. Range: -100 to 100."')
    assert nxt.look("sonar.distance->unit") == '"m"'
    assert nxt.look("robot.defaultYawSpeed->unit") == '"rad/s"'


def test_all_slots_of_a_device_with_value_unit_range_and_meaning() -> None:
    fresh = Bioloid.ready(Kit(servos=(6,), sensors=(), baud=BAUD))
    rows = fresh.say('for (var r : System.slotTable(motor6)) echo(r.join("|"))|;').replace("*** ", "").split("\n")
    assert "load|0|1|0 to 1|1 switches the torque on, 0 off" in rows
    assert "temperature|32|degC||temperature of the device" in rows
    assert "limited||||event: a limit begins to act; with its name" in rows
    names = [row.partition("|")[0] for row in rows]
    assert names == sorted(names) and {"val", "angle", "turn", "why", "age", "PGain"} <= {*names}
    # No function was called, and nothing that every object has is listed.
    assert not {"motor6", "joint", "asString", "init", "Motor"} & {*names}


def test_the_table_calls_no_function_of_a_robot() -> None:
    nxt = Nxt.ready()
    nxt.say("function robot.stop() { echo(1) } | function robot.drive(x, y) { echo(2) } | var slots = 0;")
    rows = nxt.say('for (var r : System.slotTable(robot)) echo(r.join("|"))|;').replace("*** ", "").split("\n")
    assert "go||||go(d): d metres forward, until that is done" in rows
    assert not {"1", "2"} & {*rows}


def test_a_range_that_a_program_changes_is_told_as_it_is() -> None:
    fresh = Bioloid.ready(Kit(servos=(6,), sensors=(), baud=BAUD))
    fresh.say("motor6.val->rangemax = 1|;")
    assert "Range: -2.61799 to 1." in fresh.look('System.documentation(motor6, "val")')
