"""What a server sends by itself: samples, pictures and events; lines in, bounded queues of items out, no sockets.

The newest items stay: what a program does not fetch in time is left out, and counted.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable
from typing import Any, Final, NamedTuple

from urbihw.client.dialect import Native
from urbihw.client.errors import ClientError, SlotMissing, TimedOut, UrbiError
from urbihw.client.lines import Line, guarded
from urbihw.client.literals import checked_path, checked_rate, written_path
from urbihw.client.media import Blob

MAX_ITEMS: Final = 1000
"""Maximum number of items that wait for the program."""
MAX_LAG_S: Final = 1.0
"""A sample that is this much older than the newest one is left out, so that a slow program does not fall behind."""
KEPT_SAMPLES: Final = 10
"""Number of samples that are kept however old they are."""

NO_BINARY: Final = "this slot has no Binary"
"""What the server says of a slot that holds something else than a picture or a sound."""
_MISSING: Final = re.compile(r"lookup failed: .*")

Convert = Callable[[Line], Any]


class Sample(NamedTuple):
    """The values of watched slots.

    Attributes:
        time: when they were read, in seconds since 1970 of this computer's clock.
        values: the values, in the order of the slots; None for a slot that cannot be read.
    """

    time: float
    values: tuple[Any, ...]


class Shot(NamedTuple):
    """A picture, a sound or another Binary; ``time`` as in ``Sample``."""

    time: float
    value: Blob


class EventSample(NamedTuple):
    """An event; ``time`` as in ``Sample``, ``args``: the values that it carried."""

    time: float
    args: tuple[Any, ...]


class Stream:
    """Items of one channel.  ``lost``: number of items left out, by the server or here; ``failed``: why it cannot go
    on."""

    def __init__(self, size: int = MAX_ITEMS) -> None:
        self.channel = ""
        self.items: deque[Any] = deque()
        self.size = size
        self.closed = False
        self.failed: ClientError | None = None
        self.errors: dict[str, str] = {}
        """The last error of each slot that failed."""
        self._left_out = 0
        self._server_lost = 0
        self._lost_before = 0

    @property
    def lost(self) -> int:
        """The number of items left out."""
        return self._left_out + self._lost_before + self._server_lost

    def start_text(self, dialect: Native, channel: str) -> str:
        """The statement that begins it; its answer comes on ``channel``."""
        raise NotImplementedError

    def stop_text(self, dialect: Native, channel: str) -> str:
        """The statement that ends it."""
        return dialect.unwatch(channel, self.channel)

    def begin_again(self) -> None:
        """The connection is a new one, where the server counts from 0."""
        self._lost_before += self._server_lost
        self._server_lost = 0

    def take(self, line: Line, convert: Convert, offset: float) -> None:
        """Store what a line says; ``offset`` is added to the time of the server, s."""
        raise NotImplementedError

    def add(self, item: Any) -> None:
        """Store an item, or an error that its reader gets in its place."""
        if len(self.items) >= self.size:
            self.leave_out()
        self.items.append(item)

    def leave_out(self) -> None:
        """Leave out the oldest item."""
        self.items.popleft()
        self._left_out += 1

    def next_item(self) -> Any:
        """The oldest item.  Raises BadAnswer if it could not be read."""
        item = self.items.popleft()
        if isinstance(item, ClientError):
            raise item
        return item

    def silence(self, where: object, timeout: float) -> TimedOut:
        """The error for a server that has sent nothing for so many seconds, with the reason if it told one."""
        told = "".join(f"; {slot}: {text}" for slot, text in self.errors.items())
        return TimedOut(f"{where} sent nothing for {timeout:g} s{told}")


class SampleStream(Stream):
    """The values of slots.  ``units`` are those of the slots."""

    def __init__(self, slots: tuple[str, ...], hz: float, size: int = MAX_ITEMS) -> None:
        """``hz`` samples a second, 0 for changes only.  Raises ValueError for a wrong path or rate, or no slot."""
        super().__init__(size)
        if not slots:
            raise ValueError('which slots? robot.watch("motor6.val")')
        self.slots = tuple(map(checked_path, slots))
        self.hz = checked_rate(hz)
        self.units: tuple[str, ...] = ("",) * len(slots)

    def start_text(self, dialect: Native, channel: str) -> str:
        """The statement that begins it."""
        return dialect.watch(channel, self.channel, self.slots, self.hz)

    def take(self, line: Line, convert: Convert, offset: float) -> None:
        """Store a sample, or an error, or the units."""
        if line.raw[line.begin : line.begin + 1] != b"{":
            self._add_sample((line.stamp or 0) / 1000 + offset, convert(line))
            return
        import json  # most programs do not watch anything

        told = json.loads(line.raw[line.begin :])
        if "v" in told:
            lost = int(told["lost"])
            self._add_sample(told["t"] + offset, told["v"])
            self._server_lost = lost
        elif "error" in told:
            self.errors[str(told["error"])] = str(told["text"])
        else:
            self.units = tuple(map(str, told["units"]))

    def _add_sample(self, time: float, values: Any) -> None:
        """Store a sample.  Raises ValueError if it has not a value for each slot."""
        if not isinstance(values, list) or len(values) != len(self.slots):
            raise ValueError("not a value for each slot")
        self.add(Sample(time, tuple(values)))
        items = self.items
        while len(items) > KEPT_SAMPLES and not time - getattr(items[0], "time", time) <= MAX_LAG_S:
            self.leave_out()


class ShotStream(Stream):
    """The newest content of a slot with a Binary."""

    def __init__(self, slot: str, hz: float) -> None:
        """``hz`` at most so many in a second.  Raises ValueError for a wrong path or rate."""
        super().__init__(1)
        checked_path(slot)
        if not checked_rate(hz):
            raise ValueError("hz: pictures in a second, more than 0")
        self.slot = slot
        self.hz = hz
        self._time = 0.0
        self._has_begun = False

    def start_text(self, dialect: Native, channel: str) -> str:
        """The statement that begins it."""
        return dialect.watch_binary(channel, self.channel, self.slot, self.hz)

    def take(self, line: Line, convert: Convert, offset: float) -> None:
        """Store a Binary, or what the line before it says of it."""
        if line.raw[line.begin : line.begin + 1] == b"{":
            import json

            told = json.loads(line.raw[line.begin :])
            self._time = float(told.get("t", self._time))
            self._server_lost = int(told.get("lost", self._server_lost))
            if "error" in told:
                self._note_error(str(told["error"]), str(told["text"]))
            return
        value = convert(line)
        if isinstance(value, Blob):
            self._has_begun = True
            self.add(Shot((self._time or (line.stamp or 0) / 1000) + offset, value))

    def _note_error(self, slot: str, text: str) -> None:
        """Store why the slot cannot be read.  Before the first content a slot that does not exist, or holds something
        else, ends the stream: it was a mistake of the program.  Later on the camera may come back."""
        self.errors[slot] = text
        if not self._has_begun and text.endswith(NO_BINARY):
            self.failed = UrbiError(f"{slot}: {text}")
        elif not self._has_begun and (found := _MISSING.search(text)):
            self.failed = SlotMissing(f"{slot}: {found[0]}", kind="Lookup")


class LineStream(Stream):
    """The lines that a statement writes to the Channel ``answers``, as they come."""

    def __init__(self, statement: str, size: int = MAX_ITEMS) -> None:
        super().__init__(size)
        self.statement = statement

    def start_text(self, dialect: Native, channel: str) -> str:
        """The statement that begins it."""
        body = guarded(f'var answers = Channel.new("{self.channel}") | {self.statement}', self.channel)
        return f"{self.channel}: {{ {body} }},\n" + dialect.evaluate(channel, "nil")

    def stop_text(self, dialect: Native, channel: str) -> str:
        """The statement that ends it."""
        return dialect.evaluate(channel, f"{self.channel}.stop")

    def take(self, line: Line, convert: Convert, offset: float) -> None:
        """Store a line, or the error that it tells."""
        self.add(UrbiError(line.shown.removeprefix("!!! ")) if line.is_error else line)


class EventStream(Stream):
    """The emissions of an event."""

    def __init__(self, event: str, size: int = MAX_ITEMS) -> None:
        """Raises ValueError for a wrong path."""
        super().__init__(size)
        self.event = written_path(checked_path(event))

    def start_text(self, dialect: Native, channel: str) -> str:
        """The statement that begins it."""
        return dialect.follow(channel, self.channel, self.event)

    def stop_text(self, dialect: Native, channel: str) -> str:
        """The statement that ends it."""
        return dialect.unfollow(channel, self.channel)

    def take(self, line: Line, convert: Convert, offset: float) -> None:
        """Store an emission of the event."""
        time, lost, args = convert(line)
        self._server_lost = int(lost)
        self.add(EventSample(time + offset, tuple(args)))
