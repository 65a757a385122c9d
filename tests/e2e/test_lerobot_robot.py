"""LeRobot's robot and leader (by LeRobot's interface, ``lerobot_interface``) before a simulated SO-101."""

from __future__ import annotations

import contextlib
from pathlib import Path

import lerobot_interface
import pytest
from faults_lab import Daemon, Watcher, wait_for

import urbihw
from urbihw.client.errors import UrbiError
from urbihw_fakes.endpoint import PtyEndpoint
from urbihw_fakes.so101 import So101

pytestmark = pytest.mark.e2e

ORDER = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"]
"""LeRobot's own."""
STEP = 360 / 4096
"""Degrees of a step of a servo."""


def test_lerobot_moves_an_arm_within_its_limits(tmp_path: Path) -> None:
    arm = So101(calibrated=True)
    end = PtyEndpoint(arm)
    pan = arm.joint("shoulder_pan")
    with end, contextlib.ExitStack() as stack:
        end.start()
        daemon = Daemon(tmp_path, "so101", end.url)
        stack.callback(daemon.close)
        package = stack.enter_context(lerobot_interface.installed())
        address = f"127.0.0.1:{daemon.port}"
        watcher = stack.enter_context(contextlib.closing(Watcher(end, lambda: abs(pan.motor.speed) * STEP)))
        robot = lerobot_interface.device_of(lerobot_interface.RobotConfig.choices["urbihw"](address=address))
        leader = lerobot_interface.device_of(package.UrbihwLeaderConfig(address=address))
        assert list(robot.action_features) == [f"{name}.pos" for name in ORDER] == list(leader.action_features)
        assert robot.robot_type == robot.name == "urbihw" and not robot.is_connected
        for device in (robot, leader):
            device.connect()
            stack.callback(device.disconnect)
        servos = [arm.joint(name) for name in ORDER]
        wait_for(lambda: end.call(lambda: all(servo.registers.get("torque") for servo in servos)), "torque")

        sent = robot.send_action({"shoulder_pan.pos": 500.0, "gripper.pos": 100.0})
        assert 100 < sent["shoulder_pan.pos"] < 180 and sent["gripper.pos"] == pytest.approx(100)
        wait_for(lambda: watcher.speed() > 10, "the body to move")
        wait_for(lambda: leader.get_action()["shoulder_pan.pos"] > sent["shoulder_pan.pos"] - 3, "the goal")
        wait_for(lambda: leader.get_action()["gripper.pos"] > 97, "the gripper to open")
        seen = robot.get_observation()
        assert seen["wrist_roll.pos"] == pytest.approx(0, abs=1)
        assert seen["shoulder_pan.pos"] == pytest.approx(STEP * end.call(lambda: arm.bend("shoulder_pan")), abs=3)

        robot.send_action({"shoulder_pan.pos": -90.0})
        wait_for(lambda: watcher.speed() > 10, "the body to move")
        with urbihw.connect(address) as other:
            other.estop()
            wait_for(lambda: watcher.speed() == 0, "the body to stand")
            with pytest.raises(UrbiError, match="emergency stop"):
                robot.send_action({"shoulder_pan.pos": 0.0})
            assert "LeRobot" in str(other["shoulder_pan.why"])
            other["so101.estop"] = False

        robot.send_action({"shoulder_pan.pos": 90.0})
        wait_for(lambda: watcher.speed() > 10, "the body to move again")
        robot.disconnect()
        wait_for(lambda: watcher.speed() == 0, "the body to stand when LeRobot has gone")
        with pytest.raises(ConnectionError):
            robot.get_observation()
