"""The object ``bioloid``: opening, losing and finding devices and the link."""

from __future__ import annotations

import logging
import re
from functools import cache
from typing import Any

import pytest
from bioloid_lab import BAUD, Lab

from urbihw.buses import messages as m
from urbihw.kernel.uobject import BadConfig, NotReady, RobotSettings
from urbihw_fakes.bioloid import Bioloid as Kit
from urbihw_fakes.device import Answer
from urbihw_fakes.dynamixel.ax12 import Ax12
from urbihw_fakes.dynamixel.axs1 import AxS1
from urbihw_fakes.dynamixel.xseries import XSeries


def test_opening_makes_the_objects_of_the_manual() -> None:
    lab = Lab.ready()
    assert lab.say("motors.keys.size; sensors.keys; motors[6] === motor6; sensors[100] === sensor100;") == (
        "18\n[100]\ntrue\ntrue"
    )
    assert lab.say("bioloid.motors === motors; bioloid.link; bioloid.url;") == f'true\ntrue\n"pipe://robot?baud={BAUD}"'
    assert lab.say("var n = 0| for (var m : motors) n += m.id| n;") == "171"


def test_a_motor_can_be_given_a_name_for_everybody() -> None:
    lab = Lab.small(7)
    lab.say("do (Global) { var headYaw = motors[7]; };")
    lab.say("headYaw.val = 10deg;", 0.5)
    assert lab.number("motor7.val") == pytest.approx(0.1745, abs=0.02)


def test_nobody_on_the_bus_is_not_ready() -> None:
    lab = Lab(Kit(servos=(), sensors=(), baud=BAUD))
    lab.until(lambda: bool(lab.opened))
    (error,) = lab.opened
    assert isinstance(error, NotReady)
    assert "no servo found on pipe://robot" in str(error)


def test_two_with_one_id_are_left_out_and_named(caplog: pytest.LogCaptureFixture) -> None:
    lab = Lab.ready(Kit(units=[Ax12(1), Ax12(3), Ax12(3)], baud=BAUD))
    assert lab.say("motors.keys;") == "[1]"
    assert [record.getMessage() for record in caplog.records if "several devices answer to id 3" in record.getMessage()]
    lab.kit[1].powered = False
    lab.run(1.0)
    lab.kit[1].powered = True
    lab.run(1.0)
    assert "several devices answer to id 3" in lab.look("robot.problems")
    assert [each for each in lab.findings() if "several devices answer to id 3" in each]


def test_only_two_with_one_id_is_not_ready() -> None:
    lab = Lab(Kit(units=[Ax12(3), Ax12(3)], baud=BAUD))
    lab.until(lambda: bool(lab.opened))
    (error,) = lab.opened
    assert isinstance(error, NotReady)
    assert "several devices answer to id 3" in str(error)


def test_a_link_that_cannot_be_opened_is_not_ready() -> None:
    lab = Lab()
    lab.end.unplug()
    lab.until(lambda: bool(lab.opened))
    (error,) = lab.opened
    assert isinstance(error, NotReady)


@pytest.mark.parametrize("options", [{"protocol": 3}, {"ids": "all"}])
def test_options_without_sense_are_bad_config(options: dict[str, Any]) -> None:
    with pytest.raises(BadConfig, match=next(iter(options))):
        Lab(**options)


def test_only_the_configured_ids_are_looked_for(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "urbihw.bioloid")
    lab = Lab.ready(ids=[3, 100])
    told = "only ids 3 100 are looked for (options.ids); other devices on the bus are left out"
    assert [record.getMessage() for record in caplog.records].count(told) == 1
    assert lab.say("motors.keys; sensors.keys;") == "[3]\n[100]"


def test_a_silent_servo_says_so_and_the_others_go_on(caplog: pytest.LogCaptureFixture) -> None:
    lab = Lab.ready()
    lab.say('at (motor6.lost?(var why)) echo("lost") & at (bioloid.lost?(var m)) echo(m.id);')
    lab.say("at (motor6.back?) echo(\"back\");")
    lab.kit.faults.start("silence", 6)
    lab.run(0.3)
    assert sorted(lab.heard().splitlines()) == ["*** 6", "*** lost"]
    assert lab.say("motor6.state; motor6.stale; bioloid.status;".replace("bioloid.status;", "")) == '"lost"\ntrue'
    assert lab.robot.status().endswith("lost: 6")
    lab.say("for| (var m : motors) m.val = 20deg;", 1)
    for number in (5, 7, 18):
        assert lab.number(f"motor{number}.val") == pytest.approx(0.349, abs=0.02)
        assert lab.number(f"motor{number}.age") <= 0.02
    assert lab.number("motor6.age") > 1
    lab.kit.faults.stop()
    lab.run(0.6)
    assert lab.heard() == "*** back"
    assert lab.say("motor6.state; motor6.stale;") == '"ok"\nfalse'
    assert [record.message for record in caplog.records] == ["motor 6 is lost: does not answer", "motor 6 is back"] or (
        len(caplog.records) == 2
    )


