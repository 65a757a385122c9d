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
        "holders": holders_of(told),
        "battery": battery_of(told.get("devices"), "voltage"),
        "charge": battery_of(told.get("devices"), "charge"),
        "stopped": told.get("last_stop"),
    }


def holders_of(told: Mapping[str, Any]) -> list[dict[str, str]]:
    """Those who hold the robot by an emergency stop: ``user`` and ``who``, the name."""
    rows = told.get("holders")
    return [
        {"user": str(row.get("user") or ""), "who": str(row.get("who") or "")}
        for row in (rows if isinstance(rows, list) else ())
        if isinstance(row, dict)
    ]


def battery_of(devices: Any, quantity: str) -> float | None:
    """A quantity of the device that is a battery, else the median of all: "voltage" in V, "charge" of 1; None where it
    is not known."""
    found = []
    for row in devices if isinstance(devices, list) else ():
        value = (row.get("values") or {}).get(quantity) if isinstance(row, dict) else None
        if isinstance(value, int | float) and value == value:
            if "battery" in f"{row.get('device')} {row.get('name')} {row.get('model')}".lower():
                return float(value)
            found.append(float(value))
    return sorted(found)[len(found) // 2] if found else None
