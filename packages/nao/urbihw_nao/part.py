"""One part of the driver: joints, walking, lights, sensors, calls of programs."""

from __future__ import annotations

from typing import Any

from urbihw.buses.messages import FromWorker, Request
from urbihw_nao.exchange import NaoExchange

Devices = tuple[Any, ...] | None
"""The devices that are meant; None for all."""


class NaoPart:
    """The base of all parts.  The driver holds them in a list and calls each method of each part in that order.

    ``owns`` and ``set_target``, ``verbs`` and ``request`` are asked in the same order: the first part that knows the
    device, or the verb, gets it.  ``send``, ``read`` and ``request`` are called only while there is a session; all
    methods but ``owns`` may raise LinkGone.

    Attributes:
        exchange: what all parts share.
        verbs: requests that this part executes.
    """

    verbs: frozenset[str] = frozenset()

    def __init__(self, exchange: NaoExchange) -> None:
        self.exchange = exchange

    def begin(self) -> None:
        """The robot was found on a fresh session.  Raises Unavailable, BadValue."""

    def end(self) -> None:
        """The link is gone: what waits is dropped; what was sent is remembered, for the robot goes on with it."""

    def owns(self, device: Any) -> bool:
        """Whether targets and watches of this device belong here."""
        return False

    def watch(self, on: bool) -> None:
        """Begin or end to tell the values of a device of this part; also called without a session.  Most need none."""

    def set_target(self, device: Any, item: str, value: float) -> str:
        """Remember a target for the next ``send``; return why it is refused, or ""."""
        raise NotImplementedError

    def send(self) -> None:
        """Send what is due, once a tick."""

    def read(self) -> None:
        """Ask for what is due, once a tick, after ``send``."""

    def request(self, message: Request) -> list[FromWorker]:
        """Execute a request.  Raises Unavailable, BadValue, TypeError, ValueError for what goes wrong with it."""
        raise NotImplementedError

    def drop_targets(self, devices: Devices) -> None:
        """Forget what waits to be sent to these devices: a stop comes.  Also called without a session."""

    def stop(self, devices: Devices) -> None:
        """Stop these devices on the robot, as far as this part has moved them."""

    def is_moving(self) -> bool:
        """Whether the robot moves, or is about to, by what this part was told: it would go on if the link were lost."""
        return False

    def find_moving(self) -> list[Any]:
        """Devices that move already, after the first login.  Raises Unavailable, BadValue."""
        return []
