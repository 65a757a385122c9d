"""ALAudioDevice and ALAudioPlayer: what the loudspeakers play, and what the microphones hear.

Sound to the loudspeakers is 16 bits signed little-endian, two channels interleaved; a piece is played behind the one
before, and silence is heard where it came too late.  A module that has subscribed gets what the front microphone hears
by its method ``processRemote``.
"""

from __future__ import annotations

import array
import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from urbihw_nao_fakes.services import Failed, Later, Service, method

OUTPUT_RATES = (16_000, 22_050, 44_100, 48_000)
MOST_FRAMES = 16_384
CHANNELS = 2
MICRO_RATES = {16_000: (1, 2, 3, 4), 48_000: (0,)}
"""Samples a second -> the microphones that may be asked for at this rate: 0 all four, 3 the front one."""
BUFFER_S = 0.17
LOUD = 20_000
KEPT_S = 600.0
"""Seconds of sound that the loudspeakers remember."""


class Calls(Protocol):
    """How a module of a client is called: its name, a method, its arguments."""

    def __call__(self, name: str, method: str, arguments: tuple[Any, ...]) -> None:
        """Call it; its answer is not awaited."""
        ...


@dataclass
class Piece:
    """Sound that began to be played at ``at``; samples of the left loudspeaker and of the right one in turn."""

    at: float
    rate: int
    samples: array.array[int]

    @property
    def seconds(self) -> float:
        """How long it is."""
        return len(self.samples) / CHANNELS / self.rate


@dataclass
class Client:
    """A module that gets sound."""

    rate: int = 16_000
    channels: int = 3
    deinterleaved: bool = False
    subscribed: bool = False
    sent_until: float = 0.0


@dataclass(frozen=True)
class Tone:
    """A sound in the room."""

    at: float
    frequency: float
    seconds: float

    def value(self, at: float) -> float:
        """The sample at a time, -1 to 1."""
        since = at - self.at
        return math.sin(math.tau * self.frequency * since) if 0 <= since < self.seconds else 0.0


@dataclass
class Room:
    """What is to be heard."""

    tones: list[Tone] = field(default_factory=list)


