"""Any robot that urbihw serves, for LeRobot (docs/lerobot.md): ``--robot.type=urbihw``,
``--teleop.type=urbihw_leader``, cameras of the ``type: urbihw_camera``.

LeRobot imports this package because of the name of its distribution, and finds the class of a configuration here.  It
is a client of the daemon, by ``urbihw.connect``: limits, leases and emergency stop hold.

Reading order: ``channels`` (numbers of LeRobot and slots), ``following`` (the newest value), ``configs``, ``follower``,
``leader``, ``camera``.  Only the last four import LeRobot.
"""

from lerobot_robot_urbihw.camera import UrbihwCamera
from lerobot_robot_urbihw.configs import UrbihwCameraConfig, UrbihwConfig, UrbihwLeaderConfig
from lerobot_robot_urbihw.follower import Urbihw
from lerobot_robot_urbihw.leader import UrbihwLeader

__all__ = ["Urbihw", "UrbihwCamera", "UrbihwCameraConfig", "UrbihwConfig", "UrbihwLeader", "UrbihwLeaderConfig"]
