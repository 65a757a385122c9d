"""The wire of a recording as a capture (``urbihw.buses.capture``), which a simulated robot plays."""

from __future__ import annotations

from collections.abc import Iterator

from urbihw.buses.capture import CaptureHead, capture_line
from urbihw.buses.trace import Chunk
from urbihw.recording import topics
from urbihw.recording.reading import RecordedMessage, Recording, UnreadableRecording, in_order


def capture_lines(recording: Recording) -> Iterator[str]:
    """Yield the lines of a capture, without their ends: its head, then the bytes in order of time.

    Raises UnreadableRecording when there are no bytes of a wire in it.
    """
    platform = recording.head.about.get("platform", "")
    yield CaptureHead(platform, _devices(recording)).line()
    begun: float | None = None
    for message in in_order(recording.messages((topics.WIRE_OUT, topics.WIRE_IN, topics.WIRE_STATE))):
        if message.topic == topics.WIRE_STATE:
            yield from _link_line(message)
            continue
        # The first bytes of the link may be from long before the recording: a capture begins with them, at 0.
        begun = message.time if begun is None else begun
        time = max(message.time - begun, 0.0)
        yield capture_line(Chunk(time, ">" if message.topic == topics.WIRE_OUT else "<", message.data))
    if begun is None:
        raise UnreadableRecording(f"{recording.path}: has no bytes of a wire")


def _link_line(message: RecordedMessage) -> Iterator[str]:
    try:
        told = message.content()
    except ValueError:
        return
    if told.get("event") == "LinkState":
        yield "[link up]" if told.get("up") else "[link down]"


def _devices(recording: Recording) -> list[dict[str, object]]:
    """The devices as the worker told them last."""
    devices: list[dict[str, object]] = []
    for message in recording.messages((topics.WIRE_STATE,)):
        try:
            told = message.content().get("devices")
        except ValueError:
            continue
        if isinstance(told, list) and all(isinstance(row, dict) for row in told):
            devices = told
    return devices
