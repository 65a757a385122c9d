"""The loudspeaker and the player of music files."""

from __future__ import annotations

import http.client
import urllib.request
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from urbihw.buses.messages import Reply
from urbihw.kernel.uobject import LOCK_INSTANCE, UObject, USound, event, function, owned, reading, threaded
from urbihw.platforms.channel import DeviceChannel
from urbihw.platforms.devicelog import DeviceLog
from urbihw.platforms.spykee import protocol as p
from urbihw.platforms.spykee.bulk import CHUNK_BYTES
from urbihw.platforms.spykee.sounds import Recording

AHEAD: Final = 8
"""Pieces of sound that the worker has at most: a second, in which this process may be held up."""
CHUNKS_AHEAD: Final = 4
LONGEST_MUSIC: Final = 8 * 1024 * 1024
"""Bytes of a music file; of a stream, so much is fetched."""
FETCH_TIMEOUT_S: Final = 10.0
LONGEST_QUEUE_S: Final = 600.0
"""Seconds of sound that may wait for the loudspeaker."""


class SpykeeSpeaker(UObject):
    """The loudspeaker: plays the sound that is assigned to ``val`` (raw or WAVE), behind what it plays already.

    ``remain`` (ms) is how much is left to play, ``playing`` whether there is any.
    """

    val = owned()
    remain = reading(0.0)
    playing = reading(False)

    def init(self, channel: DeviceChannel, log: DeviceLog) -> None:
        """Speak to the worker through ``channel``."""
        self._channel, self._log = channel, log
        self._pieces: Iterator[bytes] = iter(())
        self._waiting: deque[Recording] = deque()
        self._ahead = 0
        self._ends = 0.0
        self._epoch = 0
        self.notify_change(self.val, self._write)
        self.notify_access(self.remain, self._show_remain)

    def _write(self) -> None:
        sound = self.val.value
        if not isinstance(sound, USound):
            raise ValueError("this slot takes a sound: a Binary with the keywords raw or wav")
        recording = Recording(sound)
        now = self.host.now()
        if self._ends - now > LONGEST_QUEUE_S:
            raise ValueError(f"the loudspeaker has more than {LONGEST_QUEUE_S:g} s to play")
        self._ends = max(now, self._ends) + recording.seconds
        self._waiting.append(recording)
        self.playing.sense(True)
        self._feed()

    def _feed(self) -> None:
        while self._ahead < AHEAD:
            piece = next(self._pieces, None)
            if piece is None:
                if not self._waiting:
                    break
                self._pieces = self._waiting.popleft().pieces()
                continue
            self._ahead += 1
            epoch = self._epoch
            self._channel.write("speaker", "piece", piece, lambda reply, epoch=epoch: self._sent(reply, epoch))  # type: ignore[misc]
        if not self._ahead:
            self._show_end()

    def _sent(self, reply: Reply, epoch: int) -> None:
        if epoch != self._epoch:
            return
        self._ahead -= 1
        if reply.ok:
            self._feed()
        else:
            self._log.warning("speaker: not played: %s", reply.error)
            self._forget()

    def _show_end(self) -> None:
        """The last piece has left; it is over when it was played."""
        left = self._ends - self.host.now()
        if left <= 0:
            self.playing.sense(False)
            return
        handle = 0

        def over() -> None:
            self.remove_timer(handle)
            if not self._ahead and self.host.now() >= self._ends - 1e-6:
                self.playing.sense(False)

        handle = self.set_timer(left, over)

    def _show_remain(self) -> None:
        self.remain.sense(max(0.0, self._ends - self.host.now()) * 1000)

    def _forget(self) -> None:
        self._epoch += 1
        self._pieces, self._ahead, self._ends = iter(()), 0, 0.0
        self._waiting.clear()
        self.playing.sense(False)

    @function
    def stop(self) -> None:
        """Play no more of what was assigned; half a second may already be with the robot."""
        self._forget()
        self._channel.write("speaker", "flush", 0, lambda reply: None)

    @function("playSound")
    def play_sound(self, id: int) -> None:
        """Play one of the robot's own sounds, 0 to 15 (0 alarm, 1 bomb, 2 laser, 3 laugh, 4 engine, 5 robot)."""
        if id not in p.SOUNDS:
            raise ValueError(f"there is no sound {id}; there are {p.SOUNDS[0]} to {p.SOUNDS[-1]}")
        self._channel.write("play", "sound", id, self._answered)

    def _answered(self, reply: Reply) -> None:
        if not reply.ok:
            self._log.warning("speaker: %s", reply.error)


