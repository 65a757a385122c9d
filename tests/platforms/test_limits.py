"""The limits of the settings: what the body does, and what a client hears."""

from __future__ import annotations

import math
from typing import Any

import pytest
from bioloid_lab import Lab as Bioloid
from cia402_lab import Lab as Drives
from nao_lab import Lab as Nao
from nxt_lab import Lab as Nxt
from p3dx_lab import Lab as Pioneer
from segway_lab import Lab as Segway
from spykee_lab import Lab as Spykee

from urbihw.buses import messages as m
from urbihw.kernel.uobject import BadConfig, RobotSettings
from urbihw.platforms import base, limited
from urbihw.platforms.limits import LimitSettings

COUNT = math.radians(300 / 1023)
WHEEL = "motor7.cwLimit = motor7.ccwLimit = 0|;"


def fastest(lab: Bioloid, seconds: float, unit: int = 6) -> float:
    """The highest speed of a servo's horn, rad/s, over some time."""
    most = 0.0
    for _ in range(round(seconds / lab.tick)):
        lab.step()
        lab.kit.tick(lab.bus_clock.now())
        most = max(most, abs(lab.kit.servo(unit).speed) * COUNT)
    return most


def test_a_joint_stays_within_its_position_limit_and_says_which_that_is() -> None:
    lab = Bioloid.small(6, limits={"motor6": {"position": [-0.5, 0.5]}})
    lab.say("at (motor6.limited?(var by)) echo(by);")
    assert "*** limits.motor6.position" in lab.say("motor6.val = 1.5|;", 2.0)
    assert lab.number("motor6.val") == pytest.approx(0.5, abs=0.02)
    assert lab.number("motor6.requested") == 1.5
    assert lab.number("motor6.applied") == pytest.approx(0.5, abs=0.01)
    assert lab.look("motor6.limitedBy") == '"limits.motor6.position"'
    lab.say("motor6.val = 0.2|;", 1.0)
    assert lab.look("motor6.limitedBy") == '""'
    assert lab.look("motor6.why").startswith('"Lobby_1')


def test_a_limit_that_acts_on_one_write_after_the_other_is_told_once_and_stays() -> None:
    lab = Bioloid.small(6, limits={"motor6": {"position": [-0.5, 0.4]}})
    lab.say("at (motor6.limited?(var by)) echo(by);")
    told = lab.say("motor6.val = 1.5|; sleep(0.2s); motor6.val = 1.6|;", 0.5).splitlines()
    assert told == ["!!! 1.39-48: warning: limited by limits.motor6.position", "*** limits.motor6.position"]
    assert lab.number("motor6.applied") == pytest.approx(0.4, abs=0.01)
    assert lab.look("motor6.limitedBy") == '"limits.motor6.position"'
    lab.say("motor6.val = -1.5|;", 0.2)
    assert lab.number("motor6.applied") == pytest.approx(-0.5, abs=0.01)
    lab.say("motor6.val = 0.1|;", 0.2)
    assert lab.number("motor6.applied") == pytest.approx(0.1, abs=0.01)
    assert lab.look("motor6.limitedBy") == '""'
    lab.say("motor6.val = 1.5|;", 0.2)
    lab.say("robot.stop|; motor6.val = 0.1|;", 0.2)
    assert lab.number("motor6.applied") == pytest.approx(0.1, abs=0.01)
    assert lab.look("motor6.limitedBy") == '""'


def test_the_writer_is_warned_of_a_limit_of_the_settings_but_not_of_the_range_of_a_slot() -> None:
    lab = Bioloid.small(6, limits={"motor6": {"position": [-0.5, 0.4], "speed": 1.0}})
    assert lab.say("motor6.val = 0.3; motor6.val = 0.45;", 0.1).splitlines() == [
        "0.3", "!!! 1.19-28: warning: limited by limits.motor6.position", "0.45",
    ]  # fmt: skip
    # Another client is warned, too; each but once, since a movement beyond a limit would fill the window.
    lab.kernel.feed(lab.observer, b"motor6.val = 2|;")
    assert lab.say("", 0.1) == ""
    assert lab.look("0").splitlines()[0].endswith("warning: limited by limits.motor6.position")
    assert lab.say("motor6.val = 0 sin:1s ampli:1,", 30.0) == ""
    assert lab.say("motor6.speed = 3|;").endswith("warning: limited by limits.motor6.speed")
    # As in Urbi 2.3: rangemin and rangemax cut silently; limitedBy tells it.
    nxt = Nxt.ready()
    assert nxt.say("wheelL.speed = 101;", 0.2) == "100"
    assert nxt.look("wheelL.limitedBy") == '"range of speed: -100 to 100"'
    assert nxt.brick.motor("C").power == 100


