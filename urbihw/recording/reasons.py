"""Why a device did what it did at a moment of a recording: the last words on it before that moment; no I/O."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final, NamedTuple

from urbihw.recording import topics
from urbihw.recording.reading import NO_SENSE, RecordedMessage

FRESH_S: Final = 0.2
"""Seconds by which a measured value may be older than the newest one of the device."""
_NUMBER: Final = re.compile(r"[A-Za-z_]+(\d+)")


class _Said(NamedTuple):
    """What was said last of something, and when."""

    time: float
    what: str


class DeviceReasons:
    """Hears a recording up to a moment, and tells of one device.

    A device is named as on the wire (``3``, ``A``), or as a servo in urbiscript, with a number: ``motor3``; ``ids`` are
    further names of devices and what they are on the wire.
    """

    def __init__(self, device: str, ids: Mapping[str, str] | None = None) -> None:
        self._names = {device, *filter(None, [(ids or {}).get(device)])}
        if numbered := _NUMBER.fullmatch(device):
            self._names.add(numbered[1])
        self._device = device
        self._known = False
        self._asked: dict[str, _Said] = {}
        self._applied: dict[str, _Said] = {}
        self._limited: dict[str, _Said] = {}
        self._measured: dict[str, _Said] = {}
        self._words: dict[str, _Said] = {}

    def hear(self, message: RecordedMessage) -> None:
        """Take a message in; one without sense is passed over."""
        try:
            self._hear(message)
        except NO_SENSE:
            return

    def lines(self) -> Iterator[str]:
        """Yield what is known, one line each."""
        if not self._known:
            yield f"{self._device}: nothing was recorded of it until then"
            return
        writer = self._words.get("writer")
        if writer and not self._asked:
            yield f"{writer.time:10.3f}  moved last by {writer.what}, before the recording began"
        for item, (time, value) in self._asked.items():
            by = f" by {writer.what}" if writer else ""
            yield f"{time:10.3f}  asked for {item} {value}{by}"
        for item, (time, value) in self._applied.items():
            limit = self._limited.get(item)
            because = f": limited by {limit.what}" if limit and limit.what else ""
            yield f"{time:10.3f}  applied {item} {value}{because}"
        newest = max((said.time for said in self._measured.values()), default=0.0)
        for item, (time, value) in self._measured.items():
            # Registers that are read seldom, or once, say nothing of this moment.
            if time > newest - FRESH_S:
                yield f"{time:10.3f}  measured {item} {value}"
        for word in ("refused", "state", "stop", "estop", "held", "link"):
            if word in self._words and self._words[word].what:
                said = self._words[word]
                yield f"{said.time:10.3f}  {said.what}"

    def _hear(self, message: RecordedMessage) -> None:
        told = message.content()
        if message.topic == topics.TARGETS:
            self._note_rows(self._asked, told["values"], message.time)
        elif message.topic == topics.APPLIED:
            self._note_rows(self._applied, told["values"], message.time)
        elif message.topic == topics.SAMPLES:
            rows = [[name, *row] for name, items in told["values"].items() for row in items.items()]
            self._note_rows(self._measured, rows, message.time)
        elif message.topic == topics.WRITERS:
            self._note_writer(told["names"], message.time)
        elif message.topic == topics.WIRE_STATE and "up" in told:
            self._say("link", message.time, "" if told["up"] else f"the link is down: {told.get('reason', '')}")
        elif message.topic == topics.EVENTS:
            self._hear_event(told, message.time)

    def _hear_event(self, told: Mapping[str, Any], time: float) -> None:
        kind, mine = told["event"], str(told.get("device")) in self._names
        self._known = self._known or mine
        if kind == "Stopped" and self._concerns(told["devices"]):
            self._asked.clear()
            self._applied.clear()
            self._words.pop("writer", None)
            self._say("stop", time, f"stopped: {told['reason']}; what was asked before is over")
        elif kind == "Latched":
            held = f"held by an emergency stop: {told['reason']}" if told["reason"] else ""
            self._say("estop", time, held)
        elif kind == "Held":
            found = [why for name, why in told["devices"].items() if name in self._names]
            self._say("held", time, f"held: {found[0]}" if found else "")
        elif kind == "Limited" and mine:
            self._limited[str(told["item"])] = _Said(time, str(told["limit"] or ""))
        elif kind == "Refused" and mine:
            self._say("refused", time, f"refused {told['item']}: {told['reason']}")
        elif kind == "DeviceState" and mine:
            self._say("state", time, f"it is {told['new']}  {told['reason']}".rstrip())

    def _concerns(self, devices: Iterable[Any] | None) -> bool:
        return devices is None or any(str(each) in self._names for each in devices)

    def _note_rows(self, table: dict[str, _Said], rows: Iterable[list[Any]], time: float) -> None:
        for device, item, value in rows:
            if str(device) in self._names:
                self._known = True
                table[str(item)] = _Said(time, str(value))

    def _note_writer(self, names: Mapping[str, str], time: float) -> None:
        for device, name in names.items():
            if device in self._names:
                self._known = True
                self._say("writer", time, str(name))

    def _say(self, word: str, time: float, what: str) -> None:
        self._words[word] = _Said(time, what)
