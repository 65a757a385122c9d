"""Reads recordings that anybody may have written: each size in a file is a claim, which is checked before it is paid.

A file that was cut off (its recorder was killed, the disk was full) is read as far as it goes. Times are given in
seconds since the first record; they are negative for what was kept from before the recording.
"""

from __future__ import annotations

import heapq
import json
import math
import os
import stat
from collections.abc import Collection, Iterator, Mapping
from io import BytesIO
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Final, NamedTuple

from urbihw.extras import install_command
from urbihw.frozen import frozen

if TYPE_CHECKING:
    from mcap.records import Chunk, McapRecord

MOST_CHUNK_BYTES: Final = 64 << 20
"""Unpacked bytes of one chunk at most."""
MOST_CHANNELS: Final = 1000
MOST_TEXT: Final = 1 << 20
"""Bytes of a message in JSON at most."""
MOST_SORTED: Final = 16 << 20
"""Bytes of the messages that are sorted at a time."""
NO_SENSE: Final = (KeyError, ValueError, TypeError, AttributeError, IndexError, OverflowError, RecursionError)
"""What is raised by who takes a message for what it is not: anything may stand in the file of a stranger."""
_MESSAGE_COST: Final = 300
"""Bytes of a message in memory, besides its data."""
_MAGIC: Final = b"\x89MCAP0\r\n"


class UnreadableRecording(ValueError):
    """A file that is no recording, or cannot be read; the message is one line that names it."""


class RecordedMessage(NamedTuple):
    """One message of a file.

    Attributes:
        topic: the topic of its channel.
        time: seconds since the first message of the file.
        data: the bytes.
    """

    topic: str
    time: float
    data: bytes

    def content(self) -> dict[str, Any]:
        """Return a message of JSON as an object.  Raises ValueError for another one."""
        if len(self.data) > MOST_TEXT:
            raise ValueError("too long")
        try:
            told = json.loads(self.data, parse_constant=lambda _: None)
        except RecursionError:
            raise ValueError("too deep") from None
        if not isinstance(told, dict):
            raise ValueError("no object")
        return told


@frozen(slots=False)
class RecordingHead:
    """What a recording tells of itself.

    Attributes:
        about: the metadata of urbihw: ``platform``, ``version`` ...; empty in a file of another program.
        begun_ns: the time of its first record, UTC.
    """

    about: Mapping[str, str]
    begun_ns: int


