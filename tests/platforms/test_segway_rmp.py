"""The class RMP of the manual and the object ``robot``, against the simulated base in simulated time."""

from __future__ import annotations

import logging
import math
import re

import pytest
from segway_lab import CanLab, Lab

from urbihw.kernel.uobject import BadConfig, NotReady
from urbihw.kernel.uobject.protection import protect_robot
from urbihw.platforms import find
from urbihw_fakes.segway import frames as f
from urbihw_fakes.segway.rmp import SegwayRmp

READINGS = ("leftSpeed", "rightSpeed", "forward", "yaw", "left", "right")
COEFFICIENTS = tuple(f"{name}Coeff" for name in ("forwardSpeed", "yawSpeed", *READINGS))


# ---------------------------------------------------------------- the manual's chapter


def test_an_rmp_is_made_as_the_manual_has_it() -> None:
    lab = Lab.ready()
    assert lab.say("var rmp = RMP.new(0.05);").startswith("RMP_")
    assert lab.say("rmp.period;") == "0.05"
    assert lab.say("rmp.forwardSpeed = 0.5;", 2.0) == "0.5"
    assert lab.number("rmp.forwardSpeed") == pytest.approx(0.5, abs=0.005)
    assert lab.base.body.speed == pytest.approx(0.5, abs=0.005)
    assert lab.say("rmp.forwardSpeed = 0 | rmp.yawSpeed = 0.4;", 2.0) == "0.4"
    assert lab.number("rmp.yawSpeed") == pytest.approx(0.4, abs=0.005)
    assert lab.base.body.turn == pytest.approx(0.4, abs=0.005)
    assert lab.base.body.speed == 0.0


def test_all_raw_sensors_of_the_manual_measure() -> None:
    lab = Lab.ready()
    lab.say("rmp.forwardSpeed = 1 | rmp.yawSpeed = 0.2;", 3.0)
    body = lab.base.body
    wanted = (body.left_speed, body.right_speed, body.forward, body.yaw, body.left, body.right)
    # Every value is one of a moment ago.
    assert [lab.number(f"rmp.{name}") for name in READINGS] == pytest.approx(wanted, abs=0.05)
    assert lab.number("rmp.forward") > 2
    assert lab.number("rmp.yaw") == pytest.approx(0.59, abs=0.05)


def test_raw_sensors_cannot_be_written() -> None:
    lab = Lab.ready()
    answers = [lab.say(f"rmp.{name} = 1;") for name in READINGS]
    assert ["this slot can only be read" in answer for answer in answers] == [True] * 6


def test_every_coefficient_scales_what_it_is_of() -> None:
    lab = Lab.ready()
    lab.base.preset_integrators(left=1000, right=1000, forward=1000, yaw=1000)
    lab.say("rmp.forwardSpeed = 0.5 | rmp.yawSpeed = 0.5;", 3.0)
    for name in COEFFICIENTS:
        slot = name.removesuffix("Coeff")
        before, coefficient = lab.number(f"rmp.{slot}"), lab.number(f"rmp.{name}")
        assert before != 0
        lab.say(f"rmp.{name} = {coefficient * 10};")
        assert lab.number(f"rmp.{slot}") == pytest.approx(before * 10, rel=0.1)


@pytest.mark.parametrize(("model", "speed", "metre", "turn"), [("50", 401, 40181, 117031), ("200", 332, 33215, 112644)])
def test_usegway_holds_values_for_metre_second_radian(model: str, speed: float, metre: float, turn: float) -> None:
    lab = Lab.ready(SegwayRmp(model), model=model)
    assert 1 / lab.number("rmp.leftSpeedCoeff") == pytest.approx(speed, rel=1e-4)
    assert 1 / lab.number("rmp.forwardCoeff") == pytest.approx(metre, rel=1e-4)
    assert math.tau / lab.number("rmp.yawCoeff") == pytest.approx(turn, rel=1e-4)
    lab.say("rmp.forwardSpeed = 1;", 3.0)
    assert lab.base.body.speed == pytest.approx(1.0, abs=0.005)
    assert lab.number("rmp.forwardSpeed") == pytest.approx(1.0, abs=0.005)
    assert lab.number("rmp.forward") == pytest.approx(lab.base.body.forward, abs=0.05)


