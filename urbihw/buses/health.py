"""The health of a robot, as its worker knows it: each device, the wire, the stops.  No I/O; time is an argument.

The engine shows it what it posts to its parent and what its parent asks for.  The result is the answer to the verb
"health" of the control socket (docs/safety.md), in SI units; whether that is good or bad is for `verdict`.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Mapping
from typing import Any, Final

from urbihw.buses.driver import Driver
from urbihw.buses.messages import (
    Begin,
    Configure,
    DeviceReport,
    DeviceState,
    Found,
    FromWorker,
    GuestsGone,
    LinkState,
    Samples,
    Statistics,
    Stopped,
    ThresholdCrossed,
    Unusable,
    Watch,
)
from urbihw.buses.readings import ALARM, Reading

WINDOW_S: Final = 60
"""Seconds of statistics that are kept."""
MAX_DEVICES: Final = 300
"""Devices in an answer."""
MAX_TEXT: Final = 200
"""Characters of a text in an answer."""

Key = tuple[Any, str]


class HealthRecord:
    """The record of one worker.

    Attributes:
        settings: the settings in force.
        writers: device -> the client that moved it last.
    """

    def __init__(self, driver: Driver, begin: Begin, now: float) -> None:
        self.settings: Configure = begin.settings
        self.writers: dict[Any, str] = {}
        self._driver = driver
        self._begun = now
        self._restarts = begin.restarts
        self._models: dict[Any, str] = {}
        self._states: dict[Any, tuple[str, str]] = {}
        self._lost: Counter[Any] = Counter()
        self._missed: Counter[Any] = Counter()
        self._values: dict[Any, dict[str, Any]] = {}
        self._heard_at: dict[Any, float] = {}
        self._requested: dict[Key, Any] = {}
        self._applied: dict[Key, Any] = {}
        self._unusable: dict[Any, str] = {}
        self._passed: dict[Any, dict[str, bool]] = {}
        self._periods: dict[Any, dict[str, float]] = {}
        self._blocked: dict[Any, float] = {}
        self._link_reason = ""
        self._seconds: deque[Statistics] = deque(maxlen=WINDOW_S)
        self._errors: Counter[str] = Counter()
        self._late = 0
        self._stops = 0
        self._stop_reason = ""
        self._stopped_at = -math.inf
        for watch in begin.watches:
            self.record_watch(watch)

    # ---------------------------------------------------------------- what happens

    def hear(self, message: FromWorker, now: float) -> None:
        """Record a message of the worker."""
        match message:
            case Samples():
                for device, values in message.values.items():
                    self._values.setdefault(device, {}).update(values)
                self._heard_at.update(message.times)
            case DeviceReport(what="blocked"):
                self._blocked[message.device] = message.value
            case DeviceReport(what="free"):
                self._blocked.pop(message.device, None)
            case Statistics():
                self._seconds.append(message)
                self._errors.update(message.errors)
                self._late += message.late
            case DeviceState():
                self._record_state(message)
            case Found():
                for each in message.devices:
                    number = getattr(each, "id", "")
                    self._models[number] = str(getattr(each, "name", "") or getattr(each, "model", ""))
            case GuestsGone():
                for device in message.devices:
                    for table in (self._models, self._states, self._values, self._heard_at, self._unusable):
                        table.pop(device, None)
                self._clear_targets(message.devices)
            case LinkState():
                self._link_reason = message.reason
                self._blocked.clear()
                self._clear_targets(None)
            case Stopped():
                self._record_stop(message, now)
            case ThresholdCrossed():
                passed = self._passed.setdefault(message.device, {})
                passed.pop(message.name, None)
                if message.passed:
                    passed[message.name] = message.holds
            case _:
                pass

    def record_requested(self, values: Mapping[Key, Any]) -> None:
        """Record targets that were asked for and may be executed."""
        self._requested.update(values)

    def record_unusable(self, message: Unusable) -> None:
        """Record that a device counts as lost although it answers or is not on this wire, or does no longer."""
        self._unusable.pop(message.device, None)
        if message.reason:
            self._unusable[message.device] = message.reason

    def record_watch(self, watch: Watch) -> None:
        """Record how often a device is to be read."""
        periods = self._periods.setdefault(watch.device, {})
        for item in watch.items or ("",):
            if watch.period is None:
                periods.pop(item, None)
            else:
                periods[item] = watch.period

    def record_applied(self, values: Mapping[Key, Any]) -> None:
        """Record targets that the driver gets, after all limits."""
        self._applied.update(values)

    def _record_state(self, message: DeviceState) -> None:
        self._states[message.device] = message.new, message.reason
        self._lost[message.device] += message.new == "lost"
        self._missed[message.device] += message.new == "suspect"

    def _record_stop(self, message: Stopped, now: float) -> None:
        self._clear_targets(message.devices)
        for device in list(self.writers) if message.devices is None else message.devices:
            self.writers.pop(device, None)
        if message.devices is None:
            self._stops += 1
            self._stop_reason, self._stopped_at = message.reason, now

    def _clear_targets(self, devices: tuple[Any, ...] | None) -> None:
        """Forget what was asked of some devices, or (None) of all."""
        for table in (self._requested, self._applied):
            for key in [key for key in table if devices is None or key[0] in devices]:
                del table[key]

    # ---------------------------------------------------------------- the answer

    def fields(self, now: float, heard_at: float, link: bool) -> dict[str, Any]:
        """Return the fields of the answer; `heard_at` is the time of the last message of the parent."""
        timeout = self.settings.dead_man
        return {
            "robot": _cut(self._driver.identity or next(iter(self._models.values()), "")),
            "link_reason": "" if link else _cut(self._link_reason),
            "uptime": round(now - self._begun, 1),
            "restarts": self._restarts,
            "dead_man": {
                "timeout": timeout,
                "age": round(now - heard_at, 3),
                "fired": bool(timeout) and now - heard_at > timeout,
            },
            "stops": self._stops,
            "last_stop": {"reason": _cut(self._stop_reason), "age": round(now - self._stopped_at, 1)}
            if self._stops else None,
            "bus": self._bus_fields(),
            "devices": [self._device_fields(device, now, link) for device in self._devices()[:MAX_DEVICES]],
        }  # fmt: skip

    def values(self, link: bool) -> dict[str, dict[str, float | None]]:
        """The last measured values of the devices that answer, in SI units; none without a link."""
        return {
            str(device): {name: _number(each.value) for name, each in self._readings(device, values).items()
                          if name != ALARM}
            for device, values in self._values.items()
            if link and self._states.get(device, ("ok",))[0] != "lost"
        }

    def _bus_fields(self) -> dict[str, Any]:
        """The wire: the last second, the last minute, and counters since the worker began."""
        last = self._seconds[-1] if self._seconds else Statistics(0.0, 0.0, 0)
        late = sum(each.late for each in self._seconds)
        ticks = sum(each.rate for each in self._seconds) + late
        recent: Counter[str] = Counter()
        for each in self._seconds:
            recent.update(each.errors)
        return {
            "wanted_rate": self.settings.rate,
            "rate": round(last.rate, 2),
            "mean_rate": round(_mean([each.rate for each in self._seconds]), 2),
            "turnaround": round(_mean([each.turnaround for each in self._seconds]), 6),
            "held_up": round(_mean([each.held_up for each in self._seconds]), 4),
            "crowd": round(last.crowd, 2),
            "load": round(last.load, 4),
            "late": self._late,
            "late_share": round(late / ticks, 5) if ticks else 0.0,
            "errors": dict(self._errors),
            "recent_errors": dict(recent),
            "recent_seconds": len(self._seconds),
            "dropped": sum(each.dropped for each in self._seconds),
        }

    def _devices(self) -> list[Any]:
        """All devices: those found, those that send, those expected, those that were moved."""
        known = [
            *(number for number in self._models if number != ""), *(each.id for each in self.settings.expected),
            *self._states, *self._values, *self._unusable, *(device for device, _ in self._requested),
        ]  # fmt: skip
        return sorted(dict.fromkeys(known), key=lambda device: (isinstance(device, str), device))

    def _device_fields(self, device: Any, now: float, link: bool) -> dict[str, Any]:
        state, reason = self._states.get(device, ("ok" if device in self._heard_at else "unknown", ""))
        if device in self._unusable:
            state, reason = "lost", self._unusable[device]
        heard_at = self._heard_at.get(device)
        readings = self._readings(device, self._values.get(device, {}))
        limits = {
            name: [_number(each.low), _number(each.high)]
            for name, each in readings.items()
            if not (math.isnan(each.low) and math.isnan(each.high))
        }
        return {
            "device": device,
            "name": next((each.name for each in self.settings.expected if each.id == device), ""),
            "model": _cut(self._models.get(device, "")),
            "state": state if link else "no link",
            "reason": _cut(reason) if state in ("suspect", "lost") else "",
            "age": None if heard_at is None else round(max(now - heard_at, 0.0), 3),
            "period": min(self._periods.get(device, {}).values(), default=None),
            "missed": self._missed[device],
            "lost": self._lost[device],
            "blocked": round(now - self._blocked[device], 1) if device in self._blocked else 0.0,
            "alarm": _cut(str(readings[ALARM].value)) if ALARM in readings else "",
            "values": {name: _number(each.value) for name, each in readings.items() if name != ALARM},
            "units": {name: each.unit for name, each in readings.items() if name != ALARM},
            "limits": limits,
            "passed": [{"name": name, "holds": holds} for name, holds in self._passed.get(device, {}).items()],
            "requested": self._targets(device, self._requested),
            "applied": self._targets(device, self._applied),
            "who": _cut(self.writers.get(device, "")),
        }

    def _readings(self, device: Any, values: Mapping[str, Any]) -> dict[str, Reading]:
        found = (self._driver.reading(device, item, raw) for item, raw in values.items())
        known: dict[str, Reading] = {}
        for each in found:
            # Several registers may tell alarms: none of them hides that of another one.
            if each is not None and (each.quantity != ALARM or each.value or ALARM not in known):
                known[each.quantity] = each
        return known

    def _targets(self, device: Any, table: Mapping[Key, Any]) -> dict[str, float | None]:
        values = {item: raw for (whose, item), raw in table.items() if whose == device}
        return {name: _number(each.value) for name, each in self._readings(device, values).items() if name != ALARM}


def _mean(values: list[float]) -> float:
    return sum(values) / len(values) if values else 0.0


def _number(value: float | str) -> float | None:
    """A number as JSON can have it."""
    return round(value, 4) if isinstance(value, int | float) and math.isfinite(value) else None


def _cut(text: str) -> str:
    return text if len(text) <= MAX_TEXT else text[: MAX_TEXT - 3] + "..."
