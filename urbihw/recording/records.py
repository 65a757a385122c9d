"""Events of a worker as records: a topic, a time and the bytes of a message; no I/O and no clock."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from urbihw.recording import topics

_TOPIC_OF: Final = {
    "Samples": topics.SAMPLES,
    "Values": topics.VALUES,
    "Targets": topics.TARGETS,
    "Applied": topics.APPLIED,
    "Writers": topics.WRITERS,
    "Request": topics.REQUESTS,
    "Reply": topics.REQUESTS,
    "Limits": topics.LIMITS,
    "Statistics": topics.STATISTICS,
    "LinkState": topics.WIRE_STATE,
    "Found": topics.WIRE_STATE,
    "Typed": topics.TYPED,
    "Answered": topics.ANSWERED,
    "Settings": topics.SETTINGS,
}
"""Event -> topic; any other event is one of ``/events``."""
_OF_DAEMON: Final = {"Log", "Typed", "Answered", "Settings"}
"""Events that the daemon tells, not the worker."""
_ONE_KIND: Final = {topics.SAMPLES, topics.VALUES, topics.TARGETS, topics.APPLIED, topics.WRITERS, topics.LIMITS,
                    topics.STATISTICS, topics.TYPED, topics.ANSWERED, topics.SETTINGS}
"""Topics of one event only, whose name says nothing more."""
_LEVELS: Final = {"debug": 1, "info": 2, "warning": 3, "error": 4, "critical": 5}
"""Levels of the log, and their numbers in ``foxglove.Log``."""


class TopicRecord(NamedTuple):
    """One message of a recording.

    Attributes:
        topic: row of ``topics.TOPICS``.
        time: when it happened, in seconds of the machine's monotonic clock.
        data: the message, in the encoding of its topic.
    """

    topic: str
    time: float
    data: bytes


def json_record(topic: str, time: float, message: Mapping[str, Any]) -> TopicRecord:
    """Return a record of a topic in JSON."""
    return TopicRecord(topic, time, json.dumps(message, separators=(",", ":")).encode())


class RecordMaker:
    """Turns the lines of a worker and of a daemon into records."""

    def __init__(self) -> None:
        self._beginning: dict[str, list[TopicRecord]] = {}
        self._last = 0.0
        self._writers: dict[str, str] = {}

    @property
    def beginning(self) -> list[TopicRecord]:
        """What stands first in a file that begins later: what the worker told of itself, the first bytes of its link,
        by which a driver found the devices, the settings, and who moves which device."""
        told = [record for records in self._beginning.values() for record in records]
        return told + self._moved_before()

    def records(self, line: bytes) -> list[TopicRecord]:
        """Return the records of a line; one without sense gives an event that says so."""
        try:
            event = json.loads(line, parse_constant=lambda _: None)
            return self._records_of(event)
        except (ValueError, TypeError, KeyError, OverflowError, RecursionError):
            return [json_record(topics.LOST, self._last, {"count": 1, "where": "a line without sense"})]

    def _records_of(self, event: dict[str, Any]) -> list[TopicRecord]:
        if event.get("ok") is True:
            return self._answer(event)
        kind = str(event["event"])
        found = []
        dropped = event.pop("dropped", 0)
        if dropped:
            where = "daemon" if kind in _OF_DAEMON else "worker"
            found.append(json_record(topics.LOST, self._last, {"count": int(dropped), "where": where}))
        if kind == "Traffic":
            return found + self._traffic(event)
        if kind == "Log":
            return [*found, self._log(event)]
        time = self._last = float(event.pop("at", event.get("time", self._last)))
        topic = _TOPIC_OF.get(kind, topics.EVENTS)
        if topic in _ONE_KIND:
            del event["event"]
        if kind == "Samples":
            time = float(event["time"])
        if kind == "Writers":
            self._writers |= {str(device): str(name) for device, name in event["names"].items()}
        elif kind == "Stopped":
            devices = event.get("devices")
            gone = {*self._writers} if devices is None else {*map(str, devices)}
            self._writers = {device: name for device, name in self._writers.items() if device not in gone}
        record = json_record(topic, time, event)
        if kind == "Settings":
            self._beginning["settings"] = [record]
        return [*found, record]

    def _answer(self, answer: dict[str, Any]) -> list[TopicRecord]:
        if answer.get("do") != "record":
            return []
        self._last = float(answer["time"])
        about = {name: answer[name] for name in ("url", "baud", "devices", "settings", "wire") if name in answer}
        state = {"event": "Worker", "up": bool(answer["link"]), "estop": answer["estop"], "epoch": answer["epoch"]}
        self._beginning.pop("opening", None)
        found = self._beginning["worker"] = [json_record(topics.WIRE_STATE, self._last, state | about)]
        self._writers = {str(device): str(name) for device, name in answer.get("writers", {}).items()}
        return found + self._moved_before()

    def _moved_before(self) -> list[TopicRecord]:
        """Who moves which device at this moment."""
        return [json_record(topics.WRITERS, self._last, {"names": self._writers})] if self._writers else []

    @staticmethod
    def _log(event: dict[str, Any]) -> TopicRecord:
        """A line of the log, as Foxglove expects it."""
        seconds = float(event["date"])
        return json_record(topics.LOG, float(event["at"]), {
            "timestamp": {"sec": int(seconds), "nsec": round(seconds % 1 * 1e9)},
            "level": _LEVELS.get(str(event["level"]), 2),
            "message": str(event["text"]),
            "name": str(event["fields"].get("logger", "")),
            "file": "",
            "line": 0,
        })  # fmt: skip

    def _traffic(self, event: dict[str, Any]) -> list[TopicRecord]:
        found = []
        if event.get("lost"):
            found.append(json_record(topics.LOST, self._last, {"count": int(event["lost"]), "where": "wire"}))
        found += [
            TopicRecord(topics.WIRE_OUT if way == ">" else topics.WIRE_IN, float(time), bytes.fromhex(data))
            for time, way, data in event["chunks"]
        ]
        if event.get("opening"):
            self._beginning.setdefault("opening", []).extend(found)
        return found
