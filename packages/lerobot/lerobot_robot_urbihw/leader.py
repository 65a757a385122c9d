"""The leader of LeRobot: an arm that a daemon serves and a hand moves."""

from __future__ import annotations

from typing import Any

from lerobot.teleoperators.teleoperator import Teleoperator

import urbihw
from lerobot_robot_urbihw.channels import joint_channels
from lerobot_robot_urbihw.configs import UrbihwLeaderConfig
from lerobot_robot_urbihw.follower import TIMEOUT_S, switch
from lerobot_robot_urbihw.following import NewestValues
from urbihw.client.robot import Robot as DaemonRobot


class UrbihwLeader(Teleoperator):
    """Where the joints of an arm are, as an action for a robot with joints of the same names."""

    config_class = UrbihwLeaderConfig
    name = "urbihw_leader"

    def __init__(self, config: UrbihwLeaderConfig) -> None:
        super().__init__(config)
        self.config = config
        self._daemon: DaemonRobot | None = None
        self._newest: NewestValues | None = None
        with urbihw.connect(config.address, timeout=TIMEOUT_S) as robot:
            self._channels = joint_channels(robot, config.joints, config.prefix, config.grippers)

    @property
    def action_features(self) -> dict[str, Any]:
        """The numbers, in the order of the joints."""
        return {channel.name: float for channel in self._channels}

    @property
    def feedback_features(self) -> dict[str, Any]:
        """There is no feedback."""
        return {}

    @property
    def is_connected(self) -> bool:
        """Whether the connection to the daemon is there."""
        return self._daemon is not None and self._daemon.connected

    @property
    def is_calibrated(self) -> bool:
        """Always: the daemon has the calibration."""
        return True

    def connect(self, calibrate: bool = True) -> None:
        """Connect, and follow the joints."""
        self._daemon = urbihw.connect(self.config.address, timeout=TIMEOUT_S, reconnect=False)
        try:
            self._daemon.run('lobby.introduce("LeRobot, leader")|;', timeout=TIMEOUT_S)
            slots = [channel.slot for channel in self._channels]
            self._newest = NewestValues(self._daemon, slots, self.config.hz, TIMEOUT_S)
            self.configure()
        except BaseException:
            self.disconnect()
            raise

    def calibrate(self) -> None:
        """Does nothing: ``urbihw calibrate`` does it."""

    def configure(self) -> None:
        """Switch the joints off, if that is wanted: hold the arm."""
        if self.config.loose and self._daemon is not None:
            switch(self._daemon, [channel.slot for channel in self._channels], 0)

    def get_action(self) -> dict[str, Any]:
        """Where the joints are.  Raises ConnectionError for old values."""
        if self._newest is None:
            raise ConnectionError("not connected")
        values = self._newest.read(self.config.max_age)
        return {channel.name: channel.to_lerobot(value) for channel, value in zip(self._channels, values, strict=True)}

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Does nothing: there is no feedback."""

    def disconnect(self) -> None:
        """End the connection to the daemon; the arm stays as it is."""
        if self._newest is not None:
            self._newest.close()
        if self._daemon is not None:
            self._daemon.close()
        self._newest = self._daemon = None
