"""Splits the output of a server into lines: bytes in, lines out, no sockets.

A line is ``[stamp] text`` or ``[stamp:channel] text`` (server protocol, section 1).  Nothing marks a text of several
lines: those after the first have no stamp.  A Binary in a value is ``BIN size keywords``, a line feed, and that many
raw bytes (section 4); it is recognized in values only, never behind ``***`` and ``!!!``, which begin messages.

The one reader of this format: the commands, the console and the remote devices all use it.  ``values`` reads the text
of a line as a value.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Final, NamedTuple

MAX_LINE_BYTES: Final = 64 * 1024 * 1024
"""Maximum length of a line with its Binaries, in bytes: a server may never end a line."""
MAX_LAST_BYTES: Final = 1024
"""Maximum number of bytes kept of the last line."""

_HEAD: Final = re.compile(rb"\[(\d{8,20})(?::([^\]\r\n]{0,200}))?\] ?")
_BINARY: Final = re.compile(
    rb'"(?:[^"\\]|\\.)*"?'  # a string, which may contain text that looks like another line
    rb"|(?:^|\[|, ?|=> ?)BIN (\d{1,12})(?: ([^\n]*))?$",
    re.DOTALL,
)


class BadLine(ValueError):
    """The server has sent an invalid line."""


class Binary(NamedTuple):
    """The data of a Binary, and its keywords."""

    keywords: str
    data: bytes


class Line(NamedTuple):
    """One line of a server.

    Attributes:
        raw: the bytes of the line, without the line feed.
        begin: index of the text in ``raw``, behind the brackets.
        channel: name of the channel; empty for answers.
        stamp: time in ms; None for the second and later lines of a text.
        binaries: the Binaries in the text, in order.
    """

    raw: bytes
    begin: int = 0
    channel: str = ""
    stamp: int | None = None
    binaries: tuple[Binary, ...] = ()

    @property
    def text(self) -> bytes:
        """The text behind the brackets."""
        return self.raw[self.begin :]

    @property
    def shown(self) -> str:
        """The text as a str, for display."""
        return self.text.decode("utf-8", "replace")

    @property
    def is_error(self) -> bool:
        """Whether the line is an error message."""
        return self.raw.startswith(b"!!!", self.begin)


class Lines:
    """Splits one stream into lines.

    Attributes:
        last: the text of the last line, at most ``MAX_LAST_BYTES`` bytes of it; b"" before the first.
        stamped: whether a line had a time stamp, which only an urbiscript server writes.
    """

    def __init__(self, limit: int = MAX_LINE_BYTES, has_values: Callable[[str], bool] = lambda channel: True) -> None:
        """``limit`` is the maximum length of a line in bytes; ``has_values(channel)`` tells whether it may carry a
        Binary."""
        self._limit = limit
        self._has_values = has_values
        self._buffer = bytearray()
        self._from = 0
        """Index of the text behind the last Binary of an incomplete line."""
        self._searched = 0
        self._wanted = 0
        """Number of bytes that the buffer must have before it can contain another line."""
        self._channel = ""
        self._binaries: list[Binary] = []
        self.last = b""
        self.stamped = False

    def feed(self, data: bytes) -> list[Line]:
        """The lines that these bytes complete.  Raises BadLine for one that is too long."""
        self._buffer += data
        lines = []
        while (line := self._next()) is not None:
            lines.append(line)
        if len(self._buffer) > self._limit:
            raise BadLine(f"the server sent a line of more than {self._limit} bytes")
        if lines:
            raw, begin = lines[-1].raw, lines[-1].begin
            self.last = raw[begin : begin + MAX_LAST_BYTES]
        return lines

    @property
    def rest(self) -> bytes:
        """The bytes behind the last line feed."""
        return bytes(self._buffer)

    def _next(self) -> Line | None:
        buffer = self._buffer
        while len(buffer) >= self._wanted:
            end = buffer.find(b"\n", max(self._from, self._searched))
            if end < 0:
                self._searched = len(buffer)
                return None
            match = self._announced(end)
            if match is None:
                return self._complete(end)
            size = int(match[1])
            if end + 1 + size > self._limit:
                raise BadLine(f"the server announced {size} bytes, in a line of more than {self._limit} bytes")
            if len(buffer) < end + 1 + size:
                self._searched, self._wanted = end, end + 1 + size
                return None
            data = bytes(memoryview(buffer)[end + 1 : end + 1 + size])
            self._binaries.append(Binary((match[2] or b"").decode("utf-8", "replace").rstrip("\r"), data))
            self._from = end + 1 + size
        return None

    def _announced(self, end: int) -> re.Match[bytes] | None:
        """The header of a Binary (``BIN size keywords``) at the end of the text before a line feed; else None."""
        begin = self._from
        if self._buffer.rfind(b"BIN ", begin, end) < 0:
            return None
        if not begin:
            head = _HEAD.match(self._buffer)
            if head is None or not self._has_values((head[2] or b"").decode("utf-8", "replace")):
                return None
            begin = head.end()
            if self._buffer.startswith((b"***", b"!!!"), begin):
                return None
        piece = bytes(self._buffer[begin:end])
        return next((match for match in _BINARY.finditer(piece) if match[1] is not None), None)

    def _complete(self, end: int) -> Line:
        raw = bytes(memoryview(self._buffer)[:end])
        del self._buffer[: end + 1]
        head = _HEAD.match(raw)
        binaries: tuple[Binary, ...] = ()
        if self._binaries:
            binaries, self._binaries = tuple(self._binaries), []
        self._from = self._searched = self._wanted = 0
        if head is None:
            return Line(raw, 0, self._channel, None, binaries)
        self.stamped = True
        self._channel = (head[2] or b"").decode("utf-8", "replace")
        return Line(raw, head.end(), self._channel, int(head[1]), binaries)


def guarded(body: str, channel: str) -> str:
    """Wrap code so that its error is written to the channel on which a program waits for the answer.  No separator is
    added."""
    send = f'lobby.send("!!! " + %s, "{channel}")'
    return (f"try {{ {body} }} catch (var e if e.isA(Exception)) {{ {send % 'e.message'} }} "
            f"catch (var e) {{ {send % 'e'} }}")
