"""One MCAP file that is being written: readable up to the last second after whatever ends its process.

The file is called ``NAME.mcap.part`` until it is complete. Once a second the writer ends its chunk and hands it to the
system, so that SIGKILL loses at most that second; every few seconds the disk is asked to keep it, against a loss of
power. What a disk takes only in part is cut off again.

Only its owner can read it. An existing file is never overwritten, and no symbolic link is followed.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from urbihw.extras import install_command
from urbihw.recording import topics
from urbihw.recording.records import TopicRecord

SUFFIX: Final = ".mcap"
PART: Final = ".part"
FLUSH_S: Final = 1.0
SYNC_S: Final = 5.0
CHUNK_BYTES: Final = 1 << 20
SPARE_BYTES: Final = 64 << 20
"""Bytes that a recording leaves free on its disk, for others."""
MOST_BYTES: Final = 4 << 30
"""Bytes of a recording at most."""


class RecordingRefused(Exception):
    """A recording cannot begin, or cannot go on; the message is one line."""


class _WholeWrites:
    """A file that takes all bytes of a write or raises OSError: the system may take a part when a disk is full."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self.size = 0

    def write(self, data: bytes) -> int:
        view = memoryview(data)
        while view:
            sent = os.write(self._descriptor, view)
            view = view[sent:]
        self.size += len(data)
        return len(data)

    def tell(self) -> int:
        return self.size

    def flush(self) -> None:
        pass


class RecordingFile:
    """A file to which records are added.

    Attributes:
        path: the name that the file has when it is complete.
        count: records that were added.
        problem: why the file has ended by itself; "" while it goes on.
    """

    def __init__(
        self, path: Path, offset_ns: int, about: Mapping[str, str], *, most: int = MOST_BYTES, spare: int = SPARE_BYTES
    ) -> None:
        """Begin a file; ``offset_ns`` is added to times of records to make them UTC.  Raises RecordingRefused."""
        writer_of = load_writer()
        self.path = path
        self.count = 0
        self.problem = ""
        self._offset_ns = offset_ns
        self._most, self._spare = most, spare
        self._descriptor = _create(path)
        self._file = _WholeWrites(self._descriptor)
        self._safe = 0
        self._flushed_at = self._synced_at = 0.0
        self._channels: dict[str, int] = {}
        self._writer = writer_of(self._file)
        try:
            self._writer.start(profile="", library="urbihw")
            self._writer.add_metadata("urbihw", dict(about))
            self._end_chunk()
        except OSError as error:
            self._give_up(error)

    @property
    def size(self) -> int:
        """Bytes of the file so far."""
        return self._file.size

    def add(self, record: TopicRecord) -> None:
        """Add a record; nothing happens to one of a file that has ended."""
        if self.problem:
            return
        stamp = max(round(record.time * 1e9) + self._offset_ns, 0)
        try:
            channel = self._channels.get(record.topic)
            if channel is None:
                channel = self._channels[record.topic] = self._register(record.topic)
            self._writer.add_message(channel, stamp, record.data, stamp)
            self.count += 1
        except OSError as error:
            self._give_up(error)

    def keep(self, now: float) -> None:
        """Call this a few times a second: it hands to the system and to the disk what is due."""
        if self.problem or now - self._flushed_at < FLUSH_S:
            return
        self._flushed_at = now
        try:
            self._end_chunk()
            if now - self._synced_at >= SYNC_S:
                self._synced_at = now
                os.fdatasync(self._descriptor)
            left = os.fstatvfs(self._descriptor)
        except OSError as error:
            self._give_up(error)
            return
        if left.f_bavail * left.f_frsize < self._spare:
            self._complete(f"the disk is almost full: {self._spare >> 20} MB are left to others")
        elif self.size > self._most:
            self._complete(f"the recording has {self._most >> 20} MB, which is the most")

    def close(self) -> Path:
        """Complete the file, and return its name; a file that has ended keeps the name that it got."""
        if not self.problem:
            self._complete("")
        return self.path

    def _complete(self, problem: str) -> None:
        try:
            self._writer.finish()
            os.fsync(self._descriptor)
        except OSError as error:
            self._give_up(error)
            return
        os.close(self._descriptor)
        self.problem = problem or "it is complete"
        self.path = _named(self.path)

    def _end_chunk(self) -> None:
        self._writer.flush()
        self._safe = self._file.size

    def _give_up(self, error: OSError) -> None:
        """Cut off what the disk has taken of the last chunk: what is left can be read."""
        self.problem = f"{self.path}: {error.strerror or error}; what was recorded until then is kept"
        self.path = part_of(self.path)
        try:
            os.ftruncate(self._descriptor, self._safe)
        except OSError:
            pass
        os.close(self._descriptor)

    def _register(self, topic: str) -> int:
        kind = topics.TOPICS[topic]
        schema = 0
        if kind.schema:
            data = json.dumps(kind.json_schema).encode()
            schema = self._writer.register_schema(kind.schema, "jsonschema", data)
        return int(self._writer.register_channel(topic, kind.encoding, schema))


def part_of(path: Path) -> Path:
    """Return the name of a file that is not complete."""
    return path.with_name(path.name + PART)


def _named(path: Path) -> Path:
    """Give a complete file its name, and return it; the old one if a file of that name was made meanwhile."""
    part = part_of(path)
    try:
        # Unlike a rename, a link never replaces a file; but some file systems have none.
        os.link(part, path)
        part.unlink()
    except FileExistsError:
        return part
    except OSError:
        part.rename(path)
    return path


def _create(path: Path) -> int:
    """Create the file.  Raises RecordingRefused."""
    try:
        if os.path.lexists(path):
            raise FileExistsError(17, "there is a file of this name already; choose another one")
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
        return os.open(part_of(path), flags, 0o600)
    except OSError as error:
        raise RecordingRefused(f"{path}: {error.strerror}") from error


def load_writer() -> Callable[[Any], Any]:
    """Return what makes a writer for a file.  Raises RecordingRefused without the packages of the extra."""
    try:
        from mcap.writer import CompressionType, Writer
    except ImportError as error:
        raise RecordingRefused(f"this needs a package: {install_command('recording')}") from error
    return lambda file: Writer(file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
