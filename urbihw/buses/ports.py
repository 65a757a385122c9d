"""The serial ports of this machine."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

from serial.tools.list_ports import comports

from urbihw.frozen import frozen

BY_ID: Final = Path("/dev/serial/by-id")
LATENCY: Final = Path("/sys/bus/usb-serial/devices")


@frozen
class SerialPort:
    """A serial port.

    Attributes:
        device: its path.
        vendor, product: the numbers of its USB adapter, None if it has none.
        description: what the adapter says of itself.
        serial_number: of the adapter, "" if it has none.
        by_id: a name of the port that stays the same at each socket, "" if the system has none.
    """

    device: str
    vendor: int | None
    product: int | None
    description: str
    serial_number: str = ""
    by_id: str = ""


def serial_ports() -> list[SerialPort]:
    """The serial ports that exist, in order of their paths."""
    names = _lasting_names()
    found = [
        SerialPort(
            port.device, port.vid, port.pid, port.description, port.serial_number or "",
            names.get(os.path.realpath(port.device), ""),
        )
        for port in comports()
    ]  # fmt: skip
    return sorted((port for port in found if os.path.exists(port.device)), key=lambda port: port.device)


def latency(path: str) -> float:
    """Return the seconds for which the adapter of a port keeps an answer back; 0 if it has no such timer.

    Only FTDI adapters have one, of whole milliseconds; 1 ms is the shortest.
    """
    try:
        return int((LATENCY / Path(path).resolve().name / "latency_timer").read_text("ascii")) / 1000
    except (OSError, ValueError):
        return 0.0


def _lasting_names() -> dict[str, str]:
    """Path of a port -> its name in BY_ID."""
    try:
        return {os.path.realpath(name): str(name) for name in sorted(BY_ID.iterdir())}
    except OSError:
        return {}
