"""What devices hold of the bus: targets gathered for one message a round, and questions with their answers.

Nothing here waits: what a device wants goes to the worker at the end of the scheduler round, and what the worker says
comes back as a call.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Protocol

from urbihw.buses.messages import Reply, Request, Targets, ToWorker, Watch

Done = Callable[[Reply], None]


class Settles(Protocol):
    """A device that wants to look at what a round brought before it is sent."""

    def settle(self) -> None:
        """The round is over."""
        ...


class Wire:
    """The way to the worker; ``send`` hands it a message."""

    def __init__(self, send: Callable[[ToWorker], None]) -> None:
        self._send = send
        self._targets: dict[tuple[Any, str], Any] = {}
        self._outbox: list[ToWorker] = []
        self._waiting: dict[int, Done] = {}
        self._unsettled: dict[Settles, None] = {}
        self._count = 0

    def aim(self, device: Any, item: str, raw: Any) -> None:
        """Write an item with the next tick; of two in one round the later wins, and one the device has is not sent."""
        self._targets[device, item] = raw

    def write(self, device: Any, item: str, raw: Any, done: Done) -> None:
        """Write an item for sure, behind the next tick and behind all that was asked for before; ``done`` is told."""
        self._ask("write", device, item, raw, done)

    def read(self, device: Any, item: str, done: Done) -> None:
        """Read an item once."""
        self._ask("read", device, item, 0, done)

    def ask(self, verb: str, device: Any, done: Done) -> None:
        """One of the other requests of the family."""
        self._ask(verb, device, "", 0, done)

    def watch(self, device: Any, items: Iterable[str], period: float | None) -> None:
        """Read items every ``period`` seconds (0: every tick) from now on; None: no more."""
        self._outbox.append(Watch(device, tuple(items), period))

    def settle_later(self, device: Settles) -> None:
        """Call ``device.settle()`` at the end of this round."""
        self._unsettled[device] = None

    def forget(self) -> None:
        """Drop the targets of this round so far: the robot is being stopped."""
        self._settle()
        self._targets.clear()

    def flush(self) -> None:
        """The round is over: send what was gathered."""
        self._settle()
        if self._targets:
            targets, self._targets = self._targets, {}
            self._send(Targets(targets))
        if self._outbox:
            outbox, self._outbox = self._outbox, []
            for message in outbox:
                self._send(message)

    def replied(self, reply: Reply) -> None:
        """The worker answered a request."""
        done = self._waiting.pop(reply.reply_id, None)
        if done is not None:
            done(reply)

    def _settle(self) -> None:
        while self._unsettled:
            device, _ = self._unsettled.popitem()
            device.settle()

    def _ask(self, verb: str, device: Any, item: str, raw: Any, done: Done) -> None:
        self._count += 1
        self._waiting[self._count] = done
        self._outbox.append(Request(self._count, verb, device, item, raw))
