"""One connection of a client, as the server keeps it."""

from __future__ import annotations

from collections.abc import Callable

from urbihw_nao_fakes import codec
from urbihw_nao_fakes.services import Failed, Later, Method

Returned = Callable[[bytes | Failed], None]
"""Gets the payload of an answer, or why there is none."""


class Connection:
    """A client.

    Attributes:
        allowed: whether it has logged in.
        closed: the server wants it to end.
        waiting: calls that are not answered yet.
        calls: what the robot has called, and who gets the answer, by number of message.
        subscriptions: signals that it listens to, by service, object and number, with their signature.
    """

    def __init__(self) -> None:
        self.splitter = codec.Splitter()
        self.allowed = False
        self.closed = False
        self.waiting: list[tuple[codec.Message, Method, Later]] = []
        self.calls: dict[int, Returned] = {}
        self.subscriptions: dict[tuple[int, int, int], str] = {}