class Recording:
    """A file with a recording.

    Attributes:
        path: the file.
        head: what it tells of itself.
        damage: why it could be read only in part; "" if not, or not yet.
    """

    def __init__(self, path: Path) -> None:
        """Open it.  Raises UnreadableRecording."""
        try:
            import mcap.stream_reader  # noqa: F401
        except ImportError as error:
            raise UnreadableRecording(f"this needs a package: {install_command('recording')}") from error
        self.path = path
        self.damage = ""
        self.head = self._read_head()

    def messages(
        self, topics: Collection[str] = (), since: float = float("-inf"), until: float = float("inf")
    ) -> Iterator[RecordedMessage]:
        """Yield the messages of some topics (none named: of all) from ``since`` to ``until``, in the order of the
        file.

        Raises UnreadableRecording only for a file that can no longer be opened.
        """
        begun = self.head.begun_ns / 1e9
        # A chunk outside is not unpacked; a second more on both sides makes up for the rounding.
        for topic, stamp, data in self._stamped(window=(begun + since - 1.0, begun + until + 1.0)):
            time = (stamp - self.head.begun_ns) / 1e9
            if since <= time <= until and (not topics or topic in topics):
                yield RecordedMessage(topic, time, data)

    def _read_head(self) -> RecordingHead:
        about: dict[str, str] = {}
        for _, stamp, _ in self._stamped(about):
            return RecordingHead(about, stamp)
        if self.damage:
            raise UnreadableRecording(f"{self.path}: nothing in it can be read: {self.damage}")
        return RecordingHead(about, 0)

    def _stamped(
        self, about: dict[str, str] | None = None, window: tuple[float, float] = (-math.inf, math.inf)
    ) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, UTC in ns and bytes of each message; stop where the file is damaged, and note why.

        Chunks outside the ``window``, UTC in s, are passed over if the file has an index of its channels.
        """
        from mcap.exceptions import EndOfFile

        with _open(self.path) as file:
            try:
                yield from self._read(file, {} if about is None else about, window)
            except (EndOfFile, EOFError):
                self.damage = "it ends in the middle: its recorder did not complete it"
            except UnreadableRecording:
                raise
            except Exception as error:
                # Whatever a reader makes of bytes that lie: it is the file's fault, and what came before stands.
                self.damage = f"damaged after {file.tell()} bytes ({type(error).__name__})"

    def _read(
        self, file: IO[bytes], about: dict[str, str], window: tuple[float, float]
    ) -> Iterator[tuple[str, int, bytes]]:
        from mcap.records import Channel, Chunk, Message, Metadata
        from mcap.stream_reader import StreamReader

        topics = _indexed_topics(file) if window != (-math.inf, math.inf) else {}
        has_index = bool(topics)

        def told(record: McapRecord) -> Iterator[tuple[str, int, bytes]]:
            if isinstance(record, Message):
                topic = topics.get(record.channel_id)
                if topic is not None:
                    yield topic, record.log_time, record.data
            elif isinstance(record, Channel):
                if len(topics) >= MOST_CHANNELS and record.id not in topics:
                    raise ValueError("too many channels")
                topics[record.id] = record.topic
            elif isinstance(record, Metadata) and record.name == "urbihw":
                about.update(record.metadata)

        for record in StreamReader(file, emit_chunks=True, record_size_limit=MOST_CHUNK_BYTES).records:
            if isinstance(record, Chunk):
                begin, end = record.message_start_time / 1e9, record.message_end_time / 1e9
                if has_index and (end < window[0] or begin > window[1]):
                    continue
                for inner in _inner_records(_unpacked(record)):
                    yield from told(inner)
            else:
                yield from told(record)


def _indexed_topics(file: IO[bytes]) -> dict[int, str]:
    """Return the channels that the index at the end of a file names; none if there is no sound index."""
    from mcap.reader import SeekingReader

    try:
        summary = SeekingReader(file, record_size_limit=MOST_CHUNK_BYTES).get_summary()
        channels = {} if summary is None else summary.channels
    except Exception:
        # An index that lies is worth nothing.
        channels = {}
    file.seek(0)
    return {number: channel.topic for number, channel in channels.items()} if len(channels) <= MOST_CHANNELS else {}


def _open(path: Path) -> IO[bytes]:
    """Open a regular file that begins as a recording does.  Raises UnreadableRecording."""
    try:
        file = os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC), "rb")
    except OSError as error:
        raise UnreadableRecording(f"{path}: cannot be read: {error.strerror}") from error
    if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        file.close()
        raise UnreadableRecording(f"{path}: is not a regular file")
    begins = file.read(len(_MAGIC)) == _MAGIC
    file.seek(0)
    if not begins:
        file.close()
        raise UnreadableRecording(f"{path}: is no recording (no MCAP file)")
    return file


def _inner_records(data: bytes) -> Iterator[McapRecord]:
    """Yield the channels and messages of a chunk, one at a time: all of them take many times the memory of its bytes.
    """
    from mcap.data_stream import ReadDataStream
    from mcap.opcode import Opcode
    from mcap.records import Channel, Message

    stream = ReadDataStream(BytesIO(data))
    while stream.count < len(data):
        kind, length = stream.read1(), stream.read8()
        if kind == Opcode.MESSAGE:
            yield Message.read(stream, length)
        elif kind == Opcode.CHANNEL:
            yield Channel.read(stream)
        else:
            stream.read(length)


def _unpacked(chunk: Chunk) -> bytes:
    """Return the bytes of a chunk.  Raises ValueError if it would have more than it says, or too many."""
    if chunk.uncompressed_size > MOST_CHUNK_BYTES:
        raise ValueError("a chunk is too large")
    if not chunk.compression:
        return chunk.data
    data = _unpack(chunk.compression, chunk.data, chunk.uncompressed_size)
    if len(data) != chunk.uncompressed_size:
        raise ValueError("a chunk has another size than it says")
    return data


def _unpack(kind: str, data: bytes, size: int) -> bytes:
    """Unpack at most ``size`` bytes."""
    if kind == "zstd":
        import zstandard

        # The frame tells its size, too, and that is what a one-shot decompression would allocate.
        return zstandard.ZstdDecompressor(max_window_size=1 << 27).stream_reader(BytesIO(data)).read(size)
    if kind == "lz4":
        import lz4.frame

        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size))
    raise ValueError("an unknown compression")


def in_order(messages: Iterator[RecordedMessage], window: float = 1.0) -> Iterator[RecordedMessage]:
    """Yield messages by their times: within a tick a worker tells samples before the bytes that brought them.

    Those are sorted that are at most ``window`` seconds out of order, and never more than ``MOST_SORTED``
    bytes at a time.
    """
    waiting: list[tuple[float, int, RecordedMessage]] = []
    newest, size = float("-inf"), 0
    for number, message in enumerate(messages):
        newest = max(newest, message.time)
        heapq.heappush(waiting, (message.time, number, message))
        size += len(message.data) + _MESSAGE_COST
        while waiting and (waiting[0][0] < newest - window or size > MOST_SORTED):
            first = heapq.heappop(waiting)[2]
            size -= len(first.data) + _MESSAGE_COST
            yield first
    while waiting:
        yield heapq.heappop(waiting)[2]
