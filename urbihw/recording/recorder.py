"""A recorder: lines of a worker in, records into its sinks; no I/O of its own, and time is an argument."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final, Protocol

from urbihw.recording import topics
from urbihw.recording.feed import LineQueue
from urbihw.recording.reading import RecordedMessage
from urbihw.recording.records import RecordMaker, TopicRecord, json_record

STEP_S: Final = 0.2
"""Seconds for which a step waits at most."""


class RecordSink(Protocol):
    """What records are put into: a file, or the memory of the last minutes."""

    def add(self, record: TopicRecord) -> None:
        """Take a record in; it never raises."""

    def keep(self, now: float) -> None:
        """Do what is due; called a few times a second."""


class RobotRecorder:
    """Moves records from a queue into sinks.

    Attributes:
        maker: makes the records.
        sinks: where they go; may change between two steps.
        heard: called with the words of a record of an event, to end on one: see `words_of`.
    """

    def __init__(self, queue: LineQueue, maker: RecordMaker, sinks: Sequence[RecordSink]) -> None:
        self.maker = maker
        self.sinks = list(sinks)
        self.heard: Callable[[str], None] = lambda word: None
        self._queue = queue

    def step(self, now: Callable[[], float], timeout: float = STEP_S) -> int:
        """Wait for lines, and put their records into the sinks; return how many records that were."""
        lines, lost = self._queue.take(timeout)
        records = [record for line in lines for record in self.maker.records(line)]
        if lost:
            records.append(json_record(topics.LOST, now(), {"count": lost, "where": "recorder"}))
        for record in records:
            for sink in self.sinks:
                sink.add(record)
        for sink in self.sinks:
            sink.keep(now())
        for record in records:
            if record.topic in (topics.EVENTS, topics.WIRE_STATE):
                for word in words_of(record):
                    self.heard(word)
        return len(records)


def words_of(record: TopicRecord) -> Sequence[str]:
    """Return what happened, in the words of ``urbihw record --until``: ``stop``, ``estop``, ``lost``, ``gone``."""
    told: dict[str, Any] = RecordedMessage(record.topic, record.time, record.data).content()
    kind = told.get("event")
    found = []
    # A release that leaves others, or is refused, tells the holder that is left; a press has a ``who`` and frees none.
    if kind == "Latched" and told.get("who") and told.get("reason") and not told.get("freed"):
        found.append("estop")
    if kind == "Stopped" and told.get("devices") is None:
        found.append("stop")
    if kind == "LinkState" and not told.get("up"):
        found.append("lost")
    if kind == "Feed" and "gone" in str(told.get("what")):
        found.append("gone")
    return found
