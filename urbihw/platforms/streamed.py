"""A device whose ``val`` comes as a stream, such as a camera or a microphone: on while somebody reads or follows it."""

from __future__ import annotations

import math
from typing import Any, ClassVar, Final

from urbihw.kernel.uobject import UBinary, UObject, reading
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.words import COMMON

LINGER_S: Final = 3.0
"""Seconds after the last reading for which a stream goes on."""
LOOK_PERIOD_S: Final = 0.25
"""Seconds between two looks whether anybody follows."""


class OnDemand(UObject):
    """The base of such devices; ``on`` is whether the stream comes now.

    A subclass sets ``nothing`` and implements ``switch_stream``; it may restrict ``may_stream``.
    """

    nothing: ClassVar[UBinary]
    """What ``val`` is before anything has come."""

    slot_words = COMMON | {"on": ("whether the stream comes now", ""), "frames": ("number of pieces received", "1")}

    val = reading()
    on = reading(False)

    def init(self, *_: Any, **__: Any) -> None:
        """A subclass may have parameters."""
        self._read_at = -math.inf
        self.val.sense(self.nothing)
        self.notify_access(self.val, self._note_reading)
        self.set_timer(LOOK_PERIOD_S, self.update_stream)

    def switch_stream(self, on: bool) -> None:
        """Begin or end the stream."""
        raise NotImplementedError

    def may_stream(self) -> bool:
        """Whether the stream may be on at all."""
        return True

    def update_stream(self) -> None:
        """Switch the stream on if it may be on and somebody needs it, else off."""
        wanted = self.val.has_subscribers or self.host.now() - self._read_at < LINGER_S
        on = wanted and self.may_stream()
        if on is not self.on.sensed:
            self.on.sense(on)
            self.switch_stream(on)

    def _note_reading(self) -> None:
        self._read_at = self.host.now()
        self.update_stream()


class Streamed(OnDemand):
    """A device of a robot, whose stream comes from the worker."""

    def init(self, channel: DeviceChannel, *_: Any, **__: Any) -> None:
        """Speak to the worker through ``channel``; a subclass may have more parameters."""
        self.channel = channel
        super().init()
