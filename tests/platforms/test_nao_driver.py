"""The driver of a Nao: what goes over the wire in a cycle, how joints get stiff, what a stop does, what is refused."""

from __future__ import annotations

from dataclasses import replace

import pytest
from nao_lab import stand
from nao_rig import TICK, Rig

from urbihw.buses.errors import LinkGone, Unavailable
from urbihw.buses.messages import Configure, DeviceReport, DeviceState, Found, Refused, Reply, Request, Samples, Targets
from urbihw_nao.exchange import CYCLE_TIMEOUT_S
from urbihw_nao.sense_part import SLOW_CYCLES
from urbihw_nao_fakes.body import Joint
from urbihw_nao_fakes.device import Nao
from urbihw_nao_fakes.services import Failed


def test_what_is_found() -> None:
    rig = Rig().attach()
    (found,) = [each for each in rig.news if isinstance(each, Found)]
    (info,) = found.devices
    assert info.model == "naoH25" and len(info.joints) == 26
    yaw = info.joints[0]
    assert (yaw.name, round(yaw.low, 4), round(yaw.high, 4), round(yaw.speed, 3)) == ("HeadYaw", -2.0857, 2.0857, 8.268)
    assert "ALTextToSpeech" in info.services and "FaceLeds" in info.leds and "setAngles" in info.methods["ALMotion"]


def test_starting_moves_nothing_and_makes_nothing_stiff() -> None:
    rig = Rig().attach()
    before = {name: joint.angle for name, joint in rig.body.joints.items()}
    rig.run(2.0)
    assert not any(joint.stiffness for joint in rig.body.joints.values())
    assert before == {name: joint.angle for name, joint in rig.body.joints.items()}
    assert "setFallManagerEnabled" not in rig.robot.motion.calls and rig.robot.motion.fall_manager


