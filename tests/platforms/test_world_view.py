"""``worldView``: states of a simulated world, recordings of them, and pictures drawn by a process of their own."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from webots_lab import Lab

from urbihw.platforms.scene.drawing import SceneDrawing
from urbihw.platforms.scene.library import import_mujoco
from urbihw.platforms.scene.painting import NoPictures, ViewPoint, load_model
from urbihw.platforms.scene.recording import BadRecording, SceneRecording
from urbihw.platforms.scene.state import state_of, take_state, time_of
from urbihw.platforms.webots import port as ports
from urbihw.platforms.webots.scene import SimulatedScene
from urbihw_fakes.bodies.scene import scene_word
from urbihw_fakes.bodies.simulation import Simulation
from urbihw_fakes.errors import UnknownRequest

pytest.importorskip("mujoco", reason="simulated worlds need the extra mujoco")

PIONEER = ports.WORLDS / "pioneer-wander.xml"
TIMEOUT_S = 60.0
"""A busy machine draws slowly."""


def pioneer_lab() -> Lab:
    """A lab with the Pioneer's world."""
    return Lab.ready(PIONEER.stem)


def ball(mujoco: Any, file: Path) -> tuple[Any, Any]:
    """A model with a ball that falls: of a file, and its data."""
    file.write_text('<mujoco><worldbody><body name="ball" pos="0 0 2"><freejoint/><geom name="skin" size="0.1"/></body>'
                    '</worldbody></mujoco>')
    model = load_model(mujoco, file)
    return model, mujoco.MjData(model)


# ---------------------------------------------------------------- states


def test_a_state_brings_another_copy_of_the_model_to_the_same_place(tmp_path: Path) -> None:
    mujoco = import_mujoco()
    model, data = ball(mujoco, tmp_path / "ball.xml")
    mujoco.mj_step(model, data, 100)
    model.geom("skin").rgba[:] = 0.25, 0.5, 0.75, 1.0
    state = state_of(model, data)
    assert time_of(state) == pytest.approx(0.2)

    other = load_model(mujoco, tmp_path / "ball.xml")
    there = mujoco.MjData(other)
    take_state(mujoco, other, there, state)
    assert there.body("ball").xpos == pytest.approx(data.qpos[:3], abs=1e-6) and there.body("ball").xpos[2] < 1.9
    assert other.geom("skin").rgba == pytest.approx([0.25, 0.5, 0.75, 1.0])
    assert there.time == pytest.approx(0.2)


def test_the_state_of_another_model_is_refused(tmp_path: Path) -> None:
    mujoco = import_mujoco()
    model, data = ball(mujoco, tmp_path / "ball.xml")
    for wrong in (b"", state_of(model, data)[:-4], state_of(model, data) + b"\0\0\0\0"):
        with pytest.raises(ValueError, match="another model|buffer"):
            take_state(mujoco, model, data, wrong)


@pytest.mark.parametrize(("text", "reason"), [("<mujoco><wrong/></mujoco>", "wrong"), ("", "model cannot be read")])
def test_a_model_that_cannot_be_read_is_told_in_a_line(tmp_path: Path, text: str, reason: str) -> None:
    file = tmp_path / "model.xml"
    file.write_text(text)
    with pytest.raises(NoPictures, match=reason) as caught:
        load_model(import_mujoco(), file)
    assert "\n" not in str(caught.value)


# ---------------------------------------------------------------- simulated robots


def test_the_console_of_a_simulated_robot_tells_states_and_writes_the_model(tmp_path: Path) -> None:
    simulation, advanced = Simulation("p3dx", "room", 0.002), []
    word = scene_word(simulation, lambda: advanced.append(True))["scene"]
    file = tmp_path / "world.mjb"
    assert word.run([str(file)]) == "ok" and not advanced
    state = subprocess.run(["base64", "-d"], input=word.run([]).encode(), capture_output=True, check=True).stdout
    assert advanced

    mujoco = import_mujoco()
    model = load_model(mujoco, file)
    data = mujoco.MjData(model)
    take_state(mujoco, model, data, state)
    assert data.qpos == pytest.approx(simulation.data.qpos, abs=1e-5)
    with pytest.raises(UnknownRequest, match="cannot be written"):
        word.run([str(tmp_path / "missing" / "world.mjb")])


