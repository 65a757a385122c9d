"""Bases and cameras for LeRobot, and what it cannot have, over real sockets to the server."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import lerobot_interface
import pytest
from lan_server import Lan, wait_for

import urbihw
from urbihw.client.errors import UrbiError

pytestmark = pytest.mark.e2e

SETUP = """
var Global.robot = Component.new("robot"); robot.addProto(Interface.Mobile);
var robot.driven = [0, 0]; function robot.drive(x, yaw) { driven = [x, yaw] };
robot.addComponent("arm");
class Global.Grip { function init() { var this.val = 0.5 } }; Grip.addProto(Interface.RotationalMotor);
robot.arm.addDevice("grip", Grip.new); robot.makeCompactNames; grip.val->rangemin = 0; grip.val->rangemax = 2;
class Global.Stick { var val = 3; }; Stick.addProto(Interface.LinearMotor); robot.arm.addDevice("stick", Stick.new);
robot.makeCompactNames; var Global.photo = Binary.new("rgb 2 1", "abcdef");
"""


@pytest.fixture(scope="module")
def lan(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lan]:
    made = Lan(tmp_path_factory.mktemp("lan"))
    try:
        with urbihw.connect("127.0.0.1", made.plain_port, timeout=120) as robot:
            robot.run(SETUP)
        yield made
    finally:
        made.close()


@pytest.fixture
def address(lan: Lan) -> str:
    return f"127.0.0.1:{lan.plain_port}"


@pytest.fixture(scope="module")
def package() -> Iterator[Any]:
    with lerobot_interface.installed() as made:
        yield made


def test_a_base_with_a_gripper_and_a_camera(address: str, package: Any) -> None:
    camera = package.UrbihwCameraConfig(address=address, slot="photo", fps=10, width=2, height=1)
    config = package.UrbihwConfig(address=address, grippers="grip", cameras={"front": camera})
    robot = lerobot_interface.device_of(config)
    assert robot.observation_features == {
        "grip.pos": float, "stick.pos": float, "x.vel": float, "y.vel": float, "theta.vel": float, "front": (1, 2, 3),
    }  # fmt: skip
    robot.connect()
    try:
        seen = robot.get_observation()
        assert seen.pop("front").tolist() == [[[97, 98, 99], [100, 101, 102]]]
        assert seen == {"grip.pos": 25, "stick.pos": 3, "x.vel": 0, "y.vel": 0, "theta.vel": 0}
        assert robot.send_action({"grip.pos": 100.0, "theta.vel": 45.0, "unknown": 1.0}) == {
            "grip.pos": 100, "theta.vel": pytest.approx(45)
        }
        with urbihw.connect(address) as other:
            assert other.grip.val == 2
            assert other.robot.driven == [0, pytest.approx(math.pi / 4)]
        with pytest.raises(ValueError, match="no goal"):
            robot.send_action({"grip.pos": math.nan})
    finally:
        robot.disconnect()
    assert not robot.is_connected


def test_what_cannot_be_is_told(address: str, package: Any) -> None:
    with pytest.raises(ValueError, match=r"stick\.val has no range from 0 to 100"):
        package.Urbihw(package.UrbihwConfig(address=address, grippers="grip, stick"))
    with pytest.raises(AttributeError, match="nothing"):
        package.Urbihw(package.UrbihwConfig(address=address, joints="nothing"))
    camera = package.UrbihwCamera(package.UrbihwCameraConfig(address=address, slot="photo", width=640, height=480))
    with pytest.raises(ValueError, match="photo has pictures of 2 x 1"):
        camera.connect()
    assert not camera.is_connected


def test_a_camera_that_lost_its_daemon_connects_again(lan: Lan, address: str, package: Any) -> None:
    def lose() -> None:
        for each in list(lan.server.connections):
            each.close()

    camera = package.UrbihwCamera(package.UrbihwCameraConfig(address=address, slot="photo", fps=10))
    for _ in range(2):
        camera.connect()
        assert camera.async_read(60_000).shape == (1, 2, 3)
        lan.call(lose)
        wait_for(lambda: not camera.is_connected, "the loss")
        with pytest.raises(ConnectionError):
            while True:
                camera.async_read(60_000)
        camera.disconnect()


def test_a_device_that_cannot_connect_leaves_no_connection(lan: Lan, address: str, package: Any) -> None:
    wait_for(lambda: lan.count()[0] == 0, "the end of other tests")
    camera = package.UrbihwCameraConfig(address=address, slot="photo", fps=10, width=640, height=480)
    robot = lerobot_interface.device_of(package.UrbihwConfig(address=address, grippers="", cameras={"front": camera}))
    with pytest.raises(ValueError, match="photo has pictures of 2 x 1"):
        robot.connect()
    leader = lerobot_interface.device_of(package.UrbihwLeaderConfig(address=address, joints="grip", loose=True))
    with urbihw.connect(address) as other:
        other.run('do (robot.arm.grip) { get load() { 1 }; set load(v) { throw "stuck" } };')
    with pytest.raises(UrbiError, match="stuck"):
        leader.connect()
    assert not robot.is_connected and not leader.is_connected
    wait_for(lambda: lan.count()[0] == 0, "the end of the connections")
