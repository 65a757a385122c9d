"""The topics of a recording, and the schema of each: names as Foxglove expects them where it knows the kind.

All messages but the bytes of the wire are JSON with a schema, which any reader of MCAP shows without help of urbihw.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

WIRE_OUT: Final = "/wire/tx"
WIRE_IN: Final = "/wire/rx"
WIRE_STATE: Final = "/wire/state"
SAMPLES: Final = "/samples"
VALUES: Final = "/values"
TARGETS: Final = "/targets"
APPLIED: Final = "/applied"
WRITERS: Final = "/writers"
REQUESTS: Final = "/requests"
LIMITS: Final = "/limits"
EVENTS: Final = "/events"
STATISTICS: Final = "/statistics"
LOST: Final = "/lost"
LOG: Final = "/log"
TYPED: Final = "/console/in"
ANSWERED: Final = "/console/out"
SETTINGS: Final = "/settings"
OF_DAEMON: Final = frozenset({LOG, TYPED, ANSWERED, SETTINGS})
"""What the daemon tells, beside the worker: what clients send and get, the log and the settings."""


class TopicKind(NamedTuple):
    """How the messages of a topic are written.

    Attributes:
        schema: the name of the schema, "" for bytes as they are.
        fields: the fields of the schema, by name.
    """

    schema: str
    fields: Mapping[str, Any] = {}

    @property
    def encoding(self) -> str:
        """The encoding of the messages, as MCAP names it."""
        return "json" if self.schema else "raw"

    @property
    def json_schema(self) -> dict[str, Any]:
        """The schema itself, as an object of JSON."""
        return {"title": self.schema, "type": "object", "properties": dict(self.fields)}


_NUMBER: Final = {"type": "number"}
_TEXT: Final = {"type": "string"}
_TABLE: Final = {"type": "object", "additionalProperties": {"type": "object"}}
_ROWS: Final = {"type": "array", "items": {"type": "array"}}
_EVENT: Final = {"event": _TEXT, "device": {}, "reason": _TEXT}

TOPICS: Final[Mapping[str, TopicKind]] = {
    WIRE_OUT: TopicKind(""),
    WIRE_IN: TopicKind(""),
    WIRE_STATE: TopicKind("urbihw.WireState", {"up": {"type": "boolean"}, "reason": _TEXT, "url": _TEXT,
                                               "baud": _NUMBER, "devices": {"type": "array"},
                                               "wire": {"type": "boolean"}}),
    SAMPLES: TopicKind("urbihw.Samples", {"time": _NUMBER, "times": {"type": "object"}, "values": _TABLE}),
    VALUES: TopicKind("urbihw.Values", {"time": _NUMBER, "values": _TABLE}),
    TARGETS: TopicKind("urbihw.Targets", {"values": _ROWS, "epoch": _NUMBER}),
    APPLIED: TopicKind("urbihw.Applied", {"values": _ROWS}),
    WRITERS: TopicKind("urbihw.Writers", {"names": {"type": "object"}}),
    REQUESTS: TopicKind("urbihw.Requests", {**_EVENT, "reply_id": _NUMBER, "verb": _TEXT, "item": _TEXT}),
    LIMITS: TopicKind("urbihw.Limits", {"table": _ROWS, "thresholds": {"type": "array"}}),
    EVENTS: TopicKind("urbihw.Events", _EVENT),
    STATISTICS: TopicKind("urbihw.Statistics", {"rate": _NUMBER, "late": _NUMBER, "load": _NUMBER}),
    LOG: TopicKind("foxglove.Log", {
        "timestamp": {"type": "object", "title": "time", "properties": {"sec": _NUMBER, "nsec": _NUMBER}},
        "level": {"type": "integer"}, "message": _TEXT, "name": _TEXT, "file": _TEXT, "line": {"type": "integer"},
    }),
    TYPED: TopicKind("urbihw.Console", {"client": _TEXT, "text": _TEXT, "size": _NUMBER}),
    ANSWERED: TopicKind("urbihw.Console", {"client": _TEXT, "text": _TEXT, "size": _NUMBER}),
    SETTINGS: TopicKind("urbihw.Settings", {"settings": {"type": "object"}}),
    LOST: TopicKind("urbihw.Lost", {"count": _NUMBER, "where": _TEXT}),
}  # fmt: skip
"""Topic -> its kind."""
