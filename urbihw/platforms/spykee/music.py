"""Music from a file or an http address, read by a thread ahead of what is played, in bounded memory.

The robot plays a file that was sent whole.  Music of at most WHOLE_BYTES is one such file.  Longer music, and a stream
whose length is unknown (a radio station), is cut into pieces that are sent one after the other: while one is played,
the next one is read.  A cut is rarely between two frames of MP3; a decoder loses one frame there (26 ms).
"""

from __future__ import annotations

import http.client
import threading
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Final, Protocol

WHOLE_BYTES: Final = 8 * 1024 * 1024
"""Maximum size of music that is sent as one file."""
FIRST_BYTES: Final = 64 * 1024
"""Bytes of longer music from which a piece is begun: 4 s at 128 kbit/s, for which a radio station is waited for."""
PIECE_BYTES: Final = 512 * 1024
"""Maximum size of a piece, and of what is read ahead: half a minute at 128 kbit/s."""
READ_BYTES: Final = 16 * 1024
READ_TIMEOUT_S: Final = 10.0
"""Seconds within which an address must answer, and a stream must go on."""


class MusicSource(Protocol):
    """What music is read from: a file, or the answer of an http server."""

    def read1(self, size: int, /) -> bytes:
        """Wait for bytes, and return at most ``size`` of them; b"" at the end."""
        ...

    def close(self) -> None:
        """Release the file or the connection."""
        ...


class MusicReader:
    """Reads one piece of music.  All methods may be called while its thread reads.

    Attributes:
        size: bytes of the whole, None if unknown; set by ``open``.
        problem: why reading has ended early, in words for the user; "" if it has not.
    """

    def __init__(self, stream: str) -> None:
        self.stream = stream
        self.size: int | None = None
        self.problem = ""
        self._changed = threading.Condition()
        self._buffer = bytearray()
        self._ended = self._closed = False
        self._on_ready: Callable[[], None] | None = None

    def open(self) -> None:
        """Open the file or the address, and wait for the first piece.  Raises ValueError, in words for the user."""
        source, self.size = open_source(self.stream)
        threading.Thread(target=self._read, args=(source,), name="urbihw-music", daemon=True).start()
        with self._changed:
            self._changed.wait_for(self._is_ready)
            if self.problem and (self._is_whole or not self._buffer):
                raise ValueError(self.problem)
            if not self._buffer and not self._closed:
                raise ValueError(f"{self.stream} is empty")

    def next_piece(self, on_ready: Callable[[], None]) -> bytes | None:
        """The next piece, b"" at the end.

        None if it was not read yet; then the thread calls ``on_ready`` once when it is.
        """
        with self._changed:
            if not self._is_ready():
                self._on_ready = on_ready
                return None
            piece = bytes(self._buffer[: self._capacity])
            del self._buffer[: self._capacity]
            self._changed.notify_all()
            return piece

    def close(self) -> None:
        """Read no more; the thread ends within READ_TIMEOUT_S."""
        with self._changed:
            self._closed, self._on_ready = True, None
            self._buffer.clear()
            self._changed.notify_all()

    @property
    def _is_whole(self) -> bool:
        return self.size is not None and self.size <= WHOLE_BYTES

    @property
    def _capacity(self) -> int:
        return WHOLE_BYTES if self._is_whole else PIECE_BYTES

    def _is_ready(self) -> bool:
        return self._ended or self._closed or (not self._is_whole and len(self._buffer) >= FIRST_BYTES)

    # ---------------------------------------------------------------- in the thread

    def _read(self, source: MusicSource) -> None:
        count, problem = 0, ""
        try:
            while self._wait_for_room():
                data = source.read1(READ_BYTES)
                if not data:
                    break
                count += len(data)
                self._add(data)
            if self.size is not None and count < self.size:
                problem = f"{self.stream} broke off after {count} of {self.size} bytes"
        except (OSError, ValueError, http.client.HTTPException) as error:
            problem = f"{self.stream} broke off after {count} bytes: {error}"
        finally:
            source.close()
            self._end(problem)

    def _wait_for_room(self) -> bool:
        """Wait until more may be read; returns False if no more is wanted."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or len(self._buffer) < self._capacity)
            return not self._closed

    def _add(self, data: bytes) -> None:
        with self._changed:
            self._buffer += data
            self._tell_if_ready()

    def _end(self, problem: str) -> None:
        with self._changed:
            self._ended, self.problem = True, problem
            self._tell_if_ready()

    def _tell_if_ready(self) -> None:
        self._changed.notify_all()
        if self._on_ready is not None and self._is_ready():
            on_ready, self._on_ready = self._on_ready, None
            on_ready()


def open_source(stream: str) -> tuple[MusicSource, int | None]:
    """A file or the answer of an http address, and its size if that is known.  Raises ValueError."""
    if stream.startswith(("http://", "https://")):
        return _open_address(stream)
    path = Path(stream)
    if not path.is_file():
        raise ValueError(f"there is no file {stream!r}")
    try:
        return path.open("rb"), path.stat().st_size
    except OSError as error:
        raise ValueError(f"cannot read {path}: {error.strerror}") from error


def _open_address(address: str) -> tuple[MusicSource, int | None]:
    try:
        answer: http.client.HTTPResponse = urllib.request.urlopen(address, timeout=READ_TIMEOUT_S)
    except (OSError, ValueError, http.client.HTTPException) as error:
        raise ValueError(f"cannot read {address}: {getattr(error, 'reason', None) or error}") from error
    return answer, answer.length
