"""The figures of the platforms: the same joints, directions and zero as the bodies in MuJoCo and as the trees."""

from __future__ import annotations

import importlib
import json
import math
import random
from pathlib import Path
from typing import Any

import bioloid_lab
import chain_lab
import pytest
import so101_lab

from urbihw import platforms
from urbihw.figure.kinematics import places
from urbihw.figure.model import FILE, Figure, figure_file, parse, read
from urbihw.platforms.servos.options import ServoOptions
from urbihw_fakes.bioloid.kit import Bioloid
from urbihw_fakes.bodies.humanoid import MOUNTED
from urbihw_fakes.so101.arm import JOINTS

ROOT = Path(__file__).parents[2]
BODIES = ROOT / "fakes" / "urbihw_fakes" / "bodies" / "models"
NXT_WHEELS = {"left": "wheelL", "right": "wheelR"}


def device_of(platform: str, joint: str) -> str:
    """The device of a joint of a body, "" for a wheel that is not measured."""
    if platform == "bioloid":
        return f"motor{joint}"
    return joint if platform == "nao" else NXT_WHEELS[joint] if platform == "nxt" else ""


def figure_of(platform: str) -> Figure:
    path = figure_file(platforms.find(platform).folder / FILE)
    assert path is not None
    return read(path)


def figures() -> list[str]:
    return [each.name for each in platforms.manifests() if figure_file(each.folder / FILE) is not None]


def reading(platform: str, joint: str, angle: float) -> float:
    """What the device of a joint of a body measures at an angle of the model, by the words of the fakes."""
    if platform == "bioloid":
        return angle + math.radians(MOUNTED.get(int(joint), 0.0))
    return math.degrees(angle) if platform == "nxt" else angle


@pytest.mark.parametrize("platform", sorted(path.stem for path in BODIES.glob("*.xml")))
def test_the_figure_stands_as_the_body_stands(platform: str) -> None:
    mujoco = pytest.importorskip("mujoco", reason="bodies need the extra mujoco")
    model = mujoco.MjModel.from_xml_path(str(BODIES / f"{platform}.xml"))
    data = mujoco.MjData(model)
    figure = figure_of(platform)
    hinges = [model.joint(index) for index in range(model.njnt) if model.jnt_type[index] == mujoco.mjtJoint.mjJNT_HINGE]
    assert {device_of(platform, joint.name) or joint.name for joint in hinges} == set(figure.joints)
    dice = random.Random(platform)
    for _ in range(5):
        readings = {}
        for joint in hinges:
            if device := device_of(platform, joint.name):
                low, high = joint.range if model.jnt_limited[joint.id] else (-3.0, 3.0)
                angle = data.qpos[int(joint.qposadr[0])] = dice.uniform(low, high)
                readings[device] = reading(platform, joint.name, float(angle))
        mujoco.mj_kinematics(model, data)
        found = places(figure, readings)
        for index in range(1, model.nbody):
            body = model.body(index)
            pose = found[body.name]
            assert pose.place == pytest.approx(tuple(data.xpos[index]), abs=2e-4), body.name
            shares = [share for row in pose.rows for share in row]
            assert shares == pytest.approx(list(data.xmat[index]), abs=2e-3), body.name


def test_the_ranges_are_those_of_the_body() -> None:
    mujoco = pytest.importorskip("mujoco", reason="bodies need the extra mujoco")
    for platform in ("bioloid", "nao"):
        model = mujoco.MjModel.from_xml_path(str(BODIES / f"{platform}.xml"))
        joints = figure_of(platform).joints
        for index in range(model.njnt):
            if model.jnt_limited[index]:
                joint = joints[device_of(platform, model.joint(index).name)].joint
                assert joint is not None
                assert (joint.low, joint.high) == pytest.approx(tuple(model.jnt_range[index]), abs=1e-3)


def ready(platform: str) -> Any:
    return importlib.import_module(f"{platform}_lab").Lab.ready()


