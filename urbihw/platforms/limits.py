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

They are enforced in the bus worker.  Which devices a platform has and which limits they know says its manifest; what
those are in raw counts, ``Limited.limits_in_counts``.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Self

from urbihw.kernel.uobject import BadConfig
from urbihw.settings import Mistake, Table, checked, guess, positive, rising, setting

Devices = Mapping[str, Collection[str]]
"""The devices of a platform -> the limits they know; ``#`` in a name stands for a number."""


@dataclass(frozen=True)
class DeviceLimits(Table):
    """The limits of one device; what has none is infinite.

    Attributes:
        position: least and most: rad, degrees of an NXT motor.
        speed: most, in both directions: rad/s, m/s of a base, share of 100 of an NXT motor.
        turn: most of a base about its axis, in both directions: rad/s.
        acceleration: most, of wheels, bases and drives: rad/s2, m/s2.
        torque: most: N m.
        temperature: degrees C from which to warn, to reduce the torque to half, to switch the motor off.
        voltage: least and most in V; outside, a warning.
    """

    position: tuple[float, float] = setting((-math.inf, math.inf), rising(2, "[-1.0, 1.0]"))
    speed: float = setting(math.inf, positive())
    turn: float = setting(math.inf, positive())
    acceleration: float = setting(math.inf, positive())
    torque: float = setting(math.inf, positive())
    temperature: tuple[float, float, float] = setting((math.inf, math.inf, math.inf), rising(3, "[55, 65, 75]"))
    voltage: tuple[float, float] = setting((-math.inf, math.inf), rising(2, "[9.5, 12.6]"))


def whole_counts(low: float, high: float) -> tuple[float, float]:
    """The whole counts that lie between two numbers of counts; infinite ones stay.

    A target becomes a whole count, and the nearest one may lie beyond a limit.  Where no count lies between the two, as
    for a limit finer than the device, both are the one that is nearest.
    """
    least = low if math.isinf(low) else float(math.ceil(low - _ROUNDING * max(1.0, abs(low))))
    most = high if math.isinf(high) else float(math.floor(high + _ROUNDING * max(1.0, abs(high))))
    if least > most:
        least = most = float(round((low + high) / 2))
    return least, most


_ROUNDING = 1e-9  # 0.3 m/s are 299.99999999999994 counts of a mm/s


class LimitSettings:
    """The whole table."""

    def __init__(self, general: Mapping[str, Any], devices: Mapping[str, Mapping[str, Any]]) -> None:
        self._general = general
        self._devices = devices

    @classmethod
    def of(cls, table: Mapping[str, Any]) -> Self:
        """Take the table.  Raises BadConfig for a limit that does not exist and a value without sense."""
        for mistake in mistakes(table):
            raise BadConfig(f"limits.{mistake}")
        general, devices = _parts(table)
        rules = DeviceLimits.rules()
        return cls(
            checked(rules, general, "limit")[0],
            {device: checked(rules, rows, "limit")[0] for device, rows in devices.items()},
        )

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


def mistakes(table: Mapping[str, Any], devices: Devices | None = None) -> Iterator[Mistake]:
    """What is wrong with a table; ``devices`` are those that the platform may have, None if it is not known which."""
    general, by_device = _parts(table)
    everywhere = None if devices is None else {kind for kinds in devices.values() for kind in kinds}
    yield from _wrong(general, "", everywhere)
    for name, rows in by_device.items():
        pattern = None if devices is None else _pattern(name, devices)
        if pattern is None and devices is not None:
            yield Mistake(name, f"no such device{_guess_device(name, devices)}")
        else:
            yield from _wrong(rows, f"{name}.", None if devices is None or pattern is None else devices[pattern])


def _parts(table: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    """What is for all devices, and what is for one each."""
    devices = {name: rows for name, rows in table.items() if isinstance(rows, dict)}
    return {name: value for name, value in table.items() if name not in devices}, devices


def _wrong(rows: Mapping[str, Any], place: str, known: Collection[str] | None) -> Iterator[Mistake]:
    rules = {kind: rule for kind, rule in DeviceLimits.rules().items() if known is None or kind in known}
    for mistake in checked(rules, rows, "limit")[1]:
        if mistake.key in rules or mistake.key not in DeviceLimits.rules():
            yield Mistake(place + mistake.key, mistake.text)
        else:
            who = f"{place.removesuffix('.')} has no" if place else "no device of this platform has"
            yield Mistake(place + mistake.key, f"{who} such limit; there are: {', '.join(rules)}")


def _pattern(name: str, devices: Devices) -> str | None:
    return next((each for each in devices if re.fullmatch(re.escape(each).replace(r"\#", "[0-9]+"), name)), None)


def _guess_device(name: str, devices: Devices) -> str:
    close = difflib.get_close_matches(re.sub("[0-9]+", "#", name), devices, 1)
    number = re.search("[0-9]+", name)
    if close and (number or "#" not in close[0]):
        return f"; did you mean {close[0].replace('#', number[0] if number else '')}?"
    return guess(name, [each.replace("#", "N") for each in devices])
