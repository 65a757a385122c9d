"""The table ``[devices]``: what it may say, and what is refused in one line."""

from __future__ import annotations

import math
from typing import Any

import pytest
from taken_names import FILE, text

from urbihw.kernel.uobject import BadConfig
from urbihw.platforms import expected

MODELS = ("AX-12A", "AX-S1")


def told(table: dict[str, Any]) -> list[str]:
    return [str(each) for each in expected.mistakes(table, MODELS, ("bioloid",))]


def test_a_number_is_the_id_and_a_table_has_more() -> None:
    row = {"id": 4, "model": "AX-12A", "firmware": 24, "offset": 1, "direction": -1, "limits": [-1, 1], "groups": ["a"]}
    made = expected.read({"hip_l": 3, "hip_r": row})
    assert (made["hip_l"].id, made["hip_l"].limits, made["hip_l"].direction) == (3, (-math.inf, math.inf), 1)
    assert made["hip_r"] == expected.DeviceSettings(4, "AX-12A", "24", 1.0, -1, (-1.0, 1.0), ("a",))
    assert told({"hip_l": 3, "hip_r": row}) == []


def test_the_worker_gets_what_it_can_compare() -> None:
    (made,) = expected.for_worker({"hip": {"id": 3, "model": "AX-12A", "firmware": "3.10"}})
    assert (made.id, made.name, made.model, made.firmware) == (3, "hip", "AX-12A", "3.10")


@pytest.mark.parametrize(
    ("table", "line"),
    [
        ({"a": 3, "b": 3}, "b: id 3 already belongs to a"),
        ({"a b": 3}, "a b: is no name in urbiscript: letters, digits and _ only, and no keyword"),
        ({"while": 3}, "while: is no name in urbiscript: letters, digits and _ only, and no keyword"),
        ({"link": 3}, "link: is a slot of urbiscript or of the robot; choose another name"),
        ({"bioloid": 3}, "bioloid: is a slot of urbiscript or of the robot; choose another name"),
        ({"motor4": 3}, "motor4: is the name of the device with id 4; choose another name"),
        ({"a": "3"}, "a: wants the id of a device, a whole number from 0 to 253, or a table"),
        ({"a": 254}, "a: wants the id of a device, a whole number from 0 to 253, or a table"),
        ({"a": {"model": "AX-12A"}}, "a: has no id; add id = 3"),
        ({"a": {"id": 3, "modell": "AX-12A"}}, "a.modell: no such key; did you mean model?"),
        ({"a": {"id": 3, "model": "AX-12"}}, 'a.model: no model "AX-12" is known; did you mean AX-12A?'),
        ({"a": {"id": 3, "direction": 0}}, "a.direction: wants one of 1, -1, not 0"),
        ({"a": {"id": 3, "limits": [1, -1]}}, "a.limits: wants 2 rising numbers, such as [-1.0, 1.0], not [1, -1]"),
        ({"a": {"id": 3, "groups": ["if"]}}, 'a.groups: "if" cannot be the name of a group'),
        ({"a": {"id": 3, "groups": ["bioloid"]}}, 'a.groups: "bioloid" cannot be the name of a group'),
        ({"a" * 65: 3}, "a" * 65 + ": is longer than 64 characters"),
        ({"a": {"id": 3, "groups": ["b" * 65]}}, 'a.groups: "' + "b" * 65 + '" cannot be the name of a group'),
        ({"a": {"id": 3, "groups": ["motor4"]}}, 'a.groups: "motor4" cannot be the name of a group'),
        ({"a": {"id": 3, "groups": ["b"]}, "b": 4}, "b: is the name of a device and of a group; rename one of them"),
    ],
)
def test_what_is_wrong_is_one_line(table: dict[str, Any], line: str) -> None:
    assert told(table) == [line]


@pytest.mark.parametrize(
    "name",
    ["val", "Global", "System", "load", "Math", "Tag", "Lobby", "pGain", "entries", "motorTable", "estop", "echo"],
)
def test_a_name_that_would_hide_a_slot_is_refused(name: str) -> None:
    assert told({name: 3, "elbow": 4}) == [f"{name}: is a slot of urbiscript or of the robot; choose another name"]
    assert told({"elbow": {"id": 4, "groups": [name]}}) == [f'elbow.groups: "{name}" cannot be the name of a group']


def test_the_list_of_names_is_that_of_the_slots() -> None:
    assert FILE.read_text("utf-8") == text(), "write it again: python tests/platforms/taken_names.py"


def test_the_number_of_a_servo_is_also_a_name() -> None:
    assert told({"motor4": {"id": 4, "direction": -1}}) == []


def test_reading_wrong_settings_tells_the_first_mistake() -> None:
    with pytest.raises(BadConfig, match=r"^devices\.a: has no id"):
        expected.read({"a": {}})
