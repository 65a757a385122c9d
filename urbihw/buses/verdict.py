"""The verdict on the health of a robot: what is bad, what needs attention, and why.  No I/O.

It judges the answer of a worker to the verb "health" (docs/safety.md), so that each client can judge, while the
interpreter is busy.  A field that is missing or of another type counts as absent.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import IntEnum
from typing import Any, Final, NamedTuple

from urbihw.buses.pace import Pace

LOW_CHARGE: Final = 0.1
"""Share of its charge below which a battery is reported."""
NEAR_LIMIT_DEGC: Final = 5.0
"""Distance to the highest temperature at which a warning begins, in degrees C."""
SHORTEST_S: Final = 10.0
"""Seconds of a record below which shares are not judged: while everything starts, the machine is busy."""
ERROR_SHARE: Final = 0.01
"""Errors of a kind on the wire in a tick, over the last minute, from which on they are a warning."""
BAD_ERROR_SHARE: Final = 0.1
"""The same from which on they are bad."""
_AT_MOST_A_WARNING: Final = {"refused", "retried"}
"""Kinds of errors that cost time, and no values."""
SLOW_SHARE: Final = 0.9
"""Share of the wanted rate below which the rate is a warning."""
MAX_AGE_S: Final = 2.0
MAX_PERIODS: Final = 3
"""Age of the last answer of a device from which on its values are stale: in s, and in periods of its reading."""
RECENT_STOP_S: Final = 60.0
"""Seconds for which a stop by the dead man's timeout is reported."""


class Level(IntEnum):
    """The verdict; also the exit code of ``urbihw health``."""

    OK = 0
    WARNING = 1
    BAD = 2

    @property
    def word(self) -> str:
        """The level in words."""
        return self.name.lower()


class Reason(NamedTuple):
    """A reason of a verdict: `device` as it is shown, "" for the robot; `kind` is a fixed word for programs."""

    level: Level
    kind: str
    device: str
    text: str

    def __str__(self) -> str:
        return f"{self.device}: {self.text}" if self.device else self.text


def judge(told: Mapping[str, Any]) -> list[Reason]:
    """Return the reasons, the worst first; none if all is well."""
    found = [*_robot(told), *_bus(table_in(told, "bus")), *_inventory(told)]
    missing = {str(row.get("id")) for row in rows_in(told, "missing")}
    for row in rows_in(told, "devices"):
        if told.get("link") and str(row.get("device")) not in missing:
            found += _device(row)
    return sorted(found, key=lambda finding: -finding.level)


def error_level(kind: str, count: float, ticks: float) -> Level:
    """Return the verdict on errors of one kind that the wire had in some ticks."""
    if count <= ERROR_SHARE * ticks:
        return Level.OK
    return Level.BAD if count > BAD_ERROR_SHARE * ticks and kind not in _AT_MOST_A_WARNING else Level.WARNING


def level_of(findings: list[Reason]) -> Level:
    """Return the verdict: the worst of the reasons."""
    return max((finding.level for finding in findings), default=Level.OK)


def device_name(row: Mapping[str, Any]) -> str:
    """Return the name of a device for people: that of the settings with its id, or the id."""
    number, name = str(row.get("device", row.get("id", "?"))), str(row.get("name") or "")
    return f"{name} ({number})" if name else number


def _robot(told: Mapping[str, Any]) -> Iterator[Reason]:
    if not told.get("link"):
        yield Reason(Level.BAD, "link", "", f"no link: {told.get('link_reason') or 'the robot was never there'}")
    if told.get("estop"):
        hint = "urbihw release ends it, with --all also if it is not yours"
        yield Reason(Level.BAD, "estop", "", f"emergency stop by {told['estop']}; {hint}")
    dead_man = table_in(told, "dead_man")
    if dead_man.get("fired"):
        age = number_in(dead_man, "age")
        text = f"no sign of life from the daemon for {age:.1f} s: the robot is stopped"
        yield Reason(Level.BAD, "dead_man", "", text)
    last = table_in(told, "last_stop")
    reason = str(last.get("reason", ""))
    if not dead_man.get("fired") and reason.startswith("no sign of life") and number_in(last, "age") < RECENT_STOP_S:
        yield Reason(Level.WARNING, "dead_man", "", f"stopped {number_in(last, 'age'):.0f} s ago: {reason}")
    restarts = number_in(told, "restarts")
    if restarts:
        yield Reason(Level.WARNING, "restarts", "", f"the bus worker was replaced {restarts:.0f} times")


