"""What urbiscript wrote into a slot, checked."""

from __future__ import annotations

import math

from urbihw.kernel.uobject import UVar


def number(var: UVar) -> float:
    """A float; true and false are 1 and 0.  Raises ValueError for anything else, which the writer is told."""
    return checked(var.value)


def checked(value: object) -> float:
    """The same of a value."""
    if not isinstance(value, int | float):
        raise ValueError("this slot takes a number")
    if not math.isfinite(value):
        raise ValueError("this slot takes a finite number")
    return float(value)


def numbers(value: object, least: int, most: int, what: str) -> list[float]:
    """A list of ``least`` to ``most`` finite numbers.  Raises ValueError, saying ``what`` is wanted."""
    if not isinstance(value, list | tuple) or not least <= len(value) <= most:
        raise ValueError(f"expected {what}")
    try:
        return [checked(member) for member in value]
    except ValueError:
        raise ValueError(f"expected {what}, finite numbers") from None


def set_range(var: UVar, least: float, most: float) -> None:
    """Clamp what urbiscript writes to least..most, visibly."""
    var.set_property("rangemin", least)
    var.set_property("rangemax", most)
