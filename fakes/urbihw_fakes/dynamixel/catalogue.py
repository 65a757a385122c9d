"""All models by name, and chains of them by text: `make_servos("MX-28:3,XL-320:4")`."""

from __future__ import annotations

from collections.abc import Callable

from urbihw_fakes.dynamixel.ax12 import Ax12
from urbihw_fakes.dynamixel.axs1 import AxS1
from urbihw_fakes.dynamixel.families import FAMILIES
from urbihw_fakes.dynamixel.servo import Servo1, Servo2
from urbihw_fakes.dynamixel.unit import Unit
from urbihw_fakes.dynamixel.xseries import XSeries
from urbihw_fakes.dynamixel.xtables import MODELS
from urbihw_fakes.errors import UnknownRequest


def _of_family(model: str) -> Callable[[int], Unit]:
    modern = any(row.name == "hardware_error" for row in FAMILIES[model].rows)
    return lambda unit: Servo2(model, unit) if modern else Servo1(model, unit)


def _of_x_series(model: str) -> Callable[[int], Unit]:
    return lambda unit: XSeries(model, unit)


UNITS: dict[str, Callable[[int], Unit]] = {
    "AX-12": Ax12,
    "AX-S1": AxS1,
    **{model: _of_x_series(model) for model in MODELS},
    **{model: _of_family(model) for model in FAMILIES},
}
"""Name of a model -> makes one with an id."""


def make_servo(model: str, unit: int) -> Unit:
    """Return a unit of this model with this id; a name may be cut short where that is enough ("XL330").

    Raises:
        UnknownRequest: there is no such model.
    """
    name = model if model in UNITS else next((each for each in UNITS if each.startswith(model)), "")
    if not model or not name:
        raise UnknownRequest(f"model {model!r}: not simulated; there are {', '.join(UNITS)}")
    return UNITS[name](unit)


def make_servos(text: str) -> list[Unit]:
    """Return the units of a text such as "MX-28:3,XL-320:4": model and id, separated by commas.

    Raises:
        UnknownRequest: a model or an id makes no sense.
    """
    units = []
    for part in text.split(","):
        model, _, number = part.strip().partition(":")
        if not number.isdecimal() or int(number) > 252:
            raise UnknownRequest(f"{part.strip()!r}: say MODEL:ID, for instance MX-28:3, with an id of 0..252")
        units.append(make_servo(model, int(number)))
    return units
