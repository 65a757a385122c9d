"""The bundled worlds: their robots wander for ten simulated minutes without getting stuck; files of users; faults."""

from __future__ import annotations

import math
import re
import sys
from pathlib import Path
from typing import NamedTuple

import pytest
from webots_lab import Lab

from urbihw.kernel.uobject import BadConfig, NotReady
from urbihw.platforms.webots import port as ports

WORLDS = ports.WORLDS
SHORT, LONG = 1, 10
LINES = 60
"""A behaviour is shorter than this."""


minutes_of_a_test = pytest.mark.parametrize("minutes", [SHORT, pytest.param(LONG, marks=pytest.mark.long)])


class SlowLab(Lab):
    """Steps of 40 ms: half the work."""

    tick = 0.04


class Way(NamedTuple):
    """The way of a robot that wanders.

    Attributes:
        length: of the way, in m.
        places: squares of its own size that it has visited.
        rest: longest time at one place, in s.
    """

    length: float
    places: int
    rest: float


def wander(lab: Lab, body: str, size: float, minutes: int) -> Way:
    """Look at the body every second; it rests while it goes less than a tenth of its size."""
    place, length, rest, longest, squares = lab.body(body).xpos.copy(), 0.0, 0.0, 0.0, set()
    for _ in range(minutes * 60):
        lab.run(1.0)
        here = lab.body(body).xpos.copy()
        way = math.dist(place, here)
        place, length = here, length + way
        rest = rest + 1.0 if way < size / 10 else 0.0
        longest = max(longest, rest)
        squares.add((round(here[0] / size), round(here[1] / size)))
    return Way(length, len(squares), longest)


@minutes_of_a_test
@pytest.mark.parametrize(
    ("world", "body", "size", "least"),
    [("pioneer-wander", "pioneer", 0.45, Way(15.0, 6, 6.0)), ("e-puck-wander", "e-puck", 0.07, Way(3.5, 6, 6.0))],
)
def test_minutes_without_getting_stuck(world: str, body: str, size: float, least: Way, minutes: int) -> None:
    """``least`` is of one minute."""
    lab = SlowLab.ready(WORLDS / f"{world}.xml", step=40)
    lab.say("camera.load = 0|; wander.start;", 0.1)
    way = wander(lab, body, size, minutes)
    assert lab.heard() == ""
    assert way.length > minutes * least.length, way
    assert way.places > minutes * least.places, way
    assert way.rest <= least.rest, way
    lab.say("wander.stop;", 1.0)
    here = lab.body(body).xpos.copy()
    lab.run(2.0)
    assert math.dist(here, lab.body(body).xpos) < size / 50


def test_a_second_window_stops_what_the_first_one_began() -> None:
    lab = SlowLab.ready(WORLDS / "pioneer-wander.xml", step=40)
    lab.kernel.complete()
    lab.say("camera.load = 0|; wander.start;", 2.0)
    second = lab.kernel.open_lobby()
    lab.kernel.feed(second, b"wander.stop;")
    lab.run(1.0)
    assert b"urbihw: " not in second.output.take_bytes().replace(b"*** urbihw: robots as", b"")
    here = lab.body("pioneer").xpos.copy()
    lab.run(2.0)
    assert math.dist(here, lab.body("pioneer").xpos) < 0.01


@minutes_of_a_test
def test_a_head_tracks_a_ball(minutes: int) -> None:
    lab = SlowLab.ready(WORLDS / "ball-tracking.xml", step=40)
    lab.run(0.5)
    if lab.look("camera.stale") == "true":
        pytest.skip("no OpenGL: no pictures")
    lab.say("tracking.start;", 2.0)
    errors = []
    for _ in range(minutes * 60):
        lab.run(1.0)
        eye = lab.world._data.camera("camera")
        way = lab.body("ball").xpos - eye.xpos
        ahead = -eye.xmat.reshape(3, 3)[:, 2]
        errors.append(math.degrees(math.acos(float(way @ ahead) / math.hypot(*way))))
    assert lab.heard() == ""
    assert sum(errors) / len(errors) < 8.0
    assert max(errors) < 20.0


@minutes_of_a_test
def test_soccer(minutes: int) -> None:
    lab = SlowLab.ready(WORLDS / "soccer.xml", step=40)
    lab.say("soccer.start;", 0.1)
    way = wander(lab, "player", 0.2, minutes)
    assert lab.heard() == ""
    goals = int(lab.number("soccer.goals"))
    assert goals >= 3 * minutes
    assert lab.number("soccer.own") == 0
    assert way.rest <= 6.0, way
    (board,) = lab.world.labels.values()
    assert board.text == f"{goals} : 0"


@pytest.mark.parametrize("world", ports.bundled_worlds())
def test_every_world_opens_and_stands_still(world: str) -> None:
    lab = Lab.ready(WORLDS / f"{world}.xml")
    before = lab.world._data.qpos.copy()
    lab.run(3.0)
    assert abs(lab.world._data.qpos - before).max() < 0.005


