"""The loop of a worker: one wire, its link, its ticks, its master. The same code in a thread and in a process.

One step of the loop:
  1. take the messages of the parent;
  2. has the parent been silent for too long? then stop the robot, once;
  3. is the link down? then try to open it, not too often;
  4. one tick of the driver, then the one-off requests;
  5. once a second, statistics;
  6. sleep until the next tick. Ticks are absolute deadlines; those that could not be met are skipped and counted.

The loop ends when the pipe ends or when it is asked to from outside (SIGTERM, parent gone), always with a safe stop.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Final, Protocol

from urbihw import buses
from urbihw.buses.errors import BadUrl, BadValue, LinkGone, Unavailable
from urbihw.buses.link import Context, Port
from urbihw.buses.mailbox import Mailbox
from urbihw.buses.messages import (
    Alive,
    Configure,
    Ended,
    FromWorker,
    LinkState,
    Reply,
    Request,
    Statistics,
    Stop,
    Stopped,
    Targets,
    ToWorker,
    Watch,
)
from urbihw.buses.ticker import Ticker

# Protocol family of a wire -> what drives it. A family of one robot lives with it, and is named "module:Class".
FAMILIES: Final = {"dynamixel": "urbihw.buses.dynamixel.driver:DynamixelDriver"}

_FIRST_BACK_OFF = 0.2
_LAST_BACK_OFF = 2.0
_STATISTICS_PERIOD = 1.0
# With less than this until the next tick, posting waits until the wire is busy again.
_TIME_TO_POST = 0.0005


class Driver(Protocol):
    """What the engine needs of a protocol family; each method returns the messages to post.

    `attach` is handed an open port and finds the devices, or raises Unavailable (nobody answers, wrong firmware), after
    which it is tried again later; `detach` is told that the port is gone. In between come `tick`, `targets`, `watch`,
    `request` and `safe_stop`; all but `detach` may raise LinkGone. `targets`, `watch` and `request` may also come
    while there is no port. `configure` comes first, and again for new settings; it raises BadValue. `errors` counts
    failures since `attach`. Watches must outlive the port, targets must not. `tick` should call `meanwhile` when the
    wire is busy, and must not wait for longer than a tick lasts. `slow_verbs` are the requests for which the cycle
    rests on purpose.
    """

    slow_verbs: frozenset[str]

    def configure(self, settings: Configure) -> None: ...
    def attach(self, port: Port) -> list[FromWorker]: ...
    def detach(self) -> None: ...
    def tick(self, now: float, meanwhile: Callable[[], None]) -> list[FromWorker]: ...
    def targets(self, message: Targets) -> list[FromWorker]: ...
    def watch(self, message: Watch, now: float) -> list[FromWorker]: ...
    def request(self, message: Request) -> list[FromWorker]: ...
    def safe_stop(self) -> None: ...
    def errors(self) -> dict[str, int]: ...


def driver_of(family: str) -> Driver:
    """Return a fresh driver of a row of FAMILIES, or of "module:Class". Raises BadValue when there is none."""
    module_name, colon, class_name = FAMILIES.get(family, family).partition(":")
    if not colon:
        raise BadValue(f"unknown protocol family {family!r}; known: {', '.join(sorted(FAMILIES))}")
    found: Driver = getattr(importlib.import_module(module_name), class_name)()
    return found


class Engine:
    """See the head of this file. `asked_to_end` is looked at each tick."""

    def __init__(
        self,
        url: str,
        driver: Driver,
        mailbox: Mailbox,
        settings: Configure,
        context: Context,
        asked_to_end: Callable[[], bool] = lambda: False,
    ) -> None:
        self._url = url
        self._driver = driver
        self._mailbox = mailbox
        self._settings = settings
        self._context = context
        self._asked_to_end = asked_to_end
        self._clock = context.clock
        now = self._clock.now()
        self._link: Port | None = None
        self._announced: bool | None = None
        self._back_off = _FIRST_BACK_OFF
        self._retry_at = now
        self._heard_at = now
        self._stopped_for_silence = False
        self._stop_owed = ""
        self._requests: list[Request] = []
        self._unposted: list[FromWorker] = []
        self._ticker = Ticker(1 / settings.rate, now)
        self._tally = _Tally(now)
        driver.configure(settings)

    def run(self) -> None:
        """Work until the end; posts `Ended` as the last message. Does not raise: a bug becomes its reason."""
        reason = ""
        try:
            while self.step():
                pass
        except Exception as error:  # The robot must be stopped whatever happens, and the parent told.
            reason = f"our bug in the bus worker: {type(error).__name__}: {error}"
        self._post_unposted()
        self._safe_stop("the worker ends")
        if self._link is not None:
            self._link.close()
        self._mailbox.post(Ended(reason))
        self._mailbox.close()

    def step(self) -> bool:
        """Do one tick and sleep until the next; False when it is time to end."""
        now = self._clock.now()
        for message in self._mailbox.take():
            self._obey(message, now)
        if self._mailbox.ended or self._asked_to_end():
            return False
        self._watch_master(now)
        if self._link is None:
            self._try_link(now)
        self._guarded(self._tick)
        self._serve_requests()
        self._tally.ticks += 1
        now = self._clock.now()
        self._report(now)
        self._tally.late += self._ticker.advance(now)
        if self._ticker.due > now + _TIME_TO_POST:
            self._post_unposted()
        self._clock.sleep_until(self._ticker.due)
        return True

    def _tick(self) -> None:
        news = self._driver.tick(self._clock.now(), self._post_unposted)
        self._post_unposted()
        self._unposted = news

    def _post_unposted(self) -> None:
        """Post what the last tick brought: right after it, or, when the next one is due, while its wire is busy."""
        unposted, self._unposted = self._unposted, []
        for message in unposted:
            self._mailbox.post(message)

    # The master.

    def _obey(self, message: ToWorker, now: float) -> None:
        self._heard_at = now
        self._stopped_for_silence = False
        match message:
            case Alive():
                pass
            case Targets():
                self._guarded(lambda: self._post_all(self._driver.targets(message)))
            case Watch():
                self._post_all(self._driver.watch(message, now))
            case Request():
                self._requests.append(message)
            case Stop():
                self._safe_stop("asked to stop")
            case Configure():
                self._settings = message
                self._driver.configure(message)
                self._ticker = Ticker(1 / message.rate, now)

    def _watch_master(self, now: float) -> None:
        patience = self._settings.dead_man
        if patience and not self._stopped_for_silence and now - self._heard_at > patience:
            self._stopped_for_silence = True
            self._safe_stop(f"no sign of life from the master for {patience:g} s")

    def _safe_stop(self, reason: str) -> None:
        """Stop the robot now, or as soon as the link is back."""
        if self._link is None:
            self._stop_owed = reason
        elif self._guarded(self._driver.safe_stop):
            self._post_all([Stopped(reason)])
        else:
            self._stop_owed = reason

    def _serve_requests(self) -> None:
        requests, self._requests = self._requests, []
        for request in requests:
            if not self._guarded(lambda request=request: self._post_all(self._driver.request(request))):  # type: ignore[misc]
                self._post_all([Reply(request.reply_id, False, error="the link went down")])
            if request.verb in self._driver.slow_verbs:
                # Those ticks were given away on purpose; they are not late.
                self._ticker = Ticker(self._ticker.period, self._clock.now())

    # The link.

    def _try_link(self, now: float) -> None:
        if now < self._retry_at:
            return
        try:
            link = buses.open(self._url, self._context)
        except (BadUrl, Unavailable) as error:
            self._down(str(error))
            return
        self._link = link
        messages: list[FromWorker] = []
        try:
            if not self._guarded(lambda: messages.extend(self._driver.attach(link))):
                return
        except (BadUrl, Unavailable) as error:
            self._down(str(error))
            return
        self._back_off = _FIRST_BACK_OFF
        self._announced = True
        self._post_all([LinkState(True), *messages])
        if self._stop_owed:
            reason, self._stop_owed = self._stop_owed, ""
            self._safe_stop(reason)
        now = self._clock.now()
        self._ticker = Ticker(self._ticker.period, now)
        self._tally.restart(now)

    def _down(self, reason: str) -> None:
        link, self._link = self._link, None
        if link is not None:
            link.close()
            self._driver.detach()
        if self._announced is not False:
            self._announced = False
            self._post_all([LinkState(False, reason)])
        self._retry_at = self._clock.now() + self._back_off
        self._back_off = min(self._back_off * 2, _LAST_BACK_OFF)

    def _guarded(self, work: Callable[[], None]) -> bool:
        """Do something over the link; False when the link broke at it."""
        try:
            work()
        except LinkGone as error:
            self._down(str(error))
            return False
        return True

    # Telling.

    def _post_all(self, messages: list[FromWorker]) -> None:
        """Post messages, behind those of the last tick."""
        self._post_unposted()
        for message in messages:
            self._mailbox.post(message)

    def _report(self, now: float) -> None:
        if now - self._tally.since >= _STATISTICS_PERIOD:
            statistics = self._tally.close(now, self._link, self._driver.errors(), self._mailbox.take_dropped())
            self._mailbox.post(statistics)


class _Tally:
    """Counts of the running second."""

    def __init__(self, now: float) -> None:
        self.restart(now)

    def restart(self, now: float) -> None:
        """Begin at `now` with a fresh link, whose counters are at 0."""
        self.since = now
        self.ticks = 0
        self.late = 0
        self._errors: dict[str, int] = {}
        self._bytes = 0

    def close(self, now: float, link: Port | None, errors: dict[str, int], dropped: int) -> Statistics:
        """Return the second that ends now and begin the next; `errors` are totals since the link opened."""
        elapsed = now - self.since
        total = 0 if link is None else link.bytes_read + link.bytes_written
        busy = 0.0 if link is None else max(total - self._bytes, 0) * link.byte_time / elapsed
        news = {kind: count - self._errors.get(kind, 0) for kind, count in errors.items()}
        statistics = Statistics(
            time=now,
            rate=self.ticks / elapsed,
            late=self.late,
            errors={kind: count for kind, count in news.items() if count > 0},
            load=min(busy, 1.0),
            dropped=dropped,
        )
        self.restart(now)
        self._errors, self._bytes = errors, total
        return statistics
