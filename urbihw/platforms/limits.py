"""The table ``[limits]`` of the settings: what each device may be asked for, in SI units, whoever asks.

::

    [limits]                            # for all devices
    speed = 1.5                         # rad/s; m/s of a base; a share of 100 of an NXT motor
    temperature = [55, 65, 75]          # degrees C: warn, reduce the torque, release

    [limits.motor6]                     # for one, by the name of its slot
    position = [-1.0, 1.0]              # rad; degrees of an NXT motor
    acceleration = 4.0                  # rad/s2, m/s2
    torque = 0.8                        # N m
    voltage = [9.5, 12.6]               # V: outside, a warning

They are enforced in the bus worker.  A platform says in ``WiredRobot.limit_table`` what they are in raw counts.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, fields
from typing import Any, Self

from urbihw.kernel.uobject import BadConfig


@dataclass(frozen=True, slots=True)
class DeviceLimits:
    """The limits of one device; what has none is infinite.

    Attributes:
        position: least and most.
        speed, turn, acceleration, torque: most, in both directions; ``turn`` is that of a base about its axis.
        temperature: degrees C from which to warn, to reduce the torque to half, to switch the motor off.
        voltage: least and most; outside, a warning.
    """

    position: tuple[float, float] = (-math.inf, math.inf)
    speed: float = math.inf
    turn: float = math.inf
    acceleration: float = math.inf
    torque: float = math.inf
    temperature: tuple[float, float, float] = (math.inf, math.inf, math.inf)
    voltage: tuple[float, float] = (-math.inf, math.inf)


_LENGTHS = {"position": 2, "temperature": 3, "voltage": 2}
KINDS = tuple(each.name for each in fields(DeviceLimits))


class LimitSettings:
    """The whole table."""

    def __init__(self, general: Mapping[str, Any], devices: Mapping[str, Mapping[str, Any]]) -> None:
        self._general = general
        self._devices = devices

    @classmethod
    def of(cls, table: Mapping[str, Any]) -> Self:
        """Check the table.  Raises BadConfig for a kind that does not exist and a value without sense."""
        general = {name: _value("limits", name, value) for name, value in table.items() if not isinstance(value, dict)}
        devices = {
            device: {name: _value(f"limits.{device}", name, value) for name, value in rows.items()}
            for device, rows in table.items()
            if isinstance(rows, dict)
        }
        return cls(general, devices)

    def device(self, name: str) -> DeviceLimits:
        """The limits of a device by the name of its slot."""
        return DeviceLimits(**{**self._general, **self._devices.get(name, {})})

    def unknown(self, names: Collection[str]) -> list[str]:
        """The devices of the table that are none of these."""
        return [name for name in self._devices if name not in names]

    def named(self, device: str, kind: str) -> str:
        """How the settings call a limit, for messages."""
        return f"limits.{device}.{kind}" if kind in self._devices.get(device, {}) else f"limits.{kind}"

    def __bool__(self) -> bool:
        return bool(self._general or self._devices)


def _value(place: str, name: str, value: Any) -> Any:
    if name not in KINDS:
        close = difflib.get_close_matches(name, KINDS, 1)
        guess = f"did you mean {close[0]}?" if close else f"there are: {', '.join(KINDS)}"
        raise BadConfig(f"{place}.{name}: no such limit; {guess}")
    length = _LENGTHS.get(name, 0)
    if not length:
        if not _is_number(value) or value <= 0:
            raise BadConfig(f"{place}.{name}: wants a number above 0, not {value!r}")
        return float(value)
    rising = isinstance(value, list | tuple) and len(value) == length and all(map(_is_number, value))
    if not rising or list(value) != sorted(value) or value[0] == value[-1]:
        raise BadConfig(f"{place}.{name}: wants {length} rising numbers, such as {_EXAMPLES[name]}, not {value!r}")
    return tuple(map(float, value))


_EXAMPLES = {"position": "[-1.0, 1.0]", "temperature": "[55, 65, 75]", "voltage": "[9.5, 12.6]"}


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
