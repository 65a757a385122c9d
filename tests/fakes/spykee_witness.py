"""A second client of a Spykee, typed from the fact sheet alone; it knows neither the driver nor the fake.

It speaks over anything with ``write(bytes)`` and ``read(count, timeout)``, as ``urbihw_fakes.endpoint.MemoryEndpoint``.
"""

from __future__ import annotations

import struct
from typing import Any, Protocol


class Wire(Protocol):
    """A connection."""

    def write(self, data: bytes) -> None: ...

    def read(self, count: int, timeout: float) -> bytes: ...


class SpykeeClient:
    """Attributes: names, version and docked after ``login``; pictures, sound, powers, engine, ended, as they came."""

    def __init__(self, wire: Wire) -> None:
        self.wire = wire
        self.names: list[str] = []
        self.version = ""
        self.docked = False
        self.pictures: list[bytes] = []
        self.sound = b""
        self.powers: list[int] = []
        self.engine: list[int] = []
        self.ended = 0
        self.texts: dict[int, str] = {}
        self.replies: list[bytes] = []

    def send(self, kind: int, *payload: Any) -> None:
        """A packet: section 3."""
        body = b"".join(part if isinstance(part, bytes) else bytes([part & 0xFF]) for part in payload)
        self.wire.write(b"PK" + struct.pack(">BH", kind, len(body)) + body)

    def _exactly(self, count: int, timeout: float) -> bytes:
        data = b""
        while len(data) < count:
            more = self.wire.read(count - len(data), timeout)
            if not more:
                return b""
            data += more
        return data

    def take(self, timeout: float) -> int | None:
        """The next packet: its type, None when none comes in time."""
        head = self._exactly(5, timeout)
        if not head:
            return None
        assert head[:2] == b"PK", head
        kind, length = struct.unpack(">BH", head[2:])
        body = self._exactly(length, timeout)
        assert len(body) == length
        if kind == 2:
            assert body[:2] == b"\xff\xd8" and body[-2:] == b"\xff\xd9"
            self.pictures.append(body)
        elif kind == 1:
            self.sound += body
        elif kind == 3:
            self.powers.append(struct.unpack("b", body)[0])
        elif kind == 16:
            self.engine.append(body[0])
        elif kind == 8:
            self.ended += 1
        elif kind == 11:
            self.replies.append(body)
        else:
            self.texts[kind] = body.decode("latin-1")
        return int(kind)

    def listen(self, seconds: float) -> None:
        """Take what comes until nothing has come for so long."""
        while self.take(seconds) is not None:
            pass

    def login(self, user: str, password: str) -> bool:
        """Section 5: whether we are in, and the first word about the battery has come."""
        self.send(10, len(user), user.encode("latin-1"), len(password), password.encode("latin-1"))
        if self.take(2.0) != 11:
            return False
        body = self.replies[-1]
        if len(body) < 8:
            return False
        texts, rest = [], body[1:]
        for _ in range(4):
            texts.append(rest[1 : 1 + rest[0]].decode("latin-1"))
            rest = rest[1 + rest[0] :]
        self.names, self.version, self.docked = texts[:3], texts[3], rest[0] == 0
        return self.take(2.0) == 3
