"""Drives after CiA 402 as urbiscript sees them, against a simulated one in simulated time."""

from __future__ import annotations

import logging
import math
from pathlib import Path

import pytest
from cia402_lab import Lab, LivingLab

from urbihw.kernel.uobject import BadConfig, NotReady
from urbihw_fakes.can.node import CanFrame
from urbihw_fakes.cia402.dictionary import INCREMENTS
from urbihw_fakes.cia402.node import Drive

README = Path(__file__).resolve().parents[2] / "urbihw" / "platforms" / "cia402" / "README.md"


@pytest.fixture
def lab() -> Lab:
    """A drive that is on."""
    made = Lab.ready()
    made.say("drive5.load = 1;", 0.2)
    assert made.drive.machine.state == "operation enabled"
    return made


def turns(lab: Lab) -> float:
    """Where the motor of the fake is."""
    return lab.drive.machine.position / INCREMENTS


def test_starting_moves_nothing_and_switches_nothing_on() -> None:
    lab = Lab.ready()
    lab.run(2.0)
    assert (lab.drive.machine.state, turns(lab)) == ("switch on disabled", 0.0)
    assert lab.say("drive5.load; drive5.watched; drive5.increments; drive5.node;") == "0\ntrue\n4096\n5"


def test_positions_and_speeds_are_in_radians(lab: Lab) -> None:
    lab.say("drive5.val = 1;", 2.0)
    assert turns(lab) * math.tau == pytest.approx(1.0, abs=0.002)
    assert lab.number("drive5.val") == pytest.approx(1.0, abs=0.002)
    lab.say("drive5.speed = -2;", 2.0)
    assert lab.number("drive5.speed") == pytest.approx(-2.0, abs=0.005)
    assert lab.say("drive5.mode;") == '"velocity"'
    lab.say("drive5.val = 0;", 4.0)
    assert turns(lab) == pytest.approx(0.0, abs=0.001)
    assert lab.say("drive5.mode;") == '"position"'


def test_a_trajectory_is_followed(lab: Lab) -> None:
    lab.say("drive5.val = 0 sin:2s ampli:30deg,", 2.0)
    places = []
    for _ in range(200):
        lab.step()
        places.append(turns(lab) * 360)
    assert max(places) == pytest.approx(30, abs=3)
    assert min(places) == pytest.approx(-30, abs=3)


def test_limits_are_those_of_the_drive(lab: Lab) -> None:
    assert lab.number("drive5.val->rangemax") == pytest.approx(100 * math.tau, rel=1e-4)
    assert lab.number("drive5.speed->rangemin") == pytest.approx(-20 * math.tau, rel=1e-4)
    lab.say("drive5.speed = 1000;", 3.0)
    assert lab.number("drive5.speed") == pytest.approx(20 * math.tau, rel=1e-3)


def test_a_gear_is_a_coefficient(lab: Lab) -> None:
    lab.say("drive5.positionCoeff /= -10;")
    lab.say("drive5.val = 0.5;", 4.0)
    assert turns(lab) == pytest.approx(-10 * 0.5 / math.tau, abs=0.01)
    assert lab.number("drive5.val->rangemax") == pytest.approx(10 * math.tau, rel=1e-4)
    for value in ("0", "nan", "inf", '"x"'):
        assert "!!!" in lab.say(f"drive5.velocityCoeff = {value};")


@pytest.mark.parametrize(("value", "words"), [("nan", "takes a finite number"), ('"far"', "this slot takes a number")])
def test_values_without_sense_are_refused(lab: Lab, value: str, words: str) -> None:
    assert words in lab.say(f"drive5.val = {value};")


def test_off_means_off(lab: Lab) -> None:
    lab.say("drive5.load = 0;", 0.3)
    assert lab.drive.machine.state == "ready to switch on"
    assert "drive 5 is off (ready to switch on): switch it on with load = 1" in lab.say("drive5.speed = 1;")


