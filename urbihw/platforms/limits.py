"""The table ``[limits]`` of the settings: the limits of each device in SI units, for every program.

::

    [limits]                            # for all devices
    speed = 1.5                         # rad/s; m/s of a base; percent of an NXT motor and a Spykee's track
    temperature = [55, 65, 75]          # degrees C: warn, reduce the torque, release

    [limits.motor6]                     # for one, by the name of its slot, or of its joint (``[devices]``)
    position = [-1.0, 1.0]              # rad; degrees of an NXT motor
    acceleration = 4.0                  # rad/s2, m/s2
    torque = 0.8                        # N m
    voltage = [9.5, 12.6]               # V: outside, a warning

They are enforced in the bus worker.  The manifest of a platform names its devices and their limits;
``LimitedDevice.limits_in_counts`` converts them to raw counts.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any, Final, Self

from urbihw.frozen import frozen
from urbihw.kernel.uobject import BadConfig
from urbihw.settings import Mistake, SettingsTable, checked, guess, positive, rising, setting

Devices = Mapping[str, Collection[str]]
"""The devices of a platform -> their kinds of limits; ``#`` in a name stands for a number, and the name
``*`` for any."""


TEMPERATURES: Final = (-40.0, 200.0)
"""Lowest and highest temperature in degrees C that is of use as a limit: no motor is colder or hotter."""


@frozen(slots=False)
class DeviceLimits(SettingsTable):
    """The limits of one device; inf for no limit.

    Attributes:
        position: lowest and highest: rad, degrees of an NXT motor.
        speed: maximum, in both directions: rad/s, m/s of a base, percent of an NXT motor and a Spykee's track.
        turn: maximum rotation of a base, in both directions: rad/s.
        acceleration: maximum, of wheels, bases and drives: rad/s2, m/s2.
        torque: maximum: N m.
        temperature: degrees C at which to warn, to halve the torque, to switch the motor off.
        voltage: lowest and highest in V; a warning outside.
    """

    position: tuple[float, float] = setting((-math.inf, math.inf), rising(2, "[-1.0, 1.0]"))
    speed: float = setting(math.inf, positive())
    turn: float = setting(math.inf, positive())
    acceleration: float = setting(math.inf, positive())
    torque: float = setting(math.inf, positive())
    temperature: tuple[float, float, float] = setting(
        (math.inf, math.inf, math.inf), rising(3, "[55, 65, 75]", *TEMPERATURES)
    )
    voltage: tuple[float, float] = setting((-math.inf, math.inf), rising(2, "[9.5, 12.6]"))

    def looser(self, before: DeviceLimits) -> Iterator[tuple[str, str]]:
        """Yield the kinds of limits that allow more than they did before, with both values in words."""
        for kind in self.rules():
            old, new = getattr(before, kind), getattr(self, kind)
            if any(now > then for then, now in zip(_upper(kind, old), _upper(kind, new), strict=True)):
                yield kind, f"{_shown(old)} -> {_shown(new)}"


def _upper(kind: str, value: Any) -> tuple[float, ...]:
    """The numbers of a limit, each the higher the more it allows."""
    if kind in ("position", "voltage"):
        return -value[0], value[1]
    return value if isinstance(value, tuple) else (value,)


def _shown(value: Any) -> str:
    numbers = value if isinstance(value, tuple) else (value,)
    if all(map(math.isinf, numbers)):
        return "none"
    texts = ", ".join(f"{each:g}" for each in numbers)
    return f"[{texts}]" if isinstance(value, tuple) else texts


def whole_counts(low: float, high: float) -> tuple[float, float]:
    """Return the lowest and the highest whole count between two numbers; infinite ones stay.

    A target becomes a whole count, and the nearest one may lie beyond a limit.  If no count lies between the two,
    because the limit is finer than the resolution of the device, both are the nearest count.
    """
    least = low if math.isinf(low) else float(math.ceil(low - _ROUNDING * max(1.0, abs(low))))
    most = high if math.isinf(high) else float(math.floor(high + _ROUNDING * max(1.0, abs(high))))
    if least > most:
        least = most = float(round((low + high) / 2))
    return least, most


_ROUNDING = 1e-9  # 0.3 m/s are 299.99999999999994 counts of a mm/s


class LimitSettings:
    """The whole table ``[limits]`` of the settings."""

    def __init__(self, general: Mapping[str, Any], devices: Mapping[str, Mapping[str, Any]]) -> None:
        self._general = general
        self._devices = devices

    @classmethod
    def of(cls, table: Mapping[str, Any]) -> Self:
        """Read the table.  Raises BadConfig for an unknown limit or an invalid value."""
        for mistake in mistakes(table):
            raise BadConfig(f"limits.{mistake}")
        general, devices = _parts(table)
        rules = DeviceLimits.rules()
        return cls(
            checked(rules, general, "limit")[0],
            {device: checked(rules, rows, "limit")[0] for device, rows in devices.items()},
        )

    def device(self, *names: str) -> DeviceLimits:
        """Return the limits of a device by its names."""
        own = {kind: value for name in names for kind, value in self._devices.get(name, {}).items()}
        return DeviceLimits(**{**self._general, **own})

    def looser(self, before: LimitSettings, devices: Iterable[tuple[str, ...]]) -> list[str]:
        """The limits of some devices, given by their names, that allow more than they did before, in words."""
        rows = {
            f"{before.named(kind, *names)} {change}": None
            for names in devices
            for kind, change in self.device(*names).looser(before.device(*names))
        }
        return list(rows)

    @property
    def names(self) -> Collection[str]:
        """The names of devices in the table."""
        return self._devices.keys()

    def unknown(self, names: Collection[str]) -> list[str]:
        """Return the names in the table that are not among these."""
        return [name for name in self._devices if name not in names]

    def named(self, kind: str, *names: str) -> str:
        """Return the setting's name of a limit of a device with these names, for messages."""
        name = next((name for name in names if kind in self._devices.get(name, {})), "")
        return f"limits.{name}.{kind}" if name else f"limits.{kind}"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, LimitSettings):
            return NotImplemented
        return (self._general, self._devices) == (other._general, other._devices)

    def __bool__(self) -> bool:
        return bool(self._general or self._devices)