class SpykeeMp3(UObject):
    """The player of music: ``play`` sends a file or what a stream gives to the robot, which then plays it.

    ``sent`` is the share of it that has left, ``playing`` whether the robot plays; the event ``ended`` comes when it
    has played all of it.
    """

    playing = reading(False)
    sent = reading(1.0)
    ended = event()

    def init(self, channel: DeviceChannel, log: DeviceLog) -> None:
        """Speak to the worker through ``channel``."""
        self._channel, self._log = channel, log
        self._epoch = 0

    @threaded(LOCK_INSTANCE)
    def play(self, stream: str) -> None:
        """Play an MP3 file of this computer, or what an http address gives (8 MB of it); back when it was read."""
        data = fetch(stream)
        self.host.post(lambda: self._upload(data))

    @function
    def stop(self) -> None:
        """Play no more, and send no more."""
        self._epoch += 1
        self.playing.sense(False)
        self._channel.write("play", "stop", 0, self._answered)

    def _upload(self, data: bytes) -> None:
        self._epoch += 1
        self.sent.sense(0.0)
        chunks, epoch, done = chunks_of(data), self._epoch, [0]

        def send_next() -> None:
            chunk = next(chunks, None)
            if chunk is not None:
                self._channel.write("file", "chunk", chunk, lambda reply: answered(reply, len(chunk[1])))

        def answered(reply: Reply, size: int) -> None:
            if epoch != self._epoch:
                return
            if not reply.ok:
                self._epoch += 1
                self._log.warning("mp3: not sent: %s", reply.error)
                return
            done[0] += size
            self.sent.sense(done[0] / len(data))
            if done[0] == len(data):
                self.playing.sense(True)
                self._channel.write("play", "sound", p.MUSIC, self._answered)
            send_next()

        for _ in range(CHUNKS_AHEAD):
            send_next()

    def _answered(self, reply: Reply) -> None:
        if not reply.ok:
            self.playing.sense(False)
            self._log.warning("mp3: %s", reply.error)

    def has_ended(self) -> None:
        """The robot tells that it has played all of it."""
        self.playing.sense(False)
        self.ended.emit()

    def link_down(self) -> None:
        """What the robot does now is not known."""
        self.playing.sense(False)


def chunks_of(data: bytes) -> Iterator[tuple[int, bytes]]:
    """The chunks of a file with their flags: the last is known by the size."""
    for at in range(0, len(data), CHUNK_BYTES):
        last = at + CHUNK_BYTES >= len(data)
        yield (p.FIRST_CHUNK if at == 0 else 0) | (p.LAST_CHUNK if last else 0), data[at : at + CHUNK_BYTES]


def fetch(stream: str) -> bytes:
    """A file, or what an http address gives.  Raises ValueError, in words for the user."""
    data = _from_web(stream) if stream.startswith(("http://", "https://")) else _from_file(Path(stream))
    if not data:
        raise ValueError(f"{stream} is empty")
    return data


def _from_web(address: str) -> bytes:
    try:
        with urllib.request.urlopen(address, timeout=FETCH_TIMEOUT_S) as answer:
            data: bytes = answer.read(LONGEST_MUSIC)
            return data
    except (OSError, ValueError, http.client.HTTPException) as error:
        raise ValueError(f"cannot read {address}: {getattr(error, 'reason', None) or error}") from error


def _from_file(path: Path) -> bytes:
    if not path.is_file():
        raise ValueError(f"there is no file {path}")
    try:
        with path.open("rb") as file:
            data = file.read(LONGEST_MUSIC + 1)
    except OSError as error:
        raise ValueError(f"cannot read {path}: {error.strerror}") from error
    if len(data) > LONGEST_MUSIC:
        raise ValueError(f"{path} is longer than {LONGEST_MUSIC // 1024 // 1024} MB")
    return data