def test_a_fault_is_said_reset_and_nothing_moves_until_told(lab: Lab, caplog: pytest.LogCaptureFixture) -> None:
    lab.say("drive5.speed = 3;", 1.0)
    lab.say("at (drive5.faulted?(var what)) echo(what);")
    lab.drive.fault(0x2310)
    lab.run(1.5)
    assert lab.heard() == "*** code 0x2310 (continuous over-current)"
    assert lab.say("drive5.fault; drive5.load;") == '"code 0x2310 (continuous over-current)"\n0'
    assert "drive 5: code 0x2310 (continuous over-current)" in caplog.text
    lab.say("at (cia402.refused?(var d, var slot, var why)) echo(slot + \": \" + why);")
    lab.say("drive5.load = 1;", 0.3)
    assert "drive 5: load not done: drive 5 stays in fault" in caplog.text
    lab.say("drive5.resetFault;", 0.5)
    assert lab.say("drive5.fault;").endswith('""')
    place = turns(lab)
    lab.say("drive5.load = 1;", 1.0)
    assert turns(lab) == pytest.approx(place, abs=0.001)


def test_quick_stop_and_stop(lab: Lab) -> None:
    lab.say("drive5.speed = 20;", 1.0)
    lab.say("cia402.stop;", 0.5)
    assert (lab.drive.machine.speed, lab.drive.machine.state) == (0.0, "operation enabled")
    lab.say("drive5.speed = 20;", 1.0)
    lab.say("drive5.quickStop;", 0.5)
    assert (lab.drive.machine.speed, lab.drive.machine.state) == (0.0, "switch on disabled")
    lab.say("cia402.on;", 0.3)
    assert lab.drive.machine.state == "operation enabled"
    lab.say("cia402.off;", 0.3)
    assert lab.drive.machine.state == "ready to switch on"


def test_a_drive_that_lost_its_power_comes_back_off(lab: Lab, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING)
    lab.say('at (drive5.lost?(var why)) echo(why) & at (cia402.back?(var d)) echo("back " + d.node);')
    lab.say("drive5.speed = 3;", 1.0)
    lab.drive.power_off(lab.bus_clock.now())
    lab.run(1.5)
    assert lab.heard() == "*** it says nothing"
    assert lab.say("drive5.stale; drive5.load;") == "true\n0"
    lab.drive.power_on(lab.bus_clock.now())
    lab.run(1.0)
    assert lab.heard() == "*** back 5"
    assert lab.drive.machine.state == "switch on disabled"
    assert [record.message for record in caplog.records] == [
        "drive 5 is lost: it says nothing",
        "drive 5 is back, and off",
    ]


STOPPED, PRE_OPERATIONAL, RESET_COMMUNICATION = 0x02, 0x80, 0x82


def foreign_command(lab: Lab, code: int, node: int = 5) -> None:
    """Another master on the bus sends an NMT command (CiA 301: identifier 0, command, node or 0 for all)."""
    lab.drive.receive_frame(CanFrame(0, bytes((code, node))), lab.bus_clock.now())


@pytest.mark.parametrize("movement", ["drive5.speed = 2", "drive5.val = 100", "drive5.torque = 0.1"])
@pytest.mark.parametrize(
    ("code", "node", "reason"),
    [
        (STOPPED, 5, "another master on the bus has put it into STOPPED"),
        (STOPPED, 0, "another master on the bus has put it into STOPPED"),
        (PRE_OPERATIONAL, 5, "another master on the bus has put it into PRE-OPERATIONAL"),
        (RESET_COMMUNICATION, 5, "it has started anew"),
    ],
)
def test_a_drive_that_another_master_takes_away_brakes_and_stays_off(
    lab: Lab, caplog: pytest.LogCaptureFixture, movement: str, code: int, node: int, reason: str
) -> None:
    caplog.set_level(logging.WARNING)
    lab.say(f"{movement};", 1.0)
    lab.say("at (drive5.lost?(var why)) echo(why);")
    foreign_command(lab, code, node)
    lab.run(0.6)
    assert lab.drive.machine.speed == 0.0
    place = turns(lab)
    lab.run(2.0)
    assert lab.drive.machine.state == "switch on disabled"
    assert turns(lab) == pytest.approx(place, abs=1e-4)
    assert lab.heard() == f"*** {reason}"
    assert [record.message for record in caplog.records] == [f"drive 5 is lost: {reason}", "drive 5 is back, and off"]
    assert lab.say("drive5.state; drive5.load;") == '"ok"\n0'
    assert "drive 5 is off" in lab.say("drive5.speed = 1;")
    lab.say("drive5.load = 1;", 1.0)
    assert turns(lab) == pytest.approx(place, abs=1e-4)
    lab.say("drive5.speed = 2;", 1.0)
    assert lab.number("drive5.speed") == pytest.approx(2.0, abs=0.01)


