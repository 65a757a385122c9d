"""The manual's chapter 24, line by line, as typed by a user of the TriBot."""

from __future__ import annotations

from pathlib import Path

import pytest
from nxt_lab import Lab

from urbihw.platforms.nxt.options import LAYOUT as BUILT_IN
from urbihw_fakes.nxt.tribot import TriBot


def speeds(lab: Lab) -> tuple[int, int]:
    """What the left and the right wheel were told."""
    return lab.brick.motor("C").power, lab.brick.motor("A").power


def test_make_basic_movements() -> None:
    lab = Lab.ready()
    assert lab.say("wheelL.speed = 50;", 0.1) == "50"
    assert speeds(lab) == (50, 0)
    assert lab.say("wheelR.speed = -50;", 0.1) == "-50"
    assert speeds(lab) == (50, -50)
    lab.say("wheels.speed = 0;", 0.1)
    assert speeds(lab) == (0, 0)


def test_improving_the_movements() -> None:
    lab = Lab.ready(TriBot(9.0))
    lab.say("wheels.speed = 50; sleep(10s); wheels.speed = 0;", 9.9)
    assert speeds(lab) == (50, 50)
    way = 9.0 + lab.tribot.x
    assert way == pytest.approx(0.22 * 9.9, rel=0.03)
    lab.run(0.2)
    assert speeds(lab) == (0, 0)
    lab.say("wheels.speed = 50 time:3s; wheels.speed = 0 time:3s;", 1.5)
    assert speeds(lab)[0] == speeds(lab)[1] == pytest.approx(25, abs=1)
    lab.run(1.5)
    assert speeds(lab)[0] == pytest.approx(50, abs=1)
    lab.run(1.5)
    assert speeds(lab)[0] == pytest.approx(25, abs=1)
    lab.run(1.6)
    assert speeds(lab) == (0, 0)


def test_reading_sensors() -> None:
    lab = Lab.ready(TriBot(0.48))
    assert lab.say("sonar.val;") == "48"


def test_at_sonar_stops_the_robot_that_drives_to_the_wall() -> None:
    lab = Lab.ready(TriBot(0.9))
    lab.say("at (sonar.val < 50)\n  wheels.speed = 0;")
    lab.say("wheels.speed = 50;", 4)
    assert speeds(lab) == (0, 0)
    assert 0.42 < lab.tribot.distance() < 0.5
    lab.tribot.x = -0.9
    lab.run(0.2)
    lab.say("wheels.speed = 50;", 4)
    assert speeds(lab) == (0, 0)
    assert 0.42 < lab.tribot.distance() < 0.5


def test_at_bumper_goes_backward() -> None:
    lab = Lab.ready(TriBot(0.3))
    lab.say("at (bumper.val == 1)\n  wheels.speed = -50;")
    lab.say("wheels.speed = 50;", 2.0)
    assert speeds(lab) == (-50, -50)


def test_tagging_commands() -> None:
    lab = Lab.ready(TriBot(9.0))
    lab.say("var mytag = Tag.new;\nmytag: at (decibel.val > 0.7)\n  wheels.speed = 0;")

    def clap() -> tuple[int, int]:
        lab.say("wheels.speed = 30;", 0.1)
        lab.tribot.sound.audible = 0.9
        lab.run(0.2)
        lab.tribot.sound.audible = 0.1
        lab.run(0.2)
        return speeds(lab)

    assert clap() == (0, 0)
    lab.say("mytag.freeze;")
    assert clap() == (30, 30)
    lab.say("mytag.unfreeze;")
    assert clap() == (0, 0)
    lab.say("mytag.stop;")
    assert clap() == (30, 30)


def test_playing_sounds() -> None:
    lab = Lab.ready(TriBot(2.0))
    sound = lab.brick.sound
    assert lab.say("beeper.play(200, 3s);", 0.1) == ""
    assert sound.frequency == 220  # what the firmware makes of 200
    lab.run(2.8)
    assert sound.sounding(lab.bus_clock.now())
    lab.run(0.2)
    assert not sound.sounding(lab.bus_clock.now())


