"""Several slots written at once by a program: ``lobby.answerWrites``, which ``robot.write`` of the library says."""

from __future__ import annotations

import json

import pytest
from so101_lab import Lab

from urbihw.buses import messages as m
from urbihw.kernel.lobby import templates


def write(lab: Lab, text: str, seconds: float = 0.0) -> str:
    """The answer to a write on the channel c."""
    lines = lab.say(f'lobby.answerWrites("c", {text}),', seconds).splitlines()
    return next(line for line in lines if line.startswith('["'))


def test_a_group_goes_out_with_one_tick_and_tells_what_is_applied() -> None:
    lab = Lab.ready()
    lab.say("motors.load = 1;", 0.1)
    assert lab.worker is not None
    lab.worker.sent.clear()
    assert write(lab, '["shoulder_pan.val", "elbow_flex.val"], [0.3, -0.2]', 0.05) == '["", [[0.3, ""], [-0.2, ""]]]'
    (targets,) = (message for message in lab.worker.sent if isinstance(message, m.Targets))
    assert {device for device, _ in targets.values} == {1, 3}
    lab.run(1.5)
    assert lab.bend("shoulder_pan") == pytest.approx(0.3, abs=0.01)
    assert lab.bend("elbow_flex") == pytest.approx(-0.2, abs=0.01)


def test_other_numbers_are_not_compiled_again(monkeypatch: pytest.MonkeyPatch) -> None:
    lab = Lab.ready()
    lab.say("motors.load = 1;", 0.1)
    for goal in (0.1, 0.2):
        write(lab, f'["shoulder_pan.val"], [{goal}]')
    monkeypatch.setattr(templates, "parse_program", lambda text: pytest.fail(f"compiled: {text}"))
    assert write(lab, '["shoulder_pan.val"], [0.3]', 1.5) == '["", [[0.3, ""]]]'
    assert lab.bend("shoulder_pan") == pytest.approx(0.3, abs=0.01)


def test_limits_and_a_motor_that_is_off_are_told() -> None:
    lab = Lab.ready(limits={"shoulder_pan": {"position": [-0.5, 0.5]}})
    lab.say("motors.load = 1; gripper.load = 0;", 0.1)
    kind, ((pan, by), (gripper, off)) = json.loads(
        write(lab, '["shoulder_pan.val", "gripper.val"], [2, 0.1]', 0.05).replace("nan", "null")
    )
    assert kind == ""
    assert pan == pytest.approx(0.5, abs=0.002)
    assert by == "limits.shoulder_pan.position"
    assert (gripper, off) == (None, "off")
    lab.run(2.0)
    assert lab.bend("shoulder_pan") == pytest.approx(0.5, abs=0.01)


def test_nothing_is_written_if_one_of_the_slots_does_not_exist() -> None:
    lab = Lab.ready()
    lab.say("motors.load = 1;", 0.1)
    for wrong in ("nobody.val", "gripper.vel", "1 + 1"):
        assert '["error", ' in write(lab, f'["shoulder_pan.val", "{wrong}"], [0.5, 0.1]', 0.5)
    assert lab.bend("shoulder_pan") == pytest.approx(0, abs=0.002)


def test_a_device_is_not_hidden_by_a_number() -> None:
    """``robot.write(dict(zip(robot.joints, ...)))`` made variables of the connection that hid the joints."""
    lab = Lab.ready()
    lab.say("motors.load = 1;", 0.1)
    told = write(lab, '["shoulder_pan"], [0.3]')
    assert "shoulder_pan is a device: write one of its slots, such as shoulder_pan.val" in told
    (line,) = lab.say('lobby.answerSet("c", "shoulder_pan", 0.3),').splitlines()
    assert "is a device" in line
    assert write(lab, '["shoulder_pan.val"], [0.3]', 1.5) == '["", [[0.3, ""]]]'


def test_an_emergency_stop_refuses_it() -> None:
    lab = Lab.ready()
    lab.say("motors.load = 1; so101.estop = true;", 0.1)
    assert "held by an emergency stop" in write(lab, '["shoulder_pan.val"], [0.5]', 0.5)
    assert lab.bend("shoulder_pan") == pytest.approx(0, abs=0.002)


def test_a_slot_of_a_group_is_read_as_a_list_in_its_order() -> None:
    lab = Lab.ready()
    assert lab.say("motors.load = 1|; elbow_flex.val = 0.5|;", 1.5) == ""
    answer = lab.say('lobby.answerSlot("c", "motors.val"),').splitlines()[-1]
    kind, values = json.loads(answer)
    assert kind == "" and len(values) == 6
    assert values[2] == pytest.approx(0.5, abs=0.01)
    assert max(map(abs, values[:2] + values[3:])) < 0.01
