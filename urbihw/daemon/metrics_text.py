"""The health of a robot as text for Prometheus.  No I/O.

Format: Prometheus, "Exposition formats", text version 0.0.4: base units in the names, counters end in ``_total``, and
the text ends with a line end.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from urbihw.buses.verdict import judge, level_of, rows_in, table_in

CONTENT_TYPE: Final = "text/plain; version=0.0.4; charset=utf-8"
_QUANTITIES: Final = {
    "position": "radians", "speed": "radians_per_second", "torque": "newton_meters", "load": "ratio",
    "current": "amperes", "voltage": "volts", "temperature": "celsius", "charge": "ratio",
}  # fmt: skip
"""Quantity -> its unit in the name of a metric."""
_UNIT_SYMBOLS: Final = {
    "position": "rad", "speed": "rad/s", "torque": "N m", "load": "", "current": "A", "voltage": "V",
    "temperature": "degC", "charge": "",
}  # fmt: skip
"""Quantity -> the unit in which the worker tells it; in another one it is left out."""
_HELP: Final = {
    "up": "whether the bus worker answers",
    "health": "verdict of urbihw health: 0 ok, 1 warning, 2 bad",
    "link_up": "whether the link to the robot is up",
    "estop": "whether an emergency stop holds",
    "missing_devices": "expected devices that do not answer",
    "worker_uptime_seconds": "time since the bus worker was started",
    "worker_restarts_total": "bus workers that were replaced",
    "stops_total": "stops of the whole robot",
    "dead_man_age_seconds": "time since the last sign of life of the daemon",
    "bus_ticks_per_second": "rate of the bus cycle",
    "bus_wanted_ticks_per_second": "rate of the settings",
    "bus_load_ratio": "share of the time in which the wire is busy",
    "bus_late_ticks_total": "ticks that were missed because others took too long",
    "bus_errors_total": "failures on the wire, by kind",
    "device_up": "whether the device answers",
    "device_lost_total": "how often the device was lost",
    "device_missed_total": "how often answers of the device began to be missing",
    "device_age_seconds": "time since the last answer of the device",
    "device_alarm": "whether the device reports an error that lasts",
    **{f"device_{name}_{unit}": f"measured {name}" for name, unit in _QUANTITIES.items()},
}
"""Metric without its prefix -> its description."""

_Sample = tuple[str, Mapping[str, str], float]


def render(robot: str, told: Mapping[str, Any] | None) -> str:
    """The text for a robot; ``told`` is the answer of its worker, None if it does not answer."""
    families: dict[str, list[str]] = {}
    for name, labels, value in _samples(told):
        row = ",".join(f'{key}="{_escape(text)}"' for key, text in {"robot": robot, **labels}.items())
        families.setdefault(name, []).append(f"urbihw_{name}{{{row}}} {value:.10g}\n")
    return "".join(
        f"# HELP urbihw_{name} {_HELP[name]}\n"
        f"# TYPE urbihw_{name} {'counter' if name.endswith('_total') else 'gauge'}\n{''.join(rows)}"
        for name, rows in families.items()
    )


def _samples(told: Mapping[str, Any] | None) -> Iterator[_Sample]:
    yield "up", {}, float(told is not None)
    if told is None:
        return
    bus, dead_man = table_in(told, "bus"), table_in(told, "dead_man")
    yield "health", {}, float(level_of(judge(told)))
    yield "link_up", {}, float(bool(told.get("link")))
    yield "estop", {}, float(bool(told.get("estop")))
    yield "missing_devices", {}, float(len(rows_in(told, "missing")))
    numbers = (
        ("worker_uptime_seconds", told, "uptime"), ("worker_restarts_total", told, "restarts"),
        ("stops_total", told, "stops"), ("dead_man_age_seconds", dead_man, "age"),
        ("bus_ticks_per_second", bus, "rate"), ("bus_wanted_ticks_per_second", bus, "wanted_rate"),
        ("bus_load_ratio", bus, "load"), ("bus_late_ticks_total", bus, "late"),
    )  # fmt: skip
    for name, table, key in numbers:
        yield from _sample(name, {}, table.get(key))
    for kind, count in table_in(bus, "errors").items():
        yield from _sample("bus_errors_total", {"kind": str(kind)}, count)
    for row in rows_in(told, "devices"):
        yield from _device_samples(row)


def _device_samples(row: Mapping[str, Any]) -> Iterator[_Sample]:
    labels = {key: str(row.get(key) or "") for key in ("device", "name", "model")}
    yield "device_up", labels, float(row.get("state") in ("ok", "suspect", "back"))
    yield "device_alarm", labels, float(bool(row.get("alarm")))
    for name, key in (("lost_total", "lost"), ("missed_total", "missed"), ("age_seconds", "age")):
        yield from _sample(f"device_{name}", labels, row.get(key))
    units = table_in(row, "units")
    for name, value in table_in(row, "values").items():
        if name in _QUANTITIES and units.get(name) == _UNIT_SYMBOLS[name]:
            yield from _sample(f"device_{name}_{_QUANTITIES[name]}", labels, value)


def _sample(name: str, labels: Mapping[str, str], value: object) -> Iterator[_Sample]:
    if isinstance(value, int | float):
        yield name, labels, float(value)


def _escape(text: str) -> str:
    return text.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n")