def test_settings_come_back_after_a_power_cut_and_nothing_moves() -> None:
    lab = Lab.small(6)
    lab.say("motor6.speed = 2 | motor6.cwComplianceSlope = 64 | motor6.torqueLimit = 0.75 | motor6.val = 40deg;", 1)
    lab.kit.power_off(lab.bus_clock.now(), 6)
    lab.run(0.5)
    lab.kit.power_on(lab.bus_clock.now(), 6)
    lab.run(1.0)
    assert lab.register(6, "moving_speed") == round(2 / 0.0116239)
    assert lab.register(6, "cw_slope") == 64
    assert lab.register(6, "torque_limit") == round(1023 / 2)
    assert lab.register(6, "torque_enable") == 0
    assert lab.number("motor6.val") == pytest.approx(0.698, abs=0.05)


def test_a_motor_that_was_switched_off_stays_off_after_a_power_cut() -> None:
    lab = Lab.small(6)
    lab.say("motor6.load = 0;", 0.1)
    lab.kit.power_off(lab.bus_clock.now(), 6)
    lab.run(0.5)
    lab.kit.power_on(lab.bus_clock.now(), 6)
    lab.kit.servo(6).registers.put("torque_enable", 1)
    lab.run(1.0)
    assert lab.register(6, "torque_enable") == 0


def test_the_adapter_pulled_and_put_back_during_a_swing(caplog: pytest.LogCaptureFixture) -> None:
    lab = Lab.small(6)
    lab.say('at (bioloid.linkLost?(var why)) echo("gone") & at (bioloid.linkBack?) echo("here");')
    lab.say("motor6.val = 0 sin:1s ampli:20deg,", 1)
    lab.end.unplug()
    lab.run(1)
    assert lab.heard() == "*** gone"
    assert lab.say("bioloid.link; motor6.stale;") == "false\ntrue"
    lab.end.replug()
    lab.run(3)
    assert lab.heard() == "*** here"
    assert len(caplog.records) == 2
    assert lab.say("motor6.stale;") == "false"
    before = lab.number("motor6.val")
    lab.run(0.25)
    assert abs(lab.number("motor6.val") - before) > 0.05


def test_scan_finds_a_new_device() -> None:
    kit = Kit(baud=BAUD)
    lab = Lab.ready(kit, ids=[])
    lab.say('at (bioloid.found?(var d)) echo("motor " + d.id);')
    newcomer = Ax12(30)
    newcomer.set_baud(BAUD)
    newcomer.registers.put("return_delay", 0)
    kit.add(newcomer)
    lab.say("bioloid.scan;", 2)
    assert lab.number("motor30.voltage") == 12


def test_stop_holds_the_joints() -> None:
    lab = Lab.small(6)
    lab.say("motor6.speed = 1 | motor6.val = 90deg;", 0.5)
    lab.say("bioloid.stop;", 0.2)
    place = lab.number("motor6.val")
    lab.run(0.5)
    assert lab.number("motor6.val") == pytest.approx(place, abs=0.03)
    assert place < 1.0


def test_all_on_and_all_off() -> None:
    lab = Lab.ready()
    lab.say("bioloid.on;", 0.3)
    assert {lab.register(number, "torque_enable") for number in range(1, 19)} == {1}
    lab.say("bioloid.off;", 0.3)
    assert {lab.register(number, "torque_enable") for number in range(1, 19)} == {0}


def test_statistics_and_status() -> None:
    lab = Lab.ready()
    lab.run(2.5)
    assert lab.number("bioloid.rate") == pytest.approx(100, abs=3)
    assert lab.number('bioloid.statistics["rate"]') == pytest.approx(100, abs=3)
    assert lab.robot.status() == "18 servos, 1 sensor, 100 Hz"


def test_the_sign_of_life_is_sent_by_the_kernel() -> None:
    lab = Lab.small(6)
    lab.sent(m.Heartbeat)
    lab.run(2.05)
    assert len(lab.sent(m.Heartbeat)) == 4


def test_closing_lets_go_and_twice_is_fine() -> None:
    lab = Lab.small(6)
    lab.robot.close()
    lab.robot.close()
    assert lab.say("motor6.val = 1; 1+1;") == "1\n2"


