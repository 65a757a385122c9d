"""The statistics of a worker, counted for one second at a time."""

from __future__ import annotations

from urbihw.buses.driver import Driver
from urbihw.buses.link import Port
from urbihw.buses.messages import Statistics
from urbihw.buses.processor import Processor


class StatisticsCounter:
    """Counters of the present second.

    Attributes:
        since: when it began, in seconds of the worker's clock.
        ticks: ticks executed.
        late: ticks missed because others took too long.
    """

    def __init__(self, now: float, processor: Processor) -> None:
        self._processor = processor
        self.restart(now)

    def restart(self, now: float) -> None:
        """Begin a second at `now`, with a new link whose counters are 0."""
        self.since = now
        self.ticks = 0
        self.late = 0
        self._errors: dict[str, int] = {}
        self._bytes = 0
        self._held_up = self._processor.held_up()

    def close(self, now: float, link: Port | None, driver: Driver, dropped: int, wanted: float) -> Statistics:
        """Return the second that ends now and begin the next; `wanted` is the rate of the settings."""
        errors = driver.errors()
        elapsed = now - self.since
        total = 0 if link is None else link.bytes_read + link.bytes_written
        busy = 0.0 if link is None else max(total - self._bytes, 0) * link.byte_time / elapsed
        before, held_up = self._held_up, self._processor.held_up()
        waited = 0.0 if before is None or held_up is None else held_up - before
        news = {kind: count - self._errors.get(kind, 0) for kind, count in errors.items()}
        statistics = Statistics(
            time=now,
            rate=self.ticks / elapsed,
            late=self.late,
            errors={kind: max(count, 0) for kind, count in news.items()},
            load=min(busy, 1.0),
            dropped=dropped,
            wanted=wanted,
            turnaround=driver.turnaround(),
            held_up=min(waited / elapsed, 1.0),
            crowd=self._processor.crowd(),
        )
        self.restart(now)
        self._errors, self._bytes = errors, total
        return statistics
