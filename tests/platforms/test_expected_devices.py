"""Expected devices, hot plug and swapped robots on a servo bus: what is said, and that nothing moves."""

from __future__ import annotations

import math

import pytest
from bioloid_lab import BAUD, Lab

from urbihw.buses.engine import Engine
from urbihw_fakes.bioloid import Bioloid as Kit
from urbihw_fakes.dynamixel.ax12 import Ax12
from urbihw_fakes.dynamixel.xseries import XSeries

Caplog = pytest.LogCaptureFixture


def kit(*ids: int) -> Kit:
    return Kit(units=[Ax12(number) for number in ids], baud=BAUD)


def engine_of(lab: Lab) -> Engine:
    """The engine of its worker."""
    assert lab.worker is not None
    return lab.worker._engine


def warnings(caplog: Caplog) -> list[str]:
    return [record.getMessage() for record in caplog.records if record.levelname != "INFO"]


def put_in_place(lab: Lab, other: Kit) -> None:
    """Unplug the adapter, put another kit behind it, plug it in again."""
    lab.end.unplug()
    lab.run(0.3)
    for unit in other:
        unit.registers.put("return_delay", 0)
    other.pace(BAUD)
    other.tick(lab.bus_clock.now())
    lab.kit = other
    lab.end.replug()


def test_what_differs_is_listed_by_kind_and_changes(caplog: Caplog) -> None:
    devices = {"hip": 3, "knee": {"id": 4, "model": "AX-18A"}, "foot": {"id": 5, "firmware": 24}, "toe": 9}
    lab = Lab.ready(kit(3, 4, 5, 7), devices=devices)
    assert warnings(caplog)[-3:] == [
        "missing: toe (id 9)",
        "unexpected: id 7 (AX-12A, firmware 24)",
        "of another kind: knee (id 4) is AX-12A, firmware 24, not AX-18A",
    ]
    assert lab.say("bioloid.problems.size;") == "3"
    assert "toe (id 9) missing" in lab.say("bioloid.problems;")
    lab.kit.add(Ax12(9))
    lab.run(3)
    assert "toe" not in lab.say("bioloid.problems;")
    assert lab.say("motors.has(9);") == "true"


def test_a_group_whose_name_a_program_has_taken_does_not_spoil_the_tree(caplog: Caplog) -> None:
    lab = Lab.ready(kit(3), devices={"hip": 3, "toe": {"id": 9, "groups": ["legs", "feet"]}})
    lab.say("var Global.legs = 5;")
    toe = Ax12(9)
    lab.kit.add(toe)
    lab.run(3)
    assert "there is no group legs: a program has given that name to something else" in warnings(caplog)
    assert not any("not complete" in line for line in warnings(caplog))
    assert lab.say("legs;") == "5"
    lab.say("toe.load = 1; feet.val = 0.5;")
    lab.run(2)
    assert toe.position == pytest.approx(512 + 0.5 / math.radians(300 / 1023), abs=3)


def test_as_expected_is_no_problem(caplog: Caplog) -> None:
    lab = Lab.ready(kit(3, 4), devices={"hip": 3, "knee": {"id": 4, "model": "AX-12A", "firmware": "24"}})
    assert (lab.say("bioloid.problems;"), warnings(caplog)) == ("[]", [])


def test_another_robot_in_its_place_is_named_and_does_not_move(caplog: Caplog) -> None:
    caplog.set_level("INFO")
    lab = Lab.ready(kit(3, 4))
    lab.say("motor3.speed = 0.5|; motor3.val = 1 sin:3s ampli:50deg,", 0.5)
    other = kit(13, 14)
    put_in_place(lab, other)
    lab.run(3)
    assert any(
        "another robot answers: 2 AX-12A (id 13 14, firmware 24), not 2 AX-12A (id 3 4, firmware 24)" in record.message
        for record in caplog.records
    )
    assert lab.say("motors.keys;").endswith("[3, 4, 13, 14]")
    assert all(isinstance(unit, Ax12) and unit.speed == 0 and unit.position == Ax12(1).position for unit in other)


def test_a_kit_with_other_servos_under_the_same_ids_is_left_alone(caplog: Caplog) -> None:
    lab = Lab.ready(kit(3, 4))
    lab.say("motor3.val = 1 sin:3s ampli:50deg,", 0.5)
    new = XSeries(unit=3)
    put_in_place(lab, Kit(units=[new, Ax12(4)], baud=BAUD))
    _stays_blocked(lab, new, "motor 3 is lost: XL430-W250 answers to this id, not AX-12A", caplog)
    assert math.isfinite(lab.number("motor4.val"))
    caplog.clear()
    put_in_place(lab, kit(3, 4))
    lab.run(3)
    assert lab.say("motor3.state;") == '"ok"'
    assert math.isfinite(lab.number("motor3.val"))
    assert "motor 3 is back" in warnings(caplog)
    assert lab.say("bioloid.problems;") == "[]"
    assert lab.findings() == []
    lab.say("motor3.load = 1; motor3.val = 0.3;", 2)
    assert lab.number("motor3.val") == pytest.approx(0.3, abs=0.05)


