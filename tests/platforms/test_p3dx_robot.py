"""The object ``P3dx``: opening, losing and finding the robot and its laser, and what no manual tells of."""

from __future__ import annotations

import logging
import math
from typing import Any

import pytest
from p3dx_lab import Lab

from urbihw.kernel.uobject import BadConfig, NotReady, RobotSettings
from urbihw.platforms.p3dx.robot import P3dx
from urbihw_fakes.p3dx.kit import P3dx as Kit
from urbihw_fakes.p3dx.sips import Settings
from urbihw_fakes.p3dx.world import World


def driving(**options: Any) -> Lab:
    """A robot in an empty world, motors on."""
    lab = Lab.ready(Kit(World(), slip=0.0), **options)
    lab.say("P3dx.body.load = 1;", 0.5)
    return lab


def pull(lab: Lab, seconds: float) -> None:
    """Pull the robot's cable for some time, and wait until it is found again."""
    lab.robot_line.end.unplug()
    lab.run(seconds)
    lab.robot_line.end.replug()
    lab.until(lambda: lab.look("P3dx.link") == "true")
    lab.run(0.5)


def warnings(caplog: pytest.LogCaptureFixture) -> list[str]:
    """What was logged above information, one line each."""
    return [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]


# --- opening ----------------------------------------------------------------------------------------------------------


def test_nobody_there_is_not_ready() -> None:
    kit = Kit()
    kit.robot.power_off(0)
    lab = Lab(kit)
    lab.until(lambda: bool(lab.opened))
    (error,) = lab.opened
    assert isinstance(error, NotReady) and "no Pioneer answers on pipe://robot" in str(error)


@pytest.mark.parametrize("options", [{"colour": 1}, {"host_baud": 1}, {"localization": "stars"}, {"subclass": "r2d2"}])
def test_options_without_sense_are_bad_config(options: dict[str, Any]) -> None:
    with pytest.raises(BadConfig, match=next(iter(options))):
        Lab(**options)


def test_opening_moves_nothing_and_says_how_it_is() -> None:
    lab = Lab.ready()
    lab.run(2)
    assert not lab.kit.body.moving and not lab.kit.body.motors
    assert lab.robot.status() == "p3dx-sh 'fake', 12.5 V, motors off"
    assert lab.say("P3dx.link; P3dx.firmware;") == 'true\n"2.0"'


def test_an_older_robot_counts_otherwise() -> None:
    lab = Lab.ready(Kit(World(), slip=0.0, settings=Settings(subclass="p3dx")))
    lab.say("P3dx.body.load = 1;", 0.5)
    lab.say("P3dx.go(0.5);", 6)
    assert lab.where()[0] == pytest.approx(0.5, abs=0.01)
    assert lab.number("P3dx.body.odometry.x") == pytest.approx(lab.where()[0], abs=0.005)


@pytest.mark.parametrize("subclass", ["p2dx", "p2de", "p3dx"])
def test_the_sonars_of_each_subclass_count_in_its_own_unit(subclass: str) -> None:
    lab = Lab.ready(Kit(World.room(), slip=0.0, settings=Settings(subclass=subclass)))
    lab.run(1.0)
    for number in range(8):
        assert lab.number(f"P3dx.sonarPart({number}).val") == pytest.approx(
            lab.kit.robot.sonars.distance(number), abs=0.002
        )


def test_an_unknown_subclass_is_said(caplog: pytest.LogCaptureFixture) -> None:
    Lab.ready(Kit(World(), settings=Settings(subclass="p3dx-sh-lms500")))
    assert warnings(caplog) == []
    Lab.ready(Kit(World(), settings=Settings(subclass="seekur")))
    assert len(warnings(caplog)) == 1 and "'seekur' is not known" in warnings(caplog)[0]
    Lab.ready(Kit(World(), settings=Settings(subclass="seekur")), subclass="p3at-sh")
    assert len(warnings(caplog)) == 1