def test_a_cycle_is_one_reading_and_one_set_angles_for_all_joints() -> None:
    rig = Rig().attach()
    names = [name for name in rig.body.joints if not name.startswith("RHipYaw")]
    rig.order("stiffness", **dict.fromkeys(names, 1.0))
    rig.run(0.2)
    before, rig.asked = rig.robot.motion.calls["setAngles"], 0
    cycles = 50
    for index in range(cycles):
        rig.order(**dict.fromkeys(names, 0.001 * index))
        rig.run(TICK)
    assert rig.robot.motion.calls["setAngles"] - before == cycles
    # And where it is and whether it walks, in each fifth cycle, and where its two hands are, once a second.
    assert rig.asked == 2 * cycles + 2 * (cycles // SLOW_CYCLES) + 2


def test_a_joint_that_gets_stiff_stays_where_it_is() -> None:
    rig = Rig()
    rig.body.joints["HeadYaw"].command = 1.5  # of a program before
    rig.attach()
    rig.body.joints["HeadYaw"].angle = -0.7  # somebody has turned it by hand
    rig.run(0.1)
    rig.order("stiffness", HeadYaw=1.0)
    rig.run(1.0)
    assert rig.body.joints["HeadYaw"].stiffness == 1.0
    assert rig.body.joints["HeadYaw"].angle == pytest.approx(-0.7, abs=0.001)


def test_the_newest_goal_counts_while_naoqi_is_slow() -> None:
    rig = Rig().attach()
    rig.order("stiffness", HeadYaw=1.0)
    rig.run(0.2)
    rig.robot.faults.start("late", amount=0.3)
    before = rig.robot.motion.calls["setAngles"]
    for index in range(50):
        rig.order(HeadYaw=0.01 * index)
        rig.run(TICK)
    assert rig.robot.motion.calls["setAngles"] - before <= 5
    rig.robot.faults.stop()
    rig.run(1.0)
    assert rig.body.joints["HeadYaw"].angle == pytest.approx(0.49, abs=0.001)


def test_a_stop_holds_where_a_joint_is_and_leaves_it_stiff() -> None:
    rig = Rig().attach()
    rig.order("stiffness", HeadYaw=1.0, LShoulderPitch=1.0)
    rig.run(0.2)
    rig.order(HeadYaw=2.0)
    rig.run(0.14)
    rig.driver.safe_stop()
    joint = rig.body.joints["HeadYaw"]
    place = joint.angle
    rig.run(1.0)
    assert 0.3 < place < 1.9 and joint.angle == pytest.approx(place, abs=0.02) and joint.stiffness == 1.0
    assert rig.body.joints["LShoulderPitch"].angle == pytest.approx(1.5, abs=0.001)


def test_a_stop_drops_what_was_asked_for_just_before() -> None:
    rig = Rig().attach()
    rig.order("stiffness", HeadYaw=1.0)
    rig.run(0.2)
    place = rig.body.joints["HeadYaw"].angle
    rig.order(HeadYaw=2.0)
    rig.driver.safe_stop()
    rig.run(1.0)
    assert rig.body.joints["HeadYaw"].angle == pytest.approx(place, abs=0.01)


def test_a_stop_ends_the_walk_and_does_not_touch_its_legs() -> None:
    rig = Rig()
    stand(rig.body)
    rig.attach()
    rig.driver.targets(Targets({("walk", "x"): 0.1, ("walk", "yaw"): 0.3}))
    rig.run(1.0)
    assert rig.body.walk[0] == pytest.approx(0.1, abs=0.001) and rig.body.walk[2] > 0.25
    angles = rig.robot.motion.calls.get("setAngles", 0)
    rig.driver.safe_stop()
    rig.run(1.0)
    assert rig.body.walk == [0.0, 0.0, 0.0] and rig.body.standing
    assert rig.robot.motion.calls.get("setAngles", 0) == angles


def test_a_stop_with_torque_off_sits_down_first() -> None:
    rig = Rig()
    stand(rig.body)
    rig.driver.configure(Configure(torque_off_on_stop=True))
    rig.attach()
    rig.driver.safe_stop()
    rig.run(3.0)
    assert not rig.body.fallen and not any(joint.stiffness for joint in rig.body.joints.values())


def test_a_walk_that_the_last_worker_has_left_is_stopped_at_the_beginning() -> None:
    rig = Rig()
    stand(rig.body)
    rig.body.drive((0.1, 0.0, 0.0))
    rig.body.joints["HeadYaw"].order(2.0, 0.05)
    rig.run(0.5)
    rig.link.open()
    rig.driver.attach(rig.link)
    assert rig.driver.stop_what_moves() == ("walk", "HeadYaw")
    place = rig.body.joints["HeadYaw"].angle
    rig.run(1.0)
    assert not rig.body.walking and rig.body.joints["HeadYaw"].angle == pytest.approx(place, abs=0.03)


def test_a_walk_that_cannot_be_is_refused() -> None:
    rig = Rig().attach()
    rig.driver.targets(Targets({("walk", "x"): 0.1}))
    refused = [each for each in rig.run(0.2) if isinstance(each, Refused)]
    assert [(each.device, each.item) for each in refused] == [("walk", "move")]
    assert "has fallen, or its legs have no stiffness" in refused[0].reason


def test_services_are_called_and_a_stop_ends_what_they_do() -> None:
    rig = Rig()
    stand(rig.body)
    rig.attach()
    assert rig.request("call", "ALMotion", "getAngles", "HeadYaw", True)[0].ok
    assert not rig.driver.request_moves(Request(1, "call", "ALMotion", "getAngles"))
    assert not rig.driver.request_moves(Request(1, "call", "ALTextToSpeech", "say"))
    assert rig.driver.request_moves(Request(1, "call", "ALMotion", "moveTo"))
    assert rig.driver.request_moves(Request(1, "call", "ALSomethingNew", "wave"))
    assert rig.request("call", "ALMotion", "moveTo", 1.0, 0.0, 0.0, number=2) == []
    assert rig.body.walking
    rig.driver.safe_stop()
    assert [each.reply_id for each in rig.run(1.0) if isinstance(each, Reply)] == [2]
    assert not rig.body.walking
    (reply,) = rig.request("call", "ALMotion", "getAngles", "Nose", True, number=3)
    assert (reply.ok, reply.error) == (False, "ALMotion: Nose is not a recognized joint name")
    (reply,) = rig.request("describe", "ALNothing", number=4)
    assert (reply.ok, reply.error) == (False, "Cannot find service 'ALNothing' in index")


def test_events_of_memory_come_again_after_the_link_was_lost() -> None:
    rig = Rig().attach()
    assert rig.request("listen", "FrontTactilTouched")[0].ok
    rig.driver.detach()
    rig.link.close()
    rig.attach()
    rig.robot.memory.touch("Head/Touch/Front", 1.0)
    happened = [each for each in rig.run(0.2) if isinstance(each, DeviceReport)]
    assert happened == [DeviceReport("event", "FrontTactilTouched", 1.0)]


def test_a_service_that_is_gone_when_the_link_is_back_fails_its_own_calls_only() -> None:
    rig = Rig().attach()
    rig.request("describe", "ALBattery")
    rig.driver.detach()
    rig.link.close()
    (number,) = (number for number, each in rig.robot.services.items() if each.name == "ALBattery")
    battery = rig.robot.services.pop(number)
    rig.attach()
    (reply,) = rig.request("call", "ALBattery", "getBatteryCharge", number=2)
    assert (reply.ok, reply.error) == (False, "Cannot find service 'ALBattery' in index")
    rig.robot.services[number] = battery
    assert rig.request("call", "ALBattery", "getBatteryCharge", number=3)[0].ok


def test_a_silent_naoqi_is_given_up_after_a_second() -> None:
    rig = Rig().attach()
    rig.robot.faults.start("silence")
    with pytest.raises(LinkGone, match="NAOqi does not tell what it measures"):
        rig.run(CYCLE_TIMEOUT_S + 0.1)


def test_a_link_that_is_lost_fails_what_waits_and_drops_goals() -> None:
    rig = Rig()
    stand(rig.body)
    rig.attach()
    assert rig.request("call", "ALMotion", "moveTo", 1.0, 0.0, 0.0) == []
    rig.order(HeadYaw=1.0)
    rig.driver.detach()
    rig.link.close()
    told = rig.driver.tick(rig.clock.now(), lambda: None)
    assert [each for each in told if isinstance(each, Reply)] == [Reply(1, False, None, "the link went down")]
    rig.order(HeadYaw=1.0)
    rig.link.open()
    rig.driver.attach(rig.link)
    rig.driver.stop_on_reconnect()
    rig.run(1.0)
    assert rig.body.joints["HeadYaw"].angle == 0.0 and not rig.body.walking


def test_angles_that_no_joint_can_have_are_left_out() -> None:
    rig = Rig().attach()
    rig.body.joints["HeadYaw"].angle = 99.0
    told = [each for each in rig.run(0.2) if isinstance(each, Samples)]
    assert not any("angle" in each.values.get("HeadYaw", {}) for each in told[2:])
    assert rig.driver.pose("HeadYaw", "angle") == 0.0


def test_what_is_no_nao() -> None:
    robot = Nao()
    for number, service in list(robot.services.items()):
        if service.name == "ALMotion":
            del robot.services[number]
    rig = Rig(robot)
    rig.link.open()
    with pytest.raises(Unavailable, match="Cannot find service 'ALMotion' in index"):
        rig.driver.attach(rig.link)


def test_a_robot_without_a_method_is_stopped_as_far_as_it_goes() -> None:
    rig = Rig()
    stand(rig.body)
    motion = rig.robot.motion
    gone = [uid for uid, method in motion.methods.items() if method.name in ("killAll", "move")]
    for uid in gone:
        del motion.methods[uid]
    rig.attach()
    assert rig.request("call", "ALMotion", "moveTo", 1.0, 0.0, 0.0) == []
    rig.driver.safe_stop()
    refused = [each for each in rig.run(1.0) if isinstance(each, Refused)]
    assert [each.item for each in refused] == ["killAll"] and not rig.body.walking
    rig.driver.targets(Targets({("walk", "x"): 0.1}))
    refused = [each for each in rig.run(0.2) if isinstance(each, Refused)]
    assert [each.reason for each in refused] == ["ALMotion has no method move; did you mean moveTo?"]


def test_answers_of_another_form_are_no_nao() -> None:
    for name, answer in (("getLimits", [["x"]]), ("getLimits", 5), ("getBodyNames", [])):
        rig = Rig()
        methods = rig.robot.motion.methods
        (uid,) = [uid for uid, method in methods.items() if method.name == name]
        methods[uid] = replace(methods[uid], run=lambda _, answer=answer: answer)
        rig.link.open()
        with pytest.raises(Unavailable, match="is this a Nao"):
            rig.driver.attach(rig.link)


def test_a_wrong_password_is_never_shown() -> None:
    rig = Rig(Nao("nao", "right"), user="nao", password="wrong")
    rig.link.open()
    with pytest.raises(Unavailable, match="refuses user or password") as error:
        rig.driver.attach(rig.link)
    assert "wrong" not in str(error.value)
    right = Rig(Nao("nao", "right"), user="nao", password="right").attach()
    assert not any(isinstance(each, DeviceState) for each in right.news)


def test_targets_that_are_none() -> None:
    rig = Rig().attach()
    assert [each.reason for each in rig.order(Nose=1.0)] == ["no such target"]
    assert rig.driver.targets(Targets({("HeadYaw", "angle"): "x"})) == [Refused("HeadYaw", "angle", "'x' is no number")]


def test_a_stop_kills_tasks_only_when_the_robot_stands() -> None:
    rig = Rig()
    stand(rig.body)
    rig.attach()
    assert rig.request("call", "ALMotion", "moveTo", 1.0, 0.0, 0.0) == []
    assert rig.body.walking
    rig.driver.safe_stop()
    # What is asked for meanwhile is done when the stop is over.
    told = rig.driver.request(Request(2, "call", "ALMotion", "setAngles", ("HeadYaw", 0.5, 1.0)))
    told += rig.run(4.0)
    assert not rig.body.walking and rig.robot.motion.calls["killAll"] == 1 and rig.robot.motion.abrupt_ends == 0
    assert [(each.reply_id, each.ok) for each in told if isinstance(each, Reply) and each.reply_id == 2] == [(2, True)]
    assert rig.body.joints["HeadYaw"].angle == pytest.approx(0.5, abs=0.01)


def test_a_motion_that_waits_for_a_stop_is_refused_by_another_stop() -> None:
    rig = Rig()
    stand(rig.body)
    rig.attach()
    assert rig.request("call", "ALMotion", "moveTo", 1.0, 0.0, 0.0) == []
    rig.driver.safe_stop()
    assert rig.driver.request(Request(2, "call", "ALMotion", "moveTo", (1.0, 0.0, 0.0))) == []
    rig.driver.safe_stop()
    told = [each for each in rig.run(4.0) if isinstance(each, Reply) and each.reply_id == 2]
    assert [(each.ok, each.error) for each in told] == [(False, "stopped")] and not rig.body.walking


def test_a_joint_that_is_bound_to_a_speed_is_no_faster_when_its_goals_arrive_late() -> None:
    rig = Rig().attach()
    rig.order("stiffness", HeadYaw=1.0, HeadPitch=1.0, LElbowYaw=1.0)
    rig.run(0.2)
    speeds = {joint.name: joint.speed for joint in rig.driver._exchange.info.joints}
    goals = {("HeadYaw", "angle"): 1.5, ("HeadPitch", "angle"): 0.4, ("LElbowYaw", "angle"): 1.0}
    before = {name: rig.body.joints[name].angle for name, _ in goals}
    rig.driver.targets(Targets(goals, rates={("HeadYaw", "angle"): 1.0, ("HeadPitch", "angle"): 0.5}))
    rig.run(TICK)
    begin = {name: rig.body.joints[name].angle for name, _ in goals}
    rig.run(0.2)
    ways = {name: abs(rig.body.joints[name].angle - begin[name]) for name, _ in goals}
    assert 0.15 < ways["HeadYaw"] <= 0.2 * 1.05 and 0.07 < ways["HeadPitch"] <= 0.1 * 1.05
    assert abs(rig.body.joints["LElbowYaw"].angle - before["LElbowYaw"]) > 0.5 * speeds["LElbowYaw"] * 0.2
    # The next goal without a speed is reached as fast as the motor can.
    rig.order(HeadYaw=-1.5)
    rig.run(0.4)
    assert rig.body.joints["HeadYaw"].angle < -1.0


def test_a_refusal_of_any_of_the_groups_of_joints_with_one_speed_is_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig().attach()
    rig.order("stiffness", HeadYaw=1.0, HeadPitch=1.0)
    rig.run(0.2)
    refusing: list[str] = []

    def refuse(self: Joint, angle: float, share: float) -> None:
        if self.name in refusing:
            raise Failed(f"no way for {self.name}")

    monkeypatch.setattr(Joint, "order", refuse)
    for name in ("HeadYaw", "HeadPitch"):
        refusing[:] = [name]
        rates = {("HeadYaw", "angle"): 1.0, ("HeadPitch", "angle"): 0.5}
        rig.driver.targets(Targets({("HeadYaw", "angle"): 0.2, ("HeadPitch", "angle"): 0.1}, rates=rates))
        heard = [each.reason for each in rig.run(0.2) if isinstance(each, Refused)]
        assert any(f"no way for {name}" in reason for reason in heard), heard