def test_the_coefficients_of_another_model_can_be_asked_for() -> None:
    lab = Lab.ready()
    lab.say('rmp.calibrate("50");')
    assert 1 / lab.number("rmp.leftCoeff") == pytest.approx(40181, rel=1e-4)
    assert "there are: 100, 200, 400, 50" in lab.say('rmp.calibrate("300");')


def test_the_standard_robot_api() -> None:
    lab = Lab.ready()
    assert lab.say("robot.flatDump;").splitlines()[:2] == ["*** Battery: battery", "*** GyroSensor: gyroX gyroY"]
    lab.say("robot.body.x.speed = 0.3;", 2.0)
    assert lab.base.body.speed == pytest.approx(0.3, abs=0.005)
    assert lab.number("robot.body.x.val") == pytest.approx(0.3, abs=0.005)
    lab.say("robot.body.x.val = 0 | robot.body.yaw.speed = 0.2;", 2.0)
    assert (lab.base.body.speed, lab.number("robot.body.yaw.speed")) == pytest.approx((0, 0.2), abs=0.005)
    assert lab.number("wheelR.speed") == pytest.approx(0.2 * 0.27, abs=0.005)
    assert lab.number("battery.voltage") == pytest.approx(77.5, abs=0.3)
    assert 0.9 < lab.number("battery.remain") < 1.0
    assert lab.say("robot.drive(0, 0);", 2.0) == ""
    assert lab.base.body.turn == 0.0
    assert lab.say("robot.model;") == '"Segway RMP 200"'
    for part in ("robot", "battery", "robot.body.x", "robot.body.yaw", "wheelL", "gyroX"):
        assert lab.say(f"Interface.Promises.missing({part});") in ("[]", '["force"]')


def test_odometry_follows_a_curve_and_is_not_lost_by_a_reset() -> None:
    lab = Lab.ready()
    # A quarter of a circle with a radius of 1 m, to the left.
    lab.say("robot.drive(0.5, 0.5);", 1.0)
    lab.say("rmp.resetCoders;", math.pi / 2 / 0.5 - 1.0)
    lab.say("robot.drive(0, 0);", 2.0)
    x, y, heading = (lab.number(f"robot.odometry[{index}]") for index in range(3))
    body = lab.base.body
    assert heading == pytest.approx(body.yaw, abs=0.2)
    assert (x, y) == pytest.approx((math.sin(heading), 1 - math.cos(heading)), abs=0.15)
    assert lab.number("rmp.forward") < body.forward - 0.3


@pytest.mark.parametrize(
    ("name", "told"),
    [("usegway.u", ""), ("rmp.u", "*** rmp.u: the base is served already, as rmp and robot: nothing is changed")],
)
def test_the_files_of_the_manual_can_be_loaded_again_and_again(name: str, told: str) -> None:
    lab = Lab.ready()
    # As in the daemon, where no program may remove or replace the robot.
    protect_robot(lab.robot, "segway")
    lab.kernel.complete()
    path = find("segway").folder / name
    for _ in range(2):
        assert lab.say(f'load("{path}");') == told
        assert lab.look("[rmp.state, robot.isA(Interface.Mobile)]") == '["ok", true]'
    lab.say("var Global.mine = RMP.new(50ms);")
    lab.say("robot.body.x.speed = 0.3;", 2.0)
    assert lab.number("mine.forwardSpeed") == lab.number("rmp.forwardSpeed") == pytest.approx(0.3, abs=0.005)


def test_it_is_the_same_on_a_can_bus(caplog: pytest.LogCaptureFixture) -> None:
    lab = CanLab.ready()
    lab.say("rmp.forwardSpeed = 0.5 | rmp.yawSpeed = 0.2;", 2.0)
    assert (lab.base.body.speed, lab.base.body.turn) == pytest.approx((0.5, 0.2), abs=0.005)
    assert lab.number("rmp.forwardSpeed") == pytest.approx(0.5, abs=0.005)
    assert lab.number("segway.busLoad") == pytest.approx(0.23, abs=0.03)
    lab.end.unplug()
    lab.run(2.0)
    assert lab.base.body.speed == 0.0
    lab.end.replug()
    lab.run(3.0)
    assert [record.message.partition(" ")[0] for record in caplog.records] == ["link", "link"]
    assert lab.base.body.speed == 0.0


# ---------------------------------------------------------------- what else there is


