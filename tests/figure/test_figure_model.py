"""``figure.toml`` as an author writes it: what is refused, and the URDF that follows from it."""

from __future__ import annotations

import json
import math
import os
import random
from pathlib import Path
from xml.etree import ElementTree as xml

import pytest

from urbihw.cli.main import main
from urbihw.figure import BadFigure
from urbihw.figure.bench import bench
from urbihw.figure.kinematics import place_of
from urbihw.figure.model import parse, read
from urbihw.figure.pose import Pose, at
from urbihw.figure.reach import NEAR_M, CannotReach, JointRange, reach
from urbihw.figure.urdf import to_urdf

ARM = """
[[links]]
name = "base"
at = [0, 0, 0.1]
shapes = [{ capsule = [0.02, 0.1], at = [0, 0, 0.05], colour = "#ff0000" }]

[[links]]
name = "lift"
on = "base"
at = [0, 0, 0.2]
joint = { device = "lift", axis = [0, 0, 2], range = [0, 0.5], unit = "m" }

[[links]]
name = "hand"
on = "lift"
at = [0.3, 0, 0]
joint = { device = "yaw", axis = [0, 0, 1], range = [-90, 90], zero = 30, unit = "deg" }

[[links]]
name = "tip"
on = "hand"
at = [0.1, 0, 0]
"""


def arm(folder: Path) -> Path:
    path = folder / "figure.toml"
    path.write_text(ARM)
    return path


def test_joints_turn_and_slide_by_their_readings(tmp_path: Path) -> None:
    figure = read(arm(tmp_path))
    assert place_of(figure, "tip", {}).place == pytest.approx((0.4, 0, 0.3))
    moved = place_of(figure, "tip", {"lift": 0.25, "yaw": 120})
    assert moved.place == pytest.approx((0.3, 0.1, 0.55)) and moved.turn == pytest.approx((0, 0, math.pi / 2))


def test_a_table_as_json_is_the_same_figure(tmp_path: Path) -> None:
    figure = read(arm(tmp_path))
    assert parse(json.loads(json.dumps(figure.as_table()))) == figure


@pytest.mark.parametrize(("text", "other"), [
    ('on = "base"', 'on = "hand"'),
    ('axis = [0, 0, 2]', 'axis = [0, 0, 0]'),
    ('range = [0, 0.5]', 'range = [0.5, 0]'),
    ('unit = "deg"', 'unit = "inch"'),
    ('"#ff0000"', '"red"'),
    ('capsule = [0.02, 0.1]', 'capsule = [0.02]'),
    ('capsule = [0.02, 0.1]', 'capsule = [0.02, 0]'),
    ('capsule = [0.02, 0.1]', 'cone = [0.02, 0.1]'),
    ('name = "tip"', 'name = "hand"'),
    ('name = "tip"', 'nam = "hand"'),
    ('at = [0.1, 0, 0]', 'at = [0.1, 0, nan]'),
    ('at = [0.1, 0, 0]', 'places = [0.1, 0, 0]'),
])  # fmt: skip
def test_what_cannot_be_drawn_is_refused(tmp_path: Path, text: str, other: str) -> None:
    path = arm(tmp_path)
    assert text in ARM
    path.write_text(ARM.replace(text, other))
    with pytest.raises(BadFigure, match=r"figure\.toml: "):
        read(path)


def test_a_urdf_has_the_links_the_limits_from_the_drawn_pose_and_no_capsule(tmp_path: Path) -> None:
    root = xml.fromstring(to_urdf(read(arm(tmp_path)), "arm"))
    assert [each.get("name") for each in root.iter("link")] == ["robot", "base", "lift", "hand", "tip"]
    kinds = {str(each.get("name")): each.get("type") for each in root.findall("joint")}
    assert kinds == {"base_mount": "fixed", "lift": "prismatic", "yaw": "revolute", "tip_mount": "fixed"}
    yaw = next(each for each in root.findall("joint") if each.get("name") == "yaw")
    limit = yaw.find("limit")
    assert limit is not None
    assert [float(limit.get(end, "")) for end in ("lower", "upper")] == pytest.approx(
        [math.radians(-120), math.radians(60)], abs=1e-5
    )
    assert len(list(root.iter("cylinder"))) == 2 and len(list(root.iter("sphere"))) == 4


