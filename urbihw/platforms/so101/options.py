"""What the settings of an SO-101 may say beyond those of every servo bus."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from urbihw.platforms.servos.options import ServoOptions
from urbihw.settings import TEXT, setting

LEADER: Final = "leader"
LEADER_CALIBRATION: Final = "leader_calibration"


@dataclass(frozen=True)
class Options(ServoOptions):
    """The options of the platform.

    Attributes:
        leader: url of the bus of the leader arm, which is only read; "" for none.
        leader_calibration: path of its calibration file; "" for none.
    """

    leader: str = setting("", TEXT)
    leader_calibration: str = setting("", TEXT, file=True)
