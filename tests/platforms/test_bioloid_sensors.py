"""The AX-S1 as an urbiscript object."""

from __future__ import annotations

import json

import pytest
from bioloid_lab import BAUD, Lab

from urbihw_fakes.bioloid import Bioloid as Kit


@pytest.fixture
def lab() -> Lab:
    return Lab.ready(Kit(servos=(6,), baud=BAUD))


def test_distances_light_and_flags(lab: Lab) -> None:
    sensor = lab.kit.sensor()
    sensor.ir(12, 200, 3)
    sensor.light(40, 45, 38)
    lab.run(0.05)
    assert lab.say("sensor100.IRLeft; sensor100.IRCenter; sensor100.IRRight;") == "12\n200\n3"
    assert lab.say("sensor100.lightLeft; sensor100.lightCenter; sensor100.lightRight;") == "40\n45\n38"
    lab.say("sensor100.obstacleThreshold = 100;", 0.1)
    assert lab.register(100, "obstacle_compare") == 100
    assert lab.say("sensor100.obstacleCenter; sensor100.obstacleRight;") == "true\nfalse"


def test_the_louder_the_faster_as_in_the_manual(lab: Lab) -> None:
    lab.say("motor6.cwLimit = motor6.ccwLimit = 0;", 0.2)
    lab.say("at (sensor100.soundVolume->changed?) motor6.speed = sensor100.soundVolume * 6;", 0.1)
    lab.kit.sensor().sound(255)
    lab.run(0.5)
    assert lab.number("sensor100.soundVolume") == pytest.approx(1)
    assert lab.number("motor6.speed") == pytest.approx(6, abs=0.3)
    assert lab.number("sensor100.soundVolumeMax") == pytest.approx(1)
    lab.kit.sensor().sound(128)
    lab.say("sensor100.soundVolumeMax = 0;", 0.2)
    assert lab.number("sensor100.soundVolumeMax") < 0.01


def test_stop_after_four_claps_as_in_the_manual(lab: Lab) -> None:
    lab.say("motor6.cwLimit = motor6.ccwLimit = 0; motor6.speed = 1;", 0.2)
    lab.say("at (sensor100.clapCount == 4) motor6.speed = 0;")
    lab.kit.sensor().clap(lab.bus_clock.now(), 4)
    lab.run(3)
    assert lab.number("sensor100.clapCount") == 4
    assert lab.register(6, "moving_speed") == 0
    lab.say("sensor100.clapCount = 0;", 0.1)
    assert lab.number("sensor100.clapCount") == 0


def test_each_burst_of_four_claps_counts(lab: Lab) -> None:
    lab.say("at (sensor100.clapCount == 4) echo(4);")
    for _ in range(2):
        lab.kit.sensor().clap(lab.bus_clock.now(), 4)
        lab.run(3)
        assert lab.heard() == "*** 4"
    lab.kit.sensor().clap(lab.bus_clock.now(), 3)
    lab.run(0.5)
    assert lab.number("sensor100.clapCount") == 0
    lab.run(2.5)
    assert lab.number("sensor100.clapCount") == 3
    lab.run(5)
    assert lab.number("sensor100.clapCount") == 3
    assert lab.register(100, "sound_count") == 0


def test_a_note_can_be_played_twice(lab: Lab) -> None:
    lab.say("sensor100.buzzerTime = 0.4;")
    for _ in range(2):
        lab.say("sensor100.buzzerIndex = 12;", 0.1)
        assert lab.register(100, "buzzer_note") == 12
        assert lab.register(100, "buzzer_time") == 4
        lab.run(1)
        assert lab.register(100, "buzzer_time") == 0


def test_melodies(lab: Lab) -> None:
    lab.say("sensor100.playMelody(3);", 0.05)
    assert lab.register(100, "buzzer_time") == 255
    assert "there are melodies 0..26, no 30" in lab.say("sensor100.playMelody(30);")


def test_words_of_a_remote_control(lab: Lab) -> None:
    lab.say("at (sensor100.remoconReceived?(var word)) echo(word);")
    for word in (4096, 4096, 5):
        lab.kit.sensor().remocon(word)
        lab.run(0.5)
    assert lab.heard().splitlines() == ["*** 4096", "*** 4096", "*** 5"]
    assert lab.number("sensor100.remocon") == 5


def test_voltage_and_temperature(lab: Lab) -> None:
    lab.kit.sensor().volts = 11.1
    lab.run(1.2)
    assert lab.number("sensor100.voltage") == pytest.approx(11.1)


def test_the_tree_says_of_each_part_of_a_sensor_module_where_it_looks() -> None:
    tree = json.loads(Lab.ready().say("echo(System.treeText(robot))|;").removeprefix("*** "))
    said = {}
    todo = [tree["robot"]]
    while todo:
        node = todo.pop()
        todo += node["parts"]
        for slot in node.get("slots", ()):
            if slot["name"] == "val":
                said[node["global"]] = slot["meaning"]
    for name, what in (("infrared", "reflected infrared light"), ("light", "brightness")):
        for side, word in (("L", "left"), ("C", "center"), ("R", "right")):
            assert said[name + side] == f"{what}, {word}, 0 to 255"
