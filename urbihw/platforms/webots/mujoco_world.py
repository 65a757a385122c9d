"""A MuJoCo model, or a URDF, as a simulation with the devices of Webots.

The worker's thread steps and renders; a ``Renderer`` belongs to the thread that has made it.  The physics is the same
each time: a run depends on the orders and on nothing else.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

from urbihw.platforms.scene.library import import_mujoco
from urbihw.platforms.scene.state import state_of
from urbihw.platforms.webots import simulator as s
from urbihw.platforms.webots.model_check import reason_against
from urbihw.platforms.webots.mujoco_light import MujocoLight
from urbihw.platforms.webots.mujoco_motors import Motor
from urbihw.platforms.webots.mujoco_sensors import Radio, Rays, quaternion_of, rotation_vector, sensor

BASIC_STEP_MS: Final = 20
"""Basic time step of a model that names none (``<numeric name="basic step" data="32"/>``, in ms)."""
DEFAULT_WIDTH, DEFAULT_HEIGHT = 160, 120
"""Pixels of a camera whose model names no resolution."""
MAX_PIXELS: Final = 1920 * 1080
"""Pixels of a camera at most."""
MIN_TIMESTEP_S, MAX_TIMESTEP_S = 1e-5, 1.0
"""Limits of the step of the physics; a shorter one would let the simulation stand still."""
MAX_BASIC_STEP_MS: Final = 10_000
URDF_FORCE: Final = 10.0
"""Newton metres, or N, of a motor of a URDF whose joint names no effort."""
URDF_GAIN: Final = 10.0
"""Torque of a motor of a URDF for an error of 1 rad, as a multiple of its effort."""


class BadModel(Exception):
    """The model cannot be loaded; the message is one line."""


class MujocoWorld(s.BackEnd):
    """A loaded model, its state, and its devices."""

    def __init__(self, path: Path) -> None:
        """Load a model.  Raises NoMujoco, BadModel."""
        super().__init__()
        self._path = path
        self._mujoco = import_mujoco()
        self._model = self._load(path)
        self._data = self._mujoco.MjData(self._model)
        self._mujoco.mj_forward(self._model, self._data)
        self._check_numbers(path)
        self._told_unstable = False
        self._radio = Radio()
        self._motors: dict[str, Motor] = {}
        self._reads: dict[str, Callable[[], Any]] = {}
        self._writes: dict[str, Callable[[str, Any], None]] = {}
        self._leds: dict[str, tuple[Any, Any]] = {}
        self._cameras: dict[str, tuple[int, int]] = {}
        self._renderers: dict[tuple[int, int], Any] = {}
        self.labels: dict[int, s.LabelText] = {}
        self.shown: dict[str, Any] = {}
        """Speaker or display -> what was last written to it."""
        devices = [*self._find_motors(), *self._find_sensors(), *self._find_cameras(), *self._find_declared()]
        names = [each.name for each in devices]
        for name in names:
            if names.count(name) > 1:
                raise BadModel(f"{path}: two devices are called {name!r}; give one of them another name")
        model = self._model
        self._step_ms = self._basic_step()
        self._nodes = {model.body(i).name: i for i in range(1, model.nbody) if model.body(i).name}
        self._reads[s.SCENE] = lambda: state_of(self._model, self._data)
        self.world = s.SimulatedWorld(
            name=path.stem, simulator=f"MuJoCo {self._mujoco.__version__}", step_ms=self._step_ms,
            devices=tuple(devices), nodes=tuple(self._nodes), folder=str(path.parent),
            program=_texts(model).get("program", ""), model=str(path),
        )  # fmt: skip

    # ---------------------------------------------------------------- loading

    def _load(self, path: Path) -> Any:
        try:
            spec = self._mujoco.MjSpec.from_file(str(path))
            if path.suffix == ".urdf" or not _is_mjcf(path):
                self._add_motors(spec)
            return spec.compile()
        except (ValueError, OSError) as error:
            raise BadModel(f"{path}: {' '.join(str(error).split())}") from error

    def _check_numbers(self, path: Path) -> None:
        """Raise BadModel for a model with a nan, from which nothing but nan follows; the compiler lets it pass."""
        model, data = self._model, self._data
        numbers = [*model.opt.gravity, model.opt.timestep, *model.body_mass, *data.xpos.ravel(), *data.qacc]
        if not all(map(math.isfinite, numbers)):
            raise BadModel(f"{path}: a number is nan or inf: see gravity, and masses, places and joints of bodies")
        step = float(model.opt.timestep)
        if not MIN_TIMESTEP_S <= step <= MAX_TIMESTEP_S:
            raise BadModel(f"{path}: the timestep is {MIN_TIMESTEP_S:g} to {MAX_TIMESTEP_S:g} s, not {step:g}")

    def _add_motors(self, spec: Any) -> None:
        """Give each hinge and slide of a URDF, which has no motors, one that goes to positions, called as the joint."""
        kinds = self._mujoco.mjtJoint
        for joint in spec.joints:
            if joint.type not in (kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE) or not joint.name:
                continue
            force = float(joint.actfrcrange[1]) or URDF_FORCE
            gain = force * URDF_GAIN
            motor = spec.add_actuator(name=joint.name, target=joint.name, trntype=self._mujoco.mjtTrn.mjTRN_JOINT)
            motor.set_to_position(kp=gain, dampratio=1.0)
            motor.forcelimited, motor.forcerange = True, [-force, force]
            # A link of a few grams at a strong motor blows up otherwise.
            joint.armature = max(float(joint.armature), 0.01)
        spec.option.integrator = self._mujoco.mjtIntegrator.mjINT_IMPLICITFAST

    def _basic_step(self) -> int:
        model = self._model
        numerics = {model.numeric(i).name: float(model.numeric(i).data[0]) for i in range(model.nnumeric)}
        wanted = numerics.get("basic step", BASIC_STEP_MS)
        if not 0 < wanted <= MAX_BASIC_STEP_MS:
            raise BadModel(f"numeric 'basic step': 1 to {MAX_BASIC_STEP_MS} ms, not {wanted:g}")
        own = model.opt.timestep * 1000
        return max(1, round(max(1, round(float(wanted / own))) * float(own)))

    def _find_motors(self) -> list[s.SimDevice]:
        model, found = self._model, []
        for index in range(model.nu):
            row = model.actuator(index)
            if row.name and int(row.trntype[0]) == int(self._mujoco.mjtTrn.mjTRN_JOINT):
                motor = Motor(model, self._data, index, int(row.trnid[0]))
                self._motors[row.name] = motor
                self._reads[row.name] = motor.values
                self._writes[row.name] = motor.write
                found.append(motor.device)
        return found

    def _find_sensors(self) -> list[s.SimDevice]:
        found = []
        for index in range(self._model.nsensor):
            made = sensor(self._mujoco, self._model, self._data, index)
            if made is not None and made[0].name:
                found.append(made[0])
                self._reads[made[0].name] = made[1]
        return found

    def _find_cameras(self) -> list[s.SimDevice]:
        model, found = self._model, []
        near = model.vis.map.znear * model.stat.extent
        far = model.vis.map.zfar * model.stat.extent
        for index in range(model.ncam):
            camera = model.camera(index)
            width, height = (int(each) for each in model.cam_resolution[index])
            if width <= 1 or height <= 1:
                width, height = DEFAULT_WIDTH, DEFAULT_HEIGHT
            if width * height > MAX_PIXELS:
                raise BadModel(f"camera {camera.name!r}: {width} by {height} pixels; at most {MAX_PIXELS} in all")
            facts = {"width": width, "height": height, "yfov": float(camera.fovy[0]) * 0.017453292519943295}
            found.append(s.SimDevice(camera.name, s.CAMERA, facts | {"near": float(near), "far": float(far)}))
            self._cameras[camera.name] = width, height
            self._reads[camera.name] = partial(self._render, camera.name, width, height)
        return [each for each in found if each.name]

    def _find_declared(self) -> list[s.SimDevice]:
        """The devices that texts of the model declare; see ``mujoco_sensors``."""
        found = []
        for name, text in _texts(self._model).items():
            words = text.split()
            kind, parameters = (words or [""])[0], words[1:]
            try:
                device = self._declared(name, kind, parameters)
            except (KeyError, ValueError, IndexError) as error:
                raise BadModel(f"text {name!r}: {' '.join(words)!r} declares no device: {error}") from error
            found += [] if device is None else [device]
        return found

    def _declared(self, name: str, kind: str, parameters: Sequence[str]) -> s.SimDevice | None:
        if kind == "led":
            self._find_led(name)
            return s.SimDevice(name, s.LED)
        if kind == "light-sensor":
            eye = MujocoLight(self._mujoco, self._model, self._data, name)
            self._reads[name] = eye.read
            return eye.device
        if kind in ("lidar", "range-finder"):
            if len(parameters) != (3 if kind == "lidar" else 4):
                raise ValueError("wrong number of values")
            rays = Rays(self._mujoco, self._model, self._data, name, parameters)
            self._reads[name] = rays.read
            return rays.device
        if kind in ("emitter", "receiver"):
            channel = int(parameters[0])
            if kind == "emitter":
                self._writes[name] = lambda item, value: self._radio.send(channel, bytes(value))
                return s.SimDevice(name, s.EMITTER, {"channel": channel})
            self._radio.add_receiver(name, channel)
            self._reads[name] = partial(self._radio.receive, name)
            return s.SimDevice(name, s.RECEIVER, {"channel": channel})
        if kind in ("speaker", "display"):
            self._writes[name] = lambda item, value: self.shown.__setitem__(name, value)
            sizes = dict(zip(("width", "height"), map(float, parameters), strict=False))
            return s.SimDevice(name, s.SPEAKER if kind == "speaker" else s.DISPLAY, sizes)
        return None

    def _find_led(self, name: str) -> None:
        model = self._model
        try:
            rgba = model.geom(name).rgba
        except KeyError:
            rgba = model.site(name).rgba
        full = rgba.copy()

        def write(item: str, value: float) -> None:
            rgba[:3] = full[:3] * (0.2 + 0.8 * min(max(value, 0.0), 1.0))

        write("value", 0.0)
        self._writes[name] = write

    # ---------------------------------------------------------------- stepping

    def step(self, ms: int) -> bool:
        model, data, mj_step = self._model, self._data, self._mujoco.mj_step
        count = max(1, round(ms / 1000 / model.opt.timestep))
        moving = [motor for motor in self._motors.values() if motor.is_on_its_way()]
        if not moving:
            # One more call for the controls of the motors that have just arrived.
            for motor in self._motors.values():
                motor.control(0.0)
            mj_step(model, data, count)
            return True
        for _ in range(count):
            for motor in self._motors.values():
                motor.control(model.opt.timestep)
            mj_step(model, data)
        return True

    def run(self, ms: int, orders: Sequence[s.StepOrder]) -> s.Outcome:
        """See ``BackEnd``; physics that blow up are a problem, told once."""
        outcome = super().run(ms, orders)
        if self._told_unstable or not self._is_unstable():
            return outcome
        self._told_unstable = True
        problem = (
            "the physics became unstable, and MuJoCo begins again from the start: make the timestep smaller, or the "
            "motors weaker (kp, kv, gear)"
        )
        return dataclasses.replace(outcome, problems=(*outcome.problems, problem))

    def _is_unstable(self) -> bool:
        kinds = self._mujoco.mjtWarning
        return any(
            self._data.warning[int(kind)].number
            for kind in (kinds.mjWARN_BADQPOS, kinds.mjWARN_BADQVEL, kinds.mjWARN_BADQACC)
        )

    def time(self) -> float:
        return self.elapsed_ms / 1000

    def enable(self, name: str, period: int) -> None:
        """See ``BackEnd``; any device can be sampled, and any node."""
        if name not in self._reads:
            node = name.removeprefix(s.NODES)
            if node not in self._nodes:
                raise ValueError(s.no_such(s.NODE, node, self._nodes))
            self._reads[name] = partial(self._place, self._nodes[node])
        elif period and name in self._cameras:
            self._renderer(name, *self._cameras[name])

    def read(self, name: str) -> Any:
        return self._reads[name]()

    def write(self, name: str, item: str, value: Any) -> None:
        writer = self._writes.get(name)
        if writer is None:
            raise ValueError(s.no_such("device to write to", name, self._writes))
        writer(item, value)

    def stop(self, name: str) -> None:
        if name in self._motors:
            self._motors[name].hold()

    def _render(self, camera: str, width: int, height: int) -> bytes:
        renderer = self._renderer(camera, width, height)
        renderer.update_scene(self._data, camera=camera)
        return bytes(renderer.render().tobytes())

    def _renderer(self, camera: str, width: int, height: int) -> Any:
        """Return what renders pictures of a size; made once, which takes up to a second.  Raises ValueError."""
        renderer = self._renderers.get((width, height))
        if renderer is None:
            try:
                renderer = self._mujoco.Renderer(self._model, height=height, width=width)
            except Exception as error:  # Whatever the drivers of the graphics raise.
                raise ValueError(
                    f"camera {camera!r} gives no pictures: no OpenGL ({' '.join(str(error).split()) or 'not found'}); "
                    "install libegl1 and libgl1-mesa-dri, or libosmesa6; then MUJOCO_GL is egl, osmesa or not set"
                ) from error
            self._renderers[width, height] = renderer
        return renderer

    # ---------------------------------------------------------------- the supervisor

    def _place(self, body: int) -> tuple[float, ...]:
        return (*(float(each) for each in self._data.xpos[body]), *rotation_vector(self._data.xquat[body]))

    def move(self, node: str, item: str, value: Sequence[float]) -> None:
        """See ``BackEnd``: a body with a free joint, one that programs move (``mocap``), or one that is fixed."""
        model, data = self._model, self._data
        if node not in self._nodes:
            raise ValueError(s.no_such(s.NODE, node, self._nodes))
        body = model.body(self._nodes[node])
        numbers = list(value) if item == "translation" else list(quaternion_of(value))
        joint = int(body.jntadr[0])
        part = slice(0, 3) if item == "translation" else slice(3, 7)
        if joint >= 0 and int(model.jnt_type[joint]) == int(self._mujoco.mjtJoint.mjJNT_FREE):
            start = int(model.jnt_qposadr[joint])
            data.qpos[start : start + 7][part] = numbers
            data.qvel[int(model.jnt_dofadr[joint]) :][:6] = 0.0
        elif int(body.mocapid[0]) >= 0:
            (data.mocap_pos if item == "translation" else data.mocap_quat)[int(body.mocapid[0])] = numbers
        else:
            (body.pos if item == "translation" else body.quat)[:] = numbers
        self._mujoco.mj_forward(model, data)

    def label(self, label: s.LabelText) -> None:
        """Keep a text for the view of the world; an empty one removes it."""
        self.labels.pop(label.number, None)
        if label.text:
            self.labels[label.number] = label

    def reset_physics(self) -> None:
        self._data.qvel[:] = 0.0
        self._data.qacc_warmstart[:] = 0.0
        self._mujoco.mj_forward(self._model, self._data)

    def revert(self) -> None:
        """See ``BackEnd``: the caller loads the model again.  Raises ValueError for a file that was spoilt meanwhile:
        the world goes on as it was (the worker hears nothing meanwhile, so its dead-man time may stop the motors)."""
        reason = reason_against(self._path)
        if reason:
            raise ValueError(f"the world is not loaded again: {reason}")

    def quit(self) -> None:
        """See ``BackEnd``: there is no program to end."""

    def close(self) -> None:
        """Free the pictures' memory."""
        for renderer in self._renderers.values():
            with contextlib.suppress(Exception):  # A context that is already gone.
                renderer.close()
        self._renderers.clear()


def _texts(model: Any) -> dict[str, str]:
    """The texts of a model (``<custom><text>``) by name."""
    def text(data: bytes) -> str:
        return data.partition(b"\0")[0].decode("utf-8", "replace")

    return {
        text(model.names[model.name_textadr[i] :]): text(model.text_data[model.text_adr[i] :])
        for i in range(model.ntext)
    }  # fmt: skip


def _is_mjcf(path: Path) -> bool:
    with contextlib.suppress(OSError):
        return b"<mujoco" in path.read_bytes()[:4096]
    return True