def test_speeds_are_clamped_and_the_limit_is_seen() -> None:
    lab = Lab.ready()
    assert lab.number("rmp.forwardSpeed->rangemax") == pytest.approx(3.576)
    assert lab.number("rmp.yawSpeed->rangemin") == pytest.approx(-1024 / 446.9071, rel=1e-4)
    lab.say("rmp.forwardSpeed = 100;", 0.1)
    assert lab.base.reading().velocity == 1176
    lab.say("rmp.forwardSpeed = -1000;", 0.1)
    assert lab.base.reading().velocity == -1176
    assert "takes a finite number" in lab.say("rmp.forwardSpeed = nan;")
    assert "takes a finite number" in lab.say("rmp.forwardSpeed = inf;")
    assert "this slot takes a number" in lab.say('rmp.forwardSpeed = "fast";')
    assert lab.base.reading().velocity == -1176


def test_coefficients_without_sense_are_refused() -> None:
    lab = Lab.ready()
    for value in ("0", "nan", "inf", '"x"'):
        assert "!!!" in lab.say(f"rmp.velocityCoeff = {value};")
    lab.say("rmp.forwardSpeed = 1;", 2.0)
    assert lab.base.body.speed == pytest.approx(1.0, abs=0.01)


def test_a_negative_coefficient_turns_the_other_way_round() -> None:
    lab = Lab.ready()
    lab.say("rmp.turnCoeff = -rmp.turnCoeff;")
    lab.say("rmp.yawSpeed = 0.5;", 1.0)
    assert lab.base.body.turn == pytest.approx(-0.5, abs=0.01)
    assert lab.number("rmp.yawSpeed->rangemax") > 2


def test_speeds_stay_true_below_a_lower_limit() -> None:
    lab = Lab.ready()
    lab.say("rmp.speedScale = 0.5;", 0.2)
    assert (lab.base.velocity_scale, lab.number("rmp.speedScale")) == (8, 0.5)
    assert lab.number("rmp.forwardSpeed->rangemax") == pytest.approx(3.576 / 2)
    lab.say("rmp.forwardSpeed = 1;", 3.0)
    assert lab.base.body.speed == pytest.approx(1.0, abs=0.01)
    lab.say("rmp.forwardSpeed = 3;", 3.0)
    assert lab.base.body.speed == pytest.approx(3.576 / 2, abs=0.01)
    lab.say("rmp.speedScale = 0;", 0.2)
    lab.say("rmp.forwardSpeed = 1;", 3.0)
    assert lab.base.body.speed == 0.0


def test_the_other_settings_reach_the_base() -> None:
    lab = Lab.ready()
    lab.say('rmp.accelerationScale = 0.25 | rmp.turnScale = 0.5 | rmp.currentLimit = 1 | rmp.gain = "heavy";', 0.5)
    lab.say("rmp.lockout = true;", 0.2)
    base = lab.base
    assert (base.acceleration_scale, base.turn_scale, base.current_limit, base.gain) == (4, 8, 256, 2)
    assert lab.say("rmp.gain; rmp.lockout;") == '"heavy"\ntrue'


def test_modes_by_name(caplog: pytest.LogCaptureFixture) -> None:
    lab = Lab.ready(SegwayRmp(mode=f.TRACTOR))
    assert lab.say("rmp.mode;") == '"tractor"'
    lab.say('rmp.mode = "balance";', 0.5)
    assert lab.say("rmp.mode;") == '"balance"'
    assert "one of disabled, tractor, balance, power down" in lab.say('rmp.mode = "flying";')
    lab.base.estop = True
    lab.say('at (segway.refused?(var slot, var why)) echo(slot + ": " + why);')
    last = lab.say('rmp.mode = "tractor";', 2.0).splitlines()[-1]
    assert last.startswith("*** mode: the base stays in mode disabled")
    assert [record.message for record in caplog.records if "not done" in record.message] != []


def test_a_low_battery_is_an_event() -> None:
    lab = Lab.ready()
    lab.say("at (rmp.batteryLow?(var volts)) echo(volts);")
    lab.say('at (robot.body.battery.low?(var volts)) echo("tree");')
    battery = lab.base.body
    for volts, heard in ((66.0, ""), (65.5, "65.5 tree"), (66.5, ""), (65.0, ""), (67.25, ""), (64.0, "64 tree")):
        battery.volts = volts
        lab.run(0.5)
        assert sorted(lab.heard().replace("*** ", "").split()) == heard.split()
    battery.volts = 75.0
    lab.say("rmp.lowVoltage = 70;", 0.5)
    battery.volts = 69.5
    lab.run(0.5)
    assert "69.5" in lab.heard()


