"""The maker's SDK and our codec put the same bytes on the wire, wherever the SDK is right.

Left out: payloads that need stuffing (it does not send it), protocol 1.0 bulk read (it raises).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import dynamixel_sdk  # type: ignore[import-untyped]
import pytest

from urbihw.buses.servos import packet


class RecordingPort:
    """What the SDK's packet handlers need of a port, kept in memory; there is no answer."""

    is_using = False
    tx_time_per_byte = 0.01

    def __init__(self) -> None:
        self.written = b""

    def clearPort(self) -> None:
        """Nothing ever comes in."""

    def writePort(self, data: list[int]) -> int:
        self.written += bytes(data)
        return len(data)

    def readPort(self, _: int) -> bytes:
        return b""

    def setPacketTimeout(self, _: int) -> None:
        """Nobody is waited for."""

    def setPacketTimeoutMillis(self, _: float) -> None:
        """Nobody is waited for."""

    def isPacketTimeout(self) -> bool:
        return True

    def getBytesAvailable(self) -> int:
        return 0


Case = tuple[float, Callable[[Any, RecordingPort], object], bytes]
CASES: dict[str, Case] = {
    "1 ping": (1.0, lambda h, p: h.ping(p, 5), packet.ping_packet(1, 5)),
    "1 read": (1.0, lambda h, p: h.readTx(p, 5, 36, 8), packet.read_packet(1, 5, 36, 8)),
    "1 write": (1.0, lambda h, p: h.write2ByteTxOnly(p, 5, 30, 512), packet.write_packet(1, 5, 30, b"\x00\x02")),
    "1 sync write": (
        1.0,
        lambda h, p: h.syncWriteTxOnly(p, 30, 2, [1, 0, 2, 2, 44, 1], 6),
        packet.sync_write_packet(1, 30, {1: b"\x00\x02", 2: b"\x2c\x01"}),
    ),
    "2 ping": (2.0, lambda h, p: h.ping(p, 5), packet.ping_packet(2, 5)),
    "2 read": (2.0, lambda h, p: h.readTx(p, 5, 132, 4), packet.read_packet(2, 5, 132, 4)),
    "2 write": (
        2.0,
        lambda h, p: h.write4ByteTxOnly(p, 5, 116, 2048),
        packet.write_packet(2, 5, 116, b"\x00\x08\x00\x00"),
    ),
    "2 reboot": (2.0, lambda h, p: h.reboot(p, 5), packet.reboot_packet(5)),
    "2 sync read": (
        2.0,
        lambda h, p: h.syncReadTx(p, 126, 10, [1, 2], 2, False),
        packet.sync_read_packet(126, 10, [1, 2]),
    ),
    "2 fast sync read": (
        2.0,
        lambda h, p: h.syncReadTx(p, 126, 10, [1, 2], 2, True),
        packet.sync_read_packet(126, 10, [1, 2], fast=True),
    ),
    "2 sync write": (
        2.0,
        lambda h, p: h.syncWriteTxOnly(p, 65, 1, [1, 1, 2, 0], 4),
        packet.sync_write_packet(2, 65, {1: b"\x01", 2: b"\x00"}),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_same_bytes(name: str) -> None:
    version, call, ours = CASES[name]
    port = RecordingPort()
    call(dynamixel_sdk.PacketHandler(version), port)
    assert port.written.hex(" ") == ours.hex(" ")