def test_a_crate_that_is_put_into_the_world_is_in_the_state() -> None:
    simulation = Simulation("p3dx", "room", 0.002)
    word = scene_word(simulation, lambda: None)["scene"]
    before = word.run([])
    simulation.add_crate(1.0, 0.0)
    assert word.run([]) != before


# ---------------------------------------------------------------- recordings


def test_a_recording_in_simulated_time_is_the_same_each_time(tmp_path: Path) -> None:
    found = []
    for turn in range(2):
        lab, file = pioneer_lab(), tmp_path / f"{turn}.world"
        lab.say("worldView.record(10) | wander.start;")
        lab.run(3.0)
        lab.say(f'worldView.save("{file}");')
        recording = SceneRecording.parse(file.read_bytes())
        assert recording.model == PIONEER and recording.compiled == b""
        assert recording.period == pytest.approx(0.1, abs=0.021)  # of whole steps
        assert 25 <= len(recording.states) <= 31
        found.append(recording.states)
        lab.run(1.0)
        assert lab.say('worldView.save("x");').endswith("nothing is recorded: say worldView.record(20) first")
    assert found[0] == found[1] and found[0][0] != found[0][-1]


def test_a_recording_has_a_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("urbihw.platforms.scene.recording.MAX_BYTES", 100)
    recording = SceneRecording(Path("model.xml"), 20)
    for _ in range(50):
        recording.add(b"12345678")
    assert len(recording.states) == 12


def test_a_compiled_model_is_kept_in_the_recording(tmp_path: Path) -> None:
    model = tmp_path / "model.mjb"
    model.write_bytes(b"model\nof bytes")
    recording = SceneRecording.begin(model, 20)
    recording.add(b"\0" * 8)
    recording.add(b"\1" * 8)
    again = SceneRecording.parse(recording.data())
    assert again.compiled == b"model\nof bytes" and again.states == [b"\0" * 8, b"\1" * 8] and again.rate == 20
    with pytest.raises(ValueError, match=r"missing\.mjb cannot be read"):
        SceneRecording.begin(tmp_path / "missing.mjb", 20)


@pytest.mark.parametrize("data", [
    b"", b"\xff\xfe", b"{}\n", b"[]\n", b'{"kind": "x", "model": "m", "rate": 1, "size": 1, "compiled": 0}\n',
    b'{"kind": "urbihw world 1", "model": "m", "rate": -1, "size": 1, "compiled": 0}\n',
    b'{"kind": "urbihw world 1", "model": "m", "rate": 1, "size": -1, "compiled": 0}\n',
    b"[" * 100_000,
])  # fmt: skip
def test_what_is_no_recording_is_refused(data: bytes) -> None:
    with pytest.raises(BadRecording):
        SceneRecording.parse(data)


# ---------------------------------------------------------------- the object


def test_programs_cannot_make_another_view_nor_write_where_they_may_not() -> None:
    lab = pioneer_lab()
    assert "it belongs to the simulation" in lab.say("WorldView.new;")
    assert "target is the name of a body" in lab.say("worldView.target = 3;")
    assert "0 to 1000 m" in lab.say("worldView.distance = -1;")
    assert "a finite number" in lab.say("worldView.azimuth = inf;")
    assert "0.1 to 100" in lab.say("worldView.record(1e9);")
    assert "cannot be" in lab.say('worldView.record(20) | worldView.save("/nonexistent/file");')


def test_nothing_is_sampled_while_nobody_looks() -> None:
    lab = pioneer_lab()
    lab.run(1.0)
    assert lab.say("worldView.state.data.size;") == "0"
    lab.say("worldView.record(20);")
    lab.run(1.0)
    assert int(lab.say("worldView.state.data.size;")) > 100


