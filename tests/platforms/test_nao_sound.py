"""What the loudspeakers of a Nao play and what its microphones hear, by content."""

from __future__ import annotations

import array
import io
import math
import wave
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import pytest
from nao_lab import Lab

from urbihw.kernel.uobject import USound
from urbihw_nao.sound_part import AHEAD_S, PLAY_RATE
from urbihw_nao_fakes import foreign
from urbihw_nao_fakes.audio import AudioDevice, Tone
from urbihw_nao_fakes.device import Nao


@pytest.fixture
def open_lab(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Lab]]:
    """Makes robots without a network: they call us on the connection that we have made."""
    monkeypatch.setattr(foreign, "ABSOLUTE", "none")
    made: list[Lab] = []

    def open_one(*arguments: Any, **options: Any) -> Lab:
        made.append(Lab.ready(*arguments, **options))
        return made[-1]

    yield open_one
    for lab in made:
        lab.unplug()
        lab.run(0.1)


@pytest.fixture
def lab(open_lab: Callable[..., Lab]) -> Lab:
    """One of them."""
    return open_lab()


def tone(rate: int, channels: int, bits: int, seconds: float, hertz: float) -> USound:
    """A WAVE file."""
    values = [math.sin(math.tau * hertz * index / rate) for index in range(round(rate * seconds))]
    if bits == 16:
        data = array.array("h", [round(20000 * value) for value in values for _ in range(channels)]).tobytes()
    else:
        data = bytes(128 + round(80 * value) for value in values for _ in range(channels))
    file = io.BytesIO()
    with wave.open(file, "wb") as writer:
        writer.setnchannels(channels)
        writer.setsampwidth(bits // 8)
        writer.setframerate(rate)
        writer.writeframes(data)
    return USound(file.getvalue(), f"wav {channels} {rate} {bits} 1")


def play(lab: Lab, sound: USound) -> None:
    """Assign it to the speaker."""
    lab.robot.host.var("speaker.val").set(sound)


def frequency(samples: Sequence[int], rate: int) -> float:
    """Frequency of a tone, Hz."""
    rising = [index for index in range(1, len(samples)) if samples[index - 1] < 0 <= samples[index]]
    return (len(rising) - 1) * rate / (rising[-1] - rising[0])


def left(audio: AudioDevice) -> list[int]:
    """What the left loudspeaker has played."""
    return [sample for piece in audio.played for sample in piece.samples[::2]]


@pytest.mark.parametrize(("rate", "channels", "bits"), [(16000, 1, 16), (44100, 2, 16), (8000, 1, 8), (22050, 1, 16)])
def test_a_tone_is_found_in_what_was_played(lab: Lab, rate: int, channels: int, bits: int) -> None:
    play(lab, tone(rate, channels, bits, 2.0, 440))
    lab.run(0.1)
    assert lab.look("speaker.playing") == "true"
    assert lab.number("speaker.remain") == pytest.approx(1900, abs=50)
    lab.run(2.5)
    audio = lab.device.audio
    assert {piece.rate for piece in audio.played} == {PLAY_RATE} and audio.gaps() == []
    assert len(left(audio)) / PLAY_RATE == pytest.approx(2.0, abs=0.001)
    assert frequency(left(audio), PLAY_RATE) == pytest.approx(440, rel=0.002)
    assert all(piece.samples[::2] == piece.samples[1::2] for piece in audio.played)
    assert lab.look("[speaker.playing, speaker.remain]") == "[false, 0]"


def test_the_robot_has_only_so_much_ahead(lab: Lab) -> None:
    play(lab, tone(16000, 1, 16, 10.0, 440))
    for _ in range(20):
        lab.run(0.1)
        piece = lab.device.audio.played[-1]
        assert piece.at + piece.seconds - lab.bus_clock.now() < AHEAD_S + 0.1
    assert lab.device.audio.calls["sendRemoteBufferToOutput"] < 40


def test_sounds_are_played_one_behind_the_other_until_a_stop(lab: Lab) -> None:
    play(lab, tone(16000, 1, 16, 0.7, 500))
    play(lab, tone(16000, 1, 16, 10.0, 1000))
    lab.run(1.4)
    audio = lab.device.audio
    assert audio.gaps() == []
    assert frequency(left(audio)[:14000], PLAY_RATE) == pytest.approx(500, rel=0.01)
    assert frequency(left(audio)[16500:], PLAY_RATE) == pytest.approx(1000, rel=0.01)
    lab.say("speaker.stop;", 0.2)
    played = len(left(audio)) / PLAY_RATE
    assert played == pytest.approx(1.4, abs=0.1)
    lab.run(2)
    assert len(left(audio)) / PLAY_RATE == played


def test_a_stop_of_the_robot_lets_it_play_on(lab: Lab) -> None:
    play(lab, tone(16000, 1, 16, 1.0, 500))
    lab.say("robot.stop;", 1.5)
    assert len(left(lab.device.audio)) / PLAY_RATE == pytest.approx(1.0, abs=0.01)


def test_a_robot_that_lost_its_link_plays_the_next_sound_again(lab: Lab) -> None:
    play(lab, tone(16000, 1, 16, 5.0, 500))
    lab.run(0.5)
    lab.unplug()
    lab.run(1)
    assert lab.look("speaker.playing") == "false"
    lab.device.audio.rate = 16_000  # it was restarted
    lab.end.replug()
    lab.until(lambda: lab.look("nao.link") == "true")
    lab.device.audio.played.clear()
    play(lab, tone(16000, 1, 16, 0.5, 1000))
    lab.run(1)
    assert lab.device.audio.played[0].rate == PLAY_RATE
    assert frequency(left(lab.device.audio), PLAY_RATE) == pytest.approx(1000, rel=0.01)


def test_the_volume(lab: Lab) -> None:
    lab.run(0.2)
    assert lab.number("nao.volume") == 60
    lab.say("nao.volume = 25;", 0.2)
    assert lab.device.audio.volume == 25
    lab.device.audio.volume = 80
    lab.unplug()
    lab.run(1)
    lab.end.replug()
    lab.until(lambda: lab.look("nao.volume") == "80")


def test_a_robot_without_sound_says_so(open_lab: Callable[..., Lab], caplog: pytest.LogCaptureFixture) -> None:
    device = Nao()
    number = device.audio.number
    del device.services[number]
    lab = open_lab(device)
    assert "volume: this robot has no ALAudioDevice" in lab.say("nao.volume = 25;", 0.2)
    play(lab, tone(16000, 1, 16, 0.5, 1000))
    lab.run(0.5)
    assert "speaker: not played: this robot has no ALAudioDevice: it plays no sound" in caplog.text
    lab.say("micro.val|;", 0.5)
    assert "this robot has no ALAudioDevice: it hears nothing" in caplog.text


# ---------------------------------------------------------------- microphones


def test_the_microphone_is_on_while_somebody_needs_it(lab: Lab) -> None:
    lab.run(1)
    assert lab.device.audio.subscribers == []
    lab.say("micro.val|;", 0.5)
    assert lab.device.audio.subscribers == ["urbihwMicro"] and lab.look("micro.on") == "true"
    lab.run(4)
    assert lab.device.audio.subscribers == [] and not lab.device.directory.foreign
    lab.say("listening: at (micro.val->changed?) {},", 10)
    assert lab.device.audio.subscribers == ["urbihwMicro"]
    lab.say("listening.stop;", 4)
    assert lab.device.audio.subscribers == []


class Listener:
    """Keeps what the microphone gives."""

    def __init__(self, lab: Lab) -> None:
        self.samples = array.array("h")
        self.sizes: list[int] = []
        self.var = lab.robot.host.var("micro.val")
        self.var.notify_change(self._hear)

    def _hear(self) -> None:
        data = bytes(self.var.sensed.data)
        self.sizes.append(len(data))
        self.samples.frombytes(data)


def test_a_tone_in_the_room_is_heard(lab: Lab) -> None:
    ear = Listener(lab)
    lab.run(0.5)
    lab.device.audio.room.tones.append(Tone(lab.bus_clock.now() + 0.2, 700, 1.0))
    lab.run(2)
    loud = [index for index, sample in enumerate(ear.samples) if abs(sample) > 1000]
    assert (loud[-1] - loud[0]) / 16000 == pytest.approx(1.0, abs=0.01)
    assert frequency(ear.samples[loud[0] : loud[-1]], 16000) == pytest.approx(700, rel=0.003)
    assert lab.number("micro.duration") == 170


def test_the_microphone_is_on_again_after_a_lost_link(lab: Lab) -> None:
    ear = Listener(lab)
    lab.run(1)
    lab.unplug()
    lab.run(1)
    lab.end.replug()
    lab.until(lambda: lab.look("nao.link") == "true")
    lab.run(3)
    before = len(ear.samples)
    lab.run(1)
    assert len(ear.samples) - before == pytest.approx(16000, abs=3000)


def test_bytes_that_are_no_sound_are_refused(lab: Lab) -> None:
    ear = Listener(lab)
    lab.run(0.5)
    answers: list[Any] = []
    for arguments in ((1, 4, [0, 0], "text"), (3, 4, [0, 0], bytes(24)), (1, 4, [0, 0], bytes(7))):
        lab.device.directory.call_service("urbihwMicro", "processRemote", arguments, answers.append)
    lab.run(0.1)
    assert sorted(str(answer) for answer in answers) == [
        "None", "processRemote: no sound", "processRemote: no sound",
    ]  # fmt: skip
    assert 6 in ear.sizes and max(ear.sizes) < 16000


def test_what_nobody_reads_is_bounded(lab: Lab) -> None:
    ear = Listener(lab)
    lab.run(0.5)
    for _ in range(10):
        lab.device.directory.call_service("urbihwMicro", "processRemote", (1, 8000, [0, 0], bytes(16000)))
    lab.run(0.1)
    assert max(ear.sizes) == 32000


def test_a_volume_that_is_no_number_is_refused_and_the_slot_lives_on() -> None:
    lab = Lab.ready()
    for bad in ('"loud"', "[]", "nan"):
        assert "takes a" in lab.say(f"nao.volume = {bad};", 0.2)
    lab.say("nao.volume = 33;", 0.3)
    assert lab.device.audio.volume == 33
    assert "takes a number" in lab.say("tts.speed = [];", 0.2)