def test_a_beep_of_three_milliseconds_follows_the_distance() -> None:
    # The whole line, `whenever (sonar.val < 100) beeper.play(200 + 6 * sonar.val, 3ms);`, loops without ever waiting,
    # which simulated time cannot follow: see tests/e2e/test_nxt.py.
    lab = Lab.ready(TriBot(0.8))
    lab.say("beeper.play(200 + 6 * sonar.val, 3ms);", 0.05)
    assert lab.brick.sound.frequency == 680


def test_cyclic_moves() -> None:
    lab = Lab.ready(TriBot(9.0))
    lab.say("var mytag = Tag.new;\nmytag: wheels.speed = 0 sin:10s ampli:100,", 2.5)
    assert speeds(lab)[0] == speeds(lab)[1] == pytest.approx(100, abs=1)
    lab.run(5)
    assert speeds(lab)[0] == pytest.approx(-100, abs=1)
    lab.say("mytag.stop;")
    lab.say("var tag2 = Tag.new;\ntag2: wheels.speed = 50 sin:3s ampli:50,", 0.75)
    assert speeds(lab)[0] == pytest.approx(100, abs=2)
    lab.run(1.5)
    assert speeds(lab)[0] == pytest.approx(0, abs=2)


def test_parallelism() -> None:
    lab = Lab.ready(TriBot(9.0))
    lab.say("wheels.speed = 100;\nsleep(2s);\nwheels.speed = 0;", 1.9)
    assert speeds(lab) == (100, 100)
    lab.run(0.3)
    assert speeds(lab) == (0, 0)
    lab.say("wheelL.speed = 50 & wheelR.speed = -50;", 0.1)
    assert speeds(lab) == (50, -50)
    lab.say("wheels.speed = 0;", 0.1)
    lab.say("wheelL.speed = 50 time:10s,\nwheelR.speed = -40 time:10s,", 5.0)
    assert list(speeds(lab)) == pytest.approx([25, -20], abs=1)
    lab.run(5.1)
    assert speeds(lab) == (50, -40)
    lab.say(
        "wheelR.speed = 0 sin:3s ampli:50 &\nwheelL.speed = 0 sin:4s ampli:30 &\nbeeper.play(200,3s),", 0.75
    )
    assert speeds(lab)[1] == pytest.approx(50, abs=1)
    lab.run(0.25)
    assert speeds(lab)[0] == pytest.approx(30, abs=1)
    assert lab.brick.sound.sounding(lab.bus_clock.now())


def test_using_functions() -> None:
    lab = Lab.ready(TriBot(9.0))
    body = "{\n  wheels.speed = speed;\n  sleep(timer);\n  wheels.speed = 0;\n}"
    lab.say(f"function Global.forward(speed,timer)\n{body},")
    # Durations are seconds in this language: 3000, ms in an older one, are 50 minutes.
    lab.say("Global.forward(100,3000),", 5.0)
    assert speeds(lab) == (100, 100)
    lab.say("robot.stop;", 0.2)
    assert speeds(lab) == (0, 0)
    lab.say("Global.forward(100,3s);", 2.9)
    assert speeds(lab) == (100, 100)
    lab.run(0.3)
    assert speeds(lab) == (0, 0)


def test_an_assignment_to_the_name_of_a_device_hides_it_in_one_window() -> None:
    # Manual, "Copy on write": a slot that is inherited, as those of Global by a lobby, is copied.
    lab = Lab.ready(TriBot(9.0))
    assert lab.say("claw = 1; claw;").splitlines() == ["1", "1"]
    assert lab.look("claw") == "claw"
    assert lab.say('removeLocalSlot("claw")|; claw;') == "claw"


