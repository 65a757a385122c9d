"""The serial ports of this machine."""

from __future__ import annotations

import os
from dataclasses import dataclass

from serial.tools.list_ports import comports


@dataclass(frozen=True, slots=True)
class SerialPort:
    """A serial port.

    Attributes:
        device: its path.
        vendor, product: the numbers of its USB adapter, None if it has none.
        description: what the adapter says of itself.
    """

    device: str
    vendor: int | None
    product: int | None
    description: str


def serial_ports() -> list[SerialPort]:
    """The serial ports that exist, in order of their paths."""
    found = [SerialPort(port.device, port.vid, port.pid, port.description) for port in comports()]
    return sorted((port for port in found if os.path.exists(port.device)), key=lambda port: port.device)