@pytest.mark.parametrize("platform", sorted(figures()))
def test_joints_and_sensors_have_the_names_of_the_tree(platform: str) -> None:
    lab = ready(platform)
    figure = figure_of(platform)
    told = parse(json.loads(json.loads(lab.look("robot.figure.text"))))
    assert told == figure
    overview = json.loads(json.loads(lab.look("System.overviewText(robot)")))
    rows = {row["slot"].partition(".")[0]: row for row in overview["effectors"] + overview["sensors"]}
    joints = [name for name, row in rows.items() if row["role"] == "joint"]
    turning = [device for device in figure.devices if rows[device]["role"] == "joint"]
    assert sorted(turning) == sorted(joints)
    assert all(rows[device]["unit"] == link.joint.unit for device, link in figure.joints.items()
               if link.joint is not None and link.joint.device)  # fmt: skip
    assert {link.device for link in figure.links if link.device} <= set(rows)


def test_an_so101_is_drawn_as_its_makers_urdf_says() -> None:
    # Places of the joints with all angles 0, of so101_new_calib.urdf, turned so that x is ahead, the pan in the middle.
    found = places(figure_of("so101"), {"gripper": -0.7854})
    for name, place in (
        ("upper_arm", (0.0535, -0.0183, 0.1491)), ("lower_arm", (0.0815, -0.0183, 0.2617)),
        ("wrist", (0.2164, -0.0183, 0.2669)), ("gripper", (0.2775, -0.0002, 0.2669)),
        ("jaw", (0.3009, 0.0186, 0.2871)), ("hand", (0.3756, -0.0004, 0.259)),
    ):  # fmt: skip
        assert found[name].place == pytest.approx(place, abs=3e-4), name
    # With a positive reading the arm turns to the right, bends ahead and down, and opens its jaw.
    moved = places(figure_of("so101"), {"shoulder_pan": 0.5, "shoulder_lift": 0.3, "gripper": 0.5})
    assert moved["hand"].place[1] < -0.1 and moved["hand"].place[2] < found["hand"].place[2]


def test_a_kit_that_is_built_otherwise_stands_on_a_bench() -> None:
    lab = bioloid_lab.Lab.ready(Bioloid(servos=(1, 2), sensors=(), baud=bioloid_lab.BAUD))
    assert lab.look("robot.figure.links") == '["bench", "motor1_link", "motor2_link"]'
    told = parse(json.loads(json.loads(lab.look("robot.figure.text"))))
    assert told.devices == ["motor1", "motor2"]


ARM = """
[[links]]
name = "base"
[[links]]
name = "arm"
on = "base"
at = [0, 0, 0.1]
joint = { device = "motor1", axis = [0, 1, 0] }
[[links]]
name = "hand"
on = "arm"
at = [0.2, 0, 0]
"""


def test_the_settings_of_a_chain_say_which_joint_hangs_on_which(tmp_path: Path) -> None:
    path = tmp_path / "figure.toml"
    path.write_text(ARM)
    # The joint has a name of the settings in the tree, and that of its motor in the file.
    lab = chain_lab.Lab.ready(figure=str(path), devices={"elbow": {"id": 1}})
    lab.say("motor1.val = -0.5;", 3)
    assert lab.number("robot.figure.part(\"hand\").position[2]") == pytest.approx(0.1 + 0.2 * math.sin(0.5), abs=2e-3)
    assert parse(json.loads(json.loads(lab.look("robot.figure.text")))).devices == ["elbow"]


def test_a_figure_that_cannot_be_read_is_a_mistake_in_the_settings(tmp_path: Path) -> None:
    path = tmp_path / "figure.toml"
    path.write_text(ARM.replace("[0, 1, 0]", "[0, 0, 0]"))
    (mistake,) = ServoOptions(figure=str(path)).unusable_files()
    assert mistake.key == "figure" and "axis wants three numbers" in mistake.text


def test_a_program_reads_where_the_hand_is() -> None:
    lab = so101_lab.Lab.ready()
    lab.say("shoulder_pan.val = 0.5; shoulder_lift.val = 0.3;", 3)
    measured = {name: lab.number(f"{name}.val") for name in ("shoulder_pan", "shoulder_lift", "elbow_flex")}
    assert measured["shoulder_pan"] == pytest.approx(0.5, abs=0.01)
    place = places(figure_of("so101"), {**measured, "wrist_flex": lab.number("wrist_flex.val"),
                                        "wrist_roll": lab.number("wrist_roll.val")})["hand"].place  # fmt: skip
    assert json.loads(lab.look("robot.hand.position")) == pytest.approx(place, abs=1e-5)
    assert len(json.loads(lab.look("robot.hand.pose"))) == 6
    assert 'the figure has no link "foot"' in lab.say('robot.figure.part("foot").position;')