def test_gyros_are_in_radians_per_second() -> None:
    lab = Lab.ready()
    lab.base.body.push(math.radians(5))
    lab.run(0.06)
    body = lab.base.body
    assert abs(body.pitch_rate) > 0.01
    assert lab.number("robot.body.gyro[y].speed") == pytest.approx(body.pitch_rate, abs=0.05)
    assert lab.number("robot.body.gyro[y].angle") == pytest.approx(body.pitch, abs=0.01)
    lab.say("rmp.yawSpeed = 0.5;", 2.0)
    assert lab.number("robot.body.yaw.speed") == pytest.approx(body.turn, abs=0.01)


def test_faults_are_said_in_words() -> None:
    lab = Lab.ready(SegwayRmp(mode=f.TRACTOR))
    assert lab.say("rmp.fault; rmp.motors;") == '""\ntrue'
    lab.say("at (rmp.faulted?(var what)) echo(what);")
    lab.base.estop = True
    lab.run(0.2)
    assert lab.heard() == "*** motors disabled on request, emergency stop switch open"
    assert lab.say("rmp.motors;") == "false"


def test_the_lean_is_seen() -> None:
    lab = Lab.ready()
    lab.base.body.push(0.1)
    lab.run(0.02)
    assert abs(lab.number("rmp.pitch")) > 0.03
    assert lab.number("gyroY.angle") == lab.number("rmp.pitch")
    lab.run(2.0)
    assert abs(lab.number("rmp.pitch")) < 0.01


def test_coders_begin_anew() -> None:
    lab = Lab.ready()
    lab.say("rmp.forwardSpeed = 1;", 2.0)
    lab.say("rmp.forwardSpeed = 0;", 1.5)
    assert lab.number("rmp.forward") > 1
    lab.say("rmp.resetCoders;", 0.5)
    assert [lab.number(f"rmp.{name}") for name in ("forward", "yaw", "left", "right")] == [0, 0, 0, 0]


def test_switching_off() -> None:
    lab = Lab.ready()
    lab.say("segway.shutdown;", 0.5)
    assert not lab.base.powered
    assert lab.say("segway.state; rmp.stale;") == '"lost"\ntrue'


def test_two_faces_of_one_base() -> None:
    lab = Lab.ready()
    lab.say("var Global.a = RMP.new(50ms) | var Global.b = RMP.new(20ms);", 0.1)
    lab.say("a.forwardSpeed = 1;", 1.0)
    lab.say("b.forwardSpeed = 0.2;", 2.0)
    assert lab.base.body.speed == pytest.approx(0.2, abs=0.005)
    assert lab.number("a.forwardSpeed") == lab.number("b.forwardSpeed") == pytest.approx(0.2, abs=0.005)


@pytest.mark.parametrize(("period", "readings"), [("10ms", 50), ("50ms", 20), ("500ms", 2)])
def test_every_rmp_has_its_period_and_the_base_what_it_needs(period: str, readings: int) -> None:
    lab = Lab.ready()
    lab.say(f"var Global.r = RMP.new({period});", 0.2)
    heard = lab.base.heard
    lab.say("var Global.n = 0 | at (r.forward->changed?) Global.n += 1 | r.forwardSpeed = 0.5;", 2.5)
    assert lab.base.heard - heard == pytest.approx(2.5 * 50, abs=3)
    assert lab.number("n") == pytest.approx(2.5 * readings, abs=3)


def test_slow_rmps_alone_let_commands_go_out_every_50_ms() -> None:
    lab = Lab.ready()
    lab.say("rmp.period;")
    for rmp in list(lab.robot._members):  # type: ignore[attr-defined]
        lab.robot._members.discard(rmp)  # type: ignore[attr-defined]
    lab.say("var Global.r = RMP.new(500ms);", 0.2)
    heard = lab.base.heard
    lab.run(2.5)
    assert lab.base.heard - heard == pytest.approx(2.5 * 20, abs=2)


