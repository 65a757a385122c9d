"""What testers did to get a robot moving after a stop; the fake's body is the judge."""

from __future__ import annotations

import logging
from collections.abc import Callable

import pytest
from bioloid_lab import BAUD
from bioloid_lab import Lab as Bioloid
from nxt_lab import Lab as Nxt
from segway_lab import Lab as Segway

from urbihw_fakes.bioloid import Bioloid as Kit

STOPS = ["robot.stop;", "bioloid.estop = true;"]


def way(lab: Bioloid, seconds: float, place: Callable[[], float]) -> float:
    """How far something goes in some time."""
    lab.kit.tick(lab.bus_clock.now())
    least = most = place()
    for _ in range(round(seconds / lab.tick)):
        lab.step()
        lab.kit.tick(lab.bus_clock.now())
        least, most = min(least, place()), max(most, place())
    return most - least


def horn(lab: Bioloid, unit: int = 6) -> Callable[[], float]:
    """Where the horn of an AX stands, in counts."""
    return lambda: lab.kit.servo(unit).position


@pytest.mark.parametrize("stop", STOPS)
@pytest.mark.parametrize("silence", [0.05, 0.15, 0.4, 1.5])
def test_a_joint_that_is_silent_while_it_is_stopped_holds_when_it_answers_again(stop: str, silence: float) -> None:
    lab = Bioloid.small(6)
    lab.say("motor6.speed = 0.25|; motor6.val = -140deg|;", 0.5)
    lab.kit.faults.start("silence", 6)
    lab.run(0.06)
    lab.say(stop, silence)
    lab.kit.faults.stop()
    lab.run(0.6)
    assert way(lab, 2.0, horn(lab)) < 3


def test_a_second_stop_stops_what_the_first_could_not() -> None:
    lab = Bioloid.small(6)
    lab.say("motor6.speed = 0.25|; motor6.val = -140deg|;", 0.5)
    lab.kit.faults.start("checksum", 6)
    lab.say("robot.stop;", 0.1)
    lab.kit.faults.stop()
    lab.say("robot.stop;", 0.3)
    assert way(lab, 2.0, horn(lab)) < 3


def test_a_slow_joint_of_the_x_series_is_seen_by_a_new_worker() -> None:
    kit = Kit.x_series(3, baud=1_000_000)
    lab = Bioloid.ready(kit)
    lab.say("motor2.speed = 0.25|; motor2.val = -100deg|;", 0.5)
    other = Bioloid.ready(kit)
    other.run(0.3)
    place = lambda: other.kit.x_servo(2).motor.position  # noqa: E731
    assert way(other, 2.0, place) < 15


@pytest.mark.parametrize("mode", ["add", "mix", "queue", "normal"])
def test_blended_movements_end_with_a_stop_and_do_not_come_back(mode: str) -> None:
    lab = Bioloid.small(6)
    swings = "motor6.val = 0 sin:1s ampli:20deg & motor6.val = 0 sin:2s ampli:20deg"
    lab.say(f'motor6.val->blend = "{mode}"|; {swings},', 1.0)
    lab.look("robot.stop|")
    lab.run(1.0)
    assert "was stopped after this statement had begun" in lab.heard()
    lab.look("motor6.val = 0.3|")
    lab.run(2.0)
    assert way(lab, 2.0, horn(lab)) < 3
    assert lab.number("motor6.val") == pytest.approx(0.3, abs=0.02)


def test_a_finally_clause_moves_nothing_after_a_stop_but_a_catch_may() -> None:
    lab = Bioloid.small(6)
    swing = "motor6.val = 0 sin:1s ampli:30deg"
    lab.say(f"try {{ {swing} }} finally {{ {swing} }},", 1.0)
    lab.look("robot.stop|")
    lab.run(0.5)
    assert way(lab, 2.0, horn(lab)) < 3
    lab.say(f'try {{ {swing} }} catch (var e) {{ echo("caught"); {swing} }},', 1.0)
    lab.look("robot.stop|")
    assert way(lab, 2.0, horn(lab)) > 50
    assert "*** caught" in lab.heard()


@pytest.mark.parametrize("clause", ["nowhere", "throw 1", "return"])
def test_an_error_or_a_jump_in_a_finally_clause_does_not_undo_a_stop(clause: str) -> None:
    lab = Bioloid.small(6)
    swing = "motor6.val = 0 sin:1s ampli:30deg"
    lab.say(f"function f() {{ try {{ {swing} }} finally {{ {clause} }} }}|;", 0.1)
    lab.say(f"{{ try {{ f }} catch {{ }}; {swing} }},", 1.0)
    lab.look("robot.stop|")
    lab.run(0.5)
    assert way(lab, 2.0, horn(lab)) < 3


def test_a_wheel_that_becomes_a_joint_stays_where_it_is() -> None:
    lab = Bioloid.small(6)
    lab.say("motor6.val = 50deg|; sleep(1.5s); motor6.cwLimit = motor6.ccwLimit = 0|; sleep(300ms);", 2.5)
    lab.say("motor6.speed = -1|; sleep(800ms); robot.stop; sleep(300ms);", 1.5)
    lab.say("motor6.cwLimit = -150deg|; motor6.ccwLimit = 150deg|;", 0.1)
    assert way(lab, 2.0, horn(lab)) < 10
    lab.say("motor6.val = 0.5|;", 2.0)
    assert lab.number("motor6.val") == pytest.approx(0.5, abs=0.02)


