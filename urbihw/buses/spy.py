"""A link that prints its traffic: `spy:///dev/ttyUSB0?baud=57600` writes all bytes in hex to standard error.

0.001234  > FF FF 01 02 01 FB
0.001710  < FF FF 01 02 00 FC
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import TextIO

from urbihw import buses
from urbihw.buses.link import Context, Link, Url, byte_link
from urbihw.settings import SettingRule


class SpyLink(Link):
    """Passes everything on to the link it wraps and prints it with the time since opening."""

    def __init__(self, url: Url, context: Context, output: TextIO | None = None) -> None:
        self._inner = byte_link(buses.port_for(url.target, context))
        super().__init__(url, context)
        self.baud = self._inner.baud
        self.packets = self._inner.packets
        self._output = output if output is not None else sys.stderr
        self._start = 0.0

    @classmethod
    def parameters(cls, url: Url) -> Mapping[str, SettingRule]:
        """Return no rules: all parameters behind `?` belong to the inner link."""
        return {}

    def _open(self) -> None:
        self._inner.open()
        self._start = self.clock.now()

    def _close(self) -> None:
        self._inner.close()

    def _read(self, size: int, deadline: float) -> bytes:
        data = self._inner.read(size, deadline)
        if data:
            self._print("<", data)
        return data

    def _write(self, data: bytes) -> None:
        self._print(">", data)
        self._inner.write(data)

    def is_writable(self) -> bool:
        """Return whether the inner link accepts bytes now."""
        return self._inner.is_writable()

    def _print(self, direction: str, data: bytes) -> None:
        print(f"{self.clock.now() - self._start:.6f}  {direction} {data.hex(' ').upper()}", file=self._output)
