"""What the settings of a robot on a servo bus may say: the options of the bus, and the calibration file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from urbihw.buses.servos import calibration
from urbihw.buses.servos.calibration import BadCalibration
from urbihw.buses.servos.options import ServoBusOptions
from urbihw.figure import BadFigure
from urbihw.figure.model import read
from urbihw.frozen import frozen
from urbihw.settings import TEXT, Mistake, setting

CALIBRATION: Final = "calibration"
FIGURE: Final = "figure"


@frozen(slots=False)
class ServoOptions(ServoBusOptions):
    """The options of the platform.

    Attributes:
        calibration: path of the calibration file, as ``urbihw calibrate`` writes it; "" for none.
        figure: path of a figure.toml: which joint hangs on which, and what is drawn; "" for none.
    """

    calibration: str = setting("", TEXT, file=True)
    figure: str = setting("", TEXT, file=True)

    def unusable_files(self) -> Iterator[Mistake]:
        """See ``Table``: the calibration and the figure."""
        yield from check_calibration(CALIBRATION, self.calibration)
        if self.figure:
            try:
                read(Path(self.figure))
            except BadFigure as error:
                yield Mistake(FIGURE, str(error))


def check_calibration(key: str, path: str) -> Iterator[Mistake]:
    """Yield what is wrong with a calibration file that a row names; "" names none."""
    if path:
        try:
            calibration.load(path)
        except BadCalibration as error:
            yield Mistake(key, str(error))


def for_driver(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options that the driver of the bus knows."""
    return {name: value for name, value in options.items() if name not in (CALIBRATION, FIGURE)}
