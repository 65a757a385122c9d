"""The objects of a Spykee: tracks, lights, battery and dock, configuration, calibration.  Contracts test the rest."""

from __future__ import annotations

import json
import logging
import math
from pathlib import Path
from random import Random

import pytest
from spykee_lab import Lab

from urbihw.platforms.spykee.calibration import Calibration, calibration_file, load, save
from urbihw_fakes.spykee.body import FULL_SPEED
from urbihw_fakes.spykee.device import Spykee


def test_tracks_run_as_they_are_told() -> None:
    lab = Lab.ready()
    lab.say("trackL.val = 50; trackR.val = -25;", 1.0)
    assert lab.device.body.speeds == pytest.approx([0.5 * FULL_SPEED, -0.25 * FULL_SPEED])
    assert lab.look("[trackL.val, trackR.val]") == "[50, -25]"
    lab.say("trackL.val = 400;", 1.0)
    assert lab.device.body.speeds[0] == pytest.approx(FULL_SPEED)
    assert lab.look("trackL.limitedBy") == '"range of val: -100 to 100"'


def test_limits_hold_whoever_asks() -> None:
    lab = Lab.ready(limits={"trackL": {"speed": 30.0}, "trackR": {"acceleration": 20.0}})
    lab.say("trackL.val = 80; trackR.val = 80;", 1.0)
    assert lab.device.body.speeds[0] == pytest.approx(0.3 * FULL_SPEED)
    assert lab.device.body.speeds[1] == pytest.approx(0.2 * FULL_SPEED, abs=0.02)
    assert lab.look("trackL.limitedBy") == '"limits.trackL.speed"'
    assert lab.look("trackL.val") == "30"


def test_a_robot_that_loses_its_user_in_the_middle_drives_on_and_is_stopped_at_the_next_login() -> None:
    lab = Lab.ready()
    lab.say("trackL.val = 60 | trackR.val = 60;", 1.0)
    lab.unplug()
    lab.run(2.0)
    assert lab.device.body.speeds[0] > 0.2  # the firmware of the robot does that: docs/safety.md says so
    assert lab.look("trackL.val") == "0"
    lab.end.replug()
    lab.run(3.0)
    assert lab.look("Spykee.link") == "true"
    assert lab.device.body.speeds == [0.0, 0.0]


def test_a_robot_that_was_switched_off_gets_its_lights_again() -> None:
    lab = Lab.ready()
    lab.say("ledL.val = 1; headLed.val = 1; ledL.val = 0;", 0.2)
    assert lab.device.leds == {0: 1, 1: 0, 2: 0}
    lab.device.power_off(lab.bus_clock.now())
    lab.run(1.0)
    lab.device.leds = dict.fromkeys(lab.device.leds, 0)
    lab.device.power_on(lab.bus_clock.now())
    lab.until(lambda: lab.look("Spykee.link") == "false")
    lab.until(lambda: lab.look("Spykee.link") == "true")
    lab.run(0.1)
    assert lab.device.leds == {0: 1, 1: 0, 2: 0}


def test_the_level_and_charging_are_told_apart() -> None:
    lab = Lab.ready()
    assert lab.look("[Spykee.power, Spykee.charging, battery.remain]") == "[87, false, 0.87]"
    lab.device.body.put_on_dock()
    lab.run(1.0)
    assert lab.look("[Spykee.power, Spykee.charging, battery.remain, Spykee.onDock]") == "[-87, true, 0.87, true]"
    assert lab.robot.status() == "Spykee, charging"


def test_a_search_for_the_dock_is_motion() -> None:
    lab = Lab.ready()
    lab.say("Spykee.findBase;", 1.0)
    assert lab.device.body.doing == "docking"
    lab.say("robot.stop;", 0.1)
    assert lab.device.body.doing == ""
    lab.say("Spykee.estop = true;", 0.1)
    assert "release it first" in lab.say("Spykee.findBase;", 0.1)
    lab.say("Spykee.estop = false; Spykee.findBase;", 0.5)
    assert lab.device.body.doing == "docking"
    lab.say("Spykee.cancelFindBase;", 0.1)
    assert lab.device.body.doing == ""
    lab.say("Spykee.findBase;", 20.0)
    assert lab.look("Spykee.onDock") == "true"
    lab.say("Spykee.chargeStop;", 2.0)
    assert lab.look("Spykee.onDock") == "false"


