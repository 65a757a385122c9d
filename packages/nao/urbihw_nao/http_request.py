"""The head of an HTTP request, read strictly: what is not plainly well formed is refused.

A check of a header is worth nothing if the header can be hidden: behind a limit, on a folded line, by a second one of
the same name, by a name that only some readers take for it.  So nothing is repaired and nothing is skipped.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from http import HTTPStatus
from typing import Final

LARGEST: Final = 8192
"""Bytes of a head, with the blank line."""
MOST_HEADERS: Final = 64
BLANK_LINE: Final = b"\r\n\r\n"
_REQUEST_LINE: Final = re.compile(rb"([A-Z]{1,20}) ([!-\"$-~]+) HTTP/1\.[01]")
_HEADER: Final = re.compile(rb"([!#$%&'*+.^_`|~0-9A-Za-z-]+):[ \t]*([\t -~\x80-\xff]*)")
_STRAY_NEWLINE: Final = re.compile(rb"(?<!\r)\n|\r[^\n]")


class HttpRefusal(Exception):
    """The request is answered with this status and this line."""

    def __init__(self, status: HTTPStatus, text: str) -> None:
        super().__init__(text)
        self.status = status


class HeadReader:
    """Collects the bytes of a head; what follows it is dropped.

    Attributes:
        complete: the head has come, or enough of it to refuse it.
    """

    def __init__(self) -> None:
        self.complete = False
        self._data = bytearray()

    @property
    def size(self) -> int:
        """Bytes of the head so far."""
        return len(self._data)

    def receive(self, data: bytes) -> None:
        """Add bytes that have come."""
        if self.complete:
            return
        # The blank line may have begun with the last bytes.
        began = max(0, len(self._data) - len(BLANK_LINE))
        self._data += data
        if (end := self._data.find(BLANK_LINE, began)) >= 0:
            del self._data[end + len(BLANK_LINE) :]
            self.complete = True
        elif len(self._data) > LARGEST or _STRAY_NEWLINE.search(self._data, began):
            self.complete = True

    def parse(self) -> tuple[str, Mapping[str, str]]:
        """The target of a GET, and its headers with names in lower case.  Raises HttpRefusal."""
        if len(self._data) > LARGEST:
            raise HttpRefusal(HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE, f"a request has {LARGEST} bytes at most")
        if _STRAY_NEWLINE.search(self._data) or not self._data.endswith(BLANK_LINE):
            raise HttpRefusal(HTTPStatus.BAD_REQUEST, "lines end with CR LF")
        first, *rows = bytes(self._data[: -len(BLANK_LINE)]).split(b"\r\n")
        line = _REQUEST_LINE.fullmatch(first)
        if line is None:
            raise HttpRefusal(HTTPStatus.BAD_REQUEST, "this is no request of HTTP 1")
        if line[1] != b"GET":
            raise HttpRefusal(HTTPStatus.METHOD_NOT_ALLOWED, f"{line[1].decode()} is not answered, only GET")
        return line[2].decode(), _parse_headers(rows)


def _parse_headers(rows: list[bytes]) -> dict[str, str]:
    """The headers of a request.  Raises HttpRefusal."""
    if len(rows) > MOST_HEADERS:
        raise HttpRefusal(HTTPStatus.BAD_REQUEST, f"a request has {MOST_HEADERS} headers at most")
    headers: dict[str, str] = {}
    for row in rows:
        found = _HEADER.fullmatch(row)
        if found is None:
            raise HttpRefusal(HTTPStatus.BAD_REQUEST, "a header is written Name: value, on one line")
        name = found[1].decode().lower()
        if name in headers:
            raise HttpRefusal(HTTPStatus.BAD_REQUEST, f"{name[:40]} stands there twice")
        headers[name] = found[2].decode("latin-1").strip()
    if "host" not in headers:
        raise HttpRefusal(HTTPStatus.BAD_REQUEST, "one Host is needed")
    if "transfer-encoding" in headers or headers.get("content-length", "0") != "0":
        raise HttpRefusal(HTTPStatus.BAD_REQUEST, "a GET has no body here")
    return headers