def test_a_joint_goes_no_faster_than_its_speed_limit() -> None:
    free, limited = Bioloid.small(6), Bioloid.small(6, limits={"speed": 0.5})
    for lab in (free, limited):
        lab.say("motor6.val = 1|;")
    assert fastest(free, 3.0) > 3.0
    assert fastest(limited, 3.0) < 0.6
    assert limited.number("motor6.val") == pytest.approx(1.0, abs=0.02)


def test_a_wheel_turns_and_speeds_up_within_its_limits_both_ways() -> None:
    lab = Bioloid.small(6, limits={"motor6": {"speed": 0.5, "acceleration": 0.5}})
    lab.say("motor6.cwLimit = motor6.ccwLimit = 0|; sleep(300ms); motor6.speed = -3|;", 0.8)
    assert fastest(lab, 0.05) < 0.4
    # A wheel is driven open loop: friction takes a part of what is asked for.
    assert 0.3 < fastest(lab, 2.0) < 0.55
    assert lab.number("motor6.speed") < 0
    assert lab.look("motor6.limitedBy") == '"limits.motor6.speed"'
    assert lab.number("motor6.applied") == pytest.approx(-0.5, abs=0.01)


def test_the_range_of_a_slot_is_a_limit_that_is_told() -> None:
    lab = Bioloid.small(6)
    lab.say("motor6.val = 4000deg|;", 0.1)
    assert lab.number("motor6.requested") == pytest.approx(4000 * math.pi / 180, rel=1e-4)
    assert lab.look("motor6.limitedBy").startswith('"range of val: -2.6')


def test_heat_warns_then_halves_the_torque_then_lets_go_with_hysteresis() -> None:
    lab = Bioloid.small(6, limits={"motor6": {"temperature": [50, 60, 70]}})
    lab.say("at (bioloid.guarded?(var id, var by, var on)) echo(by + \" \" + on.asString);")
    lab.say("motor6.val = 0.5|;", 1.0)
    unit = lab.kit.servo(6)
    unit.heat(55)
    assert "(warn) true" in lab.say("1;", 1.5)
    unit.heat(62)
    assert "(reduce) true" in lab.say("1;", 1.5)
    assert lab.register(6, "torque_limit") == 511
    unit.heat(58)
    lab.run(1.5)
    assert lab.register(6, "torque_limit") == 511
    unit.heat(54)
    assert "(reduce) false" in lab.say("1;", 1.5)
    assert lab.register(6, "torque_limit") == 1023
    unit.heat(71)
    assert "(release) true" in lab.say("1;", 1.5)
    assert lab.register(6, "torque_enable") == 0
    lab.say("motor6.val = -0.5|;", 1.0)
    assert lab.register(6, "torque_enable") == 0


def reload(lab: Bioloid | Drives, limits: dict[str, Any]) -> None:
    """Read the settings again, with other limits."""
    lab.robot.configure(RobotSettings(lab.url, 1 / lab.tick, dead_man=0, limits=limits))
    lab.run(0.1)


@pytest.mark.parametrize("limits", [{}, {"temperature": [55, 65, 75]}])
def test_a_temperature_limit_that_is_corrected_frees_the_motor_at_once(limits: dict[str, Any]) -> None:
    lab = Bioloid.small(6, limits={"temperature": [20, 25, 30]})
    lab.run(1.5)
    held = "6 is held by limits.temperature (release): let it cool below 25 degrees, then load = 1"
    assert held in lab.say("motor6.load = 1|;", 0.3)
    assert lab.register(6, "torque_limit") == 511
    reload(lab, limits)
    assert lab.register(6, "torque_limit") == 1023
    lab.say("motor6.load = 1|; sleep(200ms); motor6.val = 0.5|;", 2.0)
    assert lab.register(6, "torque_enable") == 1
    assert lab.number("motor6.val") == pytest.approx(0.5, abs=0.02)


