"""Data that is sent in many pieces: music files, and sound for the loudspeaker; no I/O.

A stop would wait behind bulk data in the buffers of the system.  So pieces are small, are sent only while the link
accepts them at once (``Link.is_writable``), with a maximum for each tick, and sound not earlier than the robot needs
it.
"""

from __future__ import annotations

from collections import deque
from typing import Final

from urbihw.buses.messages import FromWorker, Reply
from urbihw.platforms.spykee import protocol as p

CHUNK_BYTES: Final = 4096
"""Bytes of a music file in a packet."""
PIECE_BYTES: Final = 4000
"""Maximum bytes of sound in a packet: 1/8 s, as in packets of the robot."""
LEAD_S: Final = 0.3
"""Seconds by which sound is sent ahead of its time, to outlive a delay of the network."""
END_S: Final = 0.5
"""Seconds after the end of the sound when its stream is switched off."""
WAITING: Final = 16
"""Maximum number of pieces of sound that wait: two seconds."""


def seconds_of(pcm: bytes) -> float:
    """The duration of sound, in seconds."""
    return len(pcm) / (2 * p.SOUND_RATE)


class Uploads:
    """Chunks of a file on their way; each is answered when it has left."""

    def __init__(self) -> None:
        self._chunks: deque[tuple[int, bytes]] = deque()

    @property
    def busy(self) -> bool:
        """Whether there is anything to send."""
        return bool(self._chunks)

    def add_chunk(self, reply_id: int, flags: int, data: bytes) -> None:
        """Queue one chunk of a file."""
        self._chunks.append((reply_id, p.upload(flags, data)))

    def next_packet(self) -> tuple[bytes, list[FromWorker]] | None:
        """The packet to send now, and the replies for it; None if there is none."""
        if not self._chunks:
            return None
        reply_id, data = self._chunks.popleft()
        return data, [Reply(reply_id, True)]

    def cancel_all(self, reason: str) -> list[FromWorker]:
        """Drop all that waits; returns the error replies."""
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

    def add_piece(self, reply_id: int, pcm: bytes) -> str:
        """Queue a piece.  Returns the reason if that is refused, else ""."""
        if len(self._pieces) >= WAITING:
            return "the loudspeaker has more to play than it can keep"
        if len(pcm) > PIECE_BYTES or len(pcm) % 2:
            return f"a piece of sound has at most {PIECE_BYTES} bytes, and whole samples"
        self._pieces.append((reply_id, pcm))
        return ""

    def next_packet(self, now: float) -> tuple[bytes, list[FromWorker]] | None:
        """The packets to send at this time, and the replies for them; None if there are none."""
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

    def cancel_all(self, reason: str) -> list[FromWorker]:
        """Drop all that waits; returns the error replies."""
        gone = [Reply(reply_id, False, error=reason) for reply_id, _ in self._pieces]
        self._pieces.clear()
        return [*gone]

    def reset(self) -> None:
        """Start with a new connection, on which the stream is off."""
        self._on, self._ends = False, 0.0


def _switch(on: bool) -> bytes:
    return p.packet(p.STREAM, bytes([p.LOUDSPEAKER, on]))
