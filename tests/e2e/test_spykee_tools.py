"""Sound and pictures of a Spykee by the command-line tools, over the real port: judged by what the robot heard and
showed.
"""

from __future__ import annotations

import array
import contextlib
import io
import math
import sys
import wave
from collections.abc import Iterator
from pathlib import Path

import pytest
import starts
from test_serve import Daemon, until

from urbihw_fakes.spykee.device import Spykee
from urbihw_fakes.spykee.endpoint import SpykeeEndpoint

pytestmark = pytest.mark.e2e

RATE = 16_000
TONE_S = 0.3
TIMEOUT_S = 20.0


class Place:
    """A daemon before a simulated robot, and the tools."""

    def __init__(self, end: SpykeeEndpoint, daemon: Daemon) -> None:
        self.end, self.daemon = end, daemon
        self.robot = end.device

    def tool(self, module: str, *options: str) -> tuple[int, bytes, str]:
        """Run a tool to its end: its exit code, standard output and standard error."""
        command = (sys.executable, "-m", f"urbihw.cli.{module}", "-H", "127.0.0.1", "-P", str(self.daemon.port))
        done = starts.run((*command, *options), capture_output=True, check=False, timeout=TIMEOUT_S)
        return done.returncode, done.stdout, done.stderr.decode()

    def send_sound(self, folder: Path, keywords: str, data: bytes) -> str:
        """Assign a sound to the loudspeaker by ``urbi-send``; returns what it shows on standard error."""
        program = folder / "sound.u"
        program.write_bytes(f"speaker.val = BIN {len(data)} {keywords};".encode() + data + b"; echo(1);")
        _, output, error = self.tool("send", "-Q", str(program))
        assert output.endswith(b"*** 1\n")
        return error

    def played(self) -> array.array[int]:
        """What the loudspeaker has played since the last call, without the gaps of a busy machine."""
        until(lambda: self.end.call(lambda: not self.robot.speaker.on), TIMEOUT_S)
        track = self.robot.speaker.track

        def empty() -> array.array[int]:
            pieces, track.pieces = track.pieces, []
            return array.array("h", [value for _, piece in pieces for value in piece])

        return self.end.call(empty)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    folder = tmp_path_factory.mktemp("daemon")
    with SpykeeEndpoint(Spykee()) as end:
        end.start()
        daemon = Daemon(folder, "--platform", "spykee", "--quiet", "--url", end.url)
        with contextlib.closing(daemon):
            yield Place(end, daemon)


