"""Pictures and sound of a Spykee, proven by what is in them; music; the Clapper of the manual."""

from __future__ import annotations

import array
import io
import math
import wave
from pathlib import Path
from typing import Any

import pytest
from spykee_lab import Lab

from urbihw.kernel.uobject import UImage, USound
from urbihw.platforms.jpeg import size_of
from urbihw.platforms.sound import PIECE_SAMPLES, SoundRecording
from urbihw.platforms.spykee.clapper import BLOCK_S, Counter
from urbihw.platforms.streamed import LINGER_S

RATE = 16_000


# ---------------------------------------------------------------- camera

COLOURS = {"red": (200, 30, 30), "green": (30, 160, 30), "blue": (30, 30, 200), "yellow": (210, 200, 30)}
WALLS = {"red": (0.0, 2.0), "green": (math.pi / 2, 1.5), "blue": (math.pi, 2.0), "yellow": (-math.pi / 2, 1.5)}
"""The direction in which a wall lies, and how far from the middle of the room, as the fake says."""
FOCAL, ABOVE = 277.0, 0.35
"""Pixels; m of wall above the camera."""


def tops(jpeg: bytes) -> dict[str, list[tuple[float, float]]]:
    """The upper edges of the walls in a picture: colour -> (pixels to the left of the middle, pixels above it)."""
    Image = pytest.importorskip("PIL.Image")
    image = Image.open(io.BytesIO(jpeg)).convert("RGB")
    found: dict[str, list[tuple[float, float]]] = {}
    for column in range(4, 316, 4):
        seen = image.getpixel((column, 119))
        colour = min(COLOURS, key=lambda name: math.dist(COLOURS[name], seen))
        if math.dist(COLOURS[colour], seen) > 60:
            continue
        wall = COLOURS[colour]
        above = (row for row in range(119) if math.dist(image.getpixel((column, 118 - row)), wall) > 90)
        height = next(above, 119)
        found.setdefault(colour, []).append((159.5 - column, height + 1.0))
    return found


def wall_of(edge: list[tuple[float, float]]) -> tuple[float, float]:
    """How far a wall is, and in which direction (rad to the left).

    A wall d away, whose direction is a, lies as deep as d / (cos a + u / f sin a) in column u: its edge is a straight
    line in the picture.
    """
    n = len(edge)
    mu, mh = sum(u for u, _ in edge) / n, sum(h for _, h in edge) / n
    slope = sum((u - mu) * (h - mh) for u, h in edge) / sum((u - mu) ** 2 for u, _ in edge)
    middle = (mh - slope * mu) / FOCAL
    return ABOVE / math.hypot(middle, slope), math.atan2(slope, middle)


def pose_of(jpeg: bytes) -> dict[str, float]:
    """What a picture tells of the pose: the heading, and x or y by each wall that is seen well."""
    pose: dict[str, float] = {}
    for colour, edge in sorted(tops(jpeg).items(), key=lambda row: len(row[1])):
        if len(edge) < 15:
            continue
        distance, direction = wall_of(edge)
        where, far = WALLS[colour]
        pose["heading"] = math.remainder(where - direction, math.tau)
        along = far - distance
        name, sign = {"red": ("x", 1), "green": ("y", 1), "blue": ("x", -1), "yellow": ("y", -1)}[colour]
        pose[name] = sign * along
    return pose


def picture(lab: Lab) -> bytes:
    lab.look("camera.val")
    lab.run(0.3)
    image = lab.robot.camera.val.sensed
    assert isinstance(image, UImage) and image.keywords == "jpeg 320 240"
    return bytes(image.data)


@pytest.mark.parametrize(
    ("x", "y", "degrees"), [(0, 0, 0), (0.5, 0.4, 10), (-0.4, 0.3, 90), (0.2, -0.5, -80), (0.3, 0.2, 180), (0, 0, 40)]
)
def test_the_pose_is_read_back_from_the_picture(x: float, y: float, degrees: float) -> None:
    lab = Lab.ready()
    lab.device.body.place(x, y, math.radians(degrees))
    pose = pose_of(picture(lab))
    assert math.remainder(pose["heading"] - math.radians(degrees), math.tau) == pytest.approx(0, abs=0.04)
    for name, true in (("x", x), ("y", y)):
        assert pose.get(name, true) == pytest.approx(true, abs=0.06)


