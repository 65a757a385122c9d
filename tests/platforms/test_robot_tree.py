"""System.tree: each platform's robot as data, enough for a panel without code of the platform's own."""

from __future__ import annotations

import importlib
import json
from collections.abc import Iterator
from typing import Any, NamedTuple

import pytest
from chain_lab import Lab as ChainLab
from lab import RobotLab

from urbihw.platforms import folders

Node = dict[str, Any]
PROMISED_KINDS = {"number", "truth", "text", "list", "dictionary", "binary", "event", "function", "object"}
NOT_DRIVEN = {"estop", "load"}
"""Slots that no panel with the role drive may write, although they can be written."""


class Told(NamedTuple):
    """A robot, and its tree."""

    name: str
    lab: RobotLab
    tree: Node


@pytest.fixture(params=[folder.name for folder in folders()], scope="module")
def told(request: pytest.FixtureRequest) -> Told:
    """The tree of each platform in turn."""
    module = importlib.import_module(f"{request.param}_lab")
    lab = module.lab() if hasattr(module, "lab") else module.Lab.ready()
    text = lab.say("lobby.send(System.treeText(robot))|;")
    return Told(request.param, lab, json.loads(text))


def nodes(node: Node) -> Iterator[Node]:
    yield node
    for part in node["parts"]:
        yield from nodes(part)


def slots(tree: Node) -> Iterator[tuple[str, Node]]:
    for node in nodes(tree["robot"]):
        for slot in node.get("slots", ()):
            yield f"{node['path']}.{slot['name']}", slot


def effectors(tree: Node) -> set[str]:
    return {path for path, slot in slots(tree) if slot["effector"]}


def test_the_tree_has_the_parts_of_the_dump_with_their_interfaces(told: Told) -> None:
    dump = told.lab.say("robot.dump;").split("\n")
    parts = list(nodes(told.tree["robot"]))
    assert len(parts) == len(dump)
    assert sorted(kind for part in parts for kind in part["interfaces"]) == sorted(
        word for line in dump for word in line.partition(": ")[2].split()
    )


def test_each_slot_has_a_kind_a_meaning_where_an_interface_gives_one_and_a_sound_range(told: Told) -> None:
    for path, slot in slots(told.tree):
        assert slot["kind"] in PROMISED_KINDS, path
        assert slot["min"] is None or slot["max"] is None or slot["min"] < slot["max"], path
        assert not (slot["effector"] and not slot["writable"]), path
        if slot["kind"] in ("function", "event"):
            assert not slot["readable"], path
        elif not slot["readable"]:
            assert told.lab.say(f"{path}.isNil;") == "true" and not slot["writable"], path
        assert not slot["effector"] or slot["meaning"], path
        assert not (slot["effector"] and slot["name"] in NOT_DRIVEN), path


def test_every_readable_slot_can_be_subscribed_by_its_path(told: Told) -> None:
    paths = [path for path, slot in slots(told.tree) if slot["readable"]][:900]
    names = ", ".join(f'"{path}"' for path in paths)
    told.lab.heard()
    lines = told.lab.say(f'var Global.all = Subscription.new("All", [{names}], 1)|;', 0.5).split("\n")
    told.lab.say("all.stop; Global.removeLocalSlot(\"all\")|;")
    told_lines = [json.loads(line) for line in lines if line.startswith("{")]
    refused = [line for line in told_lines if "error" in line and "is a function" in line["text"]]
    assert refused == []
    (sample,) = (line for line in told_lines if "v" in line)
    assert len(sample["v"]) == len(paths)


def test_the_object_of_the_platform_is_found_by_the_link(told: Told) -> None:
    platform = told.tree["platform"]
    names = {slot["name"] for slot in platform["slots"]}
    assert {"link", "estop", "stop", "rate", "stopped", "linkLost"} <= names
    assert told.lab.look(f"{platform['path']}.link") == "true"


def test_what_moves_the_robot_is_an_effector_and_can_be_written(told: Told) -> None:
    assert effectors(told.tree)
    for node in nodes(told.tree["robot"]):
        if "RotationalMotor" in node["interfaces"] or "Motor" in node["interfaces"]:
            assert "val" in node["effectors"], node["path"]
        if "Mobile" in node["interfaces"]:
            assert {"xSpeed", "yawSpeed"} <= set(node["effectors"])


JOINTS = {
    "bioloid": [f"motor{number}" for number in range(1, 19)],
    "nao": [
        "HeadYaw", "HeadPitch", "LShoulderPitch", "LShoulderRoll", "LElbowYaw", "LElbowRoll", "LWristYaw",
        "LHipYawPitch", "LHipRoll", "LHipPitch", "LKneePitch", "LAnklePitch", "LAnkleRoll", "RHipYawPitch", "RHipRoll",
        "RHipPitch", "RKneePitch", "RAnklePitch", "RAnkleRoll", "RShoulderPitch", "RShoulderRoll", "RElbowYaw",
        "RElbowRoll", "RWristYaw",
    ],
    "so101": ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"],
    "nxt": [],
    "p3dx": [],
    "webots": [],
    "spykee": [],
}
"""The joints of some platforms in their order; an SO-101's is that of LeRobot, a Nao's that of ``getBodyNames``."""


def test_joints_are_told_in_one_order(told: Told) -> None:
    names = json.loads(told.lab.look("System.jointNames(robot)"))
    assert names == JOINTS.get(told.name, names)
    parts = {part["path"]: part for part in nodes(told.tree["robot"])}
    assert [parts[path]["global"] or path for path in told.tree["joints"]] == names
    turning = {path for path, part in parts.items() if "RotationalMotor" in part["interfaces"]}
    assert {path for path in turning if ".wheel" not in path} <= {*told.tree["joints"]}


def test_joints_are_in_the_order_of_the_settings() -> None:
    lab = ChainLab.ready(devices={"knee": {"id": 4}, "hip": {"id": 2}})
    assert lab.look("System.jointNames(robot)") == '["knee", "hip", "motor1", "motor3", "motor5"]'


def test_an_overview_has_what_moves_and_what_measures_in_few_words(told: Told) -> None:
    text = told.lab.say("lobby.send(System.overviewText(robot))|;")
    overview = json.loads(text)
    assert len(text) < (10_000 if told.name == "nao" else 2500)
    slots_ = [row["slot"] for row in overview["effectors"] + overview["sensors"]]
    assert len(set(slots_)) == len(slots_)
    joints = [row["slot"] for row in overview["effectors"] if row["role"] == "joint"]
    assert joints == [f"{name}.val" for name in json.loads(told.lab.look("System.jointNames(robot)"))]
    for slot in slots_:
        assert "error" not in told.lab.look(f'lobby.answerSlot("c", "{slot}")'), slot


def test_the_key_changes_with_the_parts_only(told: Told) -> None:
    key = told.lab.look("System.treeKey(robot)")
    told.lab.run(0.3)
    assert told.lab.look("System.treeKey(robot)") == key
    told.lab.say('robot.addComponent("tail")|;')
    assert told.lab.look("System.treeKey(robot)") != key