def test_programs_are_short_and_models_say_whose_they_are() -> None:
    for path in WORLDS.rglob("*.u"):
        assert len(path.read_text().splitlines()) < LINES, path
    for path in WORLDS.glob("*.xml"):
        assert path.read_text().startswith("<!-- Part of urbihw, BSD 3-clause license (LICENSE)."), path


def test_a_urdf_gets_a_motor_for_each_joint(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text("""<robot name="arm">
      <link name="base"><inertial><mass value="5"/>
        <inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>
        <collision><geometry><box size=".2 .2 .1"/></geometry></collision></link>
      <link name="link"><inertial><origin xyz=".1 0 0"/><mass value=".2"/>
        <inertia ixx=".001" iyy=".001" izz=".001" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <link name="hand"><inertial><origin xyz=".1 0 0"/><mass value=".1"/>
        <inertia ixx=".001" iyy=".001" izz=".001" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name="shoulder" type="revolute"><parent link="base"/><child link="link"/><origin xyz="0 0 .2"/>
        <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="3" velocity="2"/></joint>
      <joint name="elbow" type="revolute"><parent link="link"/><child link="hand"/><origin xyz=".2 0 0"/>
        <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="3" velocity="2"/></joint></robot>""")
    lab = Lab.ready(path)
    assert lab.look("webots.deviceOrder") == '["shoulder", "elbow"]'
    assert lab.look("[joint[0] === shoulder, joint[1] === elbow]") == "[true, true]"
    lab.say("joint[0].val = 0.7|; elbow.val = -0.5|;", 3.0)
    assert lab.joint("shoulder") == pytest.approx(0.7, abs=0.02)
    assert lab.joint("elbow") == pytest.approx(-0.5, abs=0.02)
    lab.say("shoulder.val = 3|;", 3.0)
    assert lab.joint("shoulder") == pytest.approx(1.0, abs=0.02)


# ---------------------------------------------------------------- faults


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "there is no file"),
        ("<mujoco><worldbody><body></mujoco>", "the model cannot be loaded: {path}: "),
        ('<mujoco><custom><text name="x" data="lidar 3"/></custom></mujoco>', "the model cannot be loaded: "),
    ],
)
def test_a_wrong_model_is_one_line_and_is_tried_again(tmp_path: Path, text: str | None, words: str) -> None:
    path = tmp_path / "model.xml"
    if text is not None:
        path.write_text(text)
    lab = Lab(path)
    lab.until(lambda: bool(lab.opened))
    (error,) = lab.opened
    assert isinstance(error, NotReady)
    assert words.format(path=path) in str(error)
    assert "\n" not in str(error)
    path.write_text("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
    lab.until(lambda: len(lab.opened) == 2)
    assert lab.opened[1] is None


def test_a_missing_package_names_what_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    lab = Lab()
    monkeypatch.setitem(sys.modules, "mujoco", None)
    lab.until(lambda: bool(lab.opened))
    (error,) = lab.opened
    assert isinstance(error, BadConfig)
    assert re.fullmatch(r"mujoco:// needs the Python package mujoco: .*mujoco.*", str(error))


def test_an_unknown_world_names_those_that_there_are() -> None:
    lab = Lab(Path("pioneer"))
    lab.until(lambda: bool(lab.opened))
    assert "there is no world 'pioneer'; there are: ball-tracking, " in str(lab.opened[0])


def test_a_simulator_that_is_gone_is_told_and_comes_back() -> None:
    lab = Lab.ready()
    lab.say('at (webots.linkLost?(var why)) echo("lost: %s" % why); at (webots.linkBack?) echo("back");', 0.2)
    lab.plug.unplug()
    lab.run(1.0)
    assert lab.heard() == "*** lost: the simulator does not answer"
    assert lab.look("sonarFFL.stale") == "true"
    lab.plug.replug()
    lab.run(2.0)
    assert lab.heard() == "*** back"
    assert lab.look("sonarFFL.stale") == "false"


def test_no_opengl_is_one_line_and_the_rest_works(monkeypatch: pytest.MonkeyPatch) -> None:
    lab = Lab.ready()
    lab.say('at (webots.problem?(var what)) echo(what); camera.load = 0|;', 0.1)

    def fail(*_: object, **__: object) -> None:
        raise RuntimeError("no display")

    lab.world._renderers.clear()
    monkeypatch.setattr(lab.world._mujoco, "Renderer", fail)
    lab.say("camera.load = 1|;", 1.0)
    assert lab.heard() == ""  # it was said at once
    before = lab.number("webots.time")
    lab.run(0.5)
    assert lab.number("webots.time") > before


def test_limits_hold_by_the_names_of_the_simulator() -> None:
    lab = Lab.ready(limits={"left wheel": {"speed": 1.0}})
    lab.say("wheelL.speed = 3 | wheelR.speed = 3|;", 1.0)
    assert lab.turned("left wheel") is not None
    lab.step()
    assert lab.turned("left wheel") == pytest.approx(1.0, abs=0.2)
    assert lab.look("wheelL.limitedBy") == '"limits.left wheel.speed"'
    assert lab.look("wheelR.limitedBy") == '""'