def mistakes(
    table: Mapping[str, Any], devices: Devices | None = None, joints: Mapping[str, str] | None = None
) -> Iterator[Mistake]:
    """Yield the mistakes in a table; ``devices`` are the possible devices of the platform, None if unknown; ``joints``
    the names of joints -> their devices."""
    joints = joints or {}
    general, by_device = _parts(table)
    everywhere = None if devices is None else {kind for kinds in devices.values() for kind in kinds}
    yield from _wrong(general, "", everywhere)
    for name, rows in by_device.items():
        device = joints.get(name, name)
        if device != name and device in by_device:
            yield Mistake(name, f"is {device}, which has limits of its own: write them in one table")
        pattern = None if devices is None else _pattern(device, devices)
        if pattern is None and devices is not None:
            yield Mistake(name, f"no such device{_guess_device(name, devices, joints)}")
        else:
            yield from _wrong(rows, f"{name}.", None if devices is None or pattern is None else devices[pattern])


def _parts(table: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    """Return the limits for all devices, and those for single devices."""
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
    found = (each for each in devices if re.fullmatch(re.escape(each).replace(r"\#", "[0-9]+"), name))
    return next(found, "*" if "*" in devices else None)


def _guess_device(name: str, devices: Devices, joints: Collection[str]) -> str:
    close = difflib.get_close_matches(re.sub("[0-9]+", "#", name), devices, 1)
    number = re.search("[0-9]+", name)
    if close and (number or "#" not in close[0]):
        return f"; did you mean {close[0].replace('#', number[0] if number else '')}?"
    return guess(name, [*(each.replace("#", "N") for each in devices), *joints])