def test_a_servo_that_is_expected_and_missing_is_named_and_joins(caplog: pytest.LogCaptureFixture) -> None:
    kit = Kit(baud=BAUD)
    kit.faults.start("silence", 6)
    lab = Lab.ready(kit, ids=[*range(1, 19), 100])
    lab.run(0.5)
    assert "no answer from 6: it joins" in caplog.text
    assert "17 servos" in lab.robot.status() and "missing: 6" in lab.robot.status()
    lab.say('at (bioloid.found?(var m)) echo("found " + m.id.asString);')
    assert lab.say("robot.body.joint.has(6);") == "false"
    kit.faults.stop()
    assert "*** found 6" in lab.say("1;", 2.0)
    assert "missing" not in lab.robot.status()
    lab.say("motor6.val = 0.5|;", 2.0)
    assert lab.number("motor6.val") == pytest.approx(0.5, abs=0.02)
    assert lab.say("robot.body.joint.has(6);") == "true"


def test_a_servo_that_loses_answers_while_it_comes_back_comes_back_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    lab = Lab.small(5, 6, 7)
    lab.kit.faults.start("silence", 6)
    lab.run(1.0)
    assert lab.look("motor6.state") == '"lost"'
    lab.kit.faults.stop()
    feed, deaf = lab.kit.feed, [0]

    def lossy(data: bytes, now: float) -> list[Answer]:
        answers = feed(data, now)
        # READ of unit 6: the first nine are lost, for each sender.
        if data[2:3] == b"\x06" and data[4:5] == b"\x02" and deaf[0] < 9:
            deaf[0] += 1
            return []
        return answers

    monkeypatch.setattr(lab.kit, "feed", lossy)
    lab.run(3.0)
    assert deaf[0] == 9
    assert lab.look("motor6.state") == '"ok"'
    assert lab.look("motor6.stale") == "false"
    lab.say("motor6.val = 0.5|;", 2.0)
    assert lab.number("motor6.val") == pytest.approx(0.5, abs=0.02)


def test_all_motors_are_a_group() -> None:
    lab = Lab.ready(Kit(servos=(5, 6, 7), baud=BAUD))
    lab.say("motors.val = 0.5;", 1.0)
    assert lab.say("(motors.val * 10).round;") == "Group [5, 5, 5]"
    lab.say("motors.val = motors.val + Group.new(-0.5, 0, 0.5) time:1s;", 1.5)
    assert lab.say("(motors.val * 10).round;") == "Group [0, 5, 10]"
    assert lab.say("motors.val > 0.3;") == "Group [false, true, true]"
    lab.say("motors.load = 0;", 0.2)
    assert lab.say("motors.load; bioloid.motors === motors; motors.size;") == "Group [0, 0, 0]\ntrue\n3"
    assert lab.say("robot.body.joint.load;") == "Group [0, 0, 0]"
    assert lab.say("motors.val->unit;") == 'Group ["rad", "rad", "rad"]'
    assert lab.say("sensors.clapCount;") == "Group [0]"


def test_a_motor_found_later_joins_the_group_in_order() -> None:
    lab = Lab.ready(Kit(servos=(5, 7), baud=BAUD))
    lab.say("at (bioloid.found?(var m)) Global.joined = motors[m.id] === m; var Global.joined = nil;")
    lab.kit.add(Ax12(6))
    lab.kit.set_baud(BAUD)
    lab.say("bioloid.scan;", 2.0)
    assert lab.say("motors.id; joined;") == "Group [5, 6, 7]\ntrue"


def test_movements_have_the_period_of_the_bus() -> None:
    lab = Lab.ready()
    assert lab.number("System.period") == pytest.approx(lab.tick)


def slow_lab() -> Lab:
    """18 servos with the return delay of the factory, all of which are read in each cycle: 13 ms."""
    lab = Lab.ready()
    set_delays(lab, 250)
    lab.say("at (motors.val.foldl(function(var a, var b) { a + b }, 0) > 100) echo(1);")
    return lab


def set_delays(lab: Lab, count: int) -> None:
    for unit in lab.kit:
        unit.registers.put("return_delay", count)


def test_movements_follow_the_rate_that_the_bus_achieves() -> None:
    lab = slow_lab()
    lab.run(4)
    achieved = lab.number("bioloid.rate")
    assert 60 < achieved < 90
    assert lab.number("System.period") == pytest.approx(1 / achieved, rel=0.03)
    set_delays(lab, 0)
    lab.run(3)
    assert lab.number("System.period") == pytest.approx(lab.tick)