def test_loading_files(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("URBI_PATH", f":{BUILT_IN.parent}")
    lab = Lab.ready()
    assert lab.say('load("demo.u");', 0.1) == ""
    assert speeds(lab) == (40, 40)
    lab.run(10)
    lab.say("demo.stop; wheels.speed = 0;", 0.1)
    assert speeds(lab) == (0, 0)
    assert lab.brick.sound.played >= 1


def test_default_layout() -> None:
    lab = Lab.ready()
    lab.say("wheels.speed = 10;", 0.1)
    assert speeds(lab) == (10, 10)
    lab.say("wheels.speed = 0 | wheelL.speed = 10 & wheelR.speed = 10;", 0.1)
    assert speeds(lab) == (10, 10)
    assert lab.say("wheels.speed = 0 | wheelL.speed = 1000;") == "100"
    assert lab.say("wheelL.speed = -1000;") == "-100"
    lab.say("wheels.speed = 0;", 0.2)
    assert lab.number("wheelL.val") == pytest.approx(lab.brick.motor("C").rotation, abs=2)
    assert lab.look("motors.port") == 'Group ["C", "A", "B"]'
    assert lab.look("sensors.port") == "Group [4, 2, 1, 3]"
    assert lab.say("var n = 0|; hardware.each(closure (device) { n += 1 })|; n;") == "9"


def test_sensors_of_the_default_layout() -> None:
    lab = Lab.ready()
    assert lab.look("bumper.val") == "0"
    lab.tribot.pushed = True
    lab.run(0.1)
    assert lab.look("bumper.val") == "1"
    assert lab.look("sonar.val") == "150"
    lab.tribot.heading = 3.0
    lab.run(0.2)
    assert lab.look("sonar.val") == "255"
    lab.tribot.sound.loudness, lab.tribot.sound.audible = 0.6, 0.3
    lab.run(0.1)
    assert lab.look("decibel.mode") == '"DBA"'
    assert lab.number("decibel.val") == pytest.approx(0.3, abs=0.01)
    lab.say('decibel.mode = "DB";', 0.5)
    assert lab.number("decibel.val") == pytest.approx(0.6, abs=0.01)
    assert lab.look("light.mode") == '"Reflector"'
    assert lab.number("light.val") == pytest.approx(0.45, abs=0.01)
    lab.say('light.mode = "Ambient";', 0.1)
    assert lab.number("light.val") == pytest.approx(0.3, abs=0.01)
    lab.say('light.mode = "Normal";', 0.1)
    assert lab.number("light.val") == pytest.approx(307, abs=3)
    assert lab.number("battery.val") == pytest.approx((7.89 - 6.1) / 1.9, abs=0.001)


def test_beeper() -> None:
    lab = Lab.ready()
    lab.say("var frequency = 440; var duration = 1s;")
    assert lab.say("{\n  beeper.play(frequency, duration);\n  sleep(duration)\n},", 0.5) == ""
    assert lab.brick.sound.frequency == 440 and lab.brick.sound.sounding(lab.bus_clock.now())


def test_a_beep_of_no_duration_is_for_ever() -> None:
    lab = Lab.ready(layout="")
    lab.say("var beeper = Beeper.new(); beeper.play(500, 0);", 0.1)
    # The longest tone of the brick is 65.5 s.
    lab.until(lambda: lab.bus_clock.now() > 175, patience=100)
    assert lab.brick.sound.sounding(lab.bus_clock.now())
    lab.say("beeper.stop;", 0.1)
    assert not lab.brick.sound.sounding(lab.bus_clock.now())


@pytest.mark.parametrize("seconds", [66, 100, 130])
def test_a_beep_longer_than_a_command_of_the_brick(seconds: int) -> None:
    lab = Lab.ready(layout="")
    lab.say(f"beeper = Beeper.new(); beeper.play(500, {seconds}s);", 0.1)
    begun = lab.bus_clock.now()
    lab.until(lambda: not lab.brick.sound.sounding(lab.bus_clock.now()), patience=200)
    assert lab.bus_clock.now() - begun == pytest.approx(seconds - 0.1, abs=0.05)


def test_another_sound_ends_a_long_beep() -> None:
    lab = Lab.ready()
    lab.say("beeper.play(500, 100s); beeper.play(300, 1s);", 0.1)
    assert lab.brick.sound.frequency == 300
    lab.run(70)
    assert not lab.brick.sound.sounding(lab.bus_clock.now())


def test_classes_have_the_names_of_the_manual() -> None:
    lab = Lab.ready()
    devices = {
        "wheelL": "Servo", "wheelR": "Servo", "claw": "Servo", "sonar": "UltraSonicSensor", "decibel": "SoundSensor",
        "light": "LightSensor", "bumper": "Switch", "beeper": "Beeper", "battery": "Battery", "Command": "Command",
    }  # fmt: skip
    for name, kind in devices.items():
        assert lab.look(f"{name}.type") == f'"{kind}"'
    # The name in the manual's table of instances.
    assert lab.look("UltraSoundSensor") == "UltraSonicSensor"
    assert lab.look("sonar.isA(UltraSoundSensor)") == "true"


def test_command() -> None:
    lab = Lab.ready()
    assert lab.say("Command.send([3, 10, 10, 0 , 0]);", 0.1) == ""
    assert lab.brick.sound.frequency == 2570
    said = lab.say("answer = Command.request([7,0], 15);", 0.1)
    assert said.startswith("[7, 0, 0, 1, 0, 8, 128, ") and len(said.split(",")) == 15
    assert lab.say("Command.request([1], 2);", 0.1) == "[1, 236]"
    assert lab.say("Command.request([1], 3);", 0.1) == "[]"


def test_a_command_of_a_statement_that_began_before_a_stop_is_refused() -> None:
    lab = Lab.ready()
    lab.say("{ sleep(0.5s); Command.send([3, 10, 10, 0 , 0]) },", 0.1)
    lab.look("robot.stop")
    assert "was stopped after this statement had begun" in lab.say("", 1.0)
    assert lab.brick.sound.frequency == 0


LAYOUT = """\
wheelL = Servo.new("C");
wheelR = Servo.new("A");
claw = Servo.new("B");
bumper  = Switch.new(4);
sonar = UltraSonicSensor.new(2);
decibel = SoundSensor.new(1,"DBA");
light = LightSensor.new(3,"Reflector");
battery = Battery.new();
beeper = Beeper.new();
"""


def test_how_to_make_its_own_layout(tmp_path: Path) -> None:
    layout = tmp_path / "Mine.u"
    layout.write_text(LAYOUT + "var Global.legs = Group.new(wheelL, wheelR);\n")
    lab = Lab.ready(layout=str(layout))
    lab.say("legs.speed = 20;", 0.1)
    assert speeds(lab) == (20, 20)
    assert lab.look("sonar.val") == "150"


def test_a_layout_may_declare_its_names(tmp_path: Path) -> None:
    layout = tmp_path / "Mine.u"
    layout.write_text('var Global.wheelL = Servo.new("C");\nvar Global.beeper = Beeper.new;\n')
    assert Lab.ready(layout=str(layout)).look("wheelL.port") == '"C"'


def test_the_names_of_the_manual_need_no_var_at_the_prompt() -> None:
    lab = Lab.ready(layout="")
    for line in (*LAYOUT.splitlines(), "answer = Command.request([7,0], 15);"):
        assert "!!!" not in lab.say(line, 0.5)
    assert lab.say("answer.size;") == "15"
    lab = Lab.ready()
    # With the TriBot its three ports are taken: the manual, "Servo", slot port.
    assert "port A is taken by wheelR" in lab.say('wheel = Servo.new("A");')
    assert lab.say('wheelR.free; wheel = Servo.new("A"); wheel.port;').endswith('"A"')


def test_objects_made_at_the_prompt() -> None:
    lab = Lab.ready(layout="")
    assert "!!!" not in lab.say('wheel = Servo.new("A"); var decibel = SoundSensor.new(1, "DB");')
    assert "!!!" not in lab.say("var sonar = UltraSonicSensor.new(2);")
    assert "!!!" not in lab.say('var light = LightSensor.new(3, "Ambient"); var bumper = Switch.new(4);')
    assert "!!!" not in lab.say("var battery = Battery.new(); var beeper = Beeper.new(); beeper.play(200,1s);", 0.5)
    lab.say("wheel.speed = 30;", 0.1)
    assert lab.powers() == [30, 0, 0]
    assert lab.say("sonar.val; wheel.port; sonar.port; decibel.mode;") == '150\n"A"\n2\n"DB"'


def test_a_battery_has_its_value_when_it_is_made() -> None:
    lab = Lab.ready()
    lab.run(0.2)
    assert 0 < float(lab.say("Battery.new().val;")) <= 1