def test_a_caught_stop_in_a_loop_of_goes_is_told_once() -> None:
    lab = Segway.ready()
    lab.say('{ try { robot.go(5) } catch (var e) { echo("stopped") }; robot.go(0.2); echo("there") },', 1.0)
    lab.look("robot.stop|")
    lab.run(4.0)
    assert lab.heard().count("*** stopped") == 1
    assert lab.base.body.speed == pytest.approx(0.0, abs=0.02)


def test_raw_telegrams_of_the_nxt_keep_to_stop_lease_and_limits() -> None:
    lab = Nxt.ready(limits={"B": {"speed": 30}})
    motor = lab.brick.motors[1]
    lab.say("Command.send([4, 1, 100, 7, 1, 0, 32, 0, 0, 0, 0]);", 0.5)
    assert motor.power == 0
    lab.say("loop { Command.send([4, 1, 20, 7, 1, 0, 32, 0, 0, 0, 0]); sleep(0.2s) },", 0.5)
    assert motor.power == 20
    lab.look("robot.stop|")
    lab.run(1.0)
    assert motor.power == 0
    client = lab.kernel.open_lobby()
    lab.kernel.feed(client, b"Command.send([4, 1, 20, 7, 1, 0, 32, 0, 0, 0, 0]);")
    lab.run(0.5)
    assert motor.power == 20
    client.close()
    lab.run(0.5)
    assert motor.power == 0


def test_a_stop_that_is_asked_again_and_again_floods_nothing(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "urbihw.bioloid")
    lab = Bioloid.ready(Kit(servos=(6,), sensors=(100,), baud=BAUD))
    lab.say("whenever (sensor100.IRCenter > 60) { robot.stop; sleep(1ms) },")
    lab.console().line("ir 0 80 0")
    lab.run(3.0)
    assert 0 < caplog.text.count("bioloid stopped") < 10
    assert lab.look("1 + 1") == "2"


def test_what_a_hot_motor_was_refused_is_not_done_later() -> None:
    lab = Bioloid.small(6, limits={"motor6": {"temperature": [55, 65, 75]}})
    lab.say("motor6.val = 0 sin:1s ampli:20deg,", 1.0)
    lab.kit.servo(6).heat(80)
    lab.run(2.0)
    assert "is held by limits.motor6.temperature (release): let it cool below " in lab.heard()
    assert "is held by" in lab.say("motor6.load = 1;", 0.2)
    lab.kit.servo(6).heat(50)
    lab.run(2.0)
    lab.say("motor6.val = 0.5|;", 1.0)
    assert lab.register(6, "torque_enable") == 0
    lab.say("motor6.load = 1|; sleep(200ms); motor6.val = 0.5|;", 2.0)
    assert lab.number("motor6.val") == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize("loss", ["silence", "unplug"])
def test_a_movement_whose_device_is_lost_ends_if_the_settings_say_so(loss: str) -> None:
    lab = Bioloid.small(6, resume=False)
    lab.say("motor6.val = 0 sin:1s ampli:20deg,", 1.5)
    if loss == "silence":
        lab.kit.faults.start("silence", 6)
    else:
        lab.end.unplug()
    lab.run(1.5)
    lab.kit.faults.stop()
    lab.end.replug()
    lab.run(1.5)
    assert way(lab, 2.0, horn(lab)) < 3
    assert "!!!" in lab.heard()
    lab.say("motor6.val = 0.5|;", 2.0)
    assert lab.number("motor6.val") == pytest.approx(0.5, abs=0.02)


def test_an_emergency_stop_counts_from_the_statement_on_and_stop_is_no_error_under_it() -> None:
    lab = Segway.ready()
    answer = lab.say("segway.estop = true; segway.estop; robot.stop; rmp.forwardSpeed = 1;", 0.2)
    assert answer.startswith("true\ntrue\n!!!") and answer.count("!!!") == 1
    assert lab.base.body.speed == pytest.approx(0.0, abs=0.01)
    assert lab.say("segway.estop = false; segway.estop; rmp.forwardSpeed = 0.3;", 2.0) == "false\nfalse\n0.3"
    assert lab.base.body.speed == pytest.approx(0.3, abs=0.02)


@pytest.mark.parametrize("stop", STOPS)
def test_a_handler_of_at_sync_that_waits_for_another_does_not_move_after_a_stop(stop: str) -> None:
    lab = Bioloid.small(6)
    lab.say(
        "var Global.e = Event.new|; at sync (e?) { sleep(0.8s) }; at sync (e?) { motor6.val = 60deg }; { e! },", 0.2
    )
    lab.say(stop, 0.1)
    lab.say("bioloid.estop = false;", 0.1)
    assert way(lab, 2.0, horn(lab)) < 3


@pytest.mark.parametrize("end", ["stop", "block"])
def test_at_sync_whose_tag_is_stopped_while_another_handler_runs_does_not_begin(end: str) -> None:
    lab = Bioloid.small(6)
    lab.say(
        "var Global.e = Event.new|; at sync (e?) { sleep(0.8s) };"
        " var tg = Tag.new|; tg: at sync (e?) { motor6.val = 60deg }; { e! },",
        0.2,
    )
    lab.say(f"tg.{end};", 0.1)
    assert way(lab, 2.0, horn(lab)) < 3
