"""What the settings of a robot on a servo bus may say: the options of the bus, and the calibration file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from urbihw.buses.servos.options import Options
from urbihw.settings import TEXT, setting

CALIBRATION: Final = "calibration"


@dataclass(frozen=True)
class ServoOptions(Options):
    """The options of the platform.

    Attributes:
        calibration: path of the calibration file, as ``urbihw calibrate`` writes it; "" for none.
    """

    calibration: str = setting("", TEXT, file=True)


def for_driver(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options that the driver of the bus knows."""
    return {name: value for name, value in options.items() if name != CALIBRATION}
