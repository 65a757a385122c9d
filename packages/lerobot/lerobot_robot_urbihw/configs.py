"""The options of LeRobot's commands: ``--robot.address=...`` and so on."""

from __future__ import annotations

from dataclasses import dataclass, field

from lerobot.cameras import CameraConfig
from lerobot.robots.config import RobotConfig
from lerobot.teleoperators.config import TeleoperatorConfig


@RobotConfig.register_subclass("urbihw")
@dataclass(kw_only=True)
class UrbihwConfig(RobotConfig):
    """A robot of a daemon.

    Attributes:
        address: of the daemon, HOST:PORT or the path of a socket.
        joints: their names behind commas; "" for all of the robot, in its order.
        grippers: those of them that LeRobot counts from 0 to 100.
        base: whether the speeds of a base are numbers of the robot, too.
        torque: whether to switch the joints on at the beginning.
        hz: rate of the observations.
        max_age: seconds after which an observation is too old.
        lease: seconds after which the robot stands when LeRobot is held.
        cameras: LeRobot's own, and those of the daemon (``type: urbihw_camera``).
    """

    address: str = "127.0.0.1:54000"
    joints: str = ""
    grippers: str = "gripper"
    base: bool = True
    torque: bool = True
    hz: float = 60.0
    max_age: float = 0.5
    lease: float = 1.0
    cameras: dict[str, CameraConfig] = field(default_factory=dict)


@TeleoperatorConfig.register_subclass("urbihw_leader")
@dataclass(kw_only=True)
class UrbihwLeaderConfig(TeleoperatorConfig):
    """An arm that is moved by hand.

    Attributes:
        prefix: what stands before the names of the joints: "leader" for the second arm of ``--platform so101``.
        loose: whether to switch its joints off at the beginning.
    """

    address: str = "127.0.0.1:54000"
    prefix: str = ""
    joints: str = ""
    grippers: str = "gripper"
    loose: bool = False
    hz: float = 60.0
    max_age: float = 0.5


@CameraConfig.register_subclass("urbihw_camera")
@dataclass(kw_only=True)
class UrbihwCameraConfig(CameraConfig):
    """A camera of a daemon: the slot with its picture."""

    address: str = "127.0.0.1:54000"
    slot: str = "camera.val"