def test_a_client_that_drives_a_robot_on_its_dock_is_told_once() -> None:
    lab = Lab.ready()
    lab.device.body.put_on_dock()
    lab.run(0.5)
    assert lab.say("trackR.val = 0;", 0.1) == "0"
    told = "!!! 1.16-25: warning: the robot is on its dock: it does not drive before Spykee.chargeStop"
    assert lab.say("trackL.val = 60;", 0.1).splitlines() == [told, "60"]
    assert lab.say("trackL.val = 50;", 0.1) == "50"
    assert lab.look("[trackL.limitedBy, trackL.applied]") == '["off", nan]'
    assert lab.device.body.speeds == [0.0, 0.0]
    lab.say("trackL.val = 0; Spykee.chargeStop;", 2.0)
    assert lab.say("trackL.val = 60;", 1.0) == "60"
    assert lab.look("[trackL.limitedBy, trackL.applied]") == '["", 60]'
    assert lab.device.body.speeds[0] > 0.2


def test_on_its_dock_it_goes_nowhere_and_says_so() -> None:
    lab = Lab.ready()
    lab.device.body.put_on_dock()
    lab.run(0.5)
    before = lab.look("robot.position")
    told = "robot: the robot is on its dock: it does not drive before Spykee.chargeStop"
    assert lab.say("robot.xSpeed = 0.1;", 1.0).splitlines()[0].endswith(told)
    assert "on its dock" in lab.say("robot.go(0.1);", 1.0)
    assert lab.look("[robot.xSpeed, robot.moving]") == "[0, false]"
    assert lab.look("robot.position") == before
    assert lab.say("robot.xSpeed = 0;", 0.1) == "0"
    lab.say("Spykee.chargeStop;", 2.0)
    assert lab.say("robot.xSpeed = 0.1;", 1.0) == "0.1"
    assert lab.device.body.speeds[0] > 0.01


def test_it_goes_to_its_dock_and_a_stop_ends_the_search() -> None:
    lab = Lab.ready()
    lab.say("robot.goToChargingStation,", 1.0)
    assert lab.device.body.doing == "docking"
    lab.look("robot.stop")
    assert "was stopped" in lab.say("", 0.5)
    assert lab.device.body.doing == ""
    assert lab.say("robot.goToChargingStation; 1;", 0.5) == ""
    assert lab.say("", 20.0) == "1"
    assert lab.look("[Spykee.onDock, robot.moving]") == "[true, false]"


def test_a_search_for_the_dock_ends_with_the_link() -> None:
    lab = Lab.ready()
    lab.say("robot.goToChargingStation;", 1.0)
    lab.unplug()
    assert "the link to the robot is down" in lab.say("", 1.0)


def test_configuration_networks_and_log() -> None:
    lab = Lab.ready()
    assert lab.say('Spykee.setConfigValue("loader_host", "here"); Spykee.getConfigValue("loader_host");', 1) == '"here"'
    assert lab.device.settings["loader_host"] == "here"
    assert "the robot has no key x" in lab.say('Spykee.getConfigValue("x");', 1)
    assert "none of & =" in lab.say('Spykee.setConfigValue("a", "b&c");', 1)
    assert lab.say("Spykee.networks;", 1) == '[["home", "WPA", "70"], ["caf:e", "NONE", "31"]]'
    assert lab.say("Spykee.log;", 1) == '["boot", "network up"]'
    lab.device.faults.start("silence")
    assert "the robot did not answer" in lab.say("Spykee.log;", 4)
    lab.unplug()
    lab.run(0.5)
    assert "the link to the robot is down" in lab.say("Spykee.networks;", 0.1)


def test_volume() -> None:
    lab = Lab.ready(volume=30)
    assert lab.device.volume == 30
    lab.say("Spykee.volume = 80;", 0.1)
    assert (lab.device.volume, lab.look("Spykee.volume")) == (80, "80")
    lab.say("Spykee.volume = 300;", 0.1)
    assert lab.device.volume == 100
    lab.device.volume = 0
    lab.unplug()
    lab.run(0.5)
    lab.end.replug()
    lab.run(3.0)
    assert (lab.device.volume, lab.look("Spykee.volume")) == (100, "100")


def test_packets_of_all_kinds_with_anything_in_them_hurt_nobody(caplog: pytest.LogCaptureFixture) -> None:
    lab = Lab.ready()
    lab.say("at (camera.val->changed?) 1; at (micro.val->changed?) 1;", 1.0)
    clap = 'var Global.clap = Clapper.new("micro.val", 0.2, 200, 800, 4000)|;'
    lab.say(clap)
    chance = Random(3)
    for kind in range(256):
        for size in (0, 1, 2, chance.randrange(3, 60), 5001):
            data = b"PK" + bytes([kind]) + size.to_bytes(2, "big") + chance.randbytes(size)
            lab.end.send(data, lab.bus_clock.now())
        lab.run(0.02)
    lab.run(1.0)
    assert lab.look("Spykee.link") == "true"
    assert [record.message for record in caplog.records if record.levelno >= logging.WARNING] == []
    lab.say("trackL.val = 50;", 0.5)
    assert lab.device.body.speeds[0] > 0.1


