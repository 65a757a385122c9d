"""The log in the journal of systemd: priorities and fields, by its native protocol.

Only where standard error is the journal: ``JOURNAL_STREAM`` then has device and inode of that stream.  An entry is one
datagram of lines ``KEY=value``; a value with line ends is ``KEY``, a line end, its length in 8 bytes, the value.
Source: systemd, "Native Journal Protocol", and ``man 7 systemd.journal-fields``.

A record may have the attributes ``robot``, ``devices`` (a sequence of names) and ``event``; they become the fields
ROBOT, DEVICE (one for each device) and EVENT, and each kind of event has a MESSAGE_ID of its own::

    journalctl -u urbihw@bio DEVICE="motor 6"
    journalctl EVENT=lost -o json
"""

from __future__ import annotations

import logging
import os
import socket
import uuid
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

SOCKET: Final = Path("/run/systemd/journal/socket")
IDENTIFIER: Final = "urbihw"
MAX_VALUE_BYTES: Final = 32 * 1024
"""Longest value of a field; a datagram has room for about 200 kB."""
MAX_DEVICES: Final = 64
"""Devices of one entry."""
_PRIORITIES: Final = ((logging.CRITICAL, 2), (logging.ERROR, 3), (logging.WARNING, 4), (logging.INFO, 6))
"""Levels and the priorities of syslog from there on; below the last it is 7, debug."""
_EVENTS: Final = uuid.UUID("0d7b9c1e-52a5-4c3f-9a55-6f1d1f6a7c40")
"""The name space of the ids of events."""


def message_id(event: str) -> str:
    """The MESSAGE_ID of a kind of event, the same in all versions."""
    return uuid.uuid5(_EVENTS, event).hex


def journal_handler(environment: Mapping[str, str], descriptor: int = 2, path: Path = SOCKET) -> JournalHandler | None:
    """The handler for the journal; None if the stream ``descriptor`` is not the journal's."""
    try:
        stream = os.fstat(descriptor)
    except OSError:
        return None
    if environment.get("JOURNAL_STREAM") != f"{stream.st_dev}:{stream.st_ino}" or not path.is_socket():
        return None
    return JournalHandler(path)


class JournalHandler(logging.Handler):
    """Sends each record as one entry.

    It never blocks: an entry for which the journal has no room is dropped, and the next one tells how many were.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path = str(path)
        self._dropped = 0
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
        self._socket.setblocking(False)

    def emit(self, record: logging.LogRecord) -> None:
        try:
            entry = b"".join(_field(key, value) for key, value in self._fields(record))
        except Exception:
            self.handleError(record)
            return
        try:
            self._socket.sendto(entry, self._path)
        except OSError:  # the journal is busy, or starts anew
            self._dropped += 1
        else:
            self._dropped = 0

    def close(self) -> None:
        self._socket.close()
        super().close()

    def _fields(self, record: logging.LogRecord) -> Iterator[tuple[str, str]]:
        yield "MESSAGE", self.format(record)
        yield "PRIORITY", str(next((number for level, number in _PRIORITIES if record.levelno >= level), 7))
        yield "SYSLOG_IDENTIFIER", IDENTIFIER
        yield "LOGGER", record.name
        yield "CODE_FILE", record.pathname
        yield "CODE_LINE", str(record.lineno)
        yield "CODE_FUNC", record.funcName or ""
        if robot := getattr(record, "robot", ""):
            yield "ROBOT", str(robot)
        for device in tuple(getattr(record, "devices", ()))[:MAX_DEVICES]:
            yield "DEVICE", str(device)
        if event := getattr(record, "event", ""):
            yield "EVENT", str(event)
            yield "MESSAGE_ID", message_id(str(event))
        if self._dropped:
            yield "DROPPED", str(self._dropped)


def _field(key: str, value: str) -> bytes:
    data = value.encode("utf-8", "backslashreplace")[:MAX_VALUE_BYTES]
    if b"\n" not in data:
        return b"%s=%s\n" % (key.encode(), data)
    return b"%s\n%s%s\n" % (key.encode(), len(data).to_bytes(8, "little"), data)