def test_periods_without_sense() -> None:
    lab = Lab.ready()
    for period in ("0", "-1", "nan", "61", '"fast"'):
        assert "!!!" in lab.say(f"RMP.new({period});")


# ---------------------------------------------------------------- stopping


def test_starting_moves_nothing() -> None:
    lab = Lab.ready()
    lab.run(2.0)
    assert (lab.base.body.forward, lab.base.body.yaw) == (0.0, 0.0)
    assert lab.base.heard > 80


def test_stop_is_at_once() -> None:
    lab = Lab.ready()
    lab.say("rmp.forwardSpeed = 1;", 2.0)
    lab.say("segway.stop;", 0.04)
    assert lab.base.reading().velocity == 0
    lab.run(2.0)
    assert lab.base.body.speed == 0.0


def test_the_end_of_the_connection_that_drives_it_stops_it(caplog: pytest.LogCaptureFixture) -> None:
    lab = Lab.ready()
    client = lab.kernel.open_lobby()
    lab.kernel.feed(client, b"rmp.forwardSpeed = 1;")
    lab.run(2.0)
    assert lab.base.body.speed == pytest.approx(1.0, abs=0.01)
    client.close()
    lab.run(0.04)
    assert lab.base.reading().velocity == 0
    assert "is closed, which moved it" in caplog.text


def test_a_connection_that_releases_its_devices_stops_them_and_may_move_them_again(
    caplog: pytest.LogCaptureFixture,
) -> None:
    lab = Lab.ready()
    client, other = lab.kernel.open_lobby(), lab.kernel.open_lobby()
    lab.kernel.feed(client, b"rmp.forwardSpeed = 1; detach({ sleep(4s); rmp.forwardSpeed = 1 })|;")
    lab.run(2.0)
    lab.kernel.feed(other, b"lobby.releaseDevices;")
    lab.run(1.0)
    assert lab.base.body.speed == pytest.approx(1.0, abs=0.01), "another connection has nothing to release"
    lab.kernel.feed(client, b"lobby.releaseDevices;")
    lab.run(2.0)
    assert lab.base.body.speed == 0.0
    assert "has released it" in caplog.text
    assert b"after this statement had begun" in client.output.take_bytes()
    lab.kernel.feed(client, b"rmp.forwardSpeed = 0.5;")
    lab.run(2.0)
    assert lab.base.body.speed == pytest.approx(0.5, abs=0.01)


def test_the_end_of_another_connection_does_not() -> None:
    lab = Lab.ready()
    client = lab.kernel.open_lobby()
    lab.kernel.feed(client, b"rmp.forwardSpeed = 1;")
    lab.run(0.1)
    lab.say("rmp.forwardSpeed = 0.5;", 2.0)
    client.close()
    lab.run(1.0)
    assert lab.base.body.speed == pytest.approx(0.5, abs=0.01)


def test_a_kernel_that_is_stuck_loses_the_base_within_400_ms() -> None:
    lab = Lab.ready()
    lab.say("rmp.forwardSpeed = 1;", 2.0)
    assert lab.worker is not None
    stopped = False
    for _ in range(25):
        # Only the worker goes on: the kernel says nothing any more.
        lab.device.tick(lab.bus_clock.now())
        lab.worker.step()
        stopped = stopped or lab.base.reading().velocity == 0
    assert stopped


def test_the_dead_man_cannot_be_switched_off() -> None:
    lab = Lab.ready()
    assert lab.robot._wanted.dead_man == 0.4  # type: ignore[attr-defined]


# ---------------------------------------------------------------- motors that were off


def driving(mode: int = f.TRACTOR) -> Lab:
    """A base that goes 1 m/s, because somebody has said so once."""
    lab = Lab.ready(SegwayRmp(mode=mode))
    lab.say("rmp.forwardSpeed = 1;", 2.0)
    assert lab.base.body.speed == pytest.approx(1.0, abs=0.01)
    return lab


def assert_stands(lab: Lab) -> None:
    """Its motors are on, it does not move by itself, and it does when it is told to."""
    assert lab.base.motors
    place = lab.base.body.forward
    lab.run(3.0)
    assert lab.base.body.forward == pytest.approx(place, abs=0.001)
    lab.say("rmp.forwardSpeed = 1;", 2.0)
    assert lab.base.body.speed == pytest.approx(1.0, abs=0.01)


