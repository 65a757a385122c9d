"""One ROS 1 node: its two servers, what it publishes, follows and offers, and its way back to a lost master.

A node of the same name that starts later ends this one, as ROS has it: ``on_shutdown`` gets the reason.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

from urbihw.repeats import LimitedLog
from urbihw.ros import services
from urbihw.ros.errors import NoMaster, PeerError, RosError
from urbihw.ros.framing import encode_header
from urbihw.ros.master import GraphState, RosMaster, names_in
from urbihw.ros.messages import MessageType, MessageTypes
from urbihw.ros.names import checked_name, own_address
from urbihw.ros.publications import PeerNews, RosPublication
from urbihw.ros.rpc import RpcServer, cancel_all
from urbihw.ros.services import Answering, OfferedService, ServiceCaller
from urbihw.ros.streams import READ_AHEAD_BYTES, RosStream
from urbihw.ros.subscriptions import GoneNews, Receiver, RosSubscription, definition_of

log = logging.getLogger("urbihw.ros")

WATCH_PERIOD_S: Final = 2.0
"""Seconds between two looks whether the master still knows this node."""
FAREWELL_TIMEOUT_S: Final = 2.0
ROSOUT: Final = "/rosout"
MAX_STREAMS: Final = 256
MAX_TOPICS: Final = 512


class Registration(NamedTuple):
    """What the master was told: the methods to tell it and to take it back, with the parameters of both."""

    tell: str
    told: tuple[Any, ...]
    withdraw: str
    withdrawn: tuple[Any, ...]


class RosNode:
    """A node.  ``start`` before all else, ``close`` at the end; all methods belong to one asyncio loop."""

    def __init__(self, name: str, master_uri: str = "", host: str = "", types: MessageTypes | None = None) -> None:
        """``master_uri`` "" for ``ROS_MASTER_URI``; ``host`` is the address to listen on, "" for ``own_address``."""
        self.name = checked_name(name)
        self.types = types or MessageTypes()
        self.master = RosMaster(master_uri, self.name)
        self.on_shutdown: Callable[[str], None] = lambda reason: None
        self._host = host or own_address()
        self._rpc = RpcServer(self._methods())
        self._server: asyncio.Server | None = None
        self._port = 0
        self._streams: set[asyncio.Task[None]] = set()
        self._publications: dict[str, RosPublication] = {}
        self._subscriptions: dict[str, RosSubscription] = {}
        self._services: dict[str, OfferedService] = {}
        self._registrations: dict[tuple[str, str], Registration] = {}
        self._watch: asyncio.Task[None] | None = None
        self._looked = asyncio.Event()
        self._log = LimitedLog(log)

    async def start(self) -> None:
        """Listen for the master, for subscribers and for callers.  Raises OSError."""
        await self._rpc.start(self._host)
        self._server = await asyncio.start_server(self._accept, self._host, 0, limit=READ_AHEAD_BYTES)
        self._port = self._server.sockets[0].getsockname()[1]
        # Only nodes with a topic are in the graph; all have this one, for their log.
        log_kind = self.types.find("rosgraph_msgs/Log")
        self._publications[ROSOUT] = RosPublication(ROSOUT, log_kind, False, lambda node, here: None)
        self._registrations["publish", ROSOUT] = self._publishing(ROSOUT, log_kind.name)
        self._watch = asyncio.get_running_loop().create_task(self._keep_registered())

    async def close(self) -> None:
        """Tell the master that this node ends, for two seconds at most, and close all connections."""
        if self._watch is not None:
            await cancel_all({self._watch})
        with contextlib.suppress(TimeoutError, RosError):
            async with asyncio.timeout(FAREWELL_TIMEOUT_S):
                for each in self._registrations.values():
                    await self.master.ask(each.withdraw, *each.withdrawn)
        for subscription in self._subscriptions.values():
            await subscription.close()
        if self._server is not None:
            self._server.close()
        await cancel_all(self._streams)
        await self._rpc.close()

    # ---------------------------------------------------------------- topics

    async def publish(
        self, topic: str, kind: str, latch: bool = False, on_peer: PeerNews = lambda node, here: None
    ) -> RosPublication:
        """Begin to publish a topic; ``kind`` "" for the type that the master knows.  Raises RosError."""
        topic = checked_name(topic)
        if topic in self._publications:
            raise RosError(f"topic {topic} is published by this node already")
        self._check_room()
        kind = kind or await self.master.topic_type(topic)
        if not kind:
            raise RosError(f"topic {topic} is not known: give its type")
        made = RosPublication(topic, self.types.find(kind), latch, on_peer)
        self._publications[topic] = made
        try:
            await self._register("publish", topic, self._publishing(topic, kind))
        except BaseException:
            del self._publications[topic]
            raise
        return made

    def _publishing(self, topic: str, kind: str) -> Registration:
        uri = self._rpc.uri
        return Registration("registerPublisher", (topic, kind, uri), "unregisterPublisher", (topic, uri))

    async def unpublish(self, topic: str) -> None:
        """End a topic that this node publishes."""
        found = self._publications.pop(checked_name(topic), None)
        if found is not None:
            found.close()
            await self._withdraw("publish", found.topic)

    async def subscribe(
        self, topic: str, kind: str, receive: Receiver, gone: GoneNews = lambda node: None,
        receive_old: Receiver | None = None,
    ) -> RosSubscription:  # fmt: skip
        """Follow a topic; ``kind`` "" for the type that the master knows.  Raises RosError.

        ``gone`` gets the name of a publisher whose connection has ended; ``receive_old`` gets what a publisher had
        latched before this node came, in place of ``receive``.
        """
        topic = checked_name(topic)
        if topic in self._subscriptions:
            raise RosError(f"this node has subscribed to {topic} already")
        self._check_room()
        kind = kind or await self.master.topic_type(topic)
        if not kind:
            raise RosError(f"topic {topic} is not known: no node has told its type")
        known = await self._type_of_topic(topic, kind)
        made = RosSubscription(topic, known, self.name, receive, gone, receive_old)
        self._subscriptions[topic] = made
        try:
            made.follow(names_in(await self._register("subscribe", topic, Registration(
                "registerSubscriber", (topic, kind, self._rpc.uri), "unregisterSubscriber", (topic, self._rpc.uri)
            ))), old=True)  # fmt: skip
        except BaseException:
            del self._subscriptions[topic]
            raise
        return made

    async def _type_of_topic(self, topic: str, kind: str) -> MessageType:
        """The type by its name; an unknown one is learnt from a publisher."""
        try:
            return self.types.find(kind)
        except RosError as unknown:
            for node in (await self.master.state()).publishers.get(topic, ()):
                try:
                    uri = await self.master.ask("lookupNode", node)
                    definition, md5 = await definition_of(str(uri), topic, kind, self.name)
                except PeerError:
                    continue
                if definition:
                    return self.types.find_or_learn(kind, md5, definition)
            raise unknown

    async def unsubscribe(self, topic: str) -> None:
        """Leave a topic that this node follows; else nothing happens."""
        found = self._subscriptions.pop(checked_name(topic), None)
        if found is not None:
            await found.close()
            await self._withdraw("subscribe", found.topic)

    def _check_room(self) -> None:
        if len(self._publications) + len(self._subscriptions) + len(self._services) >= MAX_TOPICS:
            raise RosError(f"this node has {MAX_TOPICS} topics and services, and takes no more")

    # ---------------------------------------------------------------- services

    async def caller(self, service: str, keep_open: bool = False) -> ServiceCaller:
        """What calls a service of any node.  Raises RosError if it does not exist, or its type is not known here."""
        service = checked_name(service)
        try:
            uri = str(await self.master.ask("lookupService", service))
        except NoMaster:
            raise
        except RosError as error:
            raise RosError(f"no service {service}") from error
        told = await services.probe(uri, service, self.name)
        kind = self.types.service(told.get("type", ""), told.get("md5sum", "*"))
        return ServiceCaller(service, uri, kind, self.name, keep_open)

    async def offer(self, service: str, kind: str, answer: Answering) -> OfferedService:
        """Offer a service.  Raises RosError."""
        service = checked_name(service)
        if service in self._services:
            raise RosError(f"service {service} is offered by this node already")
        self._check_room()
        made = OfferedService(service, self.types.service(kind), answer)
        host = f"[{self._host}]" if ":" in self._host else self._host
        uri = f"rosrpc://{host}:{self._port}"
        self._services[service] = made
        try:
            await self._register("offer", service, Registration(
                "registerService", (service, uri, self._rpc.uri), "unregisterService", (service, uri)
            ))  # fmt: skip
        except BaseException:
            del self._services[service]
            raise
        return made

    async def withdraw(self, service: str) -> None:
        """End a service of this node."""
        found = self._services.pop(checked_name(service), None)
        if found is not None:
            found.close()
            await self._withdraw("offer", found.name)

    # ---------------------------------------------------------------- the master

    async def state(self) -> GraphState:
        """The graph as it is now, with this node in it."""
        await self._looked.wait()
        return await self.master.state()

    async def _register(self, what: str, name: str, registration: Registration) -> Any:
        answer = await self.master.ask(registration.tell, *registration.told)
        self._registrations[what, name] = registration
        return answer

    async def _withdraw(self, what: str, name: str) -> None:
        found = self._registrations.pop((what, name), None)
        if found is not None:
            with contextlib.suppress(RosError):
                await self.master.ask(found.withdraw, *found.withdrawn)

    async def _keep_registered(self) -> None:
        """Register all again when the master is another one than before."""
        known: Any = None
        lost = False
        while True:
            try:
                pid = await self.master.ask("getPid")
                if pid != known:
                    await self._register_all()
                if lost:
                    log.warning("the ROS master answers again")
                known, lost = pid, False
            except RosError as error:
                if known is not None and not lost:
                    log.warning("%s", error)
                    lost = True
            self._looked.set()
            await asyncio.sleep(WATCH_PERIOD_S)

    async def _register_all(self) -> None:
        for (what, name), each in [*self._registrations.items()]:
            answer = await self.master.ask(each.tell, *each.told)
            if what == "subscribe" and name in self._subscriptions:
                self._subscriptions[name].follow(names_in(answer), old=True)

    # ---------------------------------------------------------------- what others ask

    def _methods(self) -> dict[str, Callable[[list[Any]], Any]]:
        """The slave API: the answers to the master and to other nodes."""
        return {
            "requestTopic": self._request_topic,
            "publisherUpdate": self._update_publishers,
            "paramUpdate": lambda params: [1, "", 0],
            "shutdown": self._shut_down,
            "getPid": lambda params: [1, "", os.getpid()],
            "getMasterUri": lambda params: [1, "", self.master.uri],
            "getPublications": lambda params: [1, "", [[t, p.kind.name] for t, p in self._publications.items()]],
            "getSubscriptions": lambda params: [1, "", [[t, s.kind.name] for t, s in self._subscriptions.items()]],
            "getBusInfo": self._bus_info,
            "getBusStats": lambda params: [1, "", [[], [], []]],
        }

    def _request_topic(self, params: list[Any]) -> Any:
        topic, protocols = str(params[1]), params[2]
        if topic not in self._publications:
            return [0, f"{topic[:80]} is not published here", 0]
        if not any(isinstance(each, list) and each[:1] == ["TCPROS"] for each in protocols):
            return [0, "no protocol in common: TCPROS is served", 0]
        return [1, "", ["TCPROS", self._host, self._port]]

    def _update_publishers(self, params: list[Any]) -> Any:
        found = self._subscriptions.get(str(params[1]))
        if found is not None:
            found.follow(map(str, params[2]))
        return [1, "", 0]

    def _shut_down(self, params: list[Any]) -> Any:
        reason = str(params[1])[:200] if len(params) > 1 else ""
        log.warning("another node ends this one: %s", reason or "no reason given")
        asyncio.get_running_loop().call_soon(self.on_shutdown, reason)
        return [1, "", 0]

    def _bus_info(self, params: list[Any]) -> Any:
        rows: list[list[Any]] = []
        for topic, publication in self._publications.items():
            rows += [[len(rows), node, "o", "TCPROS", topic, True] for node in publication.subscribers]
        for topic, subscription in self._subscriptions.items():
            rows += [[len(rows), uri, "i", "TCPROS", topic, True] for uri in subscription.publishers]
        return [1, "", rows]

    def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if len(self._streams) >= MAX_STREAMS:
            writer.transport.abort()
            return
        task = asyncio.get_running_loop().create_task(self._serve(RosStream(reader, writer)))
        self._streams.add(task)
        task.add_done_callback(self._streams.discard)

    async def _serve(self, stream: RosStream) -> None:
        """Serve who has connected: a subscriber or a caller."""
        try:
            fields = await stream.receive_header()
            try:
                await self._served(fields).serve(stream, fields, self.name)
            except PeerError as error:
                self._log.say(fields.get("callerid", ""), "%s: %s", fields.get("callerid", "a node")[:80], error,
                              level=logging.WARNING, most=2)
                stream.writer.write(encode_header({"error": str(error)}))
        except (PeerError, OSError, EOFError) as error:
            log.debug("a peer has gone: %s", error)
        finally:
            stream.close()

    def _served(self, fields: Mapping[str, str]) -> RosPublication | OfferedService:
        """What a peer has connected for.  Raises PeerError."""
        found: RosPublication | OfferedService | None
        if "service" in fields:
            found = self._services.get(fields["service"])
        else:
            found = self._publications.get(fields.get("topic", ""))
        if found is None:
            name = fields.get("service", fields.get("topic", ""))
            raise PeerError(f"this node has no {'service' if 'service' in fields else 'topic'} {name[:80]!r}")
        return found