def test_the_place_of_a_link_reads_no_file(monkeypatch: pytest.MonkeyPatch) -> None:
    lab = so101_lab.Lab.ready()
    lab.look("robot.hand.position")
    monkeypatch.setattr("urbihw.figure.model.parse", lambda table: pytest.fail("read again"))
    monkeypatch.setattr("urbihw.robot.figures.parse", lambda table: pytest.fail("parsed again"))
    assert len(json.loads(lab.look("robot.hand.pose"))) == 6


def test_a_search_has_the_joints_that_carry_the_link_only() -> None:
    lab = so101_lab.Lab.ready()
    for joints, words in (
        ('[["gripper", 0, -1, 1]]', "gripper is no joint that carries this link"),
        ('[["a", 0, -1, 1], ["b", 0, -1, 1]]', "a is no joint that carries this link"),
        ('[["shoulder_pan", 0, -1]]', "a joint is a List of"),
        ('[["shoulder_pan", nan, -1, 1]]', "shoulder_pan has no reading"),
    ):
        told = lab.say(f'so101.figureGoals("hand", [0.2, 0, 0.2], {joints}),', 0.05)
        lab.thought()
        assert words in told + lab.say("1;", 0.1), joints
    told = lab.say('so101.figureGoals("foot", [0.2, 0, 0.2], []),', 0.05)
    lab.thought()
    assert "the figure has no link 'foot'" in told + lab.say("1;", 0.1)


def think(lab: Any, seconds: float) -> None:
    """Let time pass, with the calculation in its thread, which knows nothing of simulated time."""
    for _ in range(round(seconds / 0.1)):
        lab.thought()
        lab.run(0.1)


def test_a_hand_goes_to_a_place_within_the_limits_of_its_joints() -> None:
    pytest.importorskip("scipy", reason="needs the extra navigation")
    lab = so101_lab.Lab.ready()
    lab.say("so101.on|; robot.hand.reach([0.25, 0.1, 0.15], 2s),", 0.05)
    think(lab, 1)
    # Half way, and not yet there: the joints go together in the time that was given.
    assert 0.02 < math.dist(json.loads(lab.look("robot.hand.position")), (0.25, 0.1, 0.15)) < 0.15
    think(lab, 2)
    assert json.loads(lab.look("robot.hand.position")) == pytest.approx([0.25, 0.1, 0.15], abs=4e-3)
    # By the fake's own joints, the body is there.
    measured = {name: math.radians(lab.kit.bend(name) * 360 / 4096) for name in JOINTS}
    assert places(figure_of("so101"), measured)["hand"].place == pytest.approx((0.25, 0.1, 0.15), abs=4e-3)


def test_a_place_that_is_too_far_is_an_error_that_tells_the_nearest_one() -> None:
    pytest.importorskip("scipy", reason="needs the extra navigation")
    lab = so101_lab.Lab.ready()
    before = lab.look("robot.hand.position")
    told = lab.say("so101.on|; robot.hand.reach([0.6, 0, 0.2]),", 0.05)
    for _ in range(5):
        lab.thought()
        told += lab.say("1;", 0.1)
    assert "hand cannot reach [0.600, 0.000, 0.200]: the nearest place is [0.4" in told
    assert lab.look("robot.hand.position") == before


def test_a_stop_ends_a_reach() -> None:
    pytest.importorskip("scipy", reason="needs the extra navigation")
    lab = so101_lab.Lab.ready()
    lab.say("so101.on|; robot.hand.reach([0.25, 0.1, 0.15], 4s),", 0.05)
    think(lab, 1)
    lab.say("robot.stop;", 0.3)
    stood = [lab.kit.bend(name) for name in JOINTS]
    think(lab, 2)
    assert [lab.kit.bend(name) for name in JOINTS] == pytest.approx(stood, abs=2)
    assert math.dist(json.loads(lab.look("robot.hand.position")), (0.25, 0.1, 0.15)) > 0.03