def test_the_emergency_stop_of_the_base_ends_what_it_was_told() -> None:
    lab = driving()
    console = lab.console()
    console.line("estop on")
    lab.run(2.0)
    assert lab.base.body.speed == 0.0
    console.line("estop off")
    lab.run(0.5)
    lab.say('rmp.mode = "tractor";', 0.5)
    assert_stands(lab)


def test_a_base_that_was_lifted_stands() -> None:
    lab = driving(f.BALANCE)
    console = lab.console()
    lab.base.body.fallen = True
    lab.run(2.0)
    console.line("lift")
    lab.say('rmp.mode = "balance";', 0.5)
    assert_stands(lab)


@pytest.mark.parametrize("mode", ["tractor", "balance"])
def test_a_mode_without_motors_and_back(mode: str) -> None:
    lab = driving()
    lab.say('rmp.mode = "disabled";', 1.0)
    assert not lab.base.motors
    lab.say(f'rmp.mode = "{mode}";', 0.5)
    assert_stands(lab)


def test_both_modes_in_one_breath() -> None:
    lab = driving()
    lab.say('rmp.mode = "disabled"; rmp.mode = "tractor";', 2.0)
    assert_stands(lab)


def test_motors_that_were_off_for_one_cycle_only() -> None:
    for steps in range(1, 3):
        lab = driving()
        for _ in range(steps):
            lab.step()
        lab.console().line("blink")
        lab.run(2.0)
        assert lab.base.body.speed == 0.0
        assert lab.robot.motion.reason == "the motors of the base were switched off"
        assert_stands(lab)


def test_a_speed_for_motors_that_are_off_does_not_wait_for_them(caplog: pytest.LogCaptureFixture) -> None:
    lab = driving()
    console = lab.console()
    console.line("estop on")
    lab.run(1.0)
    lab.say("rmp.forwardSpeed = 1;", 0.5)
    assert "the motors of the base are off" in caplog.text
    console.line("estop off")
    lab.say('rmp.mode = "tractor";', 0.5)
    assert_stands(lab)


def test_a_fallen_base_says_why_it_does_not_drive() -> None:
    lab = driving(f.BALANCE)
    lab.base.body.fallen = True
    lab.run(0.5)
    why = "the base does not drive, its motors are off: safety shutdown, pitch angle limit"
    assert why in lab.say("rmp.forwardSpeed = 1;")
    lab.console().line("lift")
    lab.say('rmp.mode = "balance";', 0.5)
    assert_stands(lab)


# ---------------------------------------------------------------- frames that are missing


@pytest.mark.parametrize("identifier", (*range(0x400, 0x408), 0x680))
def test_a_frame_that_stays_out_is_marked_and_the_rest_goes_on(identifier: int) -> None:
    lab = driving()
    lab.console().line(f"lose {identifier:x}")
    lab.run(1.0)
    assert lab.say("segway.state; rmp.state; rmp.stale;") == '"ok"\n"ok"\nfalse'
    assert lab.say("rmp.missing;") == f'"0x{identifier:04X}"'
    own = {
        0x401: ("pitch", "pitchRate", "roll", "rollRate"),
        0x402: ("forwardSpeed", "yawSpeed", "leftSpeed", "rightSpeed"),
        0x403: ("left", "right"),
        0x404: ("forward", "yaw"),
        0x405: ("leftTorque", "rightTorque"),
        0x406: ("voltage", "boxVoltage", "remain"),
    }
    for frame, slots in own.items():
        assert [math.isnan(lab.number(f"rmp.{slot}")) for slot in slots] == [frame == identifier] * len(slots)
    assert lab.say("rmp.mode;") == ('""' if identifier == 0x406 else '"tractor"')
    assert lab.say("rmp.motors;") == ("false" if identifier == 0x680 else "true")
    assert lab.say("rmp.fault;") == ('"not known: the base does not send its status"' if identifier == 0x680 else '""')
    assert lab.base.body.speed == pytest.approx(1.0, abs=0.01)
    lab.console().line(f"lose {identifier:x} 0")
    lab.run(0.1)
    assert lab.say("rmp.missing; rmp.mode; rmp.motors; rmp.fault;") == '""\n"tractor"\ntrue\n""'
    assert lab.number("rmp.forward") == pytest.approx(lab.base.body.forward, abs=0.1)


