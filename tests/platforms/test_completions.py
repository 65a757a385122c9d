"""System.completions on a robot: what a user looks for comes first."""

from __future__ import annotations

import json

from bioloid_lab import Lab


def rows(lab: Lab, holder: str, prefix: str) -> list[list[str]]:
    """The names that a console offers."""
    return [list(row) for row in json.loads(lab.look(f'System.completions({holder}, "{prefix}")'))]


def test_devices_come_before_internals_and_what_moves_before_what_tells() -> None:
    lab = Lab.ready()
    lab.kernel.complete()  # as the daemon does when the robot is there
    lab.say("var mine = 1|; function Global.helper() {}|;")
    first = [name for name, rank, _ in rows(lab, "lobby", "") if rank == "0"]
    assert {"robot", "bioloid", "motors", "motor1", "motor18", "sensor100", "helper"} <= set(first)
    assert {"echo", "connectionTag", "System", "Float", "sleep", "AX12", "Filter"}.isdisjoint(first)
    assert ["motor6", "0", "An AX-12, AX-12W or AX-18."] in rows(lab, "lobby", "motor6")
    motor = {name: (rank, meaning) for name, rank, meaning in rows(lab, "motor6", "")}
    assert {name for name, (rank, _) in motor.items() if rank == "0"} == {"val", "speed"}
    assert motor["load"] == ("1", "1 switches the torque on, 0 off")
    assert motor["asMotor"][0] == motor["clone"][0] == motor["asString"][0] == motor["robot"][0] == "3"
    assert [name for name, *_ in rows(lab, "motor6", "maxV")] == ["maxVoltage"]


def test_functions_of_devices_tell_their_arguments() -> None:
    lab = Lab.ready()
    assert lab.look('System.signatureOf(motor6, "readRegister")') == '"(name)"'
    assert lab.look('System.signatureOf(bioloid, "releaseOf")') == '"(name)"'
    assert lab.look('System.signatureOf(motor6, "val")') == '""'