def test_a_temperature_limit_that_is_lowered_acts_at_once_and_keeps_its_hysteresis() -> None:
    lab = Bioloid.small(6, limits={"temperature": [50, 60, 70]})
    lab.kit.servo(6).heat(45)
    lab.say("motor6.load = 1|; motor6.val = 0.5|;", 2.0)
    reload(lab, {"temperature": [20, 30, 44]})
    assert lab.register(6, "torque_enable") == 0
    reload(lab, {"temperature": [20, 30, 49]})
    assert "is held by limits.temperature (release)" in lab.say("motor6.load = 1|;", 0.3)
    assert lab.register(6, "torque_enable") == 0
    reload(lab, {"temperature": [20, 30, 55]})
    lab.say("motor6.load = 1|;", 0.5)
    assert lab.register(6, "torque_enable") == 1
    assert lab.register(6, "torque_limit") == 511


def test_a_torque_that_heat_had_halved_is_restored_within_the_limits_of_now() -> None:
    lab = Bioloid.small(6, limits={"temperature": [20, 25, 75]})
    lab.run(1.5)
    assert lab.register(6, "torque_limit") == 511
    reload(lab, {"torque": 0.3})
    assert lab.register(6, "torque_limit") < 400


def test_what_a_worker_that_is_gone_held_is_forgotten() -> None:
    lab = Bioloid.small(6, limits={"temperature": [20, 25, 30]})
    lab.run(1.5)
    assert lab.robot.motion.held
    lab.robot.limits.settings = LimitSettings.of({})
    assert lab.worker is not None
    lab.worker._post(m.Held({}))
    lab.say("1;", 0.1)
    assert not lab.robot.motion.held


def test_torque_is_limited_from_the_start() -> None:
    lab = Bioloid.small(6, limits={"torque": 0.75})
    lab.run(0.2)
    assert lab.register(6, "torque_limit") == pytest.approx(512, abs=1)
    lab.say("motor6.torqueLimit = 1.5|;", 0.5)
    assert lab.register(6, "torque_limit") == pytest.approx(512, abs=1)


def test_a_motor_of_the_nxt() -> None:
    lab = Nxt.ready(limits={"C": {"speed": 20}})
    lab.say("wheelL.speed = 100|;", 1.0)
    assert lab.brick.motors[2].power == 20
    assert lab.look("wheelL.limitedBy") == '"limits.C.speed"'


@pytest.mark.parametrize("write", ["wheelL.val = wheelL.val + 720|;", "wheelL.val = wheelL.val + 720 time:1s,"])
def test_a_motor_of_the_nxt_on_its_way_to_a_position(write: str) -> None:
    lab = Nxt.ready(limits={"speed": 20})
    motor = lab.brick.motors[2]
    begin = motor.position
    lab.say(write)
    most = 0.0
    for _ in range(round(5 / lab.tick)):
        lab.step()
        most = max(most, abs(motor.speed))
    assert 150 < most < 185
    assert motor.position - begin == pytest.approx(720, abs=10)


def fastest_drive(lab: Drives, seconds: float) -> float:
    """The highest speed of a drive's shaft, rad/s, over some time."""
    machine, most = lab.drive.machine, 0.0
    for _ in range(round(seconds / lab.tick)):
        lab.step()
        most = max(most, abs(machine.speed) * math.tau / machine.increments)
    return most


@pytest.mark.parametrize("write", ["drive5.val = drive5.val + 3|;", "drive5.val = drive5.val + 3 time:1s,"])
def test_a_drive_on_its_way_to_a_position(write: str) -> None:
    lab = Drives.ready(limits={"speed": 1.0, "acceleration": 4.0})
    lab.say("drive5.load = 1|;", 1.0)
    lab.say(write)
    assert 0.8 < fastest_drive(lab, 5.0) < 1.05
    assert lab.number("drive5.val") == pytest.approx(3.0, abs=0.02)


def test_a_drive_on_its_way_obeys_limits_that_are_reloaded_and_gets_its_own_speed_back() -> None:
    lab = Drives.ready()
    lab.say("drive5.load = 1|;", 1.0)
    lab.say("drive5.val = 60|;", 1.0)
    reload(lab, {"speed": 1.0})
    lab.run(0.3)
    assert 0.8 < fastest_drive(lab, 1.0) < 1.05
    lab.say("cia402.stop|;", 0.5)
    reload(lab, {"speed": 0.5})
    assert fastest_drive(lab, 0.5) < 0.01
    reload(lab, {})
    lab.say("drive5.val = 60|;")
    assert fastest_drive(lab, 1.0) > 10