def _bus(bus: Mapping[str, Any]) -> Iterator[Reason]:
    seconds = number_in(bus, "recent_seconds")
    rate, wanted = number_in(bus, "rate"), number_in(bus, "wanted_rate")
    keys = "wanted_rate", "mean_rate", "late_share", "load", "turnaround", "held_up", "crowd"
    pace = Pace(*(number_in(bus, key) for key in keys))
    if seconds < SHORTEST_S:
        return
    if not pace.is_kept:
        yield Reason(Level.WARNING, "late", "", pace.explain())
    elif rate < SLOW_SHARE * wanted:
        yield Reason(Level.WARNING, "rate", "", f"{rate:.0f} Hz instead of {wanted:.0f}")
    errors = table_in(bus, "recent_errors")
    for kind in errors:
        count = number_in(errors, kind)
        level = error_level(kind, count, wanted * seconds)
        busy = pace.busy_words() if kind == "timeouts" else ""
        if level:
            if busy and pace.is_held_up:
                # A crowd alone excuses nothing: the programs of the robot itself are in it.
                level = Level.WARNING
            text = f"{count:.0f} {kind} on the wire in {seconds:.0f} s"
            yield Reason(level, "errors", "", f"{text}: {busy}" if busy else text)


def _inventory(told: Mapping[str, Any]) -> Iterator[Reason]:
    if not told.get("link"):
        return
    for row in rows_in(told, "missing"):
        yield Reason(Level.BAD, "missing", device_name(row), f"missing, expected {row.get('expected')}")
    for row in rows_in(told, "other"):
        yield Reason(Level.WARNING, "other", device_name(row), f"is {row.get('found')}, not {row.get('expected')}")
    for row in rows_in(told, "unexpected"):
        yield Reason(Level.WARNING, "unexpected", device_name(row), f"not expected ({row.get('found')})")


def _device(row: Mapping[str, Any]) -> Iterator[Reason]:
    name, state = device_name(row), row.get("state")
    if state == "lost":
        yield Reason(Level.BAD, "lost", name, f"lost: {row.get('reason') or 'no answer'}")
        return
    if state == "suspect":
        yield Reason(Level.WARNING, "suspect", name, f"suspect: {row.get('reason') or 'no answer'}")
    if row.get("alarm"):
        yield Reason(Level.BAD, "alarm", name, f"alarm: {row['alarm']}")
    if blocked := number_in(row, "blocked"):
        yield Reason(Level.WARNING, "blocked", name, f"blocked for {blocked:.1f} s: free it, or stop it")
    # A device that is not read at a period sends when it has something to say.
    is_read = _is_number(row.get("age")) and _is_number(row.get("period")) and state != "suspect"
    if is_read and number_in(row, "age") > max(MAX_AGE_S, MAX_PERIODS * number_in(row, "period")):
        yield Reason(Level.WARNING, "stale", name, f"last answer {number_in(row, 'age'):.1f} s ago")
    for passed in rows_in(row, "passed"):
        level = Level.BAD if passed.get("holds") else Level.WARNING
        yield Reason(level, "limit", name, f"beyond {passed.get('name')}" + ("; held" if passed.get("holds") else ""))
    yield from _ranges(name, table_in(row, "values"), table_in(row, "limits"))


def _ranges(name: str, values: Mapping[str, Any], limits: Mapping[str, Any]) -> Iterator[Reason]:
    """Temperature and voltage beside the range of the model, and what is left in a battery."""
    temperature, (_, hot) = values.get("temperature"), _pair(limits.get("temperature"))
    if _is_number(temperature) and _is_number(hot) and temperature > hot - NEAR_LIMIT_DEGC:
        level, words = (Level.BAD, "beyond") if temperature > hot else (Level.WARNING, "near")
        yield Reason(level, "temperature", name, f"{temperature:.0f} degC, {words} its limit of {hot:.0f}")
    voltage, (low, high) = values.get("voltage"), _pair(limits.get("voltage"))
    if _is_number(voltage) and _is_number(low) and voltage < low:
        yield Reason(Level.BAD, "voltage", name, f"{voltage:.1f} V, below its limit of {low:.1f}")
    if _is_number(voltage) and _is_number(high) and voltage > high:
        yield Reason(Level.BAD, "voltage", name, f"{voltage:.1f} V, above its limit of {high:.1f}")
    charge = values.get("charge")
    if charge is not None and _is_number(charge) and charge < LOW_CHARGE:
        yield Reason(Level.WARNING, "charge", name, f"{100 * charge:.0f} % of its charge left")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and value.__class__ is not bool


def number_in(table: Mapping[str, Any], key: str) -> float:
    """Return a number of an answer, 0 if there is none."""
    value = table.get(key)
    return float(value) if isinstance(value, int | float) else 0.0


def _pair(value: Any) -> tuple[Any, Any]:
    return (value[0], value[1]) if isinstance(value, list) and len(value) == 2 else (None, None)


def table_in(told: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    """Return a table of an answer, an empty one if there is none."""
    value = told.get(key)
    return value if isinstance(value, Mapping) else {}


def rows_in(told: Mapping[str, Any], key: str) -> list[Mapping[str, Any]]:
    """Return the tables of a list of an answer."""
    value = told.get(key)
    return [row for row in value if isinstance(row, Mapping)] if isinstance(value, list) else []
