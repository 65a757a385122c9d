"""The unit of every slot that is a number, on all robots, against ``UNITS`` in their labs (``slot_units``)."""

from __future__ import annotations

import importlib
from typing import NamedTuple

import pytest
from bioloid_lab import BAUD
from bioloid_lab import Lab as Bioloid
from lab import RobotLab
from nxt_lab import Lab as Nxt
from slot_units import UnitTable

from urbihw.kernel.uobject.uobject import UObjectFace
from urbihw.platforms import folders
from urbihw.robot.device_slots import SlotRow, rows_of
from urbihw_fakes.bioloid import Bioloid as Kit


class Shown(NamedTuple):
    """What ``help`` shows of one device."""

    names: tuple[str, ...]
    """Its names in the table above: model, names in Global, class."""
    rows: list[SlotRow]


def devices_of(lab: RobotLab) -> list[Shown]:
    """All devices of a robot, and ``robot`` itself."""
    world = lab.kernel.host.world
    found = [Shown(("robot",), rows_of(world, world.global_.slots["robot"]))]
    names: dict[int, list[str]] = {}
    for name, value in world.global_.slots.items():
        names.setdefault(id(value), []).append(name)
    for face in world.peek_obj(world.global_.slots["uobjects"]).slots.values():
        if isinstance(face, UObjectFace) and face.python is not None:
            model = face.python.variables.get("modelName")
            said = ([str(model.sensed)] if model else []) + names.get(id(face), []) + [face.kind.__name__]
            found.append(Shown(tuple(said), rows_of(world, face)))
    return found


class Rig(NamedTuple):
    """A platform that was served for a moment."""

    units: UnitTable
    devices: list[Shown]


@pytest.fixture(params=[folder.name for folder in folders()], scope="module")
def robot(request: pytest.FixtureRequest) -> Rig:
    """Each platform with its devices."""
    module = importlib.import_module(f"{request.param}_lab")
    lab = module.Lab.ready()
    lab.run(0.5)
    return Rig(module.UNITS, devices_of(lab))


def test_every_number_has_the_unit_of_the_table(robot: Rig) -> None:
    table, used, problems = robot.units, set(), []
    for names, rows in robot.devices:
        name = next((each for each in names if each in table), names[-1])
        used.add(name)
        units = {slot: unit for unit, slots in table.get(name, {}).items() for slot in slots.split()}
        shown = {row.name: row.unit for row in rows if row.unit or _is_number(row.value)}
        for slot in sorted({*units, *shown}):
            if units.get(slot) != shown.get(slot):
                problems.append(f"{name}.{slot} has the unit {shown.get(slot)!r}, in UNITS {units.get(slot)!r}")
    assert problems == []
    assert table.keys() <= used


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def test_every_slot_of_a_robot_has_a_meaning(robot: Rig) -> None:
    # An object, such as a Group or a part, says itself what it is.
    plain = ('"', "[", "true", "false", "nil", "nan", "inf", "-")
    wanting = {
        f"{names[-1]}.{row.name}"
        for names, rows in robot.devices
        for row in rows
        if not row.meaning and (not row.value or row.value[0].isdigit() or row.value.startswith(plain))
    }
    # What a program or a layout adds has no class that could tell.
    assert wanting <= {"robot.modules"}


def test_the_last_write_has_the_unit_of_the_slot_that_was_written() -> None:
    lab = Bioloid.ready(Kit(servos=(6,), sensors=(), baud=BAUD))
    units = "[motor6.requested->unit, motor6.applied->unit]"
    assert lab.look(units) == '["rad", "rad"]'
    lab.say("motor6.speed = 1;")
    assert lab.look(units) == '["rad/s", "rad/s"]'
    lab.say("motor6.val = 0.1;")
    assert lab.look(units) == '["rad", "rad"]'


def test_a_motor_of_the_brick_counts_degrees_and_its_sonar_centimetres() -> None:
    lab = Nxt.ready()
    lab.say("claw.val = 90;", 3)
    assert lab.number("claw.val") == pytest.approx(90, abs=3)
    assert lab.brick.motor("B").position == pytest.approx(lab.number("claw.val"), abs=1)
    assert lab.look("[claw.val->unit, claw.angle->unit, sonar.val->unit]") == '["deg", "rad", "cm"]'
    assert lab.number("sonar.val") == pytest.approx(100 * lab.tribot.distance(), abs=1)


def test_the_raw_value_of_the_light_sensor_is_no_ratio() -> None:
    lab = Nxt.ready()
    assert lab.look("light.val->unit") == '"ratio"'
    lab.say('light.mode = "Normal";', 0.2)
    assert (lab.look("light.val->unit"), lab.number("light.val") > 1) == ('"1"', True)


def test_help_tells_the_age_of_a_device_in_seconds() -> None:
    lab = Bioloid.ready(Kit(servos=(6,), sensors=(), baud=BAUD))
    world = lab.kernel.host.world
    rows = {row.name: row for row in rows_of(world, world.global_.slots["motor6"])}
    assert lab.look("motor6.age->unit") == '"s"'
    assert (rows["age"].unit, 0 <= float(rows["age"].value) < 0.1) == ("s", True)


def test_claps_have_no_range_and_only_0_is_taken() -> None:
    lab = Bioloid.ready(Kit(servos=(), sensors=(100,), baud=BAUD))
    assert lab.look('System.documentation(sensor100, "clapCount")').endswith('Unit: none."')
    assert lab.say("sensor100.clapCount = 5;").endswith("only 0 can be written, which begins a new count")
    assert lab.say("sensor100.clapCount = 0;") == "0"