def test_a_servo_replaced_by_another_model_on_the_live_bus_is_left_alone(caplog: Caplog) -> None:
    lab = Lab.ready(Kit(units=[XSeries("XL330-M288", 3), XSeries("XL330-M288", 4)], baud=BAUD))
    lab.say("motor3.val = 1 sin:3s ampli:50deg,", 0.5)
    lab.kit.remove(lab.kit[3])
    lab.run(1)
    new = XSeries("XM430-W350", 3)
    new.registers.put("return_delay", 0)
    lab.kit.add(new)
    lab.kit.pace(BAUD)
    _stays_blocked(lab, new, "motor 3 is lost: XM430-W350 answers to this id, not XL330-M288", caplog)


@pytest.mark.parametrize("is_live", [True, False])
def test_another_model_is_told_in_one_line(caplog: Caplog, is_live: bool) -> None:
    lab = Lab.ready(kit(3, 4))
    lab.say("motor3.speed = 0.5; motor3.punch = 0.1;", 0.5)
    caplog.clear()
    new = XSeries(unit=3)
    new.registers.put("return_delay", 0)
    if is_live:
        lab.kit.remove(lab.kit[3])
        lab.run(1)
        new.set_baud(BAUD)
        lab.kit.add(new)
        lab.kit.pace(BAUD)
        lab.say("bioloid.scan;")
    else:
        put_in_place(lab, Kit(units=[new, Ax12(4)], baud=BAUD))
    lab.run(4)
    told = [line for line in warnings(caplog) if "XL430" in line and "it is told to stop" not in line]
    assert told == ["motor 3 is lost: XL430-W250 answers to this id, not AX-12A: start urbihw again to use it"]


def _stays_blocked(lab: Lab, new: XSeries, line: str, caplog: Caplog) -> None:
    lab.run(4)
    reason = line.partition(": ")[2]
    assert reason in lab.say("bioloid.problems;")
    assert any(reason in finding for finding in lab.findings())
    assert "answers to this id" in lab.say("motor3.val = 0.4;")  # a warning
    lab.say("motor3.load = 1; motor3.val = 1;", 1)
    assert new.motor.position == XSeries().motor.position and not new.registers.get("torque_enable")
    assert any(line in text for text in warnings(caplog))
    assert lab.say("motor3.state;").endswith('"lost"')


def test_a_new_difference_does_not_tell_the_others_again(caplog: Caplog) -> None:
    lab = Lab.ready(kit(3), devices={"hip": 3, "knee": 4})
    lab.kit.add(Ax12(9))
    lab.say("bioloid.scan;")
    lab.run(3)
    told = warnings(caplog)
    assert [line for line in told if "unexpected: id 9" in line]
    assert sum("missing: knee (id 4)" in line for line in told) == 1


def test_devices_of_another_robot_are_dropped_when_the_own_one_is_back(caplog: Caplog) -> None:
    lab = Lab.ready(kit(3, 4))
    for _ in range(2):
        put_in_place(lab, kit(13, 14))
        lab.run(3)
        assert lab.say("motors.keys;").endswith("[3, 4, 13, 14]")
        caplog.clear()
        put_in_place(lab, kit(3, 4))
        lab.run(3)
        assert lab.say("motors.keys;") == "[3, 4]"
        assert lab.findings() == []
        assert engine_of(lab)._driver.errors()["timeouts"] == 0
        left = "2 devices belong to another robot, which is gone: they are no longer looked for: motor 13-14"
        assert left in warnings(caplog)
        assert "belongs to another robot" in lab.say("motor13.val = 0.2;")
        assert lab.say("motor13.state;") == '"lost"'
        assert lab.say("motors.load = 1|; motors.val = 0.2;").endswith("[0.2, 0.2]")
        lab.run(2)
        assert lab.number("motor3.val") == pytest.approx(0.2, abs=0.05)


def test_a_device_that_joins_the_own_robot_stays_when_it_is_lost() -> None:
    lab = Lab.ready(kit(3, 4))
    put_in_place(lab, kit(3, 4, 13))
    lab.run(1)
    lab.say("bioloid.scan;", 3)
    put_in_place(lab, kit(3, 4))
    lab.run(3)
    assert lab.say("motors.keys;") == "[3, 4, 13]"
    assert lab.say("motor13.state;") == '"lost"'
