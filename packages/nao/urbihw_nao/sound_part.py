"""The loudspeakers: pieces of sound go to ALAudioDevice, each a little before the one before it was played.

ALAudioDevice takes 16 bits signed, two channels interleaved, at most 16384 frames a call, at 16000, 22050, 44100 or
48000 samples a second (documentation of NAOqi 2.1 to 2.8, "ALAudioDevice").  Whether a call returns at once or when the
sound is played is not documented; both work here: one call is under way at a time, and none is sent while more than
AHEAD_S wait in the robot.
"""

from __future__ import annotations

import array
import math
from collections import deque
from typing import Any, Final

from urbihw.buses.messages import FromWorker, Reply, Request
from urbihw_nao.exchange import LINK_LOST, NaoExchange
from urbihw_nao.part import NaoPart
from urbihw_nao.qimessaging.session import QiCall, QiService

SPEAKER: Final = "speaker"
AUDIO: Final = "ALAudioDevice"
PLAY_RATE: Final = 22_050
"""Samples a second; the robot's own rate as long as it speaks no Asian language."""
AHEAD_S: Final = 0.5
"""Seconds of sound that the robot has at most: the network may be held up for so long."""
MOST_PIECES: Final = 32
MOST_FRAMES: Final = 16_384
PLAY_TIMEOUT_S: Final = 5.0
"""Seconds in which NAOqi must answer to a piece, if it answers when the sound is played."""


class SoundPart(NaoPart):
    """Requests "write" of ("speaker", "piece"), 16 bits of one channel at PLAY_RATE, and of ("speaker", "flush")."""

    verbs = frozenset({"write"})

    def __init__(self, exchange: NaoExchange) -> None:
        super().__init__(exchange)
        self._pieces: deque[tuple[int, bytes]] = deque()
        self._call: QiCall | None = None
        self._has_rate = False
        self._ends = -math.inf

    def begin(self) -> None:
        """See ``Part``: the robot may have been restarted."""
        self._has_rate, self._ends, self._call = False, -math.inf, None

    def end(self) -> None:
        self._drop_pieces(LINK_LOST)

    def owns(self, device: Any) -> bool:
        return bool(device == SPEAKER)

    def set_target(self, device: Any, item: str, value: float) -> str:
        """See ``Part``: sound is no target."""
        return "no such target"

    def request(self, message: Request) -> list[FromWorker]:
        """See ``Part``.  A piece is answered when it was sent."""
        service = self.exchange.find_service(AUDIO)
        if service is None:
            return [_failed(message.reply_id, f"this robot has no {AUDIO}: it plays no sound")]
        if message.item == "flush":
            self._drop_pieces("stopped")
            self._ends = -math.inf
            if "flushAudioOutputs" in service.meta.methods:
                self.exchange.post(service, "flushAudioOutputs")
            return [Reply(message.reply_id, True)]
        data = message.value
        if message.item != "piece" or not isinstance(data, bytes) or not 0 < len(data) // 2 <= MOST_FRAMES:
            return [_failed(message.reply_id, "no piece of sound")]
        if len(self._pieces) == MOST_PIECES:
            return [_failed(message.reply_id, "too many pieces of sound wait")]
        self._pieces.append((message.reply_id, data))
        return []

    def send(self) -> None:
        """See ``Part``: the next piece, when it is time."""
        if not self._pieces or (self._call is not None and not self._call.done):
            return
        if self._ends - self.exchange.now() >= AHEAD_S:
            return
        service = self.exchange.find_service(AUDIO)
        if service is None:
            self._drop_pieces(f"this robot has no {AUDIO} any more")
        elif not self._has_rate:
            self._start_call(service, "setParameter", "outputSampleRate", PLAY_RATE, then=self._set_rate)
        else:
            self._play(service, *self._pieces.popleft())

    def _start_call(self, service: QiService, method: str, *arguments: Any, then: Any) -> None:
        self._call = self.exchange.session.call(service, method, *arguments, then=then, timeout=PLAY_TIMEOUT_S)

    def _set_rate(self, call: QiCall) -> None:
        if call.error:
            self._drop_pieces(f"the rate of the loudspeakers cannot be set: {call.error}")
        else:
            self._has_rate = True

    def _play(self, service: QiService, reply_id: int, data: bytes) -> None:
        mono = array.array("h", data[: len(data) // 2 * 2])
        stereo = array.array("h", bytes(4 * len(mono)))
        stereo[::2] = stereo[1::2] = mono
        self._ends = max(self._ends, self.exchange.now()) + len(mono) / PLAY_RATE

        def answered(call: QiCall) -> None:
            error = call.error or ("" if call.value is not False else "the robot takes no such sound")
            self.exchange.news.append(_failed(reply_id, error) if error else Reply(reply_id, True))

        self._start_call(service, "sendRemoteBufferToOutput", len(mono), stereo.tobytes(), then=answered)

    def _drop_pieces(self, reason: str) -> None:
        pieces, self._pieces = self._pieces, deque()
        self.exchange.news += [_failed(reply_id, reason) for reply_id, _ in pieces]


def _failed(reply_id: int, reason: str) -> Reply:
    return Reply(reply_id, False, error=reason)