def test_a_frame_missing_in_every_third_cycle_is_not_seen() -> None:
    lab = driving()
    lab.console().line("lose any 3")
    lab.say('at (rmp.state != "ok" || rmp.missing != "" || rmp.stale || !rmp.motors) echo("seen");')
    lab.say("rmp.forwardSpeed = 0.5;", 5.0)
    assert lab.heard() == ""
    assert lab.base.body.speed == pytest.approx(0.5, abs=0.01)
    assert lab.number("rmp.forward") == pytest.approx(lab.base.body.forward, abs=0.05)


def test_a_way_by_counters_that_are_missing_ends() -> None:
    lab = Lab.ready()
    lab.say("robot.go(100) | echo(1),", 2.0)
    assert lab.base.body.speed > 0.1
    lab.console().line("lose 404")
    lab.run(3.0)
    assert "the base does not tell its way: 0x0404 missing" in lab.heard()
    assert lab.base.body.speed == 0.0
    assert "0x0404" in lab.say("rmp.odometry;")
    lab.console().line("lose 404 0")
    lab.run(0.5)
    assert lab.number("rmp.odometry[0]") == pytest.approx(lab.base.body.forward, abs=0.05)


# ---------------------------------------------------------------- losing and finding


def test_nobody_there_is_not_ready() -> None:
    base = SegwayRmp()
    base.power_off(0.0)
    lab = Lab(base)
    lab.until(lambda: bool(lab.opened))
    (error,) = lab.opened
    assert isinstance(error, NotReady)
    assert "switched off, says its user interface box" in str(error)


def test_silence_is_not_ready_and_says_what_to_look_at() -> None:
    lab = Lab()
    lab.device.faults.start("silence")
    lab.until(lambda: bool(lab.opened))
    (error,) = lab.opened
    assert isinstance(error, NotReady)
    assert "no RMP on pipe://robot" in str(error) and "?baud=460800" in str(error)


def test_options_without_sense_are_bad_config() -> None:
    with pytest.raises(BadConfig, match="options.model: wants one of 50, 100, 200, 400, not \"300\""):
        Lab(model="300")
    with pytest.raises(BadConfig, match="options.colour: no such option; there are: .*, model"):
        Lab(colour="red")


def test_a_base_that_is_switched_off_and_on_during_a_behaviour(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING)
    lab = Lab.ready(SegwayRmp(mode=f.TRACTOR))
    lab.say("rmp.speedScale = 0.5;", 0.2)
    lab.say('at (segway.lost?(var why)) echo("lost") & at (segway.back?) echo("back");')
    lab.say("rmp.forwardSpeed = 1;", 2.0)
    way = lab.number("rmp.forward")
    lab.base.power_off(lab.bus_clock.now())
    lab.run(3.0)
    assert lab.heard() == "*** lost"
    lab.base.power_on(lab.bus_clock.now())
    lab.run(2.0)
    assert lab.heard() == "*** back"
    # It has its settings again, does not move by itself, and the way goes on where it was.
    assert lab.base.velocity_scale == 8
    assert lab.base.body.speed == 0.0
    assert lab.number("rmp.forward") == pytest.approx(way, abs=0.3)
    assert [record.message.partition(":")[0] for record in caplog.records] == [
        "the base is lost",
        "the base is back",
        "the base was switched off and on; it gets its settings again",
    ]


def test_the_adapter_pulled_and_put_back_during_a_behaviour(caplog: pytest.LogCaptureFixture) -> None:
    lab = Lab.ready()
    lab.say('at (segway.linkLost?(var why)) echo("gone") & at (segway.linkBack?) echo("here");')
    lab.say("rmp.forwardSpeed = 0 sin:2s ampli:0.3,", 2.0)
    lab.end.unplug()
    lab.run(1.5)
    assert lab.heard() == "*** gone"
    assert lab.base.body.speed == 0.0
    lab.end.replug()
    lab.run(3.0)
    assert lab.heard() == "*** here"
    assert [record.message.partition(" ")[0] for record in caplog.records] == ["link", "link"]
    # The behaviour has gone on writing all the time, so it moves again.
    fastest = 0.0
    for _ in range(100):
        lab.step()
        fastest = max(fastest, abs(lab.base.body.speed))
    assert fastest > 0.2


