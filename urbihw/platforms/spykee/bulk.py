"""What is sent in many pieces: music files, and sound for the loudspeaker; no I/O.

Behind bulk data in the system's buffers a stop would wait.  So pieces are small, leave only while the link takes them
at once (``Link.is_writable``), at most so many in a tick, and sound no earlier than the robot needs it.
"""

from __future__ import annotations

from collections import deque
from typing import Final

from urbihw.buses.messages import FromWorker, Reply
from urbihw.platforms.spykee import protocol as p

CHUNK_BYTES: Final = 4096
"""Of a music file, in a packet."""
PIECE_BYTES: Final = 4000
"""Of sound in a packet: 1/8 s, as the robot's own."""
LEAD_S: Final = 0.3
"""Seconds by which sound is sent ahead of its time, to outlive a delay of the network."""
END_S: Final = 0.5
"""Seconds after the end of the sound when its stream is switched off."""
WAITING: Final = 16
"""Pieces of sound that may wait: two seconds."""


def seconds_of(pcm: bytes) -> float:
    """How long so many bytes sound."""
    return len(pcm) / (2 * p.SOUND_RATE)


class Uploads:
    """Chunks of a file on their way; each is answered when it has left."""

    def __init__(self) -> None:
        self._chunks: deque[tuple[int, bytes]] = deque()

    @property
    def busy(self) -> bool:
        """Whether there is anything to send."""
        return bool(self._chunks)

    def add(self, reply_id: int, flags: int, data: bytes) -> None:
        """One more chunk."""
        self._chunks.append((reply_id, p.upload(flags, data)))

    def next(self) -> tuple[bytes, list[FromWorker]] | None:
        """The packet to send now, and what to answer then."""
        if not self._chunks:
            return None
        reply_id, data = self._chunks.popleft()
        return data, [Reply(reply_id, True)]

    def drop(self, reason: str) -> list[FromWorker]:
        """Give up what waits."""
        gone = [Reply(reply_id, False, error=reason) for reply_id, _ in self._chunks]
        self._chunks.clear()
        return [*gone]


class SoundOut:
    """Pieces of sound for the loudspeaker, sent at the pace at which they are played."""

    def __init__(self) -> None:
        self._pieces: deque[tuple[int, bytes]] = deque()
        self._ends = 0.0
        self._on = False

    @property
    def busy(self) -> bool:
        """Whether there is anything to send, now or later."""
        return bool(self._pieces) or self._on

    def add(self, reply_id: int, pcm: bytes) -> str:
        """One more piece; why not, or ""."""
        if len(self._pieces) >= WAITING:
            return "the loudspeaker has more to play than it can keep"
        if len(pcm) > PIECE_BYTES or len(pcm) % 2:
            return f"a piece of sound has at most {PIECE_BYTES} bytes, and whole samples"
        self._pieces.append((reply_id, pcm))
        return ""

    def next(self, now: float) -> tuple[bytes, list[FromWorker]] | None:
        """The packets to send now, and what to answer then."""
        if self._pieces and now >= self._ends - LEAD_S:
            reply_id, pcm = self._pieces.popleft()
            switch = b"" if self._on else _switch(True)
            self._on = True
            self._ends = max(now, self._ends) + seconds_of(pcm)
            return switch + p.packet(p.AUDIO, pcm), [Reply(reply_id, True)]
        if self._on and not self._pieces and now >= self._ends + END_S:
            self._on = False
            return _switch(False), []
        return None

    def drop(self, reason: str) -> list[FromWorker]:
        """Give up what waits."""
        gone = [Reply(reply_id, False, error=reason) for reply_id, _ in self._pieces]
        self._pieces.clear()
        return [*gone]

    def restart(self) -> None:
        """A fresh connection: the stream is off."""
        self._on, self._ends = False, 0.0


def _switch(on: bool) -> bytes:
    return p.packet(p.STREAM, bytes([p.LOUDSPEAKER, on]))