def test_a_drive_that_refuses_the_limit_of_its_speed_goes_to_no_position(caplog: pytest.LogCaptureFixture) -> None:
    lab = Drives.ready()
    lab.drive.refused.add(0x6081)
    lab.say("drive5.load = 1|;", 1.0)
    lab.say("drive5.val = 60|;", 1.0)
    reload(lab, {"speed": 1.0})
    lab.run(0.3)
    assert fastest_drive(lab, 0.5) < 0.01
    lab.say("drive5.val = 60|;")
    assert fastest_drive(lab, 0.5) < 0.01
    assert "does not take the limit of its speed (object 6081)" in caplog.text
    reload(lab, {})
    lab.say("drive5.val = 60|;")
    assert fastest_drive(lab, 0.5) > 10


def test_bases_and_drives() -> None:
    segway = Segway.ready(limits={"base": {"speed": 0.5, "acceleration": 1.0}})
    segway.say("rmp.forwardSpeed = 3|;", 0.2)
    assert 0 < segway.base.reading().velocity * 3.576 / 1176 < 0.25
    segway.run(2.0)
    assert segway.base.reading().velocity * 3.576 / 1176 == pytest.approx(0.5, abs=0.01)
    pioneer = Pioneer.ready(limits={"speed": 0.2})
    pioneer.say("P3dx.body.load = 1|;", 1.0)
    pioneer.say("P3dx.body.x.speed = 0.7|;", 3.0)
    assert pioneer.number("P3dx.body.x.speed") == pytest.approx(0.2, abs=0.02)
    assert pioneer.look("P3dx.body.x.limitedBy") == '"limits.speed"'
    drives = Drives.ready(limits={"drive5": {"speed": 2.0}})
    drives.say("drive5.load = 1|;", 1.0)
    drives.say("drive5.speed = 10|;", 2.0)
    assert drives.number("drive5.speed") == pytest.approx(2.0, rel=0.02)


@pytest.mark.parametrize(
    ("kind_of_lab", "switch", "slot", "writes", "name"),
    [
        (Nao, "motors.load = 1|;", "headYaw.val", ((2, 0.5), (0.2, 0.2), (-2, -0.5)), "limits.HeadYaw.position"),
        (Spykee, "", "trackL.val", ((50, 30), (10, 10), (-50, -30)), "limits.trackL.speed"),
        (Bioloid, "", "motor6.val", ((2, 0.5), (0.2, 0.2), (-2, -0.5)), "limits.motor6.position"),
        (Bioloid, WHEEL, "motor7.speed", ((3, 1), (0.5, 0.5), (-3, -1), (-0.5, -0.5)), "limits.motor7.speed"),
        (Nxt, "", "wheelL.speed", ((100, 20), (10, 10), (-100, -20)), "limits.C.speed"),
        (Drives, "drive5.load = 1|;", "drive5.speed", ((10, 2), (1, 1), (-10, -2)), "limits.drive5.speed"),
        (Segway, "", "rmp.forwardSpeed", ((3, 0.5), (0.2, 0.2)), "limits.base.speed"),
    ],
)
def test_what_is_applied_is_right_behind_the_write(
    kind_of_lab: Any, switch: str, slot: str, writes: tuple[tuple[float, float], ...], name: str
) -> None:
    device, key, kind = slot.split(".")[0], *name.split(".")[1:]
    table = {key: {kind: [-writes[0][1], writes[0][1]] if kind == "position" else writes[0][1]}}
    lab = kind_of_lab.ready(limits=table)
    lab.say(switch, 1.0)
    for wanted, applied in writes:
        # One round: the worker has not heard of it yet.
        heard = lab.say(f"{slot} = {wanted}|; [{device}.requested, {device}.applied]; {device}.limitedBy;").splitlines()
        if heard[0].endswith(f"warning: limited by {name}"):
            del heard[0]
        requested, shown = (float(part) for part in heard[0].strip("[]").split(", "))
        assert requested == wanted and shown == pytest.approx(applied, abs=0.01)
        assert heard[1] == (f'"{name}"' if applied != wanted else '""')
    lab.say(f"{slot} = {writes[0][0]}|; {slot} = {writes[1][0]}|;")
    for _ in range(20):
        lab.step()
        # No late report about the write before.
        assert lab.number(f"{device}.applied") == pytest.approx(writes[1][1], abs=0.01)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"sped": 1.0}, "limits.sped: no such limit; did you mean speed?"),
        ({"speed": 0}, "limits.speed: wants a number above 0, not 0"),
        ({"motor6": {"position": [1, -1]}}, "limits.motor6.position: wants 2 rising numbers"),
        ({"temperature": [-300, 0, 1]}, "limits.temperature: wants 3 rising numbers from -40 to 200"),
        ({"temperature": [50, 60, 201]}, "limits.temperature: wants 3 rising numbers from -40 to 200"),
        ({"temperature": [50, 60]}, "limits.temperature: wants 3 rising numbers"),
        ({"speed": float("nan")}, "limits.speed: wants a number above 0"),
    ],
)
def test_what_makes_no_sense_is_refused_in_words(table: dict[str, object], words: str) -> None:
    with pytest.raises(BadConfig, match=words.replace("?", r"\?")):
        LimitSettings.of(table)