def test_firmware_that_ends_its_packets_early_is_understood() -> None:
    kit = Kit(World(), slip=0.0)
    kit.robot.low_firmware = True
    lab = Lab.ready(kit)
    lab.say("P3dx.body.load = 1; P3dx.body.yaw.speed = 0.5;", 2)
    assert lab.number("P3dx.body.battery.voltage") == 12.5
    # Without ROTVEL the rotation follows from the wheels.
    assert lab.number("P3dx.body.yaw.speed") == pytest.approx(0.5, abs=0.03)


# --- losing it --------------------------------------------------------------------------------------------------------


def test_a_pulled_cable_is_one_line_and_a_returned_one_another(caplog: pytest.LogCaptureFixture) -> None:
    lab = driving()
    lab.say('at (P3dx.linkLost?(var why)) echo("lost") & at (P3dx.linkBack?) echo("back");')
    lab.say("P3dx.body.x.speed = 0.3;", 2)
    pull(lab, 3)
    assert lab.heard() == "*** lost\n*** back"
    lines = warnings(caplog)
    assert len(lines) == 2 and "link lost" in lines[0] and "is back" in lines[1]


def test_nothing_moves_by_itself_after_a_reconnect() -> None:
    lab = driving()
    lab.say("P3dx.body.x.speed = 0.3;", 2)
    pull(lab, 4)
    where = lab.where()
    lab.run(3)
    assert lab.where() == where
    assert lab.look("P3dx.body.x.speed") == "0"
    lab.say("P3dx.body.load = 1;", 0.5)
    lab.say("P3dx.body.x.speed = 0.2;", 2)
    assert lab.kit.body.moving


def test_a_behaviour_goes_on_after_the_link_is_back() -> None:
    lab = driving()
    lab.say('every (0.5s) { try { P3dx.body.load = 1; P3dx.speedAlpha = 0.3 } catch { echo("not now") } },', 2)
    assert lab.kit.body.moving
    pull(lab, 3)
    lab.run(2)
    assert lab.kit.body.moving


def test_without_a_link_measurements_are_none() -> None:
    lab = driving()
    lab.run(1)
    lab.robot_line.end.unplug()
    lab.run(0.5)
    assert lab.look("P3dx.body.sonar[left][front].val") == "nan"
    assert lab.look("P3dx.body.load") == "0"
    assert lab.robot.status() == "link down"
    assert "the link to the robot is down" in lab.say("P3dx.body.x.speed = 0.1;")
    for typed in ("P3dx.body.load = 1;", "P3dx.body.sonar.load = 1;", 'P3dx.command("SETO", nil);'):
        assert "the link to the robot is down" in lab.say(typed)


def test_a_robot_switched_off_and_on(caplog: pytest.LogCaptureFixture) -> None:
    lab = driving()
    lab.say("P3dx.go(5),", 2)
    lab.kit.robot.power_off(lab.bus_clock.now())
    lab.run(4)
    assert "silent" in warnings(caplog)[0]
    lab.kit.robot.power_on(lab.bus_clock.now())
    lab.until(lambda: lab.look("P3dx.link") == "true")
    lab.run(3)
    assert not lab.kit.body.moving and not lab.kit.body.motors
    assert len(warnings(caplog)) == 2


def test_garbage_on_the_line_is_counted() -> None:
    lab = driving()
    lab.run(0.5)
    lab.kit.robot.faults.start("noise", times=5)
    lab.kit.robot.faults.start("checksum", times=3)
    lab.run(2)
    assert lab.look("P3dx.link") == "true"


def test_a_robot_whose_packets_are_all_damaged_stops_and_comes_back_standing(caplog: pytest.LogCaptureFixture) -> None:
    lab = driving()
    lab.say("P3dx.body.x.speed = 0.2;", 2)
    assert lab.kit.body.forward.speed == pytest.approx(0.2)
    lab.console().line("checksum")
    lab.run(1.5)
    # Blind for half a second, then it brakes; the link is still up.
    assert not lab.kit.body.moving
    assert lab.look("P3dx.link") == "true"
    where = lab.where()
    lab.run(1.0)
    assert lab.look("P3dx.link") == "false"
    assert "silent for 2 s" in warnings(caplog)[0]
    lab.run(5)
    assert lab.where() == where
    lab.console().line("heal")
    lab.until(lambda: lab.look("P3dx.link") == "true")
    lab.run(3)
    assert lab.where() == where
    assert "is back" in warnings(caplog)[-1]
    lab.say("P3dx.body.load = 1;", 0.5)
    lab.say("P3dx.body.x.speed = 0.2;", 2)
    assert lab.kit.body.forward.speed == pytest.approx(0.2)


