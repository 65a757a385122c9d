"""What the bus worker tells, as browsers get it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def worker_state(told: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of the event ``state`` that the health of a robot tells."""
    bus = told.get("bus") if isinstance(told.get("bus"), dict) else {}
    assert isinstance(bus, dict)
    return {
        "worker": True,
        "link": told.get("link") is True,
        "rate": bus.get("rate") or 0,
        "late": bus.get("late") or 0,
        "load": bus.get("load") or 0,
        "estop": str(told.get("estop") or ""),
        "battery": battery_voltage(told.get("devices")),
        "stopped": told.get("last_stop"),
    }


def battery_voltage(devices: Any) -> float | None:
    """The voltage of the device that is a battery, else the median of all, V; None where none is known."""
    found = []
    for row in devices if isinstance(devices, list) else ():
        voltage = (row.get("values") or {}).get("voltage") if isinstance(row, dict) else None
        if isinstance(voltage, int | float) and voltage == voltage:
            if "battery" in f"{row.get('device')} {row.get('name')} {row.get('model')}".lower():
                return float(voltage)
            found.append(float(voltage))
    return sorted(found)[len(found) // 2] if found else None
