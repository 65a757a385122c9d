"""The answer of a worker to "health", of a robot with one servo that is well."""

from __future__ import annotations

from typing import Any

HEALTHY: dict[str, Any] = {
    "ok": True, "do": "health", "epoch": 0, "estop": "", "link": True, "time": 81.25,
    "expected": [], "missing": [], "unexpected": [], "other": [],
    "robot": "", "link_reason": "", "uptime": 900.0, "restarts": 0, "stops": 0, "last_stop": None,
    "dead_man": {"timeout": 1.5, "age": 0.2, "fired": False},
    "bus": {
        "wanted_rate": 100.0, "rate": 99.9, "mean_rate": 99.9, "turnaround": 0.0001, "held_up": 0.0, "load": 0.4,
        "late": 3, "late_share": 0.0005, "errors": {"timeouts": 900},
        "recent_errors": {"timeouts": 2}, "recent_seconds": 60, "dropped": 0,
    },
    "devices": [
        {
            "device": 6, "name": "", "model": "AX-12A", "state": "ok", "reason": "", "age": 0.01, "period": 0.0,
            "missed": 0, "lost": 0,
            "alarm": "", "values": {"temperature": 41.0, "voltage": 11.1, "position": 0.5},
            "units": {"temperature": "degC", "voltage": "V", "position": "rad"},
            "limits": {"temperature": [None, 70.0], "voltage": [6.0, 14.0]}, "passed": [],
            "requested": {}, "applied": {}, "who": "",
        }
    ],
}  # fmt: skip