def test_a_period_that_a_program_has_set_stays() -> None:
    lab = slow_lab()
    lab.say("System.period = 50ms;")
    lab.run(4)
    assert lab.number("System.period") == 0.05


def test_a_rate_that_is_not_kept_is_told_once_with_cause_and_cure(caplog: pytest.LogCaptureFixture) -> None:
    lab = slow_lab()
    lab.run(9)
    (line,) = [record.getMessage() for record in caplog.records if "a cycle takes" in record.getMessage()]
    told = r"a cycle takes 1\d\.\d ms, so \d\d Hz of 100: shorten the return delay \(.*\) or set rate = \d\d"
    assert re.fullmatch(told, line)


def mixed() -> Lab:
    """AX-12, AX-S1 and X servos on one bus, at 100 Hz."""
    units = [Ax12(1), XSeries("XL430-W250", 2), Ax12(3), XSeries("XL330-M288", 4), AxS1(100)]
    return Lab.ready(Kit(units=units, baud=BAUD))


def test_both_protocols_on_one_bus_are_served_by_turns() -> None:
    lab = mixed()
    assert lab.say("motors.modelName; sensors.keys;") == (
        'Group ["AX-12A", "XL430-W250", "AX-12A", "XL330-M288"]\n[100]'
    )
    lab.say("motors.val = 0.5;", 1.5)
    assert lab.say("(motors.val * 20).round;") == "Group [10, 10, 10, 10]"
    assert max(lab.number(f"motor{number}.age") for number in (1, 2, 3, 4)) <= 2 * lab.tick
    lab.say("motors.cwLimit = motors.ccwLimit = 0; motors.speed = 1;", 1.0)
    assert lab.say("motors.speed > 0.5;") == "Group [true, true, true, true]"
    lab.say("bioloid.stop;", 1.0)
    assert lab.say("(motors.speed * 10).round;") == "Group [0, 0, 0, 0]"


@pytest.mark.parametrize("number", [1, 2])
def test_on_a_mixed_bus_each_can_be_lost_and_come_back(number: int) -> None:
    lab = mixed()
    lab.kit.faults.start("silence", number)
    lab.run(0.5)
    assert lab.say("motors.state;").count('"lost"') == 1
    lab.say("motors.val = 0.3;", 1.0)
    assert (lab.say("motors.val > 0.2;").count("true"), lab.robot.status().split("lost: ")[1]) == (3, str(number))
    lab.kit.faults.stop()
    lab.run(1.0)
    assert lab.say("motors.state;").count('"ok"') == 4
    lab.say("motors.val = -0.3;", 1.5)
    assert lab.say("motors.val < -0.2;") == "Group [true, true, true, true]"