# --- the STOP button, walls -------------------------------------------------------------------------------------------


def test_the_stop_button_ends_everything_and_is_told(caplog: pytest.LogCaptureFixture) -> None:
    lab = driving()
    lab.say("P3dx.body.x.speed = 0.3;", 2)
    lab.kit.robot.press_stop_button(True)
    lab.run(1)
    assert lab.say("P3dx.body.stopButton; P3dx.body.load;") == "true\n0"
    lab.say("P3dx.body.load = 1;", 3)
    assert "STOP button" in warnings(caplog)[0]
    lab.kit.robot.press_stop_button(False)
    lab.say("P3dx.body.load = 1;", 1)
    assert lab.kit.body.motors and not lab.kit.body.moving


def test_bumps_and_stalls_are_told() -> None:
    lab = Lab.ready(Kit(slip=0.0))
    lab.say('at (P3dx.body.bumped?(var side, var number)) echo("%s %s" % [side, number]);')
    lab.say("P3dx.body.load = 1;", 0.5)
    lab.say("P3dx.body.x.speed = 0.6;", 8)
    assert lab.heard() == ""
    assert lab.look("P3dx.body.frontBumpers") == "[false, false, true, false, false]"
    lab.say("P3dx.body.x.speed = -0.2;", 2)
    assert lab.look("P3dx.body.stalled") == "false"


def test_go_into_a_wall_ends() -> None:
    lab = Lab.ready(Kit(slip=0.0))
    lab.say("P3dx.body.load = 1;", 0.5)
    lab.say("at (robot.unreachable?) echo(\"cannot\");")
    said = lab.say('P3dx.go(10); echo("over");', 20).splitlines()
    assert said == ["*** cannot", "*** the robot is blocked after 2.75 of 10 m: the movement has ended", "*** over"]
    assert not lab.kit.body.moving


# --- the laser --------------------------------------------------------------------------------------------------------


def test_a_laser_that_is_pulled_and_put_back(caplog: pytest.LogCaptureFixture) -> None:
    lab = Lab.ready()
    lab.say('at (P3dx.body.laser.lost?(var why)) echo("lost") & at (P3dx.body.laser.back?) echo("back");')
    lab.say("P3dx.body.laser.load = 1;", 2)
    lab.laser_line.end.unplug()
    lab.run(1)
    assert lab.say("P3dx.body.laser.load; P3dx.body.laser.state;") == '*** lost\n0\n"lost"'
    lab.laser_line.end.replug()
    lab.run(4)
    assert lab.say("P3dx.body.laser.load; P3dx.body.laser.state;") == '*** back\n1\n"on"'
    assert len(warnings(caplog)) == 2


def test_a_laser_that_is_not_there_is_said_once(caplog: pytest.LogCaptureFixture) -> None:
    kit = Kit()
    kit.laser.power_off(0)
    lab = Lab.ready(kit)
    lab.say("P3dx.body.laser.load = 1;", 10)
    assert lab.look("P3dx.body.laser.load") == "0"
    assert len(warnings(caplog)) == 1 and "no laser answers" in warnings(caplog)[0]
    kit.laser.power_on(0)
    lab.run(4)
    assert lab.look("P3dx.body.laser.load") == "1"
    lab.say("P3dx.body.laser.load = 0;", 0.5)
    lab.say("P3dx.body.laser.load = 1;", 2)
    assert lab.look("P3dx.body.laser.load") == "1"


class NoLaser(Lab):
    url = "pipe://robot?baud=115200"


def test_a_robot_without_a_laser_says_so() -> None:
    lab = NoLaser.ready()
    assert "add ?laser=" in lab.say("P3dx.body.laser.load = 1;")
    assert lab.look("P3dx.body.laser.load") == "0"


