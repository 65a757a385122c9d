"""The handler that brings the lines of the process's log to its kernel, from any thread."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from typing import Any, Final

LOGGER: Final = "urbihw"
MAX_TEXT_LENGTH: Final = 1000
MAX_DEVICES: Final = 64
MAX_PENDING: Final = 200
"""Lines on their way to the kernel; while it is busy, further ones are dropped, and the next one tells how many."""


class LogTap(logging.Handler):
    """Calls ``add(entry)`` in the kernel's thread for each line: level, text, and the fields logger, robot, devices,
    event of the record (``daemon/journal``).  ``post`` is the kernel's.
    """

    def __init__(self, post: Callable[[Callable[[], None]], None], add: Callable[[Mapping[str, Any]], None]) -> None:
        super().__init__()
        self._post = post
        self._add = add
        self._pending = 0
        self._dropped = 0

    def attach(self) -> None:
        """Take all further lines."""
        logging.getLogger(LOGGER).addHandler(self)

    def detach(self) -> None:
        """Take no more lines; a second call does nothing."""
        logging.getLogger(LOGGER).removeHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        """Pass a line on.  Called by ``logging`` under the lock of this handler."""
        if self._pending >= MAX_PENDING:
            self._dropped += 1
            return
        try:
            entry = self._entry(record)
        except Exception:
            self.handleError(record)
            return
        self._pending += 1
        self._dropped = 0
        self._post(lambda: self._deliver(entry))

    def _entry(self, record: logging.LogRecord) -> dict[str, Any]:
        fields: dict[str, Any] = {"logger": record.name}
        for name in ("robot", "event"):
            if value := getattr(record, name, ""):
                fields[name] = str(value)
        if devices := tuple(getattr(record, "devices", ()))[:MAX_DEVICES]:
            fields["devices"] = [str(device) for device in devices]
        if self._dropped:
            fields["dropped"] = self._dropped
        text = record.getMessage().encode("utf-8", "backslashreplace")[:MAX_TEXT_LENGTH].decode("utf-8", "ignore")
        return {"date": round(record.created, 3), "level": record.levelname.lower(), "text": text, "fields": fields}

    def _deliver(self, entry: Mapping[str, Any]) -> None:
        self.acquire()
        self._pending -= 1
        self.release()
        self._add(entry)