def test_a_servo_whose_registers_cannot_be_read_at_the_start_is_named_and_joins(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    kit, deaf = Kit(baud=BAUD), [True]
    feed = kit.feed

    def lossy(data: bytes, now: float) -> list[Answer]:
        answers = feed(data, now)
        return [] if deaf[0] and data[2:3] == b"\x06" and data[4:5] == b"\x02" else answers

    monkeypatch.setattr(kit, "feed", lossy)
    lab = Lab.ready(kit)
    lab.run(0.5)
    assert "no answer from 6" in caplog.text and "model 0" not in caplog.text
    assert "17 servos" in lab.robot.status() and "missing: 6" in lab.robot.status()
    deaf[0] = False
    lab.run(3.0)
    assert "missing" not in lab.robot.status()
    lab.say("motor6.val = 0.5|;", 2.0)
    assert lab.number("motor6.val") == pytest.approx(0.5, abs=0.02)


def test_a_servo_that_the_settings_name_no_more_is_not_missing(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    lab = Lab.ready(Kit(units=[Ax12(1), Ax12(2)], baud=BAUD), ids=[1, 2, 6, 7])
    assert lab.say("bioloid.missing;") == "[6, 7]"
    for ids, missing in (([1, 2, 7], "[7]"), ([1, 2, 7], "[7]"), ([1, 2], "[]")):
        lab.robot.configure(RobotSettings(lab.url, 1 / lab.tick, dead_man=0, options={"ids": ids}))
        assert lab.say("bioloid.missing;") == missing
    assert "missing" not in lab.robot.status()
    told = "options.ids: other devices are looked for when the link to the robot opens again"
    assert [record.message for record in caplog.records].count(told) == 2


@pytest.mark.parametrize("model", ["AX-12", "XL430-W250"])
def test_an_expected_servo_joins_in_whatever_protocol_it_speaks(model: str) -> None:
    late = Ax12(6) if model == "AX-12" else XSeries(model, 6)
    kit = Kit(units=[Ax12(1), XSeries("XL430-W250", 2), late], baud=BAUD)
    late.power_off(0.0)
    lab = Lab.ready(kit, ids=[1, 2, 6])
    assert lab.say("motors.keys; bioloid.missing;") == "[1, 2]\n[6]"
    late.power_on(lab.bus_clock.now())
    lab.run(3.0)
    assert lab.say("motors.keys; bioloid.missing;") == "[1, 2, 6]\n[]"


def test_a_pulled_adapter_comes_back_in_both_protocols() -> None:
    lab = mixed()
    lab.end.unplug()
    lab.run(1.0)
    lab.end.replug()
    lab.run(3.0)
    assert lab.say("motors.stale;") == "Group [false, false, false, false]"
    lab.say("motors.val = 0.3;", 1.5)
    assert lab.say("motors.val > 0.2;") == "Group [true, true, true, true]"


class TossLab(Lab):
    """At the speed of a CM-5."""

    url = "pipe://robot?baud=57600"


@pytest.mark.parametrize("options", [{}, {"controller": "cm5"}])
def test_a_cm5_is_put_into_toss_mode_also_after_it_was_switched_off(options: dict[str, Any]) -> None:
    kit = Kit(servos=(5, 6), baud=BAUD, cm5=True)
    lab = TossLab.ready(kit, **options)
    assert lab.say("motors.keys;") == "[5, 6]"
    lab.say("motors.val = 0.4;", 4.0)
    assert lab.say("motors.val > 0.3;") == "Group [true, true]"
    kit.power_off(lab.bus_clock.now())
    lab.run(2.0)
    assert lab.say("motors.state;") == 'Group ["lost", "lost"]'
    kit.power_on(lab.bus_clock.now())
    lab.run(10.0)
    assert lab.say("motors.stale;") == "Group [false, false]"


def test_controllers_without_a_known_way_are_refused_with_advice() -> None:
    with pytest.raises(BadConfig, match="CM-530 has no documented mode.*U2D2"):
        Lab(controller="cm530")


@pytest.mark.parametrize(
    ("typed", "told"),
    [
        ("motor6 = 1;", "this hides motor6 from your connection: write to one of its slots, such as motor6.val; "
         'removeLocalSlot("motor6"); brings it back'),
        ("motors = 0,", 'this hides motors from your connection: removeLocalSlot("motors"); brings it back'),
        ("var motor7 = 2|; motor7.val = 1;", 'motor7 is a variable of your connection, which hides the device: '
         'removeLocalSlot("motor7");'),
        ("motor8.val = 90;", "90 is in rad, and was limited to 2.61799: write 90deg for degrees"),
        ("motor8.val 90;", "a value is assigned by =, as in x = 3"),
        ("motor8.val(1);", "a slot is written by =: motor8.val = 1"),
        ("motor8.val = 1 time=2s;", "an attribute of a movement stands before a colon: time:2s"),
        ("motor8.val = 1 in 2s;", "a movement takes its time by an attribute: x.val = 90deg time:2s"),
        ("motor8.val = 0 sin:1s amp:1;",
         "the attributes of a movement are time, speed, accel, smooth, sin, cos, adaptive, ampli, phase"),
        ("motor8.on;", "a motor is switched on by load = 1"),
        ("motor8.pos = 1;", "a joint goes where its slot val is set: val = 90deg time:2s"),
        ("motor8.foo;", "motor8.localSlotNames; lists its slots"),
        ("var Global.paw = motor8|; paw.foo;", "paw.localSlotNames; lists its slots"),
        ("motors(8).val;", "brackets choose a member: motors[1]"),
        ("motors[8] = 1;", "the members of it are not replaced, but their slots written: motors[6].val = 1"),
        ("robot.forward;", "robot.localSlotNames; lists its slots, robot.flatDump; its parts"),
        ("sonar.val;", "robot.flatDump; lists the parts of the robot"),
    ],
)  # fmt: skip
def test_what_beginners_type_at_a_robot_is_answered_by_what_to_write(typed: str, told: str) -> None:
    lab = _lab_for_beginners()
    lab.lobby = lab.kernel.open_lobby()
    lab.heard()
    said = lab.say(typed, 0.1).split("\n")
    assert f"!!!    hint: {told}" in said
    assert lab.say("motor8.val = 91;", 0.1).count("hint") == (typed != "motor8.val = 90;"), "once for a connection"


@cache
def _lab_for_beginners() -> Lab:
    """A lab whose clients get advice."""
    lab = Lab.ready()
    lab.kernel.programs.quiet = False
    return lab