class AudioDevice(Service):
    """ALAudioDevice; ``clock`` gives seconds, ``call`` reaches the modules of clients.

    Attributes:
        played: the pieces, in their order.
        rate, volume, muted: of the loudspeakers.
        room: what the microphones hear.
    """

    name = "ALAudioDevice"

    def __init__(self, clock: Callable[[], float], call: Calls) -> None:
        super().__init__()
        self.played: list[Piece] = []
        self.rate, self.volume, self.muted = 22_050, 60, False
        self.room = Room()
        self._clock, self._call = clock, call
        self._clients: dict[str, Client] = {}
        self._ends = -math.inf

    # ---------------------------------------------------------------- loudspeakers

    @method("sendRemoteBufferToOutput", "(im)", "b")
    def play(self, frames: int, data: Any) -> bool:
        """Play a piece: at most 16384 frames; false for another value."""
        if not isinstance(data, bytes) or not 0 < frames <= MOST_FRAMES or len(data) != frames * CHANNELS * 2:
            return False
        samples = array.array("h", data)
        if sys.byteorder == "big":
            samples.byteswap()
        now = self._clock()
        piece = Piece(max(now, self._ends), self.rate, samples)
        self.played = [one for one in self.played if now - one.at < KEPT_S]
        self.played.append(piece)
        self._ends = piece.at + piece.seconds
        return True

    @method("flushAudioOutputs")
    def flush(self) -> None:
        """Be silent at once: what was not played yet is cut off."""
        now = self._clock()
        for piece in self.played:
            left = max(0, round((now - piece.at) * piece.rate)) * CHANNELS
            del piece.samples[left:]
        self.played = [piece for piece in self.played if piece.samples]
        self._ends = now

    @method("setParameter", "(si)")
    def set_parameter(self, name: str, value: int) -> None:
        """The rate of the loudspeakers.  Raises Failed."""
        if name != "outputSampleRate" or value not in OUTPUT_RATES:
            raise Failed(f"ALAudioDevice: parameter {name} cannot be {value}\n\n    at alaudiodevice.cpp:5")
        self.rate = value

    @method("setOutputVolume", "(i)")
    def set_volume(self, volume: int) -> None:
        """Set the volume in percent."""
        self.volume = min(max(volume, 0), 100)

    @method("getOutputVolume", "()", "i")
    def get_volume(self) -> int:
        """The volume in percent."""
        return self.volume

    @method("muteAudioOut", "(b)")
    def mute(self, on: bool) -> None:
        """Play silently, or again."""
        self.muted = on

    def gaps(self) -> list[float]:
        """Seconds of silence between pieces."""
        ends = [piece.at + piece.seconds for piece in self.played]
        return [piece.at - end for piece, end in zip(self.played[1:], ends, strict=False) if piece.at - end > 1e-6]

    # ---------------------------------------------------------------- microphones

    @method("setClientPreferences", "(siii)")
    def set_preferences(self, name: str, rate: int, channels: int, deinterleaved: int) -> None:
        """What a module wants to hear.  Raises Failed."""
        if channels not in MICRO_RATES.get(rate, ()):
            raise Failed(f"ALAudioDevice: no microphones {channels} at {rate} samples a second")
        self._clients[name] = Client(rate, channels, bool(deinterleaved))

    @method("subscribe", "(s)")
    def subscribe(self, name: str) -> None:
        """Send to this module from now on."""
        client = self._clients.setdefault(name, Client())
        client.subscribed, client.sent_until = True, self._clock()

    @method("unsubscribe", "(s)")
    def unsubscribe(self, name: str) -> None:
        """No longer.  Raises Failed."""
        if self._clients.pop(name, None) is None:
            raise Failed(f"ALAudioDevice: {name} has not subscribed")

    @property
    def subscribers(self) -> list[str]:
        """The modules that get sound."""
        return [name for name, client in self._clients.items() if client.subscribed]

    def advance(self, now: float) -> None:
        """Send what was heard, in buffers of 170 ms."""
        for name, client in list(self._clients.items()):
            while client.subscribed and now - client.sent_until >= BUFFER_S:
                self._send(name, client)

    def is_active(self) -> bool:
        """Whether a client listens to the microphones."""
        return any(client.subscribed for client in self._clients.values())

    def _send(self, name: str, client: Client) -> None:
        count = round(BUFFER_S * client.rate)
        begun = client.sent_until
        client.sent_until = begun + count / client.rate
        channels = 4 if client.channels == 0 else 1
        samples = array.array("h")
        for index in range(count):
            at = begun + index / client.rate
            value = round(LOUD * sum(tone.value(at) for tone in self.room.tones))
            samples.extend([max(-32768, min(32767, value))] * channels)
        if sys.byteorder == "big":
            samples.byteswap()
        stamp = [int(begun), round(begun % 1 * 1e6)]
        self._call(name, "processRemote", (channels, count, stamp, samples.tobytes()))


class AudioPlayer(Service):
    """ALAudioPlayer: files of the robot; ``playing`` are those that it plays now.  ``clock`` gives seconds."""

    name = "ALAudioPlayer"

    FILES = {"/home/nao/song.wav": 8.0, "/home/nao/beep.wav": 0.5}
    """Seconds of each."""

    def __init__(self, clock: Callable[[], float]) -> None:
        super().__init__()
        self._clock = clock
        self._loaded: list[str] = []
        self._ends: dict[int, float] = {}

    @property
    def playing(self) -> list[str]:
        """The files that it plays now."""
        return [self._loaded[number - 1] for number, end in self._ends.items() if self._clock() < end]

    @method("loadFile", "(s)", "i")
    def load(self, name: str) -> int:
        """Its number.  Raises Failed."""
        if name not in self.FILES:
            raise Failed(f"ALAudioPlayer: cannot open {name}")
        self._loaded.append(name)
        return len(self._loaded)

    @method("play", "(i)")
    def play(self, number: int) -> Later:
        """The answer comes at its end.  Raises Failed."""
        if not 0 < number <= len(self._loaded):
            raise Failed(f"ALAudioPlayer: no file {number}")
        self._ends[number] = self._clock() + self.FILES[self._loaded[number - 1]]
        return Later(lambda: self._clock() >= self._ends[number])

    @method("playFile", "(s)")
    def play_file(self, name: str) -> Later:
        """The same of a file."""
        return self.play(self.load(name))

    @method("stopAll")
    def stop_all(self) -> None:
        """Stop all sounds that play."""
        self._ends = dict.fromkeys(self._ends, self._clock())
