"""A microphone and a loudspeaker: the Urbi manual, chapter 4.4, in Python.

``val`` of the microphone is what was heard during the last period, so this plays on what it hears::

    var micro = Microphone.new|; var speaker = Loudspeaker.new|;
    loop { speaker.val = micro.val; sleep(System.period) },
"""

from __future__ import annotations

from typing import ClassVar, Protocol

from urbihw.kernel.uobject import UObject, USound, function, reading, variable


class Ear(Protocol):
    """What a maker of microphones gives you: samples of 16 bits, signed, little-endian."""

    rate: int

    def record(self, samples: int) -> bytes: ...


class Mouth(Protocol):
    """What a maker of loudspeakers gives you."""

    def play(self, samples: bytes, rate: int) -> None: ...


class Microphone(UObject):
    """Derive and set ``hardware``."""

    hardware: ClassVar[Ear]
    period: ClassVar[float] = 0.02

    val = reading()
    gain = variable(1.0)

    def init(self) -> None:
        """Called by ``new``."""
        self.set_update(self.period)

    def update(self) -> None:
        """One period is over: this is its sound."""
        samples = self.hardware.record(round(self.hardware.rate * self.period))
        self.val.sense(USound.of(samples, channels=1, rate=self.hardware.rate, bits=16))


class Loudspeaker(UObject):
    """Derive and set ``hardware``; plays what is assigned to ``val``."""

    hardware: ClassVar[Mouth]

    val = variable()
    played = reading(0.0)

    def init(self) -> None:
        """Called by ``new``."""
        self.notify_change(self.val, self.sound)

    def sound(self, sound: USound) -> None:
        """Somebody assigned a sound."""
        self.hardware.play(bytes(sound.data), sound.rate)
        self.played.sense(self.played.sensed + sound.duration)

    @function
    def silence(self) -> None:
        """Begin to count anew."""
        self.played.sense(0.0)