def test_what_the_camera_shows_changes_with_a_turn() -> None:
    lab = Lab.ready()
    before = pose_of(picture(lab))["heading"]
    lab.say("robot.turn(30deg);", 4)
    after = pose_of(picture(lab))["heading"]
    assert after - before == pytest.approx(lab.device.body.heading, abs=0.05)
    assert lab.device.body.heading < -0.3


def test_the_headlight_lights_a_dark_room() -> None:
    lab = Lab.ready()
    lab.device.dark = True
    assert pose_of(picture(lab)) == {}
    lab.say("headLed.val = 1;", 0.1)
    assert "x" in pose_of(picture(lab))


def test_the_camera_is_on_while_somebody_reads() -> None:
    lab = Lab.ready()
    assert lab.look("camera.on") == "false"
    lab.say("loop { camera.val | sleep(1s) },", 0.5 + 2 * LINGER_S)
    assert lab.look("camera.on") == "true"
    lab.lobby.close()
    lab.run(LINGER_S + 0.5)
    assert lab.look("camera.on") == "false"
    frames = lab.device.frames
    lab.run(1.0)
    assert lab.device.frames == frames


@pytest.mark.parametrize("how", ["at (camera.val->changed?) { nobody }", "at (camera.val.keywords == \"x\") 1"])
def test_the_camera_is_on_while_somebody_follows(how: str) -> None:
    lab = Lab.ready()
    lab.say("var Global.nobody = 1|; var Global.follow = Tag.new(\"follow\")|;")
    lab.say(f"follow: {how},", 2 * LINGER_S + 2.5)
    assert lab.look("camera.on") == "true"
    lab.say("follow.stop;", LINGER_S + 0.5)
    assert lab.look("camera.on") == "false"


def test_the_camera_is_on_again_when_the_link_is_back() -> None:
    lab = Lab.ready()
    lab.say("at (camera.val->changed?) 1,", 1.0)
    lab.unplug()
    lab.run(1.0)
    lab.end.replug()
    lab.run(4.0)
    frames = lab.number("camera.frames")
    lab.run(1.0)
    assert lab.number("camera.frames") > frames + 10


def test_the_size_is_that_of_the_picture() -> None:
    Image = pytest.importorskip("PIL.Image")
    for size in ((160, 120), (640, 480)):
        out = io.BytesIO()
        Image.new("RGB", size).save(out, "JPEG")
        assert size_of(out.getvalue()) == size
    for bad in (b"", b"\xff\xd8", b"\xff\xd8\xff\xe0\x00\x00" * 3, bytes(100)):
        assert size_of(bad) is None


# ---------------------------------------------------------------- microphone


def frequency(samples: list[int] | array.array[int]) -> float:
    """Frequency of a tone, in Hz."""
    rising = [k for k in range(1, len(samples)) if samples[k - 1] < 0 <= samples[k]]
    return (len(rising) - 1) * RATE / (rising[-1] - rising[0])


def numbers(data: bytes) -> array.array[int]:
    made = array.array("h")
    made.frombytes(data)
    return made


class Listener:
    """Hears of each change of the microphone."""

    def __init__(self, lab: Lab) -> None:
        self.heard = b""
        self.sizes: list[int] = []
        lab.robot.micro.val.notify_change(self._take)

    def _take(self, sound: USound) -> None:
        assert sound.keywords == "raw 1 16000 16 1"
        self.sizes.append(len(sound))
        self.heard += bytes(sound.data)


def test_a_tone_is_heard_whole() -> None:
    lab = Lab.ready()
    ear = Listener(lab)
    lab.run(1.0)
    lab.device.microphone.tone(lab.bus_clock.now() + 0.1, 440, 1.0)
    lab.run(2.0)
    samples = numbers(ear.heard)
    loud = [k for k, value in enumerate(samples) if abs(value) > 1000]
    assert (loud[-1] - loud[0]) / RATE == pytest.approx(1.0, abs=0.005)
    assert frequency(samples[loud[0] : loud[-1]]) == pytest.approx(440, rel=0.003)


