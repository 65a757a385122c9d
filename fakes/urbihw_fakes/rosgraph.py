"""A ROS master and ROS nodes of our own making, for tests on machines without ROS.

They were typed from the public description of ROS's protocols (wiki.ros.org: Master_API, Slave_API, TCPROS), with the
standard library's XML-RPC and plain sockets.  ``RosMasterFake`` keeps the graph; ``RosNodeFake`` is a node that sends
and takes any bytes, wrong ones too.  Nothing here knows a message: bytes are bytes.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import socket
import struct
import threading
from collections.abc import Callable
from socketserver import ThreadingMixIn
from typing import Any
from xmlrpc.client import ServerProxy
from xmlrpc.server import SimpleXMLRPCRequestHandler, SimpleXMLRPCServer

_PIDS = itertools.count(os.getpid())


class _AnyPath(SimpleXMLRPCRequestHandler):
    rpc_paths = ()


class _RpcThreads(ThreadingMixIn, SimpleXMLRPCServer):
    daemon_threads = True


class _RpcServer:
    """An XML-RPC server in a thread, on a port of the loopback interface."""

    def __init__(self, methods: dict[str, Callable[..., Any]], port: int = 0) -> None:
        self._server = _RpcThreads(("127.0.0.1", port), _AnyPath, logRequests=False)
        for name, method in methods.items():
            self._server.register_function(method, name)
        self.port: int = self._server.server_address[1]
        self.uri = f"http://127.0.0.1:{self.port}/"
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.02,), daemon=True)
        self._thread.start()

    def close(self) -> None:
        if self._thread.is_alive():
            self._server.shutdown()
            self._thread.join()
            self._server.server_close()


class RosMasterFake:
    """The master: who publishes, subscribes and offers what, and the parameters.

    Attributes:
        uri: its address.
        calls: the names of the methods that were called, in order.
    """

    def __init__(self, port: int = 0) -> None:
        self.calls: list[str] = []
        self._pid = next(_PIDS)
        self._lock = threading.Lock()
        self._nodes: dict[str, str] = {}
        self._types: dict[str, str] = {}
        self._publishers: dict[str, dict[str, str]] = {}
        self._subscribers: dict[str, dict[str, str]] = {}
        self._services: dict[str, tuple[str, str]] = {}
        self._params: dict[str, Any] = {}
        names = [name for name in dir(self) if name.startswith("api_")]
        self._rpc = _RpcServer({name[4:]: self._counted(name) for name in names}, port)
        self.uri, self.port = self._rpc.uri, self._rpc.port

    def close(self) -> None:
        """End, with all that it knows."""
        self._rpc.close()

    def topics_of(self, node: str) -> set[str]:
        """The topics that a node publishes."""
        with self._lock:
            return {topic for topic, nodes in self._publishers.items() if node in nodes}

    def _counted(self, name: str) -> Callable[..., Any]:
        def call(*params: Any) -> Any:
            with self._lock:
                self.calls.append(name[4:])
                return getattr(self, name)(*params)

        return call

    # ---------------------------------------------------------------- the graph

    def api_registerPublisher(self, node: str, topic: str, kind: str, uri: str) -> list[Any]:
        self._nodes[node], self._types[topic] = uri, kind
        self._publishers.setdefault(topic, {})[node] = uri
        self._tell(topic)
        return [1, "registered", [*self._subscribers.get(topic, {}).values()]]

    def api_unregisterPublisher(self, node: str, topic: str, uri: str) -> list[Any]:
        gone = self._publishers.get(topic, {}).pop(node, None)
        self._tell(topic)
        return [1, "", int(gone is not None)]

    def api_registerSubscriber(self, node: str, topic: str, kind: str, uri: str) -> list[Any]:
        self._nodes[node] = uri
        if kind != "*":
            self._types.setdefault(topic, kind)
        self._subscribers.setdefault(topic, {})[node] = uri
        return [1, "subscribed", [*self._publishers.get(topic, {}).values()]]

    def api_unregisterSubscriber(self, node: str, topic: str, uri: str) -> list[Any]:
        return [1, "", int(self._subscribers.get(topic, {}).pop(node, None) is not None)]

    def api_registerService(self, node: str, service: str, rosrpc: str, uri: str) -> list[Any]:
        self._nodes[node] = uri
        self._services[service] = node, rosrpc
        return [1, "registered", 1]

    def api_unregisterService(self, node: str, service: str, rosrpc: str) -> list[Any]:
        return [1, "", int(self._services.pop(service, None) is not None)]

    def api_lookupService(self, node: str, service: str) -> list[Any]:
        if service not in self._services:
            return [-1, "no provider", ""]
        return [1, "", self._services[service][1]]

    def api_lookupNode(self, node: str, name: str) -> list[Any]:
        return [1, "", self._nodes[name]] if name in self._nodes else [-1, "unknown node", ""]

    def api_getTopicTypes(self, node: str) -> list[Any]:
        return [1, "", [[topic, kind] for topic, kind in self._types.items()]]

    def api_getSystemState(self, node: str) -> list[Any]:
        graph = [
            [[topic, [*nodes]] for topic, nodes in rows.items() if nodes]
            for rows in (self._publishers, self._subscribers)
        ]
        return [1, "", [*graph, [[name, [row[0]]] for name, row in self._services.items()]]]

    def api_getPid(self, node: str) -> list[Any]:
        return [1, "", self._pid]

    def _tell(self, topic: str) -> None:
        """Tell the subscribers who publishes, each in a thread: some are slow, or dead."""
        publishers = [*self._publishers.get(topic, {}).values()]
        for uri in self._subscribers.get(topic, {}).values():
            threading.Thread(target=_update, args=(uri, topic, publishers), daemon=True).start()

    # ---------------------------------------------------------------- parameters

    def api_setParam(self, node: str, key: str, value: Any) -> list[Any]:
        self._params[key] = value
        return [1, "", 0]

    def api_getParam(self, node: str, key: str) -> list[Any]:
        return [1, "", self._params[key]] if key in self._params else [-1, f"Parameter [{key}] is not set", 0]

    def api_hasParam(self, node: str, key: str) -> list[Any]:
        return [1, "", key in self._params]

    def api_deleteParam(self, node: str, key: str) -> list[Any]:
        if self._params.pop(key, None) is None:
            return [-1, f"Parameter [{key}] is not set", 0]
        return [1, "", 0]

    def api_getParamNames(self, node: str) -> list[Any]:
        return [1, "", [*self._params]]


def _update(uri: str, topic: str, publishers: list[str]) -> None:
    with contextlib.suppress(OSError), ServerProxy(uri) as slave:
        slave.publisherUpdate("/master", topic, publishers)


def header(**fields: str) -> bytes:
    """The header of a connection, with its length."""
    rows = b"".join(_counted(f"{name}={value}".encode()) for name, value in fields.items())
    return _counted(rows)


def _counted(data: bytes) -> bytes:
    return struct.pack("<I", len(data)) + data


class RosConnection:
    """One TCPROS connection, of either side."""

    def __init__(self, inner: socket.socket) -> None:
        inner.settimeout(5.0)
        self._inner = inner

    def send(self, data: bytes) -> None:
        """Send bytes as they are."""
        self._inner.sendall(data)

    def send_message(self, data: bytes) -> None:
        """Send a message with its length."""
        self.send(_counted(data))

    def receive(self, size: int) -> bytes:
        """Exactly so many bytes, fewer at the end."""
        data = b""
        while len(data) < size and (piece := self._inner.recv(size - len(data))):
            data += piece
        return data

    def receive_message(self) -> bytes:
        """The next message; b"" at the end."""
        head = self.receive(4)
        return self.receive(struct.unpack("<I", head)[0]) if len(head) == 4 else b""

    def receive_header(self) -> dict[str, str]:
        """The fields of the header that comes first."""
        data, fields = self.receive_message(), {}
        while data:
            (size,) = struct.unpack_from("<I", data)
            name, _, value = data[4 : 4 + size].decode().partition("=")
            fields[name] = value
            data = data[4 + size :]
        return fields

    def close(self) -> None:
        """Close the socket; the other side sees the end."""
        self._inner.close()


class RosNodeFake:
    """A node: it publishes what it is told, and follows others.

    Attributes:
        greetings: the headers of those that have connected, in order.
    """

    def __init__(self, master: RosMasterFake, name: str) -> None:
        self.name = name
        self.greetings: list[dict[str, str]] = []
        self.answer: dict[str, str] = {}
        """The header that answers a subscriber or a caller."""
        self.replies: list[bytes] = []
        """What a service sends, without a length, to one request after the other."""
        self.requests: list[bytes] = []
        self.place: tuple[str, int] | None = None
        """The address that subscribers get; None for the address of this node."""
        self.asked = 0
        """How often a subscriber has asked for the address."""
        self._master = ServerProxy(master.uri)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._port: int = self._listener.getsockname()[1]
        self._come = threading.Condition()
        self._subscribers: list[RosConnection] = []
        self._callers: list[RosConnection] = []
        self._rpc = _RpcServer({"requestTopic": self._request_topic, "publisherUpdate": lambda *params: [1, "", 0]})
        threading.Thread(target=self._accept, daemon=True).start()

    def publish(self, topic: str, kind: str, md5: str, definition: str = "", **others: str) -> None:
        """Begin to publish a topic."""
        self.answer = {"callerid": self.name, "type": kind, "md5sum": md5, "topic": topic, "latching": "0",
                       "message_definition": definition, **others}
        self._master.registerPublisher(self.name, topic, kind, self._rpc.uri)

    def offer(self, service: str, kind: str, md5: str) -> None:
        """Begin to offer a service."""
        self.answer = {"callerid": self.name, "type": kind, "md5sum": md5}
        self._master.registerService(self.name, service, f"rosrpc://127.0.0.1:{self._port}", self._rpc.uri)

    def subscriber(self, number: int = 0) -> RosConnection:
        """Wait until so many others have subscribed; the connection of the last of them."""
        with self._come:
            assert self._come.wait_for(lambda: len(self._subscribers) > number, 5.0), "there is no subscriber"
            return self._subscribers[number]

    def follow(self, topic: str, kind: str, md5: str) -> tuple[RosConnection, dict[str, str]]:
        """Subscribe to the first publisher of a topic; the connection, and the header of its answer."""
        told: Any = self._master.registerSubscriber(self.name, topic, kind, self._rpc.uri)
        with ServerProxy(told[2][0]) as slave:
            place: Any = slave.requestTopic(self.name, topic, [["TCPROS"]])
        return self.greet(place[2][1], place[2][2], callerid=self.name, topic=topic, type=kind, md5sum=md5)

    def call(self, service: str, **fields: str) -> tuple[RosConnection, dict[str, str]]:
        """Connect to a service; the connection, and the header of its answer."""
        uri: Any = self._master.lookupService(self.name, service)
        host, port = uri[2].removeprefix("rosrpc://").split(":")
        return self.greet(host, int(port), callerid=self.name, service=service, **fields)

    def greet(self, host: str, port: int, **fields: str) -> tuple[RosConnection, dict[str, str]]:
        """Connect to a port, and shake hands."""
        made = RosConnection(socket.create_connection((host, port)))
        self._callers.append(made)
        made.send(header(**fields))
        return made, made.receive_header()

    def close(self) -> None:
        """Die without a word to the master."""
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self._rpc.close()
        self._master("close")()
        for each in (*self._subscribers, *self._callers):
            each.close()

    def _request_topic(self, node: str, topic: str, protocols: list[Any]) -> list[Any]:
        self.asked += 1
        return [1, "", ["TCPROS", *(self.place or ("127.0.0.1", self._port))]]

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                made = RosConnection(self._listener.accept()[0])
                threading.Thread(target=self._serve, args=(made,), daemon=True).start()

    def _serve(self, made: RosConnection) -> None:
        with contextlib.suppress(OSError):
            greeting = made.receive_header()
            self.greetings.append(greeting)
            made.send(header(**self.answer))
            if "topic" in greeting:
                with self._come:
                    self._subscribers.append(made)
                    self._come.notify_all()
                return
            while greeting.get("probe") != "1" and self.replies:
                self.requests.append(made.receive_message())
                made.send(self.replies.pop(0))
                if greeting.get("persistent") != "1":
                    break
            made.close()
