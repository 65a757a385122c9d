"""Records as lines for people: when, what kind, what; no I/O."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

from urbihw.recording import topics
from urbihw.recording.reading import NO_SENSE, RecordedMessage
from urbihw.settings import escape_unprintable

KINDS: Final[Mapping[str, tuple[str, ...]]] = {
    "wire": (topics.WIRE_OUT, topics.WIRE_IN),
    "samples": (topics.SAMPLES,),
    "values": (topics.VALUES,),
    "targets": (topics.TARGETS, topics.APPLIED, topics.WRITERS, topics.LIMITS),
    "requests": (topics.REQUESTS,),
    "events": (topics.EVENTS, topics.WIRE_STATE, topics.LOST),
    "statistics": (topics.STATISTICS,),
    "log": (topics.LOG,),
    "clients": (topics.TYPED, topics.ANSWERED),
    "settings": (topics.SETTINGS,),
}
"""Word of a filter -> its topics."""
USUAL: Final = ("targets", "requests", "events", "log")
"""What is shown without a filter: what somebody or something has done."""
_SHOWN_BYTES: Final = 32
_MOST_LINE: Final = 400


def line_of(message: RecordedMessage) -> str:
    """Return a message as a line, without control characters; one without sense is shown as such."""
    try:
        kind, text = _SHOW[message.topic](message)
    except NO_SENSE:
        kind, text = message.topic.strip("/")[:12], f"{len(message.data)} bytes that are not understood"
    return shown_line(f"{message.time:12.6f}  {kind:10} {text}")


def shown_line(text: str) -> str:
    """Return a text of a recording as one line for a terminal: printable, and not too long."""
    line = escape_unprintable(text[: _MOST_LINE + 1])
    return line if len(line) <= _MOST_LINE else line[: _MOST_LINE - 3] + "..."


def devices_of(message: RecordedMessage) -> set[str]:
    """Return the devices that a message is about, by their names on the wire; none for all or no devices."""
    try:
        told = message.content()
        if message.topic in (topics.SAMPLES, topics.VALUES):
            return set(told["values"])
        if message.topic in (topics.TARGETS, topics.APPLIED):
            return {str(row[0]) for row in told["values"]}
        if message.topic == topics.WRITERS:
            return set(told["names"])
        several = told.get("devices")
        if isinstance(several, list) and message.topic == topics.EVENTS:
            return {str(each) for each in several}
        return {str(told["device"])} if "device" in told else set()
    except NO_SENSE:
        return set()


def rows_text(rows: list[list[Any]]) -> str:
    """Return rows of device, item and value as text: ``6 goal_position 600, 7 led 1``."""
    return ", ".join(" ".join(map(str, row)) for row in rows)


def _wire(message: RecordedMessage) -> tuple[str, str]:
    cut = " ..." if len(message.data) > _SHOWN_BYTES else ""
    way = ">" if message.topic == topics.WIRE_OUT else "<"
    return "wire", f"{way} {message.data[:_SHOWN_BYTES].hex(' ').upper()}{cut}"


def _values(message: RecordedMessage) -> tuple[str, str]:
    values = message.content()["values"]
    rows = [[device, item, value] for device, items in values.items() for item, value in items.items()]
    return message.topic.strip("/"), rows_text(rows)


def _rows(kind: str) -> Callable[[RecordedMessage], tuple[str, str]]:
    return lambda message: (kind, rows_text(message.content()["values"]))


def _writers(message: RecordedMessage) -> tuple[str, str]:
    names = message.content()["names"]
    return "writer", ", ".join(f"{device}: {name}" for device, name in names.items())


def _request(message: RecordedMessage) -> tuple[str, str]:
    told = message.content()
    if told["event"] == "Reply":
        return "reply", f"#{told['reply_id']} {told['value'] if told['ok'] else told['error']}"
    value = f" {told['value']}" if told["verb"] == "write" else ""
    return "request", f"#{told['reply_id']} {told['verb']} {told['device']} {told['item']}{value}"


def _limits(message: RecordedMessage) -> tuple[str, str]:
    return "limits", f"{len(message.content()['table'])} limits are in force"


def _wire_state(message: RecordedMessage) -> tuple[str, str]:
    told = message.content()
    if told.get("event") == "Found":
        return "found", f"{len(told['devices'])} devices"
    if told.get("event") == "Worker":
        return "worker", f"{told.get('url', '')}, the link is {'up' if told['up'] else 'down'}"
    return "link", "is up" if told["up"] else f"is down: {told['reason']}"


def _event(message: RecordedMessage) -> tuple[str, str]:
    told = message.content()
    kind = str(told.pop("event"))
    words = _EVENT_WORDS.get(kind)
    text = words(told) if words else ", ".join(f"{name} {value}" for name, value in told.items() if value)
    return kind[:1].lower() + kind[1:], text


_EVENT_WORDS: Final[Mapping[str, Callable[[dict[str, Any]], str]]] = {
    "DeviceState": lambda told: f"{told['device']}: {told['old']} -> {told['new']}  {told['reason']}".rstrip(),
    "DeviceReport": lambda told: f"{told['device']}: {told['what']} {told['value']}",
    "Stopped": lambda told: f"{'all' if told['devices'] is None else told['devices']}: {told['reason']}",
    "Latched": lambda told: f"held by {told['reason']}" if told["reason"] else f"released by {told['who']}",
    "Refused": lambda told: f"{told['device']} {told['item']}: {told['reason']}",
    "Limited": lambda told: (
        f"{told['device']} {told['item']}: {told['requested']} -> {told['applied']} by {told['limit']}"
        if told["limit"] else f"{told['device']} {told['item']}: no longer limited"
    ),
    "ThresholdCrossed": lambda told: (
        f"{told['device']} {told['item']} {told['value']}: {told['name']} {'passed' if told['passed'] else 'left'}"
    ),
}  # fmt: skip


def _statistics(message: RecordedMessage) -> tuple[str, str]:
    told = message.content()
    return "statistics", f"{told['rate']:.1f} ticks/s, {told['late']} late, load {told['load']:.2f}, {told['errors']}"


def _lost(message: RecordedMessage) -> tuple[str, str]:
    told = message.content()
    return "lost", f"{told['count']} records are missing here ({told['where']})"


def _log(message: RecordedMessage) -> tuple[str, str]:
    return "log", message.content()["message"]


def _console(message: RecordedMessage) -> tuple[str, str]:
    told = message.content()
    return "typed" if message.topic == topics.TYPED else "answered", f"{told['client']}: {told['text'].strip()}"


def _settings(message: RecordedMessage) -> tuple[str, str]:
    settings = message.content()["settings"]
    return "settings", ", ".join(f"{name} = {value}" for name, value in settings.items())


_SHOW: Final[Mapping[str, Callable[[RecordedMessage], tuple[str, str]]]] = {
    topics.WIRE_OUT: _wire,
    topics.WIRE_IN: _wire,
    topics.SAMPLES: _values,
    topics.VALUES: _values,
    topics.TARGETS: _rows("target"),
    topics.APPLIED: _rows("applied"),
    topics.WRITERS: _writers,
    topics.REQUESTS: _request,
    topics.LIMITS: _limits,
    topics.WIRE_STATE: _wire_state,
    topics.EVENTS: _event,
    topics.STATISTICS: _statistics,
    topics.LOST: _lost,
    topics.LOG: _log,
    topics.TYPED: _console,
    topics.ANSWERED: _console,
    topics.SETTINGS: _settings,
}
