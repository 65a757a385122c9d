"""What a measured item or a target means: a quantity with its SI unit, for the watch on the health of a robot.

The quantities have the same names for all families: "position", "speed", "load", "current", "voltage", "temperature",
"torque", "charge", and "alarm", whose value is a text.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

ALARM: Final = "alarm"


class Quantity(NamedTuple):
    """The meaning of an item: its name, the SI unit ("" for a ratio), and the SI value of one count."""

    name: str
    unit: str
    step: float = 1.0


class Reading(NamedTuple):
    """A value in SI units.

    Attributes:
        quantity: what it is.
        value: in `unit`; a text for "alarm", "" while there is none.
        unit: of the SI, "" for a ratio or a text.
        low, high: the range that the maker of the device allows; nan if unknown.
    """

    quantity: str
    value: float | str
    unit: str = ""
    low: float = math.nan
    high: float = math.nan


def reading_of(quantities: Mapping[str, Quantity], item: str, raw: Any) -> Reading | None:
    """Return the reading of an item by a table of quantities; None for other items and for what is no number."""
    found = quantities.get(item)
    if found is None or raw.__class__ is bool or not isinstance(raw, int | float):
        return None
    return Reading(found.name, raw * found.step, found.unit)