def test_what_comes_while_the_daemon_is_held_is_one_sound_of_the_last_second() -> None:
    lab = Lab.ready()
    ear = Listener(lab)
    lab.run(1.0)
    assert lab.worker is not None
    before, post = len(ear.heard), lab.worker._post
    kept: list[Any] = []
    lab.worker._post = kept.append
    lab.run(0.5)
    lab.worker._post = post
    for message in kept:
        post(message)
    lab.run(0.1)
    assert len(ear.heard) - before == pytest.approx(0.6 * 2 * RATE, abs=4001)
    assert max(ear.sizes) >= 3 * 4000


# ---------------------------------------------------------------- loudspeaker


def wav(rate: int, channels: int, bits: int, seconds: float, hertz: float) -> USound:
    """A tone as a WAVE file."""
    values = [math.sin(math.tau * hertz * k / rate) for k in range(round(seconds * rate))]
    if bits == 16:
        data = array.array("h", [round(20000 * v) for v in values for _ in range(channels)]).tobytes()
    else:
        data = bytes(round(128 + 80 * v) for v in values for _ in range(channels))
    out = io.BytesIO()
    with wave.open(out, "wb") as file:
        file.setparams((channels, bits // 8, rate, 0, "NONE", ""))
        file.writeframes(data)
    return USound(out.getvalue(), f"wav {channels} {rate} {bits} {1 if bits == 16 else 2}")


def play(lab: Lab, sound: USound) -> None:
    lab.robot.host.var("speaker.val").set(sound)


@pytest.mark.parametrize(("rate", "channels", "bits"), [(16000, 1, 16), (44100, 2, 16), (8000, 1, 8), (22050, 1, 16)])
def test_a_tone_is_found_in_what_was_played(rate: int, channels: int, bits: int) -> None:
    lab = Lab.ready()
    play(lab, wav(rate, channels, bits, 2.0, 440))
    lab.run(0.1)
    assert lab.look("speaker.playing") == "true"
    assert 1800 <= lab.number("speaker.remain") <= 2000
    lab.run(3.0)
    samples = lab.device.speaker.record()
    assert lab.device.speaker.gaps() == []
    assert len(samples) / RATE == pytest.approx(2.0, abs=0.001)
    assert frequency(samples) == pytest.approx(440, rel=0.002)
    assert max(samples) == pytest.approx(20000 if bits == 16 else 80 * 256, rel=0.02)
    assert lab.look("[speaker.playing, speaker.remain]") == "[false, 0]"


def test_sounds_are_played_one_behind_the_other_without_a_gap() -> None:
    lab = Lab.ready()
    play(lab, wav(16000, 1, 16, 0.7, 500))
    play(lab, wav(16000, 1, 16, 0.7, 1000))
    lab.run(3.0)
    samples = lab.device.speaker.record()
    assert (len(samples), lab.device.speaker.gaps()) == (round(1.4 * RATE), [])
    assert frequency(samples[:10000]) == pytest.approx(500, rel=0.01)
    assert frequency(samples[12000:]) == pytest.approx(1000, rel=0.01)


def test_a_sound_can_be_ended_and_another_one_begun() -> None:
    lab = Lab.ready()
    play(lab, wav(16000, 1, 16, 10.0, 500))
    lab.run(1.0)
    lab.say("speaker.stop;", 3.0)
    assert len(lab.device.speaker.record()) / RATE < 1.6
    assert lab.look("speaker.playing") == "false"
    play(lab, wav(16000, 1, 16, 0.5, 1000))
    lab.run(1.0)
    assert frequency(lab.device.speaker.record()[-4000:]) == pytest.approx(1000, rel=0.01)


def test_what_the_robot_hears_can_be_played_back() -> None:
    lab = Lab.ready()
    lab.say("at (micro.val->changed?) speaker.val = micro.val,", 1.0)
    lab.device.microphone.tone(lab.bus_clock.now() + 0.2, 600, 0.5)
    lab.run(1.5)
    assert len(lab.device.speaker.record()) > RATE


def test_a_sound_that_cannot_be_played_is_an_error_of_the_assignment() -> None:
    lab = Lab.ready()
    assert "this slot takes a sound" in lab.say("speaker.val = 3;", 0.1)
    for sound, words in (
        (USound(b"RIFFxxxx", "wav 1 16000 16 1"), "no WAVE file that can be played"),
        (USound(bytes(8), "raw 6 16000 16 1"), "1 or 2 channels"),
        (USound(bytes(6), "raw 1 16000 24 1"), "8 or 16 bits"),
    ):
        with pytest.raises(ValueError, match=words):
            SoundRecording(sound, RATE)


@pytest.mark.parametrize("count", [0, 1, PIECE_SAMPLES, PIECE_SAMPLES + 1])
def test_a_recording_has_the_samples_that_it_has(count: int) -> None:
    recording = SoundRecording(USound.of(array.array("h", range(count)).tobytes(), 1, RATE), RATE)
    assert numbers(b"".join(recording.pieces())) == array.array("h", range(count))
    assert recording.seconds == count / RATE


def test_sounds_of_the_robot() -> None:
    lab = Lab.ready()
    lab.say("speaker.playSound(0); speaker.playSound(15);", 0.2)
    assert lab.device.sounds == [0, 15]
    assert "there is no sound 16" in lab.say("speaker.playSound(16);", 0.1)


# ---------------------------------------------------------------- Clapper


def clapping(lab: Lab, *times: float) -> str:
    """What a client reads while somebody claps at these times."""
    for at in times:
        lab.device.microphone.clap(lab.bus_clock.now() + at)
    return lab.say("", max(times) + 2.0)


def test_the_example_of_the_manual() -> None:
    lab = Lab.ready()
    path = Path(__file__).resolve().parents[2] / "urbihw/platforms/spykee/clapper.u"
    lab.say(f'load("{path}");', 1.0)
    clapping(lab, 0.2, 0.6)
    assert lab.device.sounds == [3]
    clapping(lab, 0.2)
    clapping(lab, 0.2, 0.6, 1.0)
    assert lab.device.sounds == [3]
    lab.say("tag.stop;")
    clapping(lab, 0.2, 0.6)
    assert lab.device.sounds == [3]


def test_val_is_the_number_and_then_0() -> None:
    lab = Lab.ready()
    lab.say('var Global.clap = Clapper.new("micro.val", 0.2, 200, 800, 4000)|;')
    lab.say("at (clap.val->changed?) echo(clap.val); at (clap.sequence?(var n)) echo(\"event\");", 1.0)
    assert clapping(lab, 0.2, 0.6, 1.0).split() == ["***", "3", "***", "0"]  # no event


def sounds(*parts: tuple[float, float]) -> list[int]:
    """The counts that come of parts (seconds, loudness)."""
    counter = Counter(0.2, 0.2, 0.8, 4.0)
    blocks = [loudness for seconds, loudness in parts for _ in range(round(seconds / BLOCK_S))]
    return [count for loudness in blocks if (count := counter.add_block(loudness))]


CLAP = (0.03, 0.9)


@pytest.mark.parametrize(
    ("parts", "counts"),
    [
        ([(1, 0), CLAP, (2, 0)], [1]),
        ([(1, 0), CLAP, (0.4, 0), CLAP, (2, 0)], [2]),
        ([(1, 0), CLAP, (0.1, 0), CLAP, (2, 0)], [1]),  # an echo
        ([(1, 0), CLAP, (1.2, 0), CLAP, (2, 0)], [1, 1]),
        ([(1, 0), (0.03, 0.1), (2, 0)], []),  # too soft
        ([(1, 0), (0.5, 0.9), (2, 0)], []),  # too long
        ([(1, 0), *[CLAP, (0.5, 0)] * 10], [8]),  # longer than a sequence may be
    ],
)
def test_claps_are_short_loud_and_apart(parts: list[tuple[float, float]], counts: list[int]) -> None:
    assert sounds(*parts)[: len(counts) or None] == counts


def test_a_clapper_without_sense_is_refused() -> None:
    lab = Lab.ready()
    assert "expected a threshold" in lab.say('Clapper.new("micro.val", 0.2, 800, 200, 4000);')