def test_a_name_with_line_ends_stays_one_line() -> None:
    lab = Lab.ready(Spykee("SPYKEE\nroot: \x1b[2J"))
    assert "\n" not in str(lab.robot.uid.sensed) and "\x1b" not in str(lab.robot.uid.sensed)


# ---------------------------------------------------------------- calibration


def went(lab: Lab) -> float:
    return lab.device.body.ways[0]


def test_go_is_right_after_a_calibration_and_after_a_restart(tmp_path: Path) -> None:
    path = str(tmp_path / "deep" / "calibration.json")
    lab = Lab.ready(calibration=path)
    lab.say("robot.go(1);", 8.0)
    first = went(lab)
    assert abs(first - 1) > 0.03
    assert lab.say(f"Spykee.calibrateGo(1, {first});") == ""
    fresh = Lab.ready(calibration=path)
    fresh.say("robot.go(1);", 8.0)
    assert went(fresh) == pytest.approx(1.0, abs=0.02)
    assert list(json.loads(Path(path).read_text())) == ["SPYKEE0011223344"]
    other = Lab.ready(Spykee("SPYKEEother"), calibration=path)
    assert other.look("Spykee.fullSpeed") == "0.4"


def test_turn_is_right_after_a_calibration(tmp_path: Path) -> None:
    lab = Lab.ready(calibration=str(tmp_path / "c.json"))
    lab.say("robot.turn(-180deg);", 9.0)
    first = lab.device.body.heading
    lab.say(f"Spykee.calibrateTurn(180deg, {first});")
    lab.say("robot.turn(180deg);", 9.0)
    assert first - lab.device.body.heading == pytest.approx(math.pi, abs=0.05)


def test_a_calibration_that_cannot_be_meant_is_refused(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    lab = Lab.ready(calibration=str(tmp_path / "c.json"))
    for words in ("1, 20", "0, 1", "1, -1", "1, nan"):
        assert "must be alike" in lab.say(f"Spykee.calibrateGo({words});"), words
    assert not (tmp_path / "c.json").exists()
    (tmp_path / "file").touch()
    lab = Lab.ready(calibration=str(tmp_path / "file" / "c.json"))
    assert "choose another one: calibration" in lab.say("Spykee.calibrateGo(1, 1.1);")
    for text in ("{", "[]", '{"SPYKEE0011223344": {"speed": "x"}}', '{"SPYKEE0011223344": 3}'):
        (tmp_path / "bad.json").write_text(text)
        caplog.clear()
        with caplog.at_level(logging.WARNING):
            lab = Lab.ready(calibration=str(tmp_path / "bad.json"))
        assert "remove the file and calibrate again" in caplog.text, text
        assert lab.look("Spykee.fullSpeed") == "0.4"


def test_where_calibrations_are_kept(tmp_path: Path) -> None:
    assert calibration_file("", {"STATE_DIRECTORY": "/var/lib/u"}) == Path("/var/lib/u/spykee-calibration.json")
    assert calibration_file("", {"HOME": "/h"}) == Path("/h/.local/state/urbihw/spykee-calibration.json")
    path, made = tmp_path / "c.json", Calibration(0.3, 1.5)
    save(path, "a", made)
    save(path, "b", Calibration(0.5, 2.0))
    assert load(path, "a", Calibration(1, 1)) == made


def test_what_the_robot_cannot_do_is_scaled() -> None:
    calibration = Calibration(0.4, 2.0)
    assert calibration.tracks(0.2, 0.0) == pytest.approx((50.0, 50.0))
    assert calibration.tracks(0.0, 1.0) == pytest.approx((-50.0, 50.0))
    assert calibration.tracks(0.4, 2.0) == pytest.approx((0.0, 100.0))
    assert calibration.tracks(-0.8, 0.0) == pytest.approx((-100.0, -100.0))


# ---------------------------------------------------------------- the manual


def test_all_slots_of_the_manual_are_there() -> None:
    lab = Lab.ready()
    lab.say('var Global.clap = Clapper.new("micro.val", 0.2, 200, 800, 4000)|;')
    slots = {
        "trackL": ["val"], "trackR": ["val"], "ledL": ["val"], "ledR": ["val"], "headLed": ["val"], "camera": ["val"],
        "speaker": ["val", "playSound"], "micro": ["val"], "robot": ["go", "turn"], "mp3": ["play", "stop"],
        "Spykee": ["setConfigValue", "getConfigValue", "findBase", "cancelFindBase", "chargeStop", "power"],
        "clap": ["val", "emitEvent", "sequence"],
    }  # fmt: skip
    missing = [f"{name}.{slot}" for name, all_ in slots.items() for slot in all_
               if lab.look(f'{name}.hasSlot("{slot}")') != "true"]
    assert missing == []