def test_looking_moves_nothing() -> None:
    lab = pioneer_lab()
    place = lab.body("pioneer").xpos.copy()
    lab.say("worldView.record(20);")
    lab.run(2.0)
    assert lab.body("pioneer").xpos == pytest.approx(place, abs=1e-3)


# ---------------------------------------------------------------- drawing


class Gallery:
    """Pictures and problems as a kernel gets them."""

    def __init__(self) -> None:
        self.pictures: list[bytes] = []
        self.problems: list[str] = []
        self._news = threading.Condition()
        self.drawing = SceneDrawing(self._post, lambda picture, _: self.pictures.append(picture), self.problems.append)

    def _post(self, action: Callable[[], None]) -> None:
        with self._news:
            action()
            self._news.notify()

    def wait(self, ready: Callable[[], bool]) -> None:
        """Wait until it is so."""
        with self._news:
            assert self._news.wait_for(ready, TIMEOUT_S)


def test_pictures_are_drawn_by_a_process_that_can_be_killed(tmp_path: Path) -> None:
    mujoco = import_mujoco()
    model, data = ball(mujoco, tmp_path / "ball.xml")
    gallery = Gallery()
    gallery.drawing.start()
    try:
        gallery.drawing.offer(tmp_path / "ball.xml", state_of(model, data), 0.0, ViewPoint(target="ball"))
        gallery.wait(lambda: bool(gallery.pictures or gallery.problems))
        if gallery.problems:
            pytest.skip(f"no OpenGL here: {gallery.problems[0]}")
        assert gallery.pictures[0].startswith(b"\xff\xd8")
        gallery.drawing.offer(tmp_path / "ball.xml", state_of(model, data), 0.0, ViewPoint(target="no such body"))
        gallery.wait(lambda: bool(gallery.problems))
        assert gallery.problems == ["no body 'no such body'; there are: ball"]
    finally:
        gallery.drawing.stop()
    end = time.monotonic() + TIMEOUT_S
    while gallery.drawing._thread is not None and time.monotonic() < end:
        threading.Event().wait(0.01)
    assert gallery.drawing._process is None


def test_without_opengl_it_is_told_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "disable")
    model, data = ball(import_mujoco(), tmp_path / "ball.xml")
    gallery = Gallery()
    gallery.drawing.start()
    gallery.drawing.offer(tmp_path / "ball.xml", state_of(model, data), 0.0, ViewPoint())
    gallery.wait(lambda: bool(gallery.problems))
    gallery.drawing.stop()
    assert "no OpenGL" in gallery.problems[0] and not gallery.pictures


def test_the_painter_ends_with_its_input(tmp_path: Path) -> None:
    ball(import_mujoco(), tmp_path / "ball.xml")
    command = (sys.executable, "-m", "urbihw.platforms.scene.painter", str(tmp_path / "ball.xml"), "32", "24")
    done = subprocess.run(command, input=b"", capture_output=True, timeout=TIMEOUT_S, check=False)
    assert done.returncode == 0
    wrong = subprocess.run(command, input=json.dumps([0, 0, 0, "", 2]).encode() + b"\nxx", capture_output=True,
                           timeout=TIMEOUT_S, check=False)  # fmt: skip
    assert wrong.returncode == 0 and wrong.stdout.startswith(b"problem ") and wrong.stdout.count(b"\n") == 1


def test_a_model_that_cannot_be_had_is_a_line_of_the_log_and_no_failure(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def missing(scene: SimulatedScene) -> Path:
        raise ValueError("scene: the disk is full")

    monkeypatch.setattr(SimulatedScene, "model", missing)
    lab = pioneer_lab()
    assert "worldView gives no pictures: scene: the disk is full" in caplog.text
    assert lab.say("wander.start; 1 + 1;", 0.2) == "2"
    assert "the disk is full" in lab.say("worldView.record(20);")
