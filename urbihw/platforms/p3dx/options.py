"""What the configuration may say of a Pioneer: ``[options]`` in ``urbihw.toml``."""

from __future__ import annotations

from typing import ClassVar, Final

from urbihw.frozen import frozen
from urbihw.navigation.options import DrivenBaseOptions
from urbihw.platforms.camera import CameraOptions
from urbihw.platforms.p3dx.camera import CAMERAS
from urbihw.platforms.p3dx.factors import FACTORS
from urbihw.settings import TEXT, choice, number, setting

HOST_BAUDS: Final = {9600: 0, 19200: 1, 38400: 2, 57600: 3, 115200: 4}
"""Speed of the line -> argument of HOSTBAUD."""
FUSED: Final = "fused"
SHOWN: Final = "shown"
SIMULATED: Final = "sim"
"""Value in place of a url for the laser of MobileSim, whose scans come with the robot's packets."""


@frozen(slots=False)
class P3dxOptions(DrivenBaseOptions, CameraOptions):
    """The options, beside those of navigation and of the camera's pictures.

    Attributes:
        radius: as for every base; 0 for that of the subclass.
        subclass: whose conversion factors to use (see ``factors``), "" for what the robot says.
        laser: url of the laser's line, "sim" for the one of MobileSim, "" for what the robot's url says (``?laser=``).
        host_baud: ask the controller for this speed after connecting (0: stay); only with a firmware that allows it.
        camera_model: the camera on AUX1: "evi-d30" (Sony) or "vc-c4" (Canon).
        gyro: "fused": a gyro that only reports gives the heading of the odometry; "shown": it does not.
    """

    own_lasers: ClassVar[tuple[str, ...]] = (SIMULATED,)

    radius: float = setting(0.0, number(0.0, 3.0, " m"))
    subclass: str = setting("", choice("", *FACTORS))
    laser: str = setting("", TEXT, in_url=True)
    host_baud: int = setting(0, choice(0, *HOST_BAUDS))

    camera_model: str = setting("evi-d30", choice(*CAMERAS))
    gyro: str = setting(FUSED, choice(FUSED, SHOWN))
