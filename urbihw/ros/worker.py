"""The process that has a ROS node for a kernel: ``python -m urbihw.ros.worker FD``; FD is its end of a socket.

It ends with the kernel, which is seen as the end of the socket.  Several objects of the kernel may follow, or publish,
one topic: the node does it once (``SharedTopics``).  A kernel that is slow gets the newest messages: the process keeps
``WINDOW`` of a topic, and drops the oldest one.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import signal
import socket
import sys
from collections import deque
from collections.abc import Awaitable, Callable, Mapping
from functools import partial
from typing import Any, Final

from urbihw.repeats import LimitedLog
from urbihw.ros.errors import RosError
from urbihw.ros.names import checked_name, unique_name
from urbihw.ros.node import RosNode
from urbihw.ros.orders import (
    WINDOW,
    Order,
    OrderReader,
    PeerChange,
    RosAnswer,
    Said,
    ServiceAsked,
    TopicMessage,
    packed,
)  # fmt: skip
from urbihw.ros.publications import RosPublication
from urbihw.ros.services import ServiceCaller
from urbihw.ros.subscriptions import RosSubscription

log = logging.getLogger("urbihw.ros")

CHUNK_BYTES: Final = 1 << 16
Say = Callable[[Said], None]


class FollowedTopic:
    """A topic that objects of the kernel follow, and what waits for the kernel."""

    def __init__(self, say: Say, topic: str) -> None:
        self.handles: dict[int, None] = {}
        self.subscription: RosSubscription | None = None
        self._say = say
        self._topic = topic
        self._waiting: deque[bytes] = deque(maxlen=WINDOW)
        self._free = WINDOW
        self._log = LimitedLog(log)
        self._missed = 0

    def receive(self, data: bytes, publisher: str) -> None:
        """A message has come."""
        self._missed += len(self._waiting) == WINDOW
        self._waiting.append(data)
        self._send()

    def taken(self) -> None:
        """The kernel has taken a message."""
        self._free += 1
        self._send()

    def _send(self) -> None:
        while self._free and self._waiting and self.subscription is not None:
            data = self._waiting.popleft()
            try:
                message = self.subscription.kind.decode(data)
                self._say(TopicMessage(self._topic, (*self.handles,), message, self._missed))
            except RosError as error:
                self._log.say(self._topic, "%s: %s", self._topic, error, level=logging.WARNING)
                self._missed += 1
                continue
            self._free -= 1
            self._missed = 0


class PublishedTopic:
    """A topic that objects of the kernel publish."""

    def __init__(self, say: Say) -> None:
        self.handles: dict[int, None] = {}
        self.publication: RosPublication | None = None
        self._say = say

    def note_peer(self, node: str, here: bool) -> None:
        """A subscriber has come or gone."""
        for handle in self.handles:
            self._say(PeerChange(handle, node, here))


class SharedTopics:
    """The topics of all objects of the kernel, by their names."""

    def __init__(self, node: RosNode, say: Say) -> None:
        self._node = node
        self._say = say
        self._followed: dict[str, FollowedTopic] = {}
        self._published: dict[str, PublishedTopic] = {}
        self._turn = asyncio.Lock()

    async def subscribe(self, handle: int, topic: str, kind: str) -> tuple[str, dict[str, Any]]:
        """Follow a topic; its type and an empty message of it."""
        topic = checked_name(topic)
        async with self._turn:
            found = self._followed.get(topic)
            if found is None:
                found = FollowedTopic(self._say, topic)
                found.subscription = await self._node.subscribe(topic, kind, found.receive)
                self._followed[topic] = found
            found.handles[handle] = None
        assert found.subscription is not None
        return found.subscription.kind.name, found.subscription.kind.template()

    async def unsubscribe(self, handle: int, topic: str) -> None:
        """Leave a topic for one object; the last one ends the subscription."""
        topic = checked_name(topic)
        async with self._turn:
            found = self._followed.get(topic)
            if found is not None and found.handles.pop(handle, 0) is None and not found.handles:
                del self._followed[topic]
                await self._node.unsubscribe(topic)

    def taken(self, topic: str) -> None:
        """The kernel has taken a message of a topic."""
        if topic in self._followed:
            self._followed[topic].taken()

    async def advertise(self, handle: int, topic: str, kind: str, latch: bool) -> tuple[str, dict[str, Any]]:
        """Publish a topic; its type and an empty message of it."""
        topic = checked_name(topic)
        async with self._turn:
            found = self._published.get(topic)
            if found is None:
                found = PublishedTopic(self._say)
                found.publication = await self._node.publish(topic, kind, latch, found.note_peer)
                self._published[topic] = found
            publication = found.publication
            assert publication is not None
            if kind not in ("", publication.kind.name):
                raise RosError(f"topic {topic} is published with type {publication.kind.name}, not {kind}")
            found.handles[handle] = None
        for node in publication.subscribers:
            self._say(PeerChange(handle, node, True))
        return publication.kind.name, publication.kind.template()

    async def unadvertise(self, handle: int, topic: str) -> None:
        """Publish a topic no more for one object; the last one ends it."""
        topic = checked_name(topic)
        async with self._turn:
            found = self._published.get(topic)
            if found is not None and found.handles.pop(handle, 0) is None and not found.handles:
                del self._published[topic]
                await self._node.unpublish(topic)

    def publish(self, topic: str, message: Mapping[str, Any]) -> None:
        """Send a message to the subscribers of a topic.  Raises RosError."""
        found = self._published.get(checked_name(topic))
        if found is None or found.publication is None:
            raise RosError(f"topic {topic} is not advertised")
        found.publication.publish(found.publication.kind.encode(message))


class RosWorker:
    """Obeys the orders of a kernel until its end.  ``run`` does all."""

    def __init__(self, link: socket.socket) -> None:
        self._link = link
        self._node = RosNode(unique_name("urbi"))
        self._topics = SharedTopics(self._node, self._say)
        self._callers: dict[int, ServiceCaller] = {}
        self._asked: dict[int, asyncio.Future[Mapping[str, Any]]] = {}
        self._last_call = 0
        self._tasks: dict[int, asyncio.Task[None]] = {}
        self._writer: asyncio.StreamWriter
        self._ended = asyncio.Event()
        self._verbs: dict[str, Callable[..., Awaitable[Any]]] = {
            "check": self._check, "name": self._name, "state": self._state, "param": self._node.master.ask,
            "subscribe": self._topics.subscribe, "unsubscribe": self._topics.unsubscribe,
            "advertise": self._topics.advertise, "unadvertise": self._topics.unadvertise, "publish": self._publish,
            "service": self._service, "request": self._request, "release": self._release,
            "offer": self._offer, "withdraw": self._node.withdraw,
        }  # fmt: skip

    async def run(self) -> None:
        """Serve until the kernel has ended."""
        reader, self._writer = await asyncio.open_connection(sock=self._link)
        asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, self._ended.set)
        self._node.on_shutdown = lambda reason: self._ended.set()
        await self._node.start()
        listening = asyncio.get_running_loop().create_task(self._listen(reader))
        await self._ended.wait()
        listening.cancel()
        for task in self._tasks.values():
            task.cancel()
        await self._node.close()
        self._writer.close()

    async def _listen(self, reader: asyncio.StreamReader) -> None:
        orders = OrderReader()
        try:
            while data := await reader.read(CHUNK_BYTES):
                for order in orders.feed(data):
                    assert isinstance(order, Order)
                    self._take(order)
        except OSError as error:
            log.debug("the kernel has gone: %s", error)
        finally:
            self._ended.set()

    def _take(self, order: Order) -> None:
        """Carry out an order: those without an answer at once."""
        number, verb, arguments = order
        if verb == "taken":
            self._topics.taken(*arguments)
        elif verb == "cancel":
            if arguments[0] in self._tasks:
                self._tasks[arguments[0]].cancel()
        elif verb == "respond":
            self._respond(*arguments)
        else:
            self._tasks[number] = task = asyncio.get_running_loop().create_task(self._obey(order))
            task.add_done_callback(lambda _: self._tasks.pop(number, None))

    async def _obey(self, order: Order) -> None:
        try:
            self._say(RosAnswer(order.number, await self._verbs[order.verb](*order.arguments)))
        except RosError as error:
            self._say(RosAnswer(order.number, None, str(error) or "refused"))
        except Exception as error:
            log.exception("our bug: %s", order.verb)
            self._say(RosAnswer(order.number, None, f"our bug: {type(error).__name__}: {error}"))

    def _say(self, said: Said) -> None:
        """Tell the kernel.  Raises RosError for what is too large."""
        self._writer.write(packed(said))

    # ---------------------------------------------------------------- orders

    async def _check(self) -> bool:
        with contextlib.suppress(RosError):
            await self._node.master.ask("getPid")
            return True
        return False

    async def _name(self) -> str:
        return self._node.name

    async def _state(self) -> tuple[Any, ...]:
        return tuple(await self._node.state())

    async def _publish(self, topic: str, message: Mapping[str, Any]) -> None:
        self._topics.publish(topic, message)

    async def _service(self, handle: int, name: str, keep_open: bool) -> tuple[dict[str, Any], dict[str, Any]]:
        caller = self._callers[handle] = await self._node.caller(name, keep_open)
        return caller.kind.request.template(), caller.kind.response.template()

    async def _request(self, handle: int, request: Mapping[str, Any]) -> dict[str, Any]:
        return await self._callers[handle].call(request)

    async def _release(self, handle: int) -> None:
        found = self._callers.pop(handle, None)
        if found is not None:
            found.close()

    async def _offer(self, handle: int, name: str, kind: str) -> tuple[dict[str, Any], dict[str, Any]]:
        offered = await self._node.offer(name, kind, partial(self._ask_kernel, handle))
        return offered.kind.request.template(), offered.kind.response.template()

    async def _ask_kernel(self, handle: int, request: dict[str, Any]) -> Mapping[str, Any]:
        """The response of an urbiscript function."""
        self._last_call += 1
        call = self._last_call
        answer: asyncio.Future[Mapping[str, Any]] = asyncio.get_running_loop().create_future()
        self._asked[call] = answer
        try:
            self._say(ServiceAsked(handle, call, request))
            return await answer
        finally:
            del self._asked[call]

    def _respond(self, call: int, response: Mapping[str, Any], refusal: str) -> None:
        waiting = self._asked.get(call)
        if waiting is None or waiting.done():
            return
        if refusal:
            waiting.set_exception(RosError(refusal))
        else:
            waiting.set_result(response)


def main(arguments: list[str]) -> int:
    """Run a worker; returns the exit status 0."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    logging.basicConfig(level=logging.WARNING, format="urbihw: ros: %(message)s")
    link = socket.socket(fileno=int(arguments[0]))
    asyncio.run(RosWorker(link).run())
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
