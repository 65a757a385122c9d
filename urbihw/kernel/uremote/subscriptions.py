"""Subscriptions of a remote to variables and events, and the settings shared by all remotes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from urbihw.kernel.runtime.event import Emission
from urbihw.kernel.uremote.remote import MessageCode
from urbihw.kernel.uremote.rtplink import OpenPort
from urbihw.kernel.uremote.udp import UdpPort

if TYPE_CHECKING:
    from urbihw.kernel.uremote.connection import RemoteConnection


class RemoteSettings:
    """Settings shared by the connections of all remotes of a world; a part of the world.

    Attributes:
        midnight: seconds from ``System.timeReference`` to the zero of the kernel's clock.
        open_port: makes the transport of RTP packets.
    """

    def __init__(self, midnight: float, open_port: OpenPort = UdpPort) -> None:
        self.midnight = midnight
        self.open_port = open_port


class VariableSubscription:
    """A remote's subscription to a variable: the number of declarations, and the name in them."""

    __slots__ = ("count", "name")

    def __init__(self, name: str) -> None:
        self.name = name
        self.count = 0


class EventSubscription:
    """Sends a remote the emissions of an event that have a certain number of arguments."""

    __slots__ = ("_arity", "_connection", "_name")

    def __init__(self, connection: RemoteConnection, name: str, arity: int) -> None:
        self._connection = connection
        self._name = name
        self._arity = arity

    def offer(self, emission: Emission) -> None:
        """Called when an emission begins."""
        if len(emission.payload) == self._arity:
            emission.matches.append((self, True))
            self._say(MessageCode.EVENT, emission)

    def ended(self, emission: Emission, match: Any) -> None:
        """Called when an emission ends."""
        self._say(MessageCode.EVENT_END, emission)

    def _say(self, code: MessageCode, emission: Emission) -> None:
        self._connection.send(code, self._connection.world.string(self._name), *emission.payload)
