"""The player of music files and streams."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import Final

from urbihw.buses.messages import Reply
from urbihw.kernel.uobject import UObject, event, function, reading, threaded
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.devicelog import DeviceLog
from urbihw.platforms.spykee import protocol as p
from urbihw.platforms.spykee import words
from urbihw.platforms.spykee.bulk import CHUNK_BYTES
from urbihw.platforms.spykee.music import MusicReader

CHUNKS_AHEAD: Final = 4
"""Chunks of a file that the worker has at most."""


class SpykeeMp3(UObject):
    """The player of music: ``play`` sends a file or a stream to the robot, which plays it.

    ``sent`` is the share that has left, nan for a stream of unknown length; ``playing`` is whether the robot plays.
    The event ``ended`` is emitted when all of it was played.  Music of more than 8 MB and streams of unknown length are
    sent in pieces, with a short gap between two of them.
    """

    slot_words = words.MP3

    playing = reading(False)
    sent = reading(1.0)
    ended = event()

    def init(self, channel: DeviceChannel, log: DeviceLog) -> None:
        """Connect to the worker through ``channel``."""
        self._channel, self._log = channel, log
        self._calls = itertools.count(1)
        self._current = 0
        """Number of the call that decided what plays now; a call of ``play`` that is older comes too late."""
        self._reader: MusicReader | None = None
        self._sent_bytes = 0

    @threaded()
    def play(self, stream: str) -> None:
        """Play an MP3 file of this computer or an http stream, instead of what plays.

        Returns when enough was read to begin.
        """
        call = next(self._calls)
        reader = MusicReader(stream)
        reader.open()
        self.host.post(lambda: self._begin(reader, call))

    @function
    def stop(self) -> None:
        """Stop the music that plays."""
        self._current = next(self._calls)
        self._end()
        self._channel.write("play", "stop", 0, self._warn)

    def _begin(self, reader: MusicReader, call: int) -> None:
        if call < self._current:
            reader.close()
            return
        if self.playing.sensed:  # the file that plays must not be replaced under it
            self._channel.write("play", "stop", 0, self._warn)
        self._end()
        self._current, self._reader, self._sent_bytes = call, reader, 0
        self._send_next_piece(reader)

    def _end(self) -> None:
        """Read no more, and show that nothing plays."""
        self.playing.sense(False)
        if self._reader is not None:
            self._reader.close()
            self._reader = None

    def _send_next_piece(self, reader: MusicReader) -> None:
        if reader is not self._reader:
            return
        piece = reader.next_piece(lambda: self.host.post(lambda: self._send_next_piece(reader)))
        if piece:
            self._send_piece(reader, piece)
        elif piece is not None:
            if reader.problem:
                self._log.warning("mp3: %s", reader.problem)
            self._end()
            self.ended.emit()

    def _send_piece(self, reader: MusicReader, piece: bytes) -> None:
        """Send a piece as a file, chunk by chunk, then play it."""
        chunks, left = chunks_of(piece), [len(piece)]

        def send_next_chunk() -> None:
            chunk = next(chunks, None)
            if chunk is not None:
                self._channel.write("file", "chunk", chunk, lambda reply: answered(reply, len(chunk[1])))

        def answered(reply: Reply, count: int) -> None:
            if reader is not self._reader:
                return
            if not reply.ok:
                self._end()
                self._log.warning("mp3: not sent: %s", reply.error)
                return
            self._show_sent(reader, count)
            left[0] -= count
            if not left[0]:
                self.playing.sense(True)
                self._channel.write("play", "sound", p.MUSIC, self._warn)
            send_next_chunk()

        self._show_sent(reader, 0)
        for _ in range(CHUNKS_AHEAD):
            send_next_chunk()

    def _show_sent(self, reader: MusicReader, count: int) -> None:
        self._sent_bytes += count
        self.sent.sense(math.nan if reader.size is None else self._sent_bytes / reader.size)

    def _warn(self, reply: Reply) -> None:
        if not reply.ok:
            self.playing.sense(False)
            self._log.warning("mp3: %s", reply.error)

    def file_ended(self) -> None:
        """The robot reports that it has played the file that it has."""
        if self.playing.sensed and self._reader is not None:
            self.playing.sense(False)
            self._send_next_piece(self._reader)

    def link_down(self) -> None:
        """The music ends: what the robot does now is not known."""
        self._end()


def chunks_of(data: bytes) -> Iterator[tuple[int, bytes]]:
    """The chunks of a file with their flags: the last one is known by the size."""
    for at in range(0, len(data), CHUNK_BYTES):
        last = at + CHUNK_BYTES >= len(data)
        yield (p.FIRST_CHUNK if at == 0 else 0) | (p.LAST_CHUNK if last else 0), data[at : at + CHUNK_BYTES]
