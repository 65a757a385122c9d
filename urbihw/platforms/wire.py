"""What devices hold of the bus: targets gathered for one message a round, and questions with their answers.

Nothing here waits: what a device wants goes to the worker at the end of the scheduler round, and what the worker says
comes back as a call.  What is to move the robot carries its ``Origin`` and is dropped when that is dead; what carries
none is a setting.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Final, Protocol

from urbihw.buses.messages import Reply, Request, Targets, ToWorker, Watch
from urbihw.kernel.uobject import Motion, Origin

HELD_UP: Final = 0.06
"""Seconds without a target after which a movement that writes more often has been held up."""

Done = Callable[[Reply], None]


class Settles(Protocol):
    """A device that wants to look at what a round brought before it is sent."""

    def settle(self) -> None:
        """The round is over."""
        ...


class Wire:
    """The way to the worker; ``send`` hands it a message, ``motion`` knows who may move the robot."""

    def __init__(self, send: Callable[[ToWorker], None], motion: Motion) -> None:
        self._send = send
        self._motion = motion
        self._targets: dict[tuple[Any, str], tuple[Any, Origin | None]] = {}
        self._written: dict[tuple[Any, str], tuple[Origin | None, float, float]] = {}
        self._outbox: list[ToWorker] = []
        self._waiting: dict[int, Done] = {}
        self._unsettled: dict[Settles, None] = {}
        self._count = 0

    def aim(self, device: Any, item: str, raw: Any, origin: Origin | None = None) -> None:
        """Write an item with the next tick; of two in one round the later wins, and one the device has is not sent."""
        self._targets[device, item] = raw, origin

    def write(self, device: Any, item: str, raw: Any, done: Done, origin: Origin | None = None) -> None:
        """Write an item for sure, behind the next tick and behind all that was asked for before; ``done`` is told."""
        self._ask("write", device, item, raw, done, origin)

    def write_all(self, device: Any, steps: Sequence[tuple[str, Any]], done: Done, origin: Origin | None) -> None:
        """Write several items one after the other, with nothing in between; ``done`` is told."""
        self._ask("write_all", device, "", tuple(steps), done, origin)

    def read(self, device: Any, item: str, done: Done) -> None:
        """Read an item once."""
        self._ask("read", device, item, 0, done)

    def ask(self, verb: str, device: Any, done: Done, origin: Origin | None = None) -> None:
        """One of the other requests of the family."""
        self._ask(verb, device, "", 0, done, origin)

    def watch(self, device: Any, items: Iterable[str], period: float | None) -> None:
        """Read items every ``period`` seconds (0: every tick) from now on; None: no more."""
        self._outbox.append(Watch(device, tuple(items), period))

    def settle_later(self, device: Settles) -> None:
        """Call ``device.settle()`` at the end of this round."""
        self._unsettled[device] = None

    def flush(self) -> None:
        """The round is over: send what was gathered and may still be sent."""
        self._settle()
        if self._targets:
            targets, self._targets = self._targets, {}
            live = self._motion.is_live
            values = {key: raw for key, (raw, origin) in targets.items() if origin is None or live(origin, key[0])}
            if values:
                now = self._motion.now()
                resumed = frozenset(key for key in values if self._was_held_up(key, targets[key][1], now))
                self._send(Targets(values, self._motion.epoch, now, resumed))
        if self._outbox:
            outbox, self._outbox = self._outbox, []
            for message in outbox:
                self._send(message)

    def _was_held_up(self, key: tuple[Any, str], origin: Origin | None, now: float) -> bool:
        """Whether a movement goes on after its statement could not write for a while: its targets leap then."""
        last, written, interval = self._written.get(key, (None, now, 0.0))
        if origin is None or origin is not last:
            self._written[key] = origin, now, 0.0
            return False
        gap = now - written
        held_up = interval > 0 and gap > max(HELD_UP, 3 * interval)
        self._written[key] = origin, now, interval if held_up else gap
        return held_up

    def lost(self, reason: str) -> None:
        """The worker is gone: nobody will answer what it was asked."""
        waiting, self._waiting = self._waiting, {}
        for number, done in waiting.items():
            done(Reply(number, False, error=reason))

    def replied(self, reply: Reply) -> None:
        """The worker answered a request."""
        done = self._waiting.pop(reply.reply_id, None)
        if done is not None:
            done(reply)

    def _settle(self) -> None:
        while self._unsettled:
            device, _ = self._unsettled.popitem()
            device.settle()

    def _ask(
        self, verb: str, device: Any, item: str, raw: Any, done: Done, origin: Origin | None = None
    ) -> None:
        self._count += 1
        self._waiting[self._count] = done
        epoch = self._motion.epoch if origin is None else origin.epoch
        self._outbox.append(Request(self._count, verb, device, item, raw, epoch))
