"""What the settings of an SO-101 may say beyond those of every servo bus."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from urbihw.frozen import frozen
from urbihw.platforms.servos.options import ServoOptions, check_calibration
from urbihw.settings import TEXT, Mistake, setting

LEADER: Final = "leader"
LEADER_CALIBRATION: Final = "leader_calibration"


@frozen(slots=False)
class So101Options(ServoOptions):
    """The options of the platform.

    Attributes:
        leader: url of the bus of the leader arm, which is only read; "" for none.
        leader_calibration: path of its calibration file; "" for none.
    """

    leader: str = setting("", TEXT)
    leader_calibration: str = setting("", TEXT, file=True)

    def unusable_files(self) -> Iterator[Mistake]:
        """See ``Table``: the calibrations of both arms."""
        yield from super().unusable_files()
        yield from check_calibration(LEADER_CALIBRATION, self.leader_calibration)
