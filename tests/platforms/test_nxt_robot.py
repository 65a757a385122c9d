"""The object ``nxt`` and its devices: ports, losses, limits, positions, what is not in the manual."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from nxt_lab import Lab

from urbihw.kernel.uobject import BadConfig, NotReady
from urbihw_fakes.nxt.inputs import Colour
from urbihw_fakes.nxt.lowspeed import I2cDevice
from urbihw_fakes.nxt.tribot import TriBot


def test_the_brick_tells_what_it_is() -> None:
    lab = Lab.ready()
    assert lab.say("nxt.name; nxt.firmware; nxt.address; nxt.link;") == '"NXT"\n"1.29"\n"00:16:53:01:02:03"\ntrue'
    assert lab.robot.status() == '"NXT", 3 motors, 4 sensors'


def test_starting_moves_nothing_and_makes_no_sound() -> None:
    lab = Lab.ready()
    lab.run(2)
    assert not any(traffic.data[2:4] in (b"\x80\x04", b"\x80\x03") for traffic in lab.device.log if traffic.way == ">")


# ---------------------------------------------------------------- ports


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('Servo.new("A");', "port A is taken by wheelR; free that first, or choose another port"),
        ("Switch.new(2);", "port 2 is taken by sonar"),
        ("UltraSonicSensor.new(1);", "port 1 is taken by decibel"),
        ('wheelL.port = "B";', "port B is taken by claw"),
        ("sonar.port = 4;", "port 4 is taken by bumper"),
        ('Servo.new("D");', 'a Servo goes on one of the ports "A", "B", "C", not on \'D\''),
        ("Switch.new(5);", "a Switch goes on one of the ports 1, 2, 3, 4, not on 5"),
        ("sonar.port = 1.5;", "not on 1.5"),
        ('LightSensor.new(3, "Bright");', 'the modes of a LightSensor are "Reflector", "Ambient", "Normal"'),
        ('decibel.mode = "dB";', 'the modes of a SoundSensor are "DBA", "DB"'),
        ('wheelL.speed = "fast";', "this slot takes a number"),
        ("sonar.val = 3;", "this slot can only be read"),
        ("beeper.play(100, 1s);", "a beep has 200 to 14000 Hz, not 100"),
        ("beeper.play(300, -1);", "a beep lasts some seconds, or 0 for ever, not -1 s"),
        ("Command.send([0x97]);", "erases the firmware"),
        ("Command.send([256]);", "a list of integers from 0 to 255"),
        ("Command.request([], 3);", "1 to 63 bytes"),
        ("I2CSensor.new(1, 3);", "an even number"),
    ],
)
def test_what_makes_no_sense_is_an_error_that_says_so(line: str, words: str) -> None:
    lab = Lab.ready()
    said = lab.say(line, 0.1)
    assert said.startswith("!!! ") and words in said
    assert lab.powers() == [0, 0, 0]
    assert lab.say("wheelL.port; sonar.port; decibel.mode;") == '"C"\n2\n"DBA"'


def test_a_port_that_is_left_is_free_and_a_moved_motor_stands_still() -> None:
    lab = Lab.ready()
    lab.say("claw.free; wheelL.speed = 30;", 0.1)
    assert lab.powers() == [0, 0, 30]
    lab.say('wheelL.port = "B";', 0.1)
    assert lab.powers() == [0, 0, 0]
    lab.say('wheelL.speed = 20; var other = Servo.new("C");', 0.1)
    assert lab.powers() == [0, 20, 0]
    assert lab.look('nxt.owner("B") === wheelL') == "true"
    assert lab.look("claw.stale") == "true"
    lab.say("claw.speed = 50;", 0.1)
    assert lab.powers() == [0, 20, 0]


def test_a_sensor_moves_to_another_port() -> None:
    lab = Lab.ready()
    lab.say("bumper.free; light.free; sonar.port = 3;", 0.3)
    assert lab.look("sonar.val") == "255"
    lab.brick.plug(2, lab.brick.inputs[1].plugged)
    lab.run(0.3)
    assert lab.look("sonar.val") == "150"


# ---------------------------------------------------------------- positions


def test_writing_a_position_turns_the_motor_there() -> None:
    lab = Lab.ready()
    lab.say("claw.val = 90;", 1.5)
    assert lab.brick.motor("B").rotation == pytest.approx(90, abs=4)
    lab.say("claw.turn = -1;", 3)
    assert lab.brick.motor("B").rotation == pytest.approx(-360, abs=4)
    lab.say("claw.angle = pi/2;", 2)
    assert lab.brick.motor("B").rotation == pytest.approx(-270, abs=4)
    assert lab.number("claw.angle") == pytest.approx(1.57, abs=0.08)
    assert lab.number("claw.turn") == pytest.approx(-0.75, abs=0.02)
    assert lab.look("claw.torque") == "nan"


def test_a_speed_ends_the_way_to_a_position() -> None:
    lab = Lab.ready()
    lab.say("claw.val = 3000;", 0.5)
    assert lab.brick.motor("B").power > 0
    lab.say("claw.speed = 0;", 0.3)
    assert lab.powers() == [0, 0, 0]
    lab.run(1)
    assert lab.powers() == [0, 0, 0]


def test_reset_and_coast() -> None:
    lab = Lab.ready()
    lab.say("claw.speed = 50;", 1)
    lab.say("claw.reset;", 0.1)
    assert lab.number("claw.val") < 100
    lab.say("claw.coast;", 0.1)
    assert lab.brick.motor("B").mode == 0
    assert lab.look("claw.speed") == "0"


# ---------------------------------------------------------------- losses


def test_the_cable_pulled_and_put_back(caplog: pytest.LogCaptureFixture) -> None:
    lab = Lab.ready(TriBot(9.0))
    lab.say('at (nxt.linkLost?(var why)) echo("gone") & at (nxt.linkBack?) echo("here");')
    lab.say("wheels.speed = 0 sin:10s ampli:50,", 1)
    lab.unplug()
    lab.run(1)
    assert lab.heard() == "*** gone"
    assert lab.say("nxt.link; wheelL.stale; sonar.stale;") == "false\ntrue\ntrue"
    lab.end.replug()
    lab.run(3)
    assert lab.heard() == "*** here"
    assert [re.sub("pipe.*", "", record.message) for record in caplog.records] == ["link lost: ", "link to "]
    assert lab.say("nxt.link; wheelL.stale; sonar.stale;") == "true\nfalse\nfalse"
    # The swing goes on.
    assert lab.brick.motor("C").power != 0


def test_nothing_moves_by_itself_when_the_link_is_back() -> None:
    lab = Lab.ready(TriBot(9.0))
    lab.say("wheels.speed = 30;", 0.5)
    assert lab.powers() == [30, 0, 30]
    lab.unplug()
    lab.run(0.5)
    # The brick goes on by itself, and what is said meanwhile is forgotten.
    assert lab.powers() == [30, 0, 30]
    lab.say("claw.speed = 80;")
    lab.end.replug()
    lab.run(3)
    assert lab.powers() == [0, 0, 0]
    assert lab.say("wheelL.speed; claw.speed;") == "0\n0"


def test_a_brick_that_was_switched_off_and_on_is_set_up_again(caplog: pytest.LogCaptureFixture) -> None:
    lab = Lab.ready()
    lab.device.power_off(lab.bus_clock.now())
    lab.run(6)
    assert lab.look("nxt.link") == "false"
    lab.device.power_on(lab.bus_clock.now())
    lab.run(8)
    assert lab.say("nxt.link; sonar.val; light.stale;") == "true\n150\nfalse"
    assert len(caplog.records) == 2


def test_nobody_answers() -> None:
    tribot = TriBot()
    tribot.brick.switch_off()
    lab = Lab(tribot)
    lab.until(lambda: bool(lab.opened))
    (error,) = lab.opened
    assert isinstance(error, NotReady)
    assert "no NXT answers: is it switched on, and does it run the firmware of LEGO?" in str(error)


def test_a_firmware_of_another_kind(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("urbihw_fakes.nxt.system.PROTOCOL", (1, 2))
    lab = Lab()
    lab.until(lambda: bool(lab.opened))
    (error,) = lab.opened
    assert isinstance(error, NotReady)
    assert "the brick speaks protocol 2.01, urbihw 1.x" in str(error)


@pytest.mark.parametrize("word", ["silence", "cut", "noise", "late"])
def test_some_bad_answers_are_counted_and_got_over(word: str) -> None:
    lab = Lab.ready()
    lab.device.faults.start(word, times=2, amount=2.0 if word == "late" else None)
    lab.run(6)
    assert lab.look("nxt.link") == "true"
    lab.tribot.obstacle = 0.3
    lab.tribot.pushed = True
    lab.run(1)
    assert lab.say("sonar.val; bumper.val;") == "30\n1"
    assert lab.number("bumper.age") < 0.1


def test_a_sonar_that_is_not_there_reads_255_and_the_others_go_on() -> None:
    tribot = TriBot()
    tribot.brick.inputs[1].plugged = tribot.touch
    lab = Lab.ready(tribot)
    assert lab.say("sonar.val; sonar.distance; bumper.val;") == "255\ninf\n0"
    assert lab.number("bumper.age") < 0.1


def test_the_brick_is_kept_awake() -> None:
    tribot = TriBot()
    tribot.brick.sleep_limit = 120_000
    lab = Lab.ready(tribot, layout="")
    lab.run(130)
    assert tribot.brick.awake
    assert lab.look("nxt.link") == "true"


# ---------------------------------------------------------------- stopping


def test_stop_holds_all_motors_and_is_silent() -> None:
    lab = Lab.ready()
    lab.say("wheels.speed = 30; claw.val = 2000; beeper.play(300, 0);", 0.3)
    lab.say("nxt.stop;", 0.3)
    assert lab.powers() == [0, 0, 0]
    assert lab.brick.motor("A").mode == 0x07
    assert not lab.brick.sound.sounding(lab.bus_clock.now())
    assert lab.say("wheelL.speed;") == "0"
    lab.run(1)
    assert lab.powers() == [0, 0, 0]
    lab.say("wheels.speed = 30;", 0.1)
    assert lab.powers() == [30, 0, 30]


def test_closing_lets_go_and_twice_is_fine() -> None:
    lab = Lab.ready()
    lab.robot.close()
    lab.robot.close()
    assert lab.say("wheelL.speed = 1; 1+1;") == "1\n2"


# ---------------------------------------------------------------- options and layouts


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"speed": 3}, "options.speed: no such option; there are: .*, track, layout, battery_empty, battery_full"),
        ({"layout": 3}, "options.layout: wants a text, not 3"),
        ({"battery_empty": 9.0}, "options.battery_empty: 9 must be fewer volts than battery_full, 8"),
    ],
)
def test_options_without_sense(options: dict[str, Any], words: str) -> None:
    with pytest.raises(BadConfig, match=words):
        Lab(**options)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "cannot load the layout"),
        ('wheelL = Servo.new("C");\nwheelR = Servo.new("C");\n', "Mine.u:2.10-23: new: port C is taken by wheelL"),
        ("wheelL = Servo.new(;\n", "Mine.u:1.20: syntax error"),
    ],
)
def test_layouts_that_do_not_work(tmp_path: Path, text: str | None, words: str) -> None:
    layout = tmp_path / "Mine.u"
    if text is not None:
        layout.write_text(text)
    lab = Lab(layout=str(layout))
    lab.until(lambda: bool(lab.opened))
    (error,) = lab.opened
    assert isinstance(error, BadConfig)
    assert words in str(error)


def test_the_ends_of_the_battery_are_options() -> None:
    lab = Lab.ready(battery_empty=7.1, battery_full=8.3)
    assert lab.number("battery.val") == pytest.approx((7.89 - 7.1) / 1.2, abs=0.001)
    assert lab.number("battery.voltage") == 7.89
    lab.brick.millivolts = 9000
    lab.run(1.2)
    assert lab.number("battery.remain") == 1


# ---------------------------------------------------------------- more sensors


def test_a_colour_sensor() -> None:
    tribot = TriBot()
    tribot.brick.plug(0, Colour(4))
    lab = Lab.ready(tribot)
    lab.say("decibel.free; var Global.eye = ColourSensor.new(1);", 0.6)
    assert lab.say("eye.val; eye.colour;") == '4\n"yellow"'


def test_any_i2c_sensor() -> None:
    tribot = TriBot()
    tribot.brick.plug(0, I2cDevice(0x14, bytes(range(100))))
    lab = Lab.ready(tribot)
    lab.say("decibel.free; var Global.chip = I2CSensor.new(1, 0x14);", 0.3)
    assert lab.say("chip.read(5, 3);", 0.3) == "[5, 6, 7]"
    lab.say("chip.write(6, [77, 78]);", 0.3)
    assert lab.say("chip.read(5, 4);", 0.3) == "[5, 77, 78, 8]"
    assert "a transfer writes 1 to 15 bytes" in lab.say("chip.read(5, 20);", 0.1)
    lab.brick.plug(0, tribot.touch)
    assert "no sensor answers on the I2C bus" in lab.say("chip.read(5, 3);", 0.3)


def test_a_command_while_the_link_is_down_fails() -> None:
    lab = Lab.ready()
    lab.unplug()
    lab.run(0.1)
    assert lab.say("Command.request([7,0], 15);", 0.5) == "[]"


@pytest.mark.parametrize("leaves", [True, False])
def test_a_program_that_a_command_has_begun_ends_with_its_client(leaves: bool) -> None:
    """Its motors stand then; so do others, since the end of a program lets all coast."""
    lab = Lab.ready()
    lab.brick.program_power = 50
    name = ", ".join(str(byte) for byte in b"Demo.rxe".ljust(20, b"\0"))
    lab.say(f"Command.send([0, {name}]);", 1.0)
    speeds = {port: lab.brick.motor(port).speed for port in "ABC"}
    assert lab.brick.program and all(speed > 300 for speed in speeds.values()), speeds
    if leaves:
        lab.lobby.close()
    lab.run(3.0)
    assert bool(lab.brick.program) is not leaves
    speeds = {port: lab.brick.motor(port).speed for port in "ABC"}
    assert all((abs(speed) < 1) is leaves for speed in speeds.values()), speeds
