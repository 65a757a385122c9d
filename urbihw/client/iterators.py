"""The iterators of the blocking client: samples, pictures and events, as they come."""

from __future__ import annotations

from types import TracebackType
from typing import Any, Generic, TypeVar

from urbihw.client.connection import Connection
from urbihw.client.streams import EventSample, EventStream, Sample, SampleStream, Shot, ShotStream, Stream

S = TypeVar("S", bound=Stream)
Self = TypeVar("Self", bound="Items[Any]")


class Items(Generic[S]):
    """Items that a server sends, until ``close``, which may be called by another thread, or the end of ``with``."""

    def __init__(self, connection: Connection, stream: S, timeout: float | None) -> None:
        self._connection = connection
        self._stream = stream
        self._timeout = timeout

    @property
    def lost(self) -> int:
        """The number of items left out so far, because the program was too slow."""
        return self._stream.lost

    def close(self) -> None:
        """End it; iterations end, too."""
        self._connection.close_stream(self._stream)

    def __iter__(self: Self) -> Self:
        return self

    def _next(self) -> Any:
        item = self._connection.next_item(self._stream, self._timeout)
        if item is None:
            raise StopIteration
        return item

    def __enter__(self: Self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __del__(self) -> None:
        """Called when the reader is gone: the items are ignored, and the server ends them at the next chance."""
        self._connection.forget_stream(self._stream)


class SlotWatch(Items[SampleStream]):
    """Samples of slots: ``(time, values)``."""

    @property
    def slots(self) -> tuple[str, ...]:
        """The paths of the slots."""
        return self._stream.slots

    @property
    def units(self) -> tuple[str, ...]:
        """The units of the slots, "" where there is none."""
        return self._stream.units

    @property
    def errors(self) -> dict[str, str]:
        """The last error of each slot that could not be read, whose values are None."""
        return dict(self._stream.errors)

    def __next__(self) -> Sample:
        """The next sample.  Raises TimedOut, or why there is no connection."""
        item: Sample = self._next()
        return item


class Shots(Items[ShotStream]):
    """The newest content of a slot with a picture or a sound: ``(time, picture)``."""

    @property
    def errors(self) -> dict[str, str]:
        """Why the slot could not be read the last time that it could not."""
        return dict(self._stream.errors)

    def __next__(self) -> Shot:
        """The next one.  Raises TimedOut, or why there is no connection."""
        item: Shot = self._next()
        return item


class Events(Items[EventStream]):
    """Emissions of an event: ``(time, args)``."""

    def __next__(self) -> EventSample:
        """The next emission.  Raises TimedOut, or why there is no connection."""
        item: EventSample = self._next()
        return item
