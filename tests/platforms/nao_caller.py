"""Somebody who calls our modules: at their end point by QiMessaging, typed with the codec of the fake, or by HTTP."""

from __future__ import annotations

import socket
from collections.abc import Callable
from typing import Any, Self

from urbihw_nao_fakes import codec

MAIN_OBJECT, META_OBJECT, AUTHENTICATE = 1, 2, 8


class Plug:
    """A connection to this computer; ``turn`` lets the other side look at it."""

    def __init__(self, address: tuple[str, int], turn: Callable[[], None]) -> None:
        self.socket = socket.create_connection(address, timeout=5)
        self.socket.setblocking(False)
        # Simulated time does not wait for what the system holds back.
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.data = b""
        self.closed = False
        self._turn = turn

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def send(self, data: bytes) -> None:
        """Write."""
        self.socket.sendall(data)

    def look(self) -> None:
        """Let the other side have a turn, and read what it has said."""
        self._turn()
        try:
            while data := self.socket.recv(65536):
                self.data += data
            self.closed = True
        except BlockingIOError:
            pass
        except ConnectionError:
            self.closed = True

    def until(self, done: Callable[[], bool], turns: int = 500) -> None:
        """Take turns until something holds."""
        for _ in range(turns):
            if done():
                return
            self.look()
        raise AssertionError("it did not happen in time")


class QiCaller(Plug):
    """A client of one service."""

    def __init__(self, address: tuple[str, int], turn: Callable[[], None], number: int) -> None:
        super().__init__(address, turn)
        self.number = number
        self.answers: dict[int, tuple[int, bytes]] = {}
        self.methods: dict[str, tuple[Any, ...]] = {}
        self._splitter = codec.Splitter()
        self._count = 0

    def look(self) -> None:
        super().look()
        data, self.data = self.data, b""
        for message in self._splitter.feed(data):
            self.answers[message.number] = message.kind, message.payload

    def begin(self, service: int, thing: int, action: int, payload: bytes, kind: int = codec.CALL) -> int:
        """Send a message; return its number."""
        self._count += 1
        self.send(codec.frame(kind, self._count, codec.Target(service, thing, action), payload))
        return self._count

    def finish(self, number: int) -> tuple[int, bytes]:
        """Wait for the answer: its kind and its bytes."""
        self.until(lambda: number in self.answers or self.closed)
        assert number in self.answers, "hung up"
        return self.answers.pop(number)

    def log_in(self, **words: str) -> int:
        """Return the state that the other side answers."""
        _, payload = self.finish(self.begin(0, 0, AUTHENTICATE, codec.encode("{sm}", words)))
        state: int = codec.decode("{sm}", payload)["__qi_auth_state"]
        return state

    def learn(self) -> str:
        """Ask for the methods; return the description."""
        _, payload = self.finish(self.begin(self.number, MAIN_OBJECT, META_OBJECT, codec.encode("(I)", (0,))))
        methods, _, _, description = codec.decode(codec.META, payload)
        self.methods = {row[2]: row for row in methods.values()}
        return str(description)

    def start(self, name: str, *arguments: Any, kind: int = codec.CALL) -> int:
        """Call a method; return the number of the call."""
        uid, _, _, parameters, *_ = self.methods[name]
        return self.begin(self.number, MAIN_OBJECT, uid, codec.encode(parameters, arguments), kind)

    def call(self, name: str, *arguments: Any) -> Any:
        """Call a method and wait; an error is returned as an ``Exception``."""
        return self.value(name, self.finish(self.start(name, *arguments)))

    def value(self, name: str, answer: tuple[int, bytes]) -> Any:
        """The value of an answer; an error as an ``Exception``."""
        kind, payload = answer
        if kind == codec.ERROR:
            return RuntimeError(codec.decode("m", payload))
        return codec.decode(self.methods[name][1], payload)
