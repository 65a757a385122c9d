"""The devices of the manual's chapter 4, as they stand in docs/examples: one scenario each, played with the devices
plugged into the server and again with the devices in a process of their own."""

from __future__ import annotations

import importlib.util
import math
import struct
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from PIL import Image, ImageDraw
from places import PLACES, Plugged, Remote

from urbihw.kernel.uobject import UObject

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"


def example(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"example_{name}", EXAMPLES / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def kind_of(base: Any, hardware: Any) -> type[UObject]:
    made: type[UObject] = type(base.__name__, (base,), {"hardware": hardware})
    return made


@pytest.fixture(params=PLACES)
def place(request: pytest.FixtureRequest) -> Iterator[Plugged]:
    yield PLACES[request.param]()


# ---------------------------------------------------------------- servomotors


class Motors:
    def __init__(self) -> None:
        self.positions = dict.fromkeys(range(1, 5), 0.0)
        self.orders: list[tuple[int, float]] = []
        self.volleys: list[dict[int, float]] = []
        self.gains: list[tuple[int, float, float, float]] = []

    def initialize(self, id: int) -> bool:
        return id in self.positions

    def get_position(self, id: int) -> float:
        return self.positions[id]

    def set_position(self, id: int, position: float) -> None:
        self.orders.append((id, position))
        self.positions[id] = position - 0.01

    def set_positions(self, positions: dict[int, float]) -> None:
        self.volleys.append(dict(positions))
        self.positions.update(positions)

    def set_pid(self, id: int, p: float, i: float, d: float) -> None:
        self.gains.append((id, p, i, d))


def test_a_servomotor(place: Plugged) -> None:
    motors = Motors()
    place.register(kind_of(example("servo").Servo, motors))
    assert place.say("var wrist = Servo.new(3)|; wrist.val = 0.5; sleep(50ms); wrist.val;", 0.1) == ["0.5", "0.49"]
    assert motors.orders == [(3, 0.5)]
    motors.orders.clear()
    place.say("wrist.val = 1 time:1s;", 1.5)
    positions = [position for _, position in motors.orders]
    assert positions[-1] == 1.0 and positions == sorted(positions)
    assert len(positions) == pytest.approx(50, abs=2)
    assert place.say("wrist.val;", 2.0) == ["0.99"]
    place.say("wrist.P = 2; wrist.setPID(3, 1, 0.5); sleep(20ms);", 2.2)
    assert motors.gains == [(3, 2.0, 0.0, 0.0), (3, 3.0, 1.0, 0.5)]
    assert place.say("wrist.D;", 2.4) == ["0.5"]
    (refusal,) = place.say("Servo.new(9);", 2.6)
    assert refusal.endswith("new: there is no servomotor 9")
    name = place.say("wrist.__uobjectName;", 2.7)[0].strip('"')
    assert place.say(f'wrist.destroy; uobjects.hasSlot("{name}");', 2.8) == ["false"]


def test_a_hub(place: Plugged) -> None:
    module = example("servo_hub")
    motors = Motors()
    module.ServoHub.hardware = motors
    place.register(module.ServoHub, module.HubServo)
    assert place.say("var a = HubServo.new(1)|; var b = HubServo.new(2)|;", 0.1) == []
    place.say("a.val = 0.5 | b.val = 0.7;", 0.2)
    assert motors.volleys == [{1: 0.5, 2: 0.7}]
    assert place.say("a.val; b.val;", 0.3) == ["0.5", "0.7"]
    place.say("a.val = 1 time:0.2s & b.val = 0 time:0.2s;", 0.7)
    assert motors.volleys[-1] == {1: 1.0, 2: 0.0}
    assert all(set(volley) == {1, 2} for volley in motors.volleys[1:-1])
    assert len(place.host.hub(module.ServoHub).members) == 2
    place.say("b.destroy;", 0.8)
    assert len(place.host.hub(module.ServoHub).members) == 1
    place.say("a.val = 0.25;", 1.0)
    assert motors.volleys[-1] == {1: 0.25}


# ---------------------------------------------------------------- images


class Scene:
    """A red ball on a meadow, which rolls to the right and out of sight."""

    width, height = 160, 120

    def __init__(self) -> None:
        self.x = -20
        self.shots = 0

    def initialize(self, id: int) -> bool:
        return id == 0

    def get_width(self, id: int) -> int:
        return self.width

    def get_height(self, id: int) -> int:
        return self.height

    def get_image(self, id: int) -> bytes:
        self.shots += 1
        picture = Image.new("RGB", (self.width, self.height), (40, 160, 60))
        draw = ImageDraw.Draw(picture)
        draw.rectangle((0, 0, self.width, 40), fill=(120, 180, 255))
        draw.ellipse((self.x - 10, 50, self.x + 10, 70), fill=(230, 30, 20))
        return picture.tobytes()


def test_a_camera(place: Plugged) -> None:
    scene = Scene()
    scene.x = 80
    place.register(kind_of(example("camera").Camera, scene))
    assert place.say("var camera = Camera.new(0)|; camera.width; camera.height;", 0.1) == ["160", "120"]
    place.say("", 0.2)
    assert place.say("camera.val.keywords; camera.val.data.size;", 0.25) == ['"rgb 160 120"', "57600"]
    before = scene.shots
    place.say("for (5) camera.val|;", 0.251)
    assert scene.shots <= before + 1
    (refusal,) = place.say("Camera.new(1);", 0.3)
    assert refusal.endswith("there is no camera 1")
    assert place.say("camera.val = 1;", 0.4)[0].endswith("val: this slot can only be read")


def test_a_ball_detector(place: Plugged) -> None:
    scene = Scene()
    place.register(kind_of(example("camera").Camera, scene), example("ball").BallTracker)
    place.say('var camera = Camera.new(0)|; var ball = BallTracker.new(camera.getSlot("val"))|;', 0.1)
    place.say('at (ball.visible) echo("there") onleave echo("gone"); every (20ms) camera.val|,', 0.2)
    assert place.say("ball.visible;", 0.3) == ["0"]
    scene.x = 80
    assert place.say("", 0.5) == ["*** there"]
    x, y = (float(line) for line in place.say("ball.x; ball.y;", 0.6))
    assert x == pytest.approx(0.5, abs=0.01)
    assert y == pytest.approx(0.5, abs=0.01)
    scene.x = 40
    place.say("", 0.8)
    assert float(place.say("ball.x;", 0.9)[0]) == pytest.approx(0.25, abs=0.01)
    scene.x = 200
    assert place.say("", 1.1) == ["*** gone"]


def test_the_camera_plugged_in_and_the_detector_beside() -> None:
    place = Remote()
    scene = Scene()
    scene.x = 120
    place.server.host.register(kind_of(example("camera").Camera, scene))
    place.register(example("ball").BallTracker)
    place.say("var Global.camera = Camera.new(0)|;", 0.1)
    place.say('var ball = BallTracker.new(camera.getSlot("val"))|; every (20ms) camera.val|,', 0.2)
    visible, x = (float(line) for line in place.say("ball.visible; ball.x;", 0.5))
    assert visible and x == pytest.approx(0.75, abs=0.01)


# ---------------------------------------------------------------- sounds


class Tone:
    """A microphone that hears 440 Hz, and a loudspeaker that remembers."""

    rate = 8000

    def __init__(self) -> None:
        self.heard = 0
        self.played = b""

    def record(self, samples: int) -> bytes:
        times = range(self.heard, self.heard + samples)
        self.heard += samples
        return b"".join(struct.pack("<h", int(20000 * math.sin(math.tau * 440 * t / self.rate))) for t in times)

    def play(self, samples: bytes, rate: int) -> None:
        assert rate == self.rate
        self.played += samples


def test_a_microphone(place: Plugged) -> None:
    module, tone = example("microphone"), Tone()
    place.register(kind_of(module.Microphone, tone), kind_of(module.Loudspeaker, tone))
    place.say("var micro = Microphone.new|; var speaker = Loudspeaker.new|;", 0.1)
    assert place.say("micro.val.keywords; micro.val.data.size;", 0.2) == ['"raw 1 8000 16 1"', "320"]
    place.say("at (micro.val->changed?) speaker.val = micro.val;", 0.3)
    place.say("", 0.8)
    whole = Tone().record(tone.heard)
    assert len(tone.played) >= 320 * 20
    assert tone.played in whole
    assert float(place.say("speaker.played;", 0.9)[0]) == pytest.approx(0.5, abs=0.12)
    assert place.say("speaker.silence; speaker.played;", 0.901)[-1] in ("0", "0.02")
    assert place.say('speaker.val = "la";', 1.0) == ['"la"']
