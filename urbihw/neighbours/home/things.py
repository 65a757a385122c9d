"""What the broker gets to know of a robot: topics, the discovery of Home Assistant, the state.

Source of the fields: ``components/mqtt/schemas.py`` of Home Assistant and its page on MQTT discovery: a retained JSON
at ``homeassistant/device/ID/config`` with ``dev``, ``o`` and ``cmps``.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

MAX_THINGS: Final = 100
"""Most things of a robot that a home sees."""
DIGITS: Final = 2
PROBLEMS: Final = "robot.problems"
ESTOP: Final = "robot.estop"
_UNSAFE: Final = re.compile(r"[^A-Za-z0-9_]+")
_UNITS: Final = {"degC": "\u00b0C", "deg": "\u00b0", "1": "", "ratio": ""}
"""Unit of a slot -> that of Home Assistant, where they differ."""
_CLASSES: Final = {"V": "voltage", "A": "current", "degC": "temperature", "m": "distance"}
"""Unit of a slot -> the class of a sensor."""
_FULL: Final = 100
_TELLING: Final = ("joint", "wheel", "distance", "touch", "battery", "sensor")
"""Roles of the overview whose values are numbers for a home."""


class HomeThing(NamedTuple):
    """A slot that the home sees: its name there, its role and unit, and the ends of its range if it may be moved."""

    name: str
    slot: str
    role: str
    unit: str
    ends: tuple[float, float] | None = None


class HomeTopics(NamedTuple):
    """The topics of a robot."""

    id: str

    @property
    def root(self) -> str:
        """What all topics begin with."""
        return f"urbihw/{self.id}"

    @property
    def state(self) -> str:
        """The values, as a JSON text."""
        return f"{self.root}/state"

    @property
    def availability(self) -> str:
        """``online`` or ``offline``, retained."""
        return f"{self.root}/availability"

    @property
    def error(self) -> str:
        """Why an order was not carried out."""
        return f"{self.root}/error"

    @property
    def stop(self) -> str:
        """Any message stops the robot."""
        return f"{self.root}/stop"

    def goal(self, name: str) -> str:
        """A goal for a joint."""
        return f"{self.root}/set/{name}"


def safe(name: str) -> str:
    """A name that can stand in a topic and in a template."""
    return _UNSAFE.sub("_", name).strip("_")[:64]


def things_of(overview: Mapping[str, Any], joints: Sequence[str]) -> list[HomeThing]:
    """The things of a robot; ``joints`` may be moved.  Raises ValueError for one that there is not, or that has no
    range."""
    found = []
    rows = [row for row in (*overview["effectors"], *overview["sensors"]) if row["role"] in _TELLING]
    rows.sort(key=lambda row: str(row["slot"]).removesuffix(".val") not in joints)  # what may be moved is not left out
    for row in rows[:MAX_THINGS]:
        slot = str(row["slot"])
        joint = slot.removesuffix(".val")
        ends = None
        if row["role"] == "joint" and joint in joints:
            if "min" not in row or "max" not in row:
                raise ValueError(f"{joint} has no range, so a home cannot move it")
            ends = (float(row["min"]), float(row["max"]))
        found.append(HomeThing(safe(joint), slot, str(row["role"]), str(row.get("unit") or ""), ends))
    missing = {*joints} - {thing.slot.removesuffix(".val") for thing in found if thing.ends}
    if missing:
        raise ValueError(f"there is no joint {', '.join(sorted(missing))}")
    return found


def discovery_text(topics: HomeTopics, robot: str, model: str, things: Sequence[HomeThing]) -> str:
    """The discovery of a robot, as a JSON text."""
    parts = {thing.name: _part(topics, thing) for thing in things}
    parts["stop"] = {"p": "button", "name": "stop", "command_topic": topics.stop, "retain": False}
    for name, kind in (("estop", "safety"), ("problem", "problem")):
        parts[name] = {"p": "binary_sensor", "name": name, "device_class": kind, "state_topic": topics.state,
                       "value_template": f"{{{{ 'ON' if value_json.{name} else 'OFF' }}}}"}  # fmt: skip
    parts["problem"].update(json_attributes_topic=topics.state,
                            json_attributes_template="{{ {'problems': value_json.problem} | tojson }}")  # fmt: skip
    for name, part in parts.items():
        part["unique_id"] = f"urbihw_{topics.id}_{name}"
    device = {"identifiers": [f"urbihw_{topics.id}"], "name": robot, "model": model, "manufacturer": "urbihw"}
    return json.dumps({"dev": device, "o": {"name": "urbihw"}, "cmps": parts,
                       "availability_topic": topics.availability}, separators=(",", ":"))  # fmt: skip


def _part(topics: HomeTopics, thing: HomeThing) -> dict[str, Any]:
    """One thing of the discovery."""
    part: dict[str, Any] = {"p": "sensor", "name": thing.name, "state_topic": topics.state,
                            "value_template": f"{{{{ value_json.{thing.name} }}}}"}  # fmt: skip
    if thing.role == "battery" and thing.slot.endswith(".remain"):
        part.update(device_class="battery", unit_of_measurement="%", state_class="measurement")
        return part
    unit = _UNITS.get(thing.unit, thing.unit)
    if unit:
        part.update(unit_of_measurement=unit, state_class="measurement")
    if thing.unit in _CLASSES:
        part["device_class"] = _CLASSES[thing.unit]
    if thing.ends is not None:
        part.pop("state_class", None)
        part.pop("device_class", None)
        part.update(p="number", command_topic=topics.goal(thing.name), optimistic=False, retain=False, qos=0,
                    min=thing.ends[0], max=thing.ends[1], step=0.01)  # fmt: skip
    return part


def state_text(things: Sequence[HomeThing], values: Sequence[Any]) -> str:
    """The state as a JSON text; ``values`` are those of the things, of ``ESTOP`` and of ``PROBLEMS``."""
    *numbers, estop, problems = values
    state: dict[str, Any] = {}
    for thing, value in zip(things, numbers, strict=True):
        number = float(value) if isinstance(value, int | float) else None
        if number is not None and thing.role == "battery" and thing.slot.endswith(".remain"):
            number = round(number * _FULL)
        state[thing.name] = number if number is None else round(number, DIGITS)
    state["estop"] = bool(estop)
    state["problem"] = [str(each)[:200] for each in problems[:10]] if isinstance(problems, list) else []
    return json.dumps(state, separators=(",", ":"))
