"""Checked access to values written by urbiscript, for callbacks of devices; the writer gets the ValueError."""

from __future__ import annotations

import math

from urbihw.kernel.uobject.uvar import UVar


def number(var: UVar) -> float:
    """The value of a variable as a finite float; true and false count as 1 and 0.  Raises ValueError for any other
    value.
    """
    return finite_number(var.value)


def finite_number(value: object) -> float:
    """A value as a finite float.  Raises ValueError for any other value."""
    if not isinstance(value, int | float):
        raise ValueError("this slot takes a number")
    if not math.isfinite(value):
        raise ValueError("this slot takes a finite number")
    return float(value)


def finite_numbers(value: object, least: int, most: int, what: str) -> list[float]:
    """A list of ``least`` to ``most`` finite numbers.  Raises ValueError with the message that ``what`` was
    expected.
    """
    if not isinstance(value, list | tuple) or not least <= len(value) <= most:
        raise ValueError(f"expected {what}")
    try:
        return [finite_number(member) for member in value]
    except ValueError:
        raise ValueError(f"expected {what}, finite numbers") from None


def set_range(var: UVar, least: float, most: float) -> None:
    """Limit what urbiscript writes to least..most; both are visible as the properties ``rangemin`` and ``rangemax``."""
    var.set_property("rangemin", least)
    var.set_property("rangemax", most)
