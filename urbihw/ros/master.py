"""What a node asks the master (wiki.ros.org/ROS/Master_API)."""

from __future__ import annotations

import os
from typing import Any, Final, NamedTuple

from urbihw.ros import rpc
from urbihw.ros.errors import NoMaster, PeerError, RosError

DEFAULT_URI: Final = "http://localhost:11311"


class GraphState(NamedTuple):
    """Who publishes, subscribes and offers what: name -> names of nodes; and the types of topics."""

    publishers: dict[str, list[str]]
    subscribers: dict[str, list[str]]
    services: dict[str, list[str]]
    types: dict[str, str]


class RosMaster:
    """The master at an address, as a node with a name asks it."""

    def __init__(self, uri: str, node: str) -> None:
        """``uri`` "" for that of ``ROS_MASTER_URI``, by default port 11311 of this machine."""
        self.uri = uri or os.environ.get("ROS_MASTER_URI") or DEFAULT_URI
        self._node = node

    async def ask(self, method: str, *params: Any) -> Any:
        """The value of an answer.  Raises NoMaster, or RosError with what the master says."""
        try:
            answer = await rpc.call(self.uri, method, self._node, *params)
        except PeerError as error:
            raise NoMaster(f"no ROS master: {error}") from error
        return value_of(answer)

    async def state(self) -> GraphState:
        """The graph as it is now."""
        rows = [_named(part) for part in _checked(await self.ask("getSystemState"), 3)]
        types = dict(_pairs(await self.ask("getTopicTypes")))
        return GraphState(rows[0], rows[1], rows[2], {name: str(kind) for name, kind in types.items()})

    async def topic_type(self, topic: str) -> str:
        """The type of a topic, "" if it is not known."""
        for name, kind in _pairs(await self.ask("getTopicTypes")):
            if name == topic and kind != "*":
                return str(kind)
        return ""


def value_of(answer: Any) -> Any:
    """The value of ``[code, message, value]``.  Raises RosError with the message."""
    if not isinstance(answer, list) or len(answer) != 3:
        raise PeerError("an answer that is not [code, message, value]")
    if answer[0] != 1:
        raise RosError(str(answer[1])[:300])
    return answer[2]


def _checked(rows: Any, size: int | None = None) -> list[Any]:
    if not isinstance(rows, list) or (size is not None and len(rows) < size):
        raise PeerError("an answer of another form than the master's")
    return rows


def _named(rows: Any) -> dict[str, list[str]]:
    return {name: names_in(nodes) for name, nodes in _pairs(rows)}


def _pairs(rows: Any) -> list[tuple[str, Any]]:
    return [(str(name), value) for name, value in (_checked(row, 2)[:2] for row in _checked(rows))]


def names_in(rows: Any) -> list[str]:
    """The texts of a list that was told.  Raises PeerError for another value."""
    return [str(each) for each in _checked(rows)]