def test_a_speed_of_before_does_not_come_back_with_the_link() -> None:
    lab = Lab.ready()
    lab.say("rmp.forwardSpeed = 1;", 2.0)
    lab.end.unplug()
    lab.run(2.0)
    lab.end.replug()
    lab.run(3.0)
    assert lab.base.body.speed == 0.0
    lab.say("rmp.forwardSpeed = 1;", 2.0)
    assert lab.base.body.speed == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(("word", "amount"), [("checksum", None), ("noise", 7), ("cut", 25)])
def test_a_bad_line_is_counted_and_the_base_stays_in_hand(word: str, amount: float | None) -> None:
    lab = Lab.ready()
    lab.say("rmp.forwardSpeed = 0.5;", 1.1)
    assert lab.number('segway.statistics["damaged"]') == 0
    counts = []
    for _ in range(60):
        lab.device.faults.start(word, amount=amount, times=1)
        lab.step()
        counts.append(lab.number('segway.statistics["damaged"]'))
    assert max(counts) >= 20
    lab.run(2.0)
    assert lab.number('segway.statistics["damaged"]') == 0
    assert lab.base.body.speed == pytest.approx(0.5, abs=0.01)
    assert lab.number("rmp.forwardSpeed") == pytest.approx(0.5, abs=0.01)
    assert lab.say("segway.state;") == '"ok"'


def test_the_oldest_firmware_is_driven_too(caplog: pytest.LogCaptureFixture) -> None:
    lab = Lab.ready(SegwayRmp("50", old_firmware=True), model="50")
    lab.say("rmp.forwardSpeed = 0.5;", 2.0)
    assert lab.base.body.speed == pytest.approx(0.5, abs=0.01)
    assert lab.say("rmp.mode; rmp.fault;") == '""\n""'
    assert "firmware of the base is old" in caplog.text


def test_status_for_the_service_manager() -> None:
    lab = Lab.ready()
    lab.run(1.5)
    assert re.fullmatch("RMP 200, 7[78] V, (49|50|51) Hz", lab.robot.status())
    lab.device.faults.start("silence")
    lab.run(1.0)
    assert lab.robot.status() == "base lost"
    lab.end.unplug()
    lab.run(0.2)
    assert lab.robot.status() == "link down"


# ---------------------------------------------------------------- Mobile


def test_go_and_turn_arrive() -> None:
    lab = Lab.ready()
    lab.say("robot.go(1.5) | echo(1);", 15.0)
    assert lab.base.body.forward == pytest.approx(1.5, abs=0.1)
    lab.say("robot.turn(-90deg) | echo(2);", 10.0)
    assert lab.base.body.yaw == pytest.approx(math.pi / 2, abs=0.1)
    lab.say("robot.go(-1);", 15.0)
    assert lab.base.body.forward == pytest.approx(0.5, abs=0.2)
    assert lab.base.body.speed == 0.0


def test_stopping_the_job_that_goes_stops_the_base() -> None:
    lab = Lab.ready()
    lab.say("var Global.t = Tag.new | t: robot.go(100),", 2.0)
    assert lab.base.body.speed > 0.1
    lab.say("t.stop;", 1.0)
    assert lab.base.body.speed == 0.0


def test_the_dead_man_of_a_script_stops_the_base() -> None:
    lab = Lab.ready()
    lab.say("robot.watchdogInterval = 0.3 | robot.watchdog | robot.xSpeed = 0.5;", 0.25)
    assert lab.base.body.speed > 0.2
    lab.run(1.0)
    assert lab.base.body.speed == 0.0


def test_a_base_that_is_lost_on_its_way_ends_the_way() -> None:
    lab = Lab.ready()
    lab.say("robot.go(100) | echo(1),", 2.0)
    lab.device.faults.start("silence")
    lab.run(3.0)
    assert lab.base.body.speed == 0.0
    lab.device.faults.stop()
    lab.run(1.0)
    place = lab.base.body.forward
    lab.run(3.0)
    assert lab.base.body.forward == pytest.approx(place, abs=0.01)


def test_an_RMP_that_is_made_with_no_number_says_what_it_takes() -> None:
    lab = Lab.ready()
    assert 'RMP.new: expected the period in seconds, given "a"' in lab.say('RMP.new("a");')
