"""The channel from devices to the bus worker: targets gathered for one message per round, and requests with replies.

Nothing here blocks: targets and requests are sent to the worker at the end of the scheduler round, and its replies
arrive as calls.  A write that may move the robot carries its ``Origin`` and is dropped when that is no longer live; a
write without an origin is a setting, and the worker refuses it if it would move the robot.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final, Protocol

from urbihw.buses.messages import Reply, Request, Targets, ToWorker, Watch, Writers
from urbihw.kernel.uobject import Motion, Origin

HELD_UP_S: Final = 0.06
"""Seconds without a target after which a movement that writes more often has been held up."""

MAX_DEPTH: Final = 20
"""Lists in lists that a program may send."""

Done = Callable[[Reply], None]


class Settles(Protocol):
    """A device that combines several writes of one round into one operation."""

    def settle(self) -> None:
        """Called at the end of the round, before its messages are sent."""
        ...


def check_data(value: Any, depth: int = 0) -> None:
    """Raise ValueError unless a value of a program is data that the worker's process can get.

    Data are numbers, truth values, texts, bytes, None, and lists and dictionaries of data; an object of the
    interpreter, such as a job or a function, is not one.
    """
    if value is None or isinstance(value, bool | int | float | str | bytes | bytearray):
        return
    if depth > MAX_DEPTH:
        raise ValueError(f"lists are nested deeper than {MAX_DEPTH}")
    match value:
        case list() | tuple():
            members: Iterable[Any] = value
        case dict():
            members = (*value.keys(), *value.values())
        case _:
            raise ValueError("expected numbers, Strings, lists and dictionaries of them: no other object can be sent")
    for member in members:
        check_data(member, depth + 1)


class DeviceChannel:
    """The channel of all devices of a robot; ``send`` passes a message to the worker, ``motion`` checks origins."""

    def __init__(self, send: Callable[[ToWorker], None], motion: Motion) -> None:
        self._send = send
        self._motion = motion
        self._targets: dict[tuple[Any, str], tuple[Any, Origin | None, float]] = {}
        self._written: dict[tuple[Any, str], tuple[Origin | None, float, float]] = {}
        self._writers: dict[Any, tuple[str, int, int]] = {}
        self._outbox: list[ToWorker] = []
        self._waiting: dict[int, Done] = {}
        self._unsettled: dict[Settles, None] = {}
        self._count = 0
        self.check_target: Callable[[Any, str, Any], None] | None = None
        """Called with device, item and raw value of each target; None while the robot has no limits."""
        self.blocked: dict[Any, str] = {}
        """Devices to which nothing is sent, and why."""

    def origin(self) -> Origin:
        """Return the origin of a write at this moment, for a warning to its client."""
        return self._motion.origin()

    def set_target(
        self, device: Any, item: str, raw: Any, origin: Origin | None = None, scale: float = math.inf
    ) -> None:
        """Write an item with the next tick; the last write of a round wins, and an unchanged value is not sent.

        ``scale`` is how many counts of the item are one unit of the slot: the pace of a movement is sent in counts; inf
        if the worker need not keep it.
        """
        if device in self.blocked:
            return
        self._targets[device, item] = raw, origin, math.inf if origin is None else origin.pace * abs(scale)
        if self.check_target is not None:
            self.check_target(device, item, raw)

    def write(self, device: Any, item: str, raw: Any, done: Done, origin: Origin | None = None) -> None:
        """Write an item by a request, after the next tick and all earlier requests; ``done`` gets the reply."""
        self._queue_request("write", device, item, raw, done, origin)

    def write_all(self, device: Any, steps: Sequence[tuple[str, Any]], done: Done, origin: Origin | None) -> None:
        """Write several items one after the other, with nothing in between; ``done`` gets the reply."""
        self._queue_request("write_all", device, "", tuple(steps), done, origin)

    def read(self, device: Any, item: str, done: Done) -> None:
        """Read an item once; ``done`` gets the reply."""
        self._queue_request("read", device, item, 0, done)

    def send_request(self, verb: str, device: Any, done: Done, origin: Origin | None = None, value: Any = 0) -> None:
        """Send one of the family's other requests; ``done`` gets the reply."""
        self._queue_request(verb, device, "", value, done, origin)

    def call(self, device: Any, item: str, arguments: Sequence[Any], done: Done, origin: Origin | None = None) -> None:
        """Call something of a device, in a family that has the verb "call"; ``done`` gets its result.

        Raises ValueError for an argument that is no data.
        """
        check_data(arguments)
        self._queue_request("call", device, item, tuple(arguments), done, origin)

    def watch(self, device: Any, items: Iterable[str], period: float | None) -> None:
        """Read items every ``period`` seconds (0: every tick) from now on; None ends the reading."""
        self._outbox.append(Watch(device, tuple(items), period))

    def settle_later(self, device: Settles) -> None:
        """Call ``device.settle()`` at the end of this round."""
        self._unsettled[device] = None

    def flush(self) -> None:
        """End of the round: send the gathered targets whose origin is live, then the other messages."""
        self._settle_devices()
        if self._targets:
            targets, self._targets = self._targets, {}
            live = self._motion.is_live
            values = {key: raw for key, (raw, origin, _) in targets.items() if origin is None or live(origin, key[0])}
            if values:
                self._tell_writers({key[0]: origin for key in values if (origin := targets[key][1]) is not None})
                now = self._motion.now()
                resumed = frozenset(key for key in values if self._was_held_up(key, targets[key][1], now))
                rates = {key: rate for key in values if (rate := targets[key][2]) < math.inf}
                settings = frozenset(key for key in values if targets[key][1] is None)
                self._send(Targets(values, self._motion.epoch, now, resumed, rates, settings))
        if self._outbox:
            outbox, self._outbox = self._outbox, []
            for message in outbox:
                self._send(message)

    def _tell_writers(self, origins: Mapping[Any, Origin]) -> None:
        """Tell the worker who moves devices that another client moved before, or no client since the last stop."""
        writers = {device: (origin.client, origin.epoch, origin.mark) for device, origin in origins.items()}
        news = {device: writer[0] for device, writer in writers.items() if self._writers.get(device) != writer}
        if news:
            self._writers |= writers
            self._send(Writers(news))

    def _was_held_up(self, key: tuple[Any, str], origin: Origin | None, now: float) -> bool:
        """Return whether a movement continues after its writer was held up: its next target is then far ahead."""
        last, written, interval = self._written.get(key, (None, now, 0.0))
        if origin is None or origin is not last:
            self._written[key] = origin, now, 0.0
            return False
        gap = now - written
        held_up = interval > 0 and gap > max(HELD_UP_S, 3 * interval)
        self._written[key] = origin, now, interval if held_up else gap
        return held_up

    def fail_pending(self, reason: str) -> None:
        """Answer all pending requests with an error: the worker was replaced or has ended."""
        waiting, self._waiting = self._waiting, {}
        for number, done in waiting.items():
            done(Reply(number, False, error=reason))

    def handle_reply(self, reply: Reply) -> None:
        """Pass the reply to the ``done`` of its request."""
        done = self._waiting.pop(reply.reply_id, None)
        if done is not None:
            done(reply)

    def _settle_devices(self) -> None:
        while self._unsettled:
            device, _ = self._unsettled.popitem()
            device.settle()

    def _queue_request(
        self, verb: str, device: Any, item: str, raw: Any, done: Done, origin: Origin | None = None
    ) -> None:
        self._count += 1
        if device in self.blocked:
            done(Reply(self._count, False, error=self.blocked[device]))
            return
        self._waiting[self._count] = done
        epoch = self._motion.epoch if origin is None else origin.epoch
        self._outbox.append(Request(self._count, verb, device, item, raw, epoch, setting=origin is None))
