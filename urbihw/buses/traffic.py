"""The bytes on a worker's wire, collected for those who ask for them by the control socket (``trace``).

Nothing is collected as long as no client listens: a port then has no observer. What waits is bounded; more is
dropped, the oldest first, and counted. Connections that a driver opens beside its port (`Port.twin`) are not seen.
"""

from __future__ import annotations

from collections import deque
from dataclasses import asdict, is_dataclass
from typing import Any, Final

from urbihw.buses.clock import BusClock
from urbihw.buses.link import Port
from urbihw.buses.messages import Found, FromWorker

MOST_CHUNKS: Final = 2000
"""Chunks that are collected in one tick."""
MOST_BYTES: Final = 1 << 18
"""Their bytes."""


class TrafficLog:
    """Collects what one port moves, between two calls of `take`."""

    def __init__(self, url: str, clock: BusClock) -> None:
        self._url = url
        self._clock = clock
        self._devices: list[dict[str, Any]] = []
        self._chunks: deque[tuple[float, str, bytes]] = deque()
        self._size = 0
        self._lost = 0

    def hear(self, message: FromWorker) -> None:
        """Note which devices were found: who decodes the bytes must know their models."""
        if isinstance(message, Found):
            self._devices = [asdict(device) for device in message.devices if is_dataclass(type(device))]

    def fields(self, port: Port | None) -> dict[str, Any]:
        """Return what a client must know to decode the bytes: url, devices, and bits per second on the wire."""
        return {
            # What stands behind `?` may be a password.
            "url": self._url.partition("?")[0],
            "devices": self._devices,
            "baud": 0 if port is None else port.baud,
        }

    def observe(self, port: Port | None, wanted: bool) -> None:
        """Collect from a port, or no longer."""
        if port is None or (port.observer is not None) == wanted:
            return
        port.observer = self._add if wanted else None
        if not wanted:
            self._chunks.clear()
            self._size = self._lost = 0

    def take(self) -> dict[str, Any] | None:
        """Return the event with what was collected, None for nothing; the next one begins."""
        if not self._chunks:
            return None
        rows = [[round(time, 6), direction, data.hex()] for time, direction, data in self._chunks]
        event = {"event": "Traffic", "chunks": rows, "lost": self._lost}
        self._chunks.clear()
        self._size = self._lost = 0
        return event

    def _add(self, direction: str, data: bytes) -> None:
        self._chunks.append((self._clock.now(), direction, data))
        self._size += len(data)
        while len(self._chunks) > MOST_CHUNKS or (self._size > MOST_BYTES and len(self._chunks) > 1):
            self._size -= len(self._chunks.popleft()[2])
            self._lost += 1
