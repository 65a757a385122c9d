"""The robot of LeRobot: observations and actions of any robot that a daemon serves."""

from __future__ import annotations

import math
from typing import Any, Final

from lerobot.cameras import make_cameras_from_configs
from lerobot.robots.robot import Robot

import urbihw
from lerobot_robot_urbihw.channels import base_channels, joint_channels
from lerobot_robot_urbihw.configs import UrbihwConfig
from lerobot_robot_urbihw.following import NewestValues
from urbihw.client.literals import checked_path, written_path
from urbihw.client.robot import Robot as DaemonRobot

TIMEOUT_S: Final = 10.0
ACTION_TIMEOUT_S: Final = 1.0


class Urbihw(Robot):
    """A robot of a daemon.  Its features are asked in the constructor, since LeRobot wants them before it connects."""

    config_class = UrbihwConfig
    name = "urbihw"

    def __init__(self, config: UrbihwConfig) -> None:
        super().__init__(config)
        self.config = config
        self.cameras = make_cameras_from_configs(config.cameras)
        self._daemon: DaemonRobot | None = None
        self._newest: NewestValues | None = None
        with urbihw.connect(config.address, timeout=TIMEOUT_S) as robot:
            self._channels = joint_channels(robot, config.joints, "", config.grippers)
            if config.base:
                self._channels += base_channels(robot)

    @property
    def observation_features(self) -> dict[str, Any]:
        """The numbers, and the shape of each picture."""
        pictures = {name: (camera.height, camera.width, 3) for name, camera in self.cameras.items()}
        return {**self.action_features, **pictures}

    @property
    def action_features(self) -> dict[str, Any]:
        """The numbers, in the order of the joints."""
        return {channel.name: float for channel in self._channels}

    @property
    def is_connected(self) -> bool:
        """Whether the connection to the daemon is there, and all cameras are."""
        return (self._daemon is not None and self._daemon.connected
                and all(camera.is_connected for camera in self.cameras.values()))  # fmt: skip

    @property
    def is_calibrated(self) -> bool:
        """Always: the daemon has the calibration."""
        return True

    def connect(self, calibrate: bool = True) -> None:
        """Connect.  What LeRobot moves belongs to this connection: it stops when LeRobot ends, is killed or held."""
        self._daemon = urbihw.connect(
            self.config.address, timeout=TIMEOUT_S, reconnect=False, lease=self.config.lease
        )
        try:
            self._daemon.run('lobby.introduce("LeRobot")|;', timeout=TIMEOUT_S)
            slots = [channel.slot for channel in self._channels]
            self._newest = NewestValues(self._daemon, slots, self.config.hz, TIMEOUT_S)
            for camera in self.cameras.values():
                camera.connect()
            self.configure()
        except BaseException:
            self.disconnect()
            raise

    def calibrate(self) -> None:
        """Does nothing: ``urbihw calibrate`` does it."""

    def configure(self) -> None:
        """Switch the joints on, which hold where they are."""
        if self.config.torque and self._daemon is not None:
            switch(self._daemon, [channel.slot for channel in self._channels if channel.name.endswith(".pos")], 1)

    def get_observation(self) -> dict[str, Any]:
        """The newest numbers and pictures.  Raises ConnectionError for old ones."""
        if self._newest is None:
            raise ConnectionError("not connected")
        values = self._newest.read(self.config.max_age)
        numbers = {channel.name: channel.to_lerobot(value)
                   for channel, value in zip(self._channels, values, strict=True)}  # fmt: skip
        return {**numbers, **{name: camera.read_latest() for name, camera in self.cameras.items()}}

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Write the goals, all with one tick of the bus, and return what the limits have made of them.  Raises
        UrbiError, during an emergency stop for example."""
        if self._daemon is None:
            raise ConnectionError("not connected")
        chosen = [channel for channel in self._channels if channel.name in action]
        goals = {channel.slot: channel.to_slot(float(action[channel.name])) for channel in chosen}
        told = self._daemon.write(goals, timeout=ACTION_TIMEOUT_S) if goals else {}
        sent = {}
        for channel in chosen:
            applied = told[channel.slot].applied
            # None: the device does not tell; nan: it is off.
            if applied is None or not math.isfinite(applied):
                applied = goals[channel.slot]
            sent[channel.name] = channel.to_lerobot(applied)
        return sent

    def disconnect(self) -> None:
        """End the connection: joints hold where they are, wheels stand."""
        try:
            for camera in self.cameras.values():
                if camera.is_connected:
                    camera.disconnect()
        finally:
            newest, daemon = self._newest, self._daemon
            self._newest = self._daemon = None
            if daemon is not None:
                daemon.close()
            if newest is not None:
                newest.close()


def switch(robot: DaemonRobot, slots: list[str], load: int) -> None:
    """Switch the joints of these slots on (1) or off (0), where they can be switched.  Raises ClientError."""
    for slot in slots:
        joint = written_path(checked_path(slot.removesuffix(".val")))
        robot.run(f'if ({joint}.hasSlot("load")) {joint}.load = {load}|;', timeout=TIMEOUT_S)