def test_a_dirty_window_is_told() -> None:
    lab = Lab.ready()
    lab.kit.laser.dirty = True
    lab.say("P3dx.body.laser.load = 1;", 2)
    assert lab.look("P3dx.body.laser.dirty") == "true"


def test_the_laser_of_mobilesim_comes_over_the_robots_line() -> None:
    lab = NoLaser.ready(Kit(settings=Settings(serial="SIM", name="MobileSim")))
    lab.say("P3dx.body.laser.load = 1;", 1)
    assert lab.look("P3dx.body.laser.val.size") == "181"
    lab.kit.body.set_pose(0.0, 2.0, 0.0)
    lab.run(0.5)
    assert lab.number("P3dx.body.laser.val[0]") == pytest.approx(1.0, abs=0.01)
    assert lab.number("P3dx.body.laser.angleMax") == pytest.approx(math.pi / 2, abs=1e-4)
    lab.say("P3dx.body.laser.load = 0;", 1)
    assert lab.kit.robot.sim_laser.mode == 0


# --- everything else that ARCOS has -----------------------------------------------------------------------------------


def test_packets_on_request() -> None:
    lab = driving()
    assert lab.look("P3dx.values(\"encoder\").size") == "0"
    lab.say('P3dx.watch("encoder"); P3dx.watch("io");', 0.5)
    assert lab.look('P3dx.values("encoder")') == '["left" => 0, "right" => 0]'
    lab.say("P3dx.body.x.speed = 0.2;", 2)
    assert lab.number('P3dx.values("encoder")["left"]') > 10000
    assert lab.number('P3dx.values("io")["analog"][8]') == pytest.approx(12.5 / 20 * 1023, abs=1)
    lab.say('P3dx.unwatch("encoder");', 0.5)
    assert lab.look('P3dx.values("encoder").size') == "0"
    assert "there are: battery, encoder" in lab.say('P3dx.watch("toaster");')


def test_outputs() -> None:
    lab = driving()
    lab.say("P3dx.body.digitalOut = 5;", 0.5)
    assert lab.kit.robot.extras.digital_out == 5
    assert lab.look("P3dx.body.digitalOut") == "5"
    assert lab.look("P3dx.body.digitalIn") == "255"


def test_commands_by_name() -> None:
    lab = driving()
    lab.say('P3dx.command("SAY", [25, 60, 25, 64]); P3dx.command("BUMPSTALL", 1);', 0.5)
    assert [order.number for order in lab.kit.robot.orders if order.number in (15, 44)] == [15, 44]
    assert lab.kit.body.bump_stall == 1
    for typed, why in (
        ('P3dx.command("VEL", 100);', "slots that drive"), ('P3dx.command("FLY", nil);', "no command"),
        ('P3dx.command("STOP", 1);', "takes nothing"), ('P3dx.command("SAY", [300]);', "from 0 to 255"),
        ("P3dx.sonarPart(16);", "0 to 15"),
    ):  # fmt: skip
        assert why in lab.say(typed)


def test_settings_are_taken_while_running() -> None:
    lab = driving()
    with pytest.raises(BadConfig, match="cell"):
        lab.robot.configure(RobotSettings(lab.url, options={"cell": 9}))
    lab.robot.configure(RobotSettings(lab.url, options={"cell": 0.2}))
    assert isinstance(lab.robot, P3dx)
    assert lab.robot.options.cell == 0.2


def test_closing_twice_is_fine() -> None:
    lab = Lab.ready()
    lab.say("P3dx.body.laser.load = 1;", 1)
    lab.robot.close()
    lab.robot.close()


def test_a_laser_switched_off_and_on_at_once_is_on() -> None:
    lab = Lab.ready()
    lab.say("P3dx.body.laser.load = 1;", 2)
    lab.say("P3dx.body.laser.load = 0| P3dx.body.laser.load = 1;", 3)
    assert lab.look("P3dx.body.laser.state") == '"on"'
    lab.run(3)
    assert lab.number("P3dx.body.laser.load") == 1
