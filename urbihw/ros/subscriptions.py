"""A topic to which this node has subscribed: a connection to each publisher, opened again while the master lists it."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterable
from typing import Any, Final

from urbihw.backoff import BackOff
from urbihw.repeats import LimitedLog
from urbihw.ros import rpc
from urbihw.ros.errors import PeerError, RosError
from urbihw.ros.master import value_of
from urbihw.ros.messages import MessageType
from urbihw.ros.rpc import cancel_all
from urbihw.ros.streams import RosStream, connect

log = logging.getLogger("urbihw.ros")

FIRST_PAUSE_S: Final = 0.2
MAX_PAUSE_S: Final = 5.0
MAX_PUBLISHERS: Final = 64
OLD_S: Final = 0.5
"""Seconds after the handshake in which a publisher sends what it has latched: the first message of that time is old."""
Receiver = Callable[[bytes, str], None]
"""Gets the bytes of a message and the node that has sent it."""
GoneNews = Callable[[str], None]
"""Gets the node whose connection has ended."""


class RosSubscription:
    """A topic with its type.

    Attributes:
        publishers: the nodes that are connected, by their addresses.
    """

    def __init__(
        self, topic: str, kind: MessageType, node: str, receive: Receiver, gone: GoneNews,
        receive_old: Receiver | None = None,
    ) -> None:  # fmt: skip
        """``receive_old`` gets what a publisher had latched before it was met, in place of ``receive``."""
        self.topic, self.kind = topic, kind
        self._receive, self._gone, self._receive_old = receive, gone, receive_old or receive
        self.publishers: dict[str, str] = {}
        self._node = node
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self._log = LimitedLog(log)

    def follow(self, uris: Iterable[str], old: bool = False) -> None:
        """Connect to these publishers, which were there before us if ``old``, and leave all others."""
        wanted = dict.fromkeys([*uris][:MAX_PUBLISHERS])
        for uri in [uri for uri in self._tasks if uri not in wanted]:
            self._tasks.pop(uri).cancel()
        for uri in wanted:
            if uri not in self._tasks:
                self._tasks[uri] = asyncio.get_running_loop().create_task(self._keep(uri, old))

    async def close(self) -> None:
        """Leave all publishers, for good."""
        tasks, self._tasks = {*self._tasks.values()}, {}
        await cancel_all(tasks)

    async def _keep(self, uri: str, old: bool) -> None:
        """Receive from a publisher, again after each end.  One that has died without a word stays listed."""
        pauses = BackOff(FIRST_PAUSE_S, MAX_PAUSE_S)
        while True:
            try:
                stream, fields = await self._open(uri)
                pauses.reset()
                latched = old and fields.get("latching") == "1"
                # What it has sent last comes again with the next connection, if it is latched.
                old = True
                await self._receive_all(uri, stream, fields.get("callerid", "")[:256], latched)
            except RosError as error:
                self._log.say(uri, "%s: publisher at %s: %s", self.topic, uri, error)
            except (OSError, EOFError) as error:
                log.debug("%s: publisher at %s has gone: %s", self.topic, uri, error)
            except Exception as error:  # the publisher must be tried again, whatever it has sent
                self._log.say(uri, "our bug: %s: publisher at %s: %r", self.topic, uri, error)
            await asyncio.sleep(pauses.next_pause())

    async def _open(self, uri: str) -> tuple[RosStream, dict[str, str]]:
        kind = self.kind
        stream, fields = await _greeted(uri, self.topic, kind.name, kind.md5, self._node)
        if fields.get("md5sum", kind.md5) not in ("*", kind.md5):
            stream.close()
            raise PeerError(f"md5 sum {fields['md5sum']}, not {kind.md5}: another version of {kind.name}")
        return stream, fields

    async def _receive_all(self, uri: str, stream: RosStream, name: str, latched: bool) -> None:
        """Receive until the end; with ``latched``, what comes at once is old."""
        self.publishers[uri] = name
        try:
            if latched:
                met = asyncio.get_running_loop().time()
                data = await stream.receive()
                is_old = asyncio.get_running_loop().time() - met < OLD_S
                (self._receive_old if is_old else self._receive)(data, name)
            while True:
                self._receive(await stream.receive(), name)
        finally:
            stream.close()
            del self.publishers[uri]
            self._gone(name)


async def definition_of(uri: str, topic: str, kind: str, node: str) -> tuple[str, str]:
    """The definition and the md5 sum that a publisher tells of a type.  Raises RosError."""
    stream, fields = await _greeted(uri, topic, kind, "*", node)
    stream.close()
    return fields.get("message_definition", ""), fields.get("md5sum", "*")


async def _greeted(uri: str, topic: str, kind: str, md5: str, node: str) -> tuple[RosStream, dict[str, str]]:
    told: Any = value_of(await rpc.call(uri, "requestTopic", node, topic, [["TCPROS"]]))
    if not isinstance(told, list) or len(told) < 3 or told[0] != "TCPROS" or not isinstance(told[2], int):
        raise PeerError(f"publisher at {uri} offers no TCPROS")
    stream = await connect(str(told[1]), told[2])
    try:
        fields = {"callerid": node, "topic": topic, "type": kind, "md5sum": md5, "tcp_nodelay": "1"}
        return stream, await stream.greet(fields)
    except EOFError as error:
        stream.close()
        raise PeerError(f"publisher at {uri} has closed the connection") from error
    except BaseException:
        stream.close()
        raise
