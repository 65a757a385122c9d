"""What the process with the node and its kernel say to each other, as frames of a length and a pickle.

Both ends are processes of the same user, started from the same installation; nothing of the network is unpickled.  The
kernel sends ``Order``; the process sends the other ones.
"""

from __future__ import annotations

import pickle
import struct
from collections.abc import Iterator
from typing import Any, Final, NamedTuple

from urbihw.ros.errors import RosError
from urbihw.ros.framing import MAX_FRAME_BYTES

WINDOW: Final = 16
"""Messages of a topic that the kernel has got and not yet taken; later ones wait in the process, the newest of them."""
_LENGTH: Final = struct.Struct("<I")
MAX_PICKLE_BYTES: Final = 2 * MAX_FRAME_BYTES
"""Maximum size of what is said; a list of numbers is up to nine times as large as in a message."""


class Order(NamedTuple):
    """Do something; the answer has the same ``number``, with 0 there is none."""

    number: int
    verb: str
    arguments: tuple[Any, ...]


class RosAnswer(NamedTuple):
    """The result of an order; ``refusal`` is the reason why there is none, else ""."""

    number: int
    value: Any
    refusal: str = ""


class TopicMessage(NamedTuple):
    """A message of a topic for the subscribers with these ``handles``; ``missed`` are those dropped before it."""

    topic: str
    handles: tuple[int, ...]
    message: dict[str, Any]
    missed: int


class PeerChange(NamedTuple):
    """A node has subscribed to a topic that this process publishes (``here``), or has gone."""

    handle: int
    node: str
    here: bool


class ServiceAsked(NamedTuple):
    """A request to a service that an urbiscript function offers."""

    handle: int
    call: int
    request: dict[str, Any]


Said = Order | RosAnswer | TopicMessage | PeerChange | ServiceAsked


def packed(said: Said) -> bytes:
    """The frame of what one side says.  Raises RosError if the other side would not take it."""
    data = pickle.dumps(said, pickle.HIGHEST_PROTOCOL)
    if len(data) > MAX_PICKLE_BYTES:
        raise RosError(f"a message of {len(data)} bytes is too large for urbiscript: {MAX_PICKLE_BYTES} are taken")
    return _LENGTH.pack(len(data)) + data


class OrderReader:
    """Takes bytes in pieces of any size, and gives what was said."""

    def __init__(self) -> None:
        self._data = bytearray()

    def feed(self, data: bytes) -> Iterator[Said]:
        """What is complete with these bytes.  Raises ValueError for a length that is no frame's."""
        self._data += data
        while len(self._data) >= 4:
            length: int = _LENGTH.unpack_from(self._data)[0]
            if length > MAX_PICKLE_BYTES:
                raise ValueError(f"our bug: a frame of {length} bytes")
            if len(self._data) < 4 + length:
                return
            piece = bytes(memoryview(self._data)[4 : 4 + length])
            del self._data[: 4 + length]
            said: Said = pickle.loads(piece)
            yield said