def test_a_master_that_takes_the_drive_away_again_and_again_does_not_make_it_run(lab: Lab) -> None:
    lab.say("drive5.speed = 2;", 1.0)
    for _ in range(100):
        foreign_command(lab, STOPPED)
        lab.run(0.02)
    assert lab.drive.machine.speed == 0.0
    lab.run(2.0)
    assert lab.say("drive5.state;") == '"ok"'
    assert lab.drive.machine.speed == 0.0


def test_the_adapter_pulled_and_put_back(lab: Lab, caplog: pytest.LogCaptureFixture) -> None:
    lab.say("drive5.speed = 3;", 1.0)
    lab.end.unplug()
    lab.run(2.0)
    assert lab.drive.machine.speed == 0.0
    assert lab.robot.status() == "link down"
    lab.end.replug()
    lab.run(3.0)
    assert [record.message.partition(" ")[0] for record in caplog.records] == ["link", "link"]
    assert lab.drive.machine.speed == 0.0
    lab.say("drive5.load = 1;", 0.3)
    lab.say("drive5.speed = 3;", 1.0)
    assert lab.number("drive5.speed") == pytest.approx(3.0, abs=0.01)


def test_drives_by_number() -> None:
    lab = Lab.ready()
    assert lab.say("cia402.drive(5) === drive5; cia402.drives.size; robot.body.joint[0] === drive5;") == "true\n1\ntrue"
    assert "no drive 6; there are: 5" in lab.say("cia402.drive(6);")
    assert lab.robot.status().startswith("1 drive")


def test_nobody_there_is_not_ready() -> None:
    drive = Drive(5)
    drive.power_off(0.0)
    lab = Lab(drive)
    lab.until(lambda: bool(lab.opened))
    (error,) = lab.opened
    assert isinstance(error, NotReady)
    assert "no node answers on can://pipe/robot: power, wiring, bitrate?" in str(error)


def test_options_without_sense_are_bad_config() -> None:
    with pytest.raises(BadConfig, match="options.nodes: wants a list of whole numbers from 1 to 126"):
        Lab(nodes=5)


def test_an_emergency_is_an_event_with_its_text(lab: Lab) -> None:
    lab.say('at (cia402.emergency?(var d, var code, var text)) echo("%s %s %s" % [d.node, code, text]);')
    lab.say("at (drive5.emergency?(var code, var text)) Global.told = [code, text]; var Global.told = nil;")
    lab.drive.fault(0x7305)
    lab.run(0.2)
    assert lab.heard() == "*** 5 29445 encoder"
    assert lab.say("told;") == '[29445, "encoder"]'


def test_homing_finds_the_switch_and_says_so(lab: Lab) -> None:
    lab.say('at (drive5.homed?) echo("home");')
    lab.say("drive5.home(18);", 1.0)
    assert lab.say("drive5.mode;") == '"homing"'
    assert lab.number("drive5.speed") == pytest.approx(math.tau, rel=0.05)
    lab.run(8.0)
    assert lab.heard() == "*** home"
    assert lab.number("drive5.val") == pytest.approx(0.0, abs=0.3)
    assert lab.number("drive5.speed") == 0
    lab.say("drive5.val = -1;", 3.0)
    assert lab.number("drive5.val") == pytest.approx(-1.0, abs=0.01)


def test_homing_is_not_ended_by_a_ramp_that_was_under_way() -> None:
    lab = Lab.ready(limits={"acceleration": 0.5})
    lab.say('drive5.load = 1; at (drive5.homed?) echo("home");', 0.5)
    lab.say("drive5.speed = 6;", 0.5)
    lab.say("drive5.home(18);", 1.0)
    assert lab.say("drive5.mode;") == '"homing"'
    lab.run(8.0)
    assert lab.heard() == "*** home"