def test_a_simulator_reads_the_urdf_of_a_nao_and_places_its_links_alike() -> None:
    mujoco = pytest.importorskip("mujoco", reason="needs the extra mujoco")
    path = Path(__file__).parents[2] / "packages" / "nao" / "urbihw_nao" / "figure.toml"
    figure = read(path)
    compiler = '<compiler fusestatic="false" balanceinertia="true" boundmass="0.001" boundinertia="1e-6"/>'
    text = to_urdf(figure, "nao").replace('<robot name="nao">', f'<robot name="nao"><mujoco>{compiler}</mujoco>')
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    readings = {}
    for index in range(model.njnt):
        low, high = model.jnt_range[index]
        readings[model.joint(index).name] = data.qpos[int(model.jnt_qposadr[index])] = 0.7 * low + 0.3 * high
    mujoco.mj_kinematics(model, data)
    for link in ("head", "left_tip", "right_foot"):
        found = tuple(data.xpos[model.body(link).id])
        assert place_of(figure, link, readings).place == pytest.approx(found, abs=1e-5), link


def test_turns_are_told_as_they_were_given() -> None:
    for turn in ((0.3, -0.4, 2.0), (0.0, math.pi / 2, 0.7), (0.0, -math.pi / 2, 0.7), (-3.0, 1.0, -2.0)):
        assert at((1.0, 2.0, 3.0), turn).turn == pytest.approx(turn)
    assert Pose().then(at((1.0, 0.0, 0.0))).place == (1.0, 0.0, 0.0)


def test_joints_of_an_unknown_robot_stand_in_a_row() -> None:
    figure = bench({"a": ("rad", -1.0, 1.0), "b": ("turn", -math.inf, math.inf), "slide": ("m", 0.0, 1.0)})
    assert figure.devices == ["a", "b"] and parse(figure.as_table()) == figure


def test_the_command_prints_links_urdf_and_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["figure", "so101"]) == 0
    assert "\n    upper_arm: joint shoulder_lift about 0 1 0, -1.7453 to 1.7453 rad\n" in capsys.readouterr().out
    assert main(["figure", str(arm(tmp_path)), "--urdf"]) == 0
    assert '<robot name="figure">' in capsys.readouterr().out
    assert main(["figure", "so101", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["links"][0]["name"] == "base"
    assert main(["figure", "cia402"]) == 78
    assert "robot.figure.text" in capsys.readouterr().err


def test_every_place_of_a_hand_is_reached_within_the_limits() -> None:
    pytest.importorskip("scipy", reason="needs the extra navigation")
    figure = read(Path(__file__).parents[2] / "urbihw" / "platforms" / "so101" / "figure.toml")
    links = {name: link.joint for name, link in figure.joints.items() if name != "gripper"}
    joints = {name: JointRange(0.0, joint.low, joint.high) for name, joint in links.items() if joint is not None}
    dice = random.Random(3)
    for _ in range(6):
        place = place_of(figure, "hand", {name: dice.uniform(*row[1:]) for name, row in joints.items()}).place
        goals = reach(figure, "hand", place, joints)
        assert math.dist(place_of(figure, "hand", goals).place, place) < NEAR_M
        assert all(joints[name].low <= goal <= joints[name].high for name, goal in goals.items())
    with pytest.raises(CannotReach, match=r"13\.\d cm away"):
        reach(figure, "hand", (0.6, 0.0, 0.2), joints)
    with pytest.raises(CannotReach, match="at the end of its range: elbow_flex"):
        reach(figure, "hand", (-0.2, 0.1, 0.2), {**joints, "shoulder_lift": JointRange(0.3, 0.3, 0.3)})


def test_a_joint_that_turns_for_ever_is_searched_within_a_turn(tmp_path: Path) -> None:
    pytest.importorskip("scipy", reason="needs the extra navigation")
    figure = read(arm(tmp_path))
    open_ended = {"lift": JointRange(0.2, -math.inf, 0.5), "yaw": JointRange(700.0, -math.inf, math.inf)}
    goals = reach(figure, "tip", (0.3, 0.1, 0.55), open_ended)
    assert math.dist(place_of(figure, "tip", goals).place, (0.3, 0.1, 0.55)) < NEAR_M
    assert abs(goals["yaw"] - 700) <= 360 and goals["lift"] <= 0.5
    with pytest.raises(CannotReach, match="cm away"):
        reach(figure, "tip", (0.8, 0.0, 0.3), open_ended)


def test_a_file_is_read_again_only_when_it_has_changed(tmp_path: Path) -> None:
    path = arm(tmp_path)
    before = read(path)
    assert read(path) is before
    path.write_text(ARM.replace("at = [0.1, 0, 0]", "at = [0.2, 0, 0]"))
    os.utime(path, ns=(1, 1))
    assert read(path).link("tip").at == (0.2, 0, 0)