def test_a_device_that_is_not_there_is_named(caplog: pytest.LogCaptureFixture) -> None:
    Bioloid.ready(limits={"motor66": {"speed": 1.0}})
    assert "limits.motor66: there is no such device; there are: motor1," in caplog.text


def test_a_reload_that_removes_or_raises_limits_says_so(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in (limited, base):
        monkeypatch.setattr(module, "LOOSER_SHOWN_S", 2.0)
    joint = {"position": [-0.5, 0.5], "speed": 0.5}
    lab = Bioloid.ready(limits={"speed": 1.0, "motor6": joint, "motor7": {"torque": 1}})
    one = {"speed": 1.0, "motor6": {"position": [-0.4, 0.4], "speed": 0.5}, "motor7": {"torque": 0.9}}
    for limits, logged, shown in (
        (one, "", ""),
        ({"speed": 1.0, "motor6": {"position": [-0.4, 0.6]}, "motor7": {"torque": 0.9}},
         "limits.motor6.position [-0.4, 0.4] -> [-0.4, 0.6]; limits.motor6.speed 0.5 -> 1",
         "limits.motor6.position [-0.4, 0.4] -> [-0.4, 0.6]; limits.motor6.speed 0.5 -> 1"),
        ({}, "limits.speed 1 -> none; limits.motor6.position [-0.4, 0.6] -> none; limits.motor7.torque 0.9 -> none",
         "limits.speed 1 -> none; limits.motor6.position [-0.4, 0.4] -> none; limits.motor6.speed 0.5 -> none; "
         "limits.motor7.torque 0.9 -> none"),
        # A reload that changes another limit does not hide what was raised before.
        ({"motor6": {"temperature": [40, 50, 60]}}, "",
         "limits.speed 1 -> none; limits.motor6.position [-0.4, 0.4] -> none; limits.motor6.speed 0.5 -> none; "
         "limits.motor7.torque 0.9 -> none"),
        (one, "limits.motor6.temperature [40, 50, 60] -> none", ""),
    ):  # fmt: skip
        caplog.clear()
        reload(lab, limits)
        begin = "limits removed or raised by the settings: "
        lines = [each.message for each in caplog.records if begin in each.message]
        assert lines == ([begin + logged] if logged else [])
        assert lab.look("robot.problems") == (f'["{begin}{shown}"]' if shown else "[]")
    reload(lab, {"speed": 2.0})
    shown = lab.look("robot.problems")
    assert "limits.speed 1 -> 2" in shown
    # The reload is for something else: the limits are those of before.
    reload(lab, {"speed": 2.0})
    assert lab.look("robot.problems") == shown
    lab.run(2.1)
    assert lab.look("robot.problems") == "[]"
    reload(lab, {"speed": 3.0})
    assert lab.look("robot.problems") == f'["{begin}limits.speed 2 -> 3"]'


def test_a_limit_of_an_absent_device_that_a_reload_removes_is_told(caplog: pytest.LogCaptureFixture) -> None:
    lab = Bioloid.ready(limits={"motor66": {"speed": 1.0}})
    reload(lab, {})
    assert "limits.motor66.speed 1 -> none" in lab.look("robot.problems")