def samples_of(rate: int, channels: int, bits: int, signed: bool, hertz: float = 440.0) -> bytes:
    """A tone at 0.6 of full loudness, little-endian; the same in all channels."""
    values = [0.6 * math.sin(math.tau * hertz * k / rate) for k in range(round(TONE_S * rate))]
    full, middle = 2 ** (bits - 1) - 1, 0 if signed else 2 ** (bits - 1)
    numbers = (round(full * value) + middle for value in values for _ in range(channels))
    return b"".join(number.to_bytes(bits // 8, "little", signed=signed) for number in numbers)


def wave_of(rate: int, channels: int, bits: int) -> bytes:
    """The same as a WAVE file, whose samples of 8 bits are unsigned."""
    out = io.BytesIO()
    with wave.open(out, "wb") as file:
        file.setparams((channels, bits // 8, rate, 0, "NONE", ""))
        file.writeframes(samples_of(rate, channels, bits, signed=bits == 16))
    return out.getvalue()


def frequency(samples: array.array[int]) -> float:
    """Frequency of a tone, in Hz."""
    rising = [k for k in range(1, len(samples)) if samples[k - 1] < 0 <= samples[k]]
    return (len(rising) - 1) * RATE / (rising[-1] - rising[0])


SOUNDS = {
    "wav 16 kHz": ("wav 1 16000 16 1", wave_of(16000, 1, 16)),
    "wav of a compact disc": ("wav 2 44100 16 1", wave_of(44100, 2, 16)),
    "wav of 8 bits": ("wav 1 8000 8 2", wave_of(8000, 1, 8)),
    "wav with keywords that say something else": ("wav 2 48000 8 1", wave_of(22050, 1, 16)),
    "raw, as the microphone": ("raw 1 16000 16 1", samples_of(16000, 1, 16, signed=True)),
    "raw, 8 bits, signed": ("raw 1 11025 8 1", samples_of(11025, 1, 8, signed=True)),
    "raw, 8 bits, unsigned": ("raw 1 11025 8 2", samples_of(11025, 1, 8, signed=False)),
    "raw, 16 bits, unsigned": ("raw 1 16000 16 2", samples_of(16000, 1, 16, signed=False)),
    "raw, stereo, 48 kHz": ("raw 2 48000 16 1", samples_of(48000, 2, 16, signed=True)),
    "raw, stereo, 8 bits": ("raw 2 22050 8 2", samples_of(22050, 2, 8, signed=False)),
}


@pytest.mark.parametrize(("keywords", "data"), SOUNDS.values(), ids=SOUNDS.keys())
def test_a_tone_that_is_sent_is_what_the_loudspeaker_plays(
    place: Place, tmp_path: Path, keywords: str, data: bytes
) -> None:
    assert place.send_sound(tmp_path, keywords, data) == "[00000000:client_error] End of file\n"
    until(lambda: place.end.call(lambda: place.robot.speaker.on), TIMEOUT_S)
    samples = place.played()
    assert len(samples) == pytest.approx(TONE_S * RATE, abs=2)
    assert frequency(samples) == pytest.approx(440, rel=0.005)
    assert max(samples) == pytest.approx(0.6 * 32767, rel=0.03)
    assert min(samples) == pytest.approx(-0.6 * 32767, rel=0.03)


@pytest.mark.parametrize(
    ("keywords", "data", "words"),
    [
        ("wav 1 16000 16 1", b"RIFFgarbage", "no WAVE file that can be played"),
        ("wav 1 16000 16 1", b"RIFF\xff\xff\xff\xffWAVEfmt \x00\x00", "no WAVE file that can be played"),
        ("raw 6 16000 16 1", bytes(48), "1 or 2 channels"),
        ("raw 1 16000 24 1", bytes(48), "8 or 16 bits"),
        ("raw 1 5 16 1", bytes(48), "1000 to 192000 samples a second"),
        ("jpeg 1 1", b"\xff\xd8\xff\xd9", "takes a sound"),
        ("raw", bytes(8), "sound"),
        ("", b"garbage", "sound"),
    ],
)
def test_garbage_is_an_error_of_one_line_and_silence(
    place: Place, tmp_path: Path, keywords: str, data: bytes, words: str
) -> None:
    error, end = place.send_sound(tmp_path, keywords, data).splitlines()
    assert "!!!" in error and words in error
    assert end.endswith("End of file")
    assert len(place.played()) == 0


def test_what_the_robot_hears_is_what_urbi_sound_records(place: Place, tmp_path: Path) -> None:
    place.end.call(lambda: place.robot.microphone.tone(place.end.clock(), 700, TIMEOUT_S))
    file = tmp_path / "heard.wav"
    code, _, error = place.tool("sound", "-t", "1.5", "-o", str(file))
    assert (code, error) == (0, "")
    with wave.open(str(file)) as recorded:
        assert (recorded.getnchannels(), recorded.getsampwidth(), recorded.getframerate()) == (1, 2, RATE)
        samples = array.array("h", recorded.readframes(recorded.getnframes()))
    assert 1.5 * RATE <= len(samples) <= 4 * RATE
    assert frequency(samples) == pytest.approx(700, rel=0.01)
    assert max(samples) == pytest.approx(15_000, rel=0.02)
    place.end.call(place.robot.microphone.track.pieces.clear)


def test_what_urbi_sound_has_recorded_can_be_sent_back(place: Place, tmp_path: Path) -> None:
    place.end.call(lambda: place.robot.microphone.tone(place.end.clock(), 700, TIMEOUT_S))
    file = tmp_path / "heard.wav"
    assert place.tool("sound", "-t", "1", "-o", str(file))[0] == 0
    place.end.call(place.robot.microphone.track.pieces.clear)
    place.send_sound(tmp_path, "wav 1 16000 16 1", file.read_bytes())
    until(lambda: place.end.call(lambda: place.robot.speaker.on), TIMEOUT_S)
    samples = place.played()
    assert len(samples) >= RATE
    assert frequency(samples) == pytest.approx(700, rel=0.01)


@pytest.mark.parametrize(
    ("degrees", "colour", "ending"),
    [(0, (200, 30, 30), "jpg"), (90, (30, 160, 30), "png"), (180, (30, 30, 200), "jpg")],
)
def test_what_the_robot_sees_is_what_urbi_image_saves(
    place: Place, tmp_path: Path, degrees: float, colour: tuple[int, int, int], ending: str
) -> None:
    Image = pytest.importorskip("PIL.Image")
    client = place.daemon.client()
    until(lambda: client.ask("camera.on;") == "false", TIMEOUT_S)
    client.close()
    place.end.call(lambda: place.robot.body.place(0.0, 0.0, math.radians(degrees)))
    file = tmp_path / f"seen.{ending}"
    code, _, error = place.tool("image", "-o", str(file))
    assert (code, error) == (0, "")
    with Image.open(file) as picture:
        assert picture.size == (320, 240)
        seen = picture.convert("RGB").getpixel((160, 119))
    assert math.dist(seen, colour) < 60
