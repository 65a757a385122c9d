"""What a person can type at a running fake."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace

import pytest
from fake_talk import Talk

from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.bioloid.console import commands
from urbihw_fakes.console import Console
from urbihw_fakes.dynamixel.ax12 import Ax12
from urbihw_fakes.dynamixel.axs1 import AxS1
from urbihw_fakes.dynamixel.catalogue import make_servo
from urbihw_fakes.dynamixel.xseries import XSeries
from urbihw_fakes.endpoint import TcpEndpoint
from urbihw_fakes.p3dx.kit import P3dx


class Desk:
    """A kit with somebody at its console; the clock stands where the test puts it."""

    def __init__(self, kit: Bioloid) -> None:
        self.now = 0.0
        self.kit = kit
        self.wire = Talk(kit)
        self.endpoint = TcpEndpoint(kit, clock=lambda: self.now)
        self.console = Console(self.endpoint, commands(kit, self.endpoint.clock))

    def say(self, line: str) -> str:
        self.wire.now = self.now
        return self.console.line(line)


@pytest.fixture
def desk() -> Iterator[Desk]:
    desk = Desk(Bioloid())
    yield desk
    desk.endpoint.close()


def test_faults_and_healing(desk: Desk) -> None:
    assert desk.say("silence 6") == "ok"
    assert desk.wire.p1(6, "01") == ""
    assert desk.say("heal 6") == "ok"
    assert desk.wire.p1(6, "01") == "00"
    assert desk.say("cut all 2") == "ok"
    assert desk.wire.raw("FF FF 06 02 01 F6") == ["FF FF"]
    assert desk.say("heal") == "ok"
    assert desk.say("echo") == "ok"
    assert len(desk.wire.raw("FF FF 06 02 01 F6")) == 2


def test_the_world_of_the_sensor(desk: Desk) -> None:
    assert desk.say("ir 10 200 3") == "ok"
    assert desk.say("light 1 2 255") == "ok"
    assert desk.say("sound 200") == "ok"
    assert desk.wire.p1(100, "02 1A 08") == "00 0A C8 03 01 02 FF 02 04"
    desk.say("clap 4")
    desk.now = 5.0
    desk.say("remocon 0x0102")
    assert desk.wire.p1(100, "02 23 03") == "00 C8 FF 04"
    assert desk.wire.p1(100, "02 30 02") == "00 02 01"


def test_the_world_of_the_servos(desk: Desk) -> None:
    assert desk.say("load 6 0.5") == "ok"
    assert desk.kit.servo(6).load == 0.5
    assert desk.say("temperature 6 80") == "ok"
    assert desk.say("voltage 11.1") == "ok"
    assert desk.say("voltage 9 7") == "ok"
    assert desk.wire.p1(6, "02 2A 02") == "04 6F 50"
    assert desk.wire.p1(7, "02 2A 01") == "00 5A"
    assert desk.say("temperature 6 free") == "ok"
    assert desk.kit.servo(6).held_celsius is None


def test_power_and_adapter(desk: Desk) -> None:
    assert desk.say("power off") == "ok"
    assert desk.wire.p1(6, "01") == ""
    assert desk.say("state 6").startswith("model=12 ")
    assert desk.say("state").splitlines()[0] == "1 Ax12 (no power) present_position=512"
    assert desk.say("power on 6") == "ok"
    assert desk.wire.p1(6, "01") == "00"
    assert desk.say("unplug") == "ok"
    assert not desk.endpoint.plugged
    assert desk.say("plug") == "ok"
    assert desk.endpoint.plugged


def test_an_x_kit_at_the_console() -> None:
    desk = Desk(Bioloid.x_series(2))
    assert desk.say("load 2 -0.25") == "ok"
    assert desk.kit.x_servo(2).motor.load == -0.25
    assert desk.say("temperature 1 50") == "ok"
    assert desk.say("state") == "1 XSeries present_position=2048\n2 XSeries present_position=2048"
    assert "not an AX-S1" in desk.say("clap 2 1")
    desk.endpoint.close()


def test_the_log(desk: Desk) -> None:
    desk.wire.raw("FF FF 06 02 01 F6")
    assert desk.say("log 1") == "[0.000000] < FF FF 06 02 00 F7"


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("", ""),
        ("dance", "error: 'dance' is not a word here; say help"),
        ("silence six", "error: usage: silence [ID|all]"),
        ("late 6 soon", "error: usage: late [ID|all [SECONDS]]"),
        ("silence 6 7 8", "ok"),
        ("load 6", "error: usage: load ID TORQUE"),
        ("load 100 1", "error: load 100: not a servo"),
        ("ir 1 2", "error: usage: ir LEFT CENTER RIGHT [ID]"),
        ("ir 1 2 256", "error: usage: ir LEFT CENTER RIGHT [ID]"),
        ("power maybe", "error: power maybe: say on or off"),
        ("power", "error: usage: power on|off [ID]"),
        ("clap 1 6", "error: unit 6: this is Ax12, not an AX-S1"),
    ],
)
def test_answers_to_odd_lines(desk: Desk, line: str, answer: str) -> None:
    assert desk.say(line) == answer


def test_help_names_every_word(desk: Desk) -> None:
    text = desk.say("help")
    for word in ("silence", "heal", "clap", "ir", "light", "load", "temperature", "voltage", "unplug", "plug", "power"):
        assert f"\n{word} " in f"\n{text}" or f"\n{word}\n" in text


def test_units_are_plugged_in_one_after_the_other() -> None:
    desk = Desk(Bioloid(units=[Ax12(1), Ax12(1)]))
    try:
        assert desk.say("connect 2") == "ok"
        desk.kit[1].registers.put("torque_enable", 1)
        desk.kit[1].registers.put("id", 5)
        assert desk.say("connect all") == "ok"
        assert sorted(unit.id for unit in desk.kit) == [1, 5]
        # Plugging in is switching on: without torque.
        assert desk.say("connect 1") == "ok" and desk.say("connect all") == "ok"
        assert desk.kit[5].registers.get("torque_enable") == 0
        assert desk.say("connect 3") == "error: usage: connect NUMBER...|all"
    finally:
        desk.endpoint.close()


def test_a_horn_is_turned_by_hand_without_torque_only() -> None:
    desk = Desk(Bioloid(units=[Ax12(1), XSeries("XL430-W250", 2), make_servo("MX-28", 3), AxS1(100)]))
    try:
        before = {number: desk.kit[number].registers for number in (1, 2, 3)}
        assert [desk.say(f"turn {number} 30") for number in (1, 2, 3)] == ["ok"] * 3
        desk.say("state")
        found = [before[number].get("present_position") for number in (1, 2, 3)]
        assert found == pytest.approx([512 + 102, 2048 + 341, 2048 + 341], abs=1)
        before[1].put("torque_enable", 1)
        assert desk.say("turn 1 30") == "error: turn 1: its torque is on, it holds"
        assert desk.say("turn 100 30") == "error: turn 100: not a servo"
    finally:
        desk.endpoint.close()


def test_help_names_the_units_that_a_fault_may_be_of(desk: Desk) -> None:
    rows = {row["name"]: row for row in desk.console.words()}
    assert rows["late"]["parameters"] == "[ID|all [SECONDS]]"
    assert rows["late"]["meaning"] == "each answer comes later (0.05 s); ID: 1 to 18, 100"
    assert rows["echo"]["parameters"] == ""


def test_a_robot_that_is_one_unit_takes_no_id() -> None:
    kit = P3dx()
    console = Console(SimpleNamespace(device=kit.robot), {})  # type: ignore[arg-type]
    parameters = {row["name"]: row["parameters"] for row in console.words()}
    assert (parameters["silence"], parameters["late"], parameters["heal"]) == ("", "[SECONDS]", "")
    assert parameters["power"] == "on|off"
    assert console.line("late 0.2") == "ok"
    (fault,) = kit.robot.faults
    assert (fault.word, fault.who, fault.amount) == ("late", None, 0.2)
