"""A topic that this node publishes, and those who have subscribed to it."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Final

from urbihw.ros.errors import PeerError
from urbihw.ros.framing import encode_header, frame
from urbihw.ros.messages import MessageType
from urbihw.ros.streams import RosStream

log = logging.getLogger("urbihw.ros")

MAX_UNREAD_BYTES: Final = 4 << 20
"""Bytes that wait for a subscriber that reads slowly; what is published meanwhile it does not get."""
MAX_SUBSCRIBERS: Final = 64
PeerNews = Callable[[str, bool], None]
"""Is told the node that has subscribed (True) or that has gone (False)."""


class RosPublication:
    """A topic with its type.

    Attributes:
        latest: the last message, for those who come later; None unless ``latch``.
        dropped: number of messages that a slow subscriber did not get.
    """

    def __init__(self, topic: str, kind: MessageType, latch: bool, on_peer: PeerNews) -> None:
        self.topic, self.kind, self.latch = topic, kind, latch
        self.latest: bytes | None = None
        self.dropped = 0
        self._on_peer = on_peer
        self._peers: dict[RosStream, str] = {}

    @property
    def subscribers(self) -> list[str]:
        """The nodes that have subscribed."""
        return [*self._peers.values()]

    def publish(self, data: bytes) -> None:
        """Send a message to all subscribers."""
        framed = frame(data)
        if self.latch:
            self.latest = framed
        for peer in self._peers:
            self._send(peer, framed)

    def _send(self, peer: RosStream, framed: bytes) -> None:
        if peer.writer.transport.get_write_buffer_size() > MAX_UNREAD_BYTES:
            self.dropped += 1
        else:
            peer.writer.write(framed)

    async def serve(self, stream: RosStream, fields: dict[str, str], node: str) -> None:
        """Serve a subscriber until it goes.  Raises PeerError with the reason of a refusal."""
        kind = self.kind
        if fields.get("type", "*") not in ("*", kind.name) or fields.get("md5sum") not in ("*", kind.md5):
            raise PeerError(
                f"topic {self.topic} has type {kind.name}, md5sum {kind.md5}, not {fields.get('type')}, "
                f"{fields.get('md5sum')}"
            )
        if len(self._peers) >= MAX_SUBSCRIBERS:
            raise PeerError(f"topic {self.topic} has {MAX_SUBSCRIBERS} subscribers, and takes no more")
        answer = {"callerid": node, "type": kind.name, "md5sum": kind.md5, "topic": self.topic,
                  "latching": str(int(self.latch)), "message_definition": kind.definition}
        stream.writer.write(encode_header(answer))
        peer = fields.get("callerid", "")[:256]
        self._peers[stream] = peer
        try:
            self._on_peer(peer, True)
            if self.latest is not None:
                self._send(stream, self.latest)
            await stream.wait_closed()
        finally:
            del self._peers[stream]
            self._on_peer(peer, False)

    def close(self) -> None:
        """Send away all subscribers."""
        for peer in self._peers:
            peer.close()
