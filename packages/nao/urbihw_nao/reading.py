"""What is read of ALMemory: the keys, by device and item (fact sheet, section 9)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

PREFIX: Final = "Device/SubDeviceList/"
SENSORS: Final[Mapping[str, tuple[str, ...]]] = {
    "sonarL": ("US/Left/Sensor/Value",),
    "sonarR": ("US/Right/Sensor/Value",),
    "headTouchF": ("Head/Touch/Front/Sensor/Value",),
    "headTouchM": ("Head/Touch/Middle/Sensor/Value",),
    "headTouchR": ("Head/Touch/Rear/Sensor/Value",),
    "bumperLL": ("LFoot/Bumper/Left/Sensor/Value",),
    "bumperLR": ("LFoot/Bumper/Right/Sensor/Value",),
    "bumperRL": ("RFoot/Bumper/Left/Sensor/Value",),
    "bumperRR": ("RFoot/Bumper/Right/Sensor/Value",),
    # The second name is that of robots before NAOqi 2.
    "accelX": ("InertialSensor/AccelerometerX/Sensor/Value", "InertialSensor/AccX/Sensor/Value"),
    "accelY": ("InertialSensor/AccelerometerY/Sensor/Value", "InertialSensor/AccY/Sensor/Value"),
    "accelZ": ("InertialSensor/AccelerometerZ/Sensor/Value", "InertialSensor/AccZ/Sensor/Value"),
    "gyroX": ("InertialSensor/GyroscopeX/Sensor/Value", "InertialSensor/GyrX/Sensor/Value"),
    "gyroY": ("InertialSensor/GyroscopeY/Sensor/Value", "InertialSensor/GyrY/Sensor/Value"),
    "charge": ("Battery/Charge/Sensor/Value",),
    "current": ("Battery/Current/Sensor/Value",),
    "angleX": ("InertialSensor/AngleX/Sensor/Value",),
    "angleY": ("InertialSensor/AngleY/Sensor/Value",),
    "weightL": ("LFoot/FSR/TotalWeight/Sensor/Value",),
    "weightR": ("RFoot/FSR/TotalWeight/Sensor/Value",),
}
"""Item of the device ``SENSOR`` -> its keys behind PREFIX, newest name first."""
CONTACTS: Final[Mapping[str, str]] = {
    "contact": "footContact", "contactL": "leftFootContact", "contactR": "rightFootContact",
    "hasFallen": "robotHasFallen",
}  # fmt: skip
"""The same without PREFIX.  Whether and when NAOqi takes back ``robotHasFallen`` is unconfirmed."""
SENSOR: Final = "sensors"
OUTSIDE: Final = 0.3
"""Rad beyond its range at which an angle of a joint is no measurement."""

MOST_PARTS: Final = 1000
MOST_CHARACTERS: Final = 10_000
"""What a value of ALMemory may have that goes to programs by itself: as a followed variable or an event."""

Key = tuple[str, str]
"""Device and item."""


def joint_keys(joints: Sequence[str]) -> dict[str, Key]:
    """What is read in each cycle."""
    found = {f"{PREFIX}{name}/Position/Sensor/Value": (name, "angle") for name in joints}
    return found | {f"{PREFIX}{name}/Hardness/Actuator/Value": (name, "stiffness") for name in joints}


def slow_keys(joints: Sequence[str]) -> dict[str, Key]:
    """What is read now and then: all names that there may be, those of each sensor in the order of ``SENSORS``."""
    found = {PREFIX + name: (SENSOR, item) for item, names in SENSORS.items() for name in names}
    found |= {name: (SENSOR, item) for item, name in CONTACTS.items()}
    return found | {f"{PREFIX}{name}/Temperature/Sensor/Value": (name, "temperature") for name in joints}


def known_keys(keys: Mapping[str, Key], values: Sequence[Any]) -> dict[str, Key]:
    """The keys that this robot has, by a first reading: the first of several names of a sensor."""
    found: dict[str, Key] = {}
    for (name, key), value in zip(keys.items(), values, strict=True):
        if _number(value) is not None and key not in found.values():
            found[name] = key
    return found


def sort_values(keys: Mapping[str, Key], values: Any) -> dict[str, dict[str, float]]:
    """Device -> item -> value; what is no number is left out."""
    found: dict[str, dict[str, float]] = {}
    if isinstance(values, list) and len(values) == len(keys):
        for (device, item), value in zip(keys.values(), values, strict=True):
            number = _number(value)
            if number is not None:
                found.setdefault(device, {})[item] = number
    return found


def is_bounded(value: Any) -> bool:
    """Whether a value of ALMemory is one for programs: no bytes, at most MOST_PARTS numbers, texts and lists in it, and
    MOST_CHARACTERS in its texts together.
    """
    parts = characters = 0
    waiting = [value]
    while waiting:
        one = waiting.pop()
        parts += 1
        if isinstance(one, str):
            characters += len(one)
        elif isinstance(one, list | tuple):
            waiting += one
        elif isinstance(one, dict):
            waiting += [*one.keys(), *one.values()]
        elif not (one is None or isinstance(one, bool | int | float)):
            return False
        if parts + len(waiting) > MOST_PARTS or characters > MOST_CHARACTERS:
            return False
    return True


def _number(value: Any) -> float | None:
    if isinstance(value, bool | int | float) and math.isfinite(value):
        return float(value)
    return None