@pytest.mark.parametrize("ended_by", ["cia402.stop;", "drive5.quickStop;", "drive5.speed = 0;", "drive5.load = 0;"])
def test_homing_ends_with_a_stop(lab: Lab, ended_by: str) -> None:
    lab.say('at (cia402.refused?(var d, var slot, var why)) echo(slot); at (drive5.homed?) echo("found");')
    lab.say("drive5.home(17);", 1.0)
    told = lab.say(ended_by, 0.5)
    assert lab.drive.machine.speed == pytest.approx(0.0, abs=INCREMENTS / 2)
    place = turns(lab)
    lab.run(2.0)
    assert turns(lab) == pytest.approx(place, abs=0.2)
    assert (told + lab.heard()).split("***")[1:] == [" home"]


def test_homing_ends_with_the_connection_of_its_client(lab: Lab) -> None:
    lab.say("drive5.home(18);", 1.0)
    assert lab.drive.machine.speed > 0
    lab.lobby.close()
    lab.run(0.5)
    assert lab.drive.machine.speed == 0
    place = turns(lab)
    lab.run(2.0)
    assert turns(lab) == pytest.approx(place, abs=1e-4)


@pytest.mark.parametrize("method", ["1e9", "128", "-129"])
def test_a_homing_method_beyond_the_object_is_refused_at_the_call(lab: Lab, method: str) -> None:
    assert "a homing method (0x6098) is a number from -128 to 127" in lab.say(f"drive5.home({method});", 0.5)
    lab.say("drive5.speed = 1;", 1.0)
    assert lab.number("drive5.speed") == pytest.approx(1.0, abs=0.01)


def test_a_homing_method_that_the_drive_does_not_have_is_refused(lab: Lab, caplog: pytest.LogCaptureFixture) -> None:
    lab.say("drive5.home(99);", 0.5)
    assert "drive 5: home not done: drive 5 refuses homing method 99" in caplog.text
    lab.say("drive5.load = 0;", 0.3)
    assert "switch it on with load = 1" in lab.say("drive5.home(17);")


def test_a_torque_is_in_newton_metres_and_a_stop_brakes(lab: Lab) -> None:
    lab.say("drive5.torque = 0.127;", 5.0)
    assert lab.say("drive5.mode;") == '"torque"'
    assert lab.drive.machine.target_torque == 100
    assert lab.number("drive5.torque") == pytest.approx(0.127, rel=0.05)
    assert lab.number("drive5.speed") == pytest.approx(2 * math.tau, rel=0.05)
    lab.say("cia402.stop;", 0.5)
    assert (lab.drive.machine.speed, lab.drive.machine.state) == (0.0, "operation enabled")


def test_a_torque_keeps_its_limit_and_is_refused_where_another_limit_could_not_be_kept() -> None:
    lab = Lab.ready(limits={"drive5": {"torque": 0.1}})
    lab.say("drive5.load = 1;", 0.2)
    lab.say("drive5.torque = 1;", 0.2)
    assert lab.drive.machine.target_torque == pytest.approx(78, abs=1)
    lab = Lab.ready(limits={"drive5": {"speed": 1.0}})
    lab.say("drive5.load = 1;", 0.2)
    assert "has a limit of position or speed" in lab.say("drive5.torque = 1;", 0.2)
    assert lab.drive.machine.target_torque == 0


@pytest.mark.parametrize("limits", [{}, {"speed": 2.0}], ids=["no limit", "limit"])
@pytest.mark.parametrize("stop", ["", "cia402.stop;"], ids=["", "stopped"])
def test_a_drive_does_not_start_for_an_old_goal_before_it_gets_a_new_one(stop: str, limits: dict[str, float]) -> None:
    lab = LivingLab.ready(limits=limits)
    lab.say("drive5.load = 1;", 1.0)
    lab.say("drive5.speed = 6;", 5.0)
    lab.say(f"drive5.speed = 0; {stop}", 1.0)
    machine = lab.drive.machine
    place = machine.position
    lab.say("drive5.val = drive5.val + 1;")
    backward = fastest = 0.0
    for _ in range(150):
        lab.step()
        backward, fastest = min(backward, machine.speed), max(fastest, machine.speed)
    assert backward >= -0.01 * machine.increments
    assert fastest / machine.increments * math.tau <= (2.0 if limits else 15.0) * 1.05
    assert machine.position - place == pytest.approx(machine.increments / math.tau, abs=3)
