"""The microphones: while they are watched, ALAudioDevice sends what the front one hears to a module of ours.

ALAudioDevice calls ``processRemote`` of each module that has subscribed, with the number of channels, the number of
samples of each, a time stamp, and the samples: 16 bits, 16000 a second for one channel, every 170 ms (documentation of
NAOqi 2.1 to 2.8, "ALAudioDevice").  The robot must be able to reach us: see ``urbihw_nao.qimessaging.hosting``.
"""

from __future__ import annotations

from typing import Any, Final

from urbihw.buses.messages import Refused
from urbihw_nao.exchange import NaoExchange
from urbihw_nao.part import NaoPart
from urbihw_nao.qimessaging.hosting import Hosting
from urbihw_nao.qimessaging.serving import IncomingCall, ServedMethod
from urbihw_nao.sound_part import AUDIO

MICRO: Final = "micro"
SUBSCRIBER: Final = "urbihwMicro"
"""Our module; its name is also that of the subscription."""
HEAR_RATE: Final = 16_000
FRONT_CHANNEL: Final = 3
INTERLEAVED: Final = 0
MOST_BYTES: Final = 2 * HEAR_RATE
"""Largest value: a second of sound, in bytes.  Further sound is dropped."""


class MicroPart(NaoPart):
    """Value "val" of MICRO: samples of 16 bits, HEAR_RATE a second, those since the last one."""

    def __init__(self, exchange: NaoExchange, hosting: Hosting) -> None:
        super().__init__(exchange)
        self._hosting = hosting
        self._wanted = False
        self._is_asked = self._is_subscribed = False

    def begin(self) -> None:
        """See ``Part``: a fresh session knows of no module."""
        self._is_asked = self._is_subscribed = False

    def owns(self, device: Any) -> bool:
        return bool(device == MICRO)

    def watch(self, on: bool) -> None:
        self._wanted = on

    def send(self) -> None:
        """See ``Part``: begin or end the subscription."""
        if self._wanted and not self._is_asked:
            self._is_asked = True
            if self.exchange.find_service(AUDIO) is None:
                self._warn(f"this robot has no {AUDIO}: it hears nothing")
            else:
                method = ServedMethod("processRemote", self._take_sound, "(iimm)", "v", "sound of the microphones")
                self._hosting.serve_object(SUBSCRIBER, [method], "microphone of urbihw", self._subscribe)
        elif not self._wanted and self._is_asked:
            self._is_asked = False
            self._unsubscribe()

    def _subscribe(self, problem: str) -> None:
        service = self.exchange.find_service(AUDIO)
        if problem or service is None:
            self._warn(f"the robot takes no module for its sound: {problem}")
        elif self._wanted:
            self._is_subscribed = True
            preferences = SUBSCRIBER, HEAR_RATE, FRONT_CHANNEL, INTERLEAVED
            self.exchange.call(
                MICRO, service, "setClientPreferences", *preferences,
                then=lambda _: self.exchange.call(MICRO, service, "subscribe", SUBSCRIBER),
            )  # fmt: skip

    def _unsubscribe(self) -> None:
        service = self.exchange.find_service(AUDIO)
        if self._is_subscribed and service is not None:
            self.exchange.post(service, "unsubscribe", SUBSCRIBER)
        self._is_subscribed = False
        self._hosting.withdraw_object(SUBSCRIBER)

    def _take_sound(self, call: IncomingCall) -> None:
        channels, _, _, data = call.arguments
        if not isinstance(data, bytes) or channels not in (1, 2, 4):
            raise ValueError("no sound")
        call.answer()
        if not self._wanted:
            return
        frame = 2 * channels
        samples = memoryview(data[: len(data) // frame * frame]).cast("h")[::channels]
        heard = self.exchange.values.setdefault(MICRO, {})
        # The order of the bytes is kept: these are little-endian wherever this runs.
        heard["val"] = (heard.get("val", b"") + samples.tobytes())[:MOST_BYTES]

    def _warn(self, reason: str) -> None:
        self.exchange.news.append(Refused(MICRO, AUDIO, reason))
