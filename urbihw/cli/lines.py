"""What a server says, cut into lines: bytes in, lines out, no sockets.

A line is ``[stamp] text`` or ``[stamp:channel] text`` (server protocol, section 1).  Nothing marks a text of several
lines: those after the first have no stamp.  A Binary in a value is ``BIN size keywords``, a line feed, and that many
raw bytes (section 4); it is looked for in values only, never behind ``***`` and ``!!!``, which is text of people.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

LONGEST: Final = 64 * 1024 * 1024
"""Bytes that a line may have, and a Binary: no server is trusted to end one."""

_HEAD: Final = re.compile(rb"\[(\d{1,20})(?::([^\]\r\n]{0,200}))?\] ?")
_BINARY: Final = re.compile(rb"(?:^|\[|, |=> ?)BIN (\d{1,12})(?: ([^\"\n]*))?$")


class BadLine(ValueError):
    """The server sends what is no line."""


@dataclass(frozen=True)
class Binary:
    """The data of a Binary, and what it is."""

    keywords: str
    data: bytes


@dataclass(frozen=True)
class Line:
    """One line of a server.

    Attributes:
        raw: as it came, without its line feed.
        text: what stands behind the brackets.
        channel: its name, empty for answers.
        stamp: milliseconds; None for the second and later lines of a text.
        binaries: those in the text, in order.
    """

    raw: bytes
    text: bytes
    channel: str = ""
    stamp: int | None = None
    binaries: tuple[Binary, ...] = ()

    @property
    def shown(self) -> str:
        """The text for people."""
        return self.text.decode("utf-8", "replace")

    @property
    def is_error(self) -> bool:
        """Whether it tells of a mistake."""
        return self.text.startswith(b"!!!")


class Lines:
    """Cuts one stream into lines."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._from = 0
        self._searched = 0
        self._channel = ""
        self._binaries: list[Binary] = []

    def feed(self, data: bytes) -> list[Line]:
        """The lines that these bytes complete.  Raises BadLine for one that is too long."""
        self._buffer += data
        lines = []
        while (line := self._next()) is not None:
            lines.append(line)
        if len(self._buffer) > LONGEST:
            raise BadLine(f"the server sent a line of more than {LONGEST >> 20} MB")
        return lines

    @property
    def rest(self) -> bytes:
        """What came behind the last line feed."""
        return bytes(self._buffer)

    def _next(self) -> Line | None:
        buffer = self._buffer
        while True:
            end = buffer.find(b"\n", max(self._from, self._searched))
            if end < 0:
                self._searched = len(buffer)
                return None
            begin = self._piece_begin()
            match = _BINARY.search(bytes(buffer[begin:end])) if self._is_value(begin) else None
            if match is None:
                return self._complete(end)
            size = int(match[1])
            if size > LONGEST:
                raise BadLine(f"the server announced {size} bytes")
            if len(buffer) < end + 1 + size:
                self._searched = end
                return None
            data = bytes(buffer[end + 1 : end + 1 + size])
            self._binaries.append(Binary((match[2] or b"").decode("utf-8", "replace"), data))
            self._from = end + 1 + size

    def _piece_begin(self) -> int:
        """Where what follows the last binary begins, or the text."""
        if self._from:
            return self._from
        head = _HEAD.match(self._buffer)
        return head.end() if head else 0

    def _is_value(self, begin: int) -> bool:
        if self._from:
            return True
        return _HEAD.match(self._buffer) is not None and bytes(self._buffer[begin : begin + 3]) not in (b"***", b"!!!")

    def _complete(self, end: int) -> Line:
        raw = bytes(self._buffer[:end])
        del self._buffer[: end + 1]
        head = _HEAD.match(raw)
        binaries, self._binaries = tuple(self._binaries), []
        self._from = self._searched = 0
        if head is None:
            return Line(raw, raw, self._channel, None, binaries)
        self._channel = (head[2] or b"").decode("utf-8", "replace")
        return Line(raw, raw[head.end() :], self._channel, int(head[1]), binaries)


def guarded(body: str, channel: str) -> str:
    """Code whose error is said on a channel, where a program waits for its answer; the statement is not yet ended."""
    send = f'lobby.send("!!! " + %s, "{channel}")'
    return (f"try {{ {body} }} catch (var e if e.isA(Exception)) {{ {send % 'e.message'} }} "
            f"catch (var e) {{ {send % 'e'} }}")
