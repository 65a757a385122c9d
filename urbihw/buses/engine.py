"""The loop of a worker: one wire, its link, its ticks, its master, and the authority over motion.

The same code in a thread and in a process.  One step of the loop:
  1. take what the parent and the control socket want; stops are obeyed first;
  2. has the parent been silent for too long? then stop the robot, once;
  3. is the link down? then try to open it, not too often;
  4. one tick of the driver, then the one-off requests;
  5. once a second, statistics; ten times a second, a sign of life;
  6. wait until the next tick. Ticks are absolute deadlines; those that could not be met are skipped and counted.

A stop does not wait for its turn: the wait of 6. ends when something comes, and a driver looks (`urgent`) between two
transactions and gives its tick up.

The loop ends when the pipe ends or when it is asked to from outside (SIGTERM, parent gone), always with a safe stop.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from urbihw import buses
from urbihw.buses.authority import Authority
from urbihw.buses.backoff import BackOff
from urbihw.buses.control import ESTOP, RELEASE, STOP, SUBSCRIBE, ControlSocket, Order
from urbihw.buses.driver import Driver
from urbihw.buses.errors import BadUrl, LinkGone, Unavailable
from urbihw.buses.gate import Gate
from urbihw.buses.link import Context, Port, take_off
from urbihw.buses.mailbox import Mailbox
from urbihw.buses.messages import (
    Alive,
    Begin,
    Configure,
    DeviceState,
    EmergencyStop,
    Ended,
    FromWorker,
    Latched,
    Limits,
    LinkState,
    Pulse,
    Refused,
    Release,
    Reply,
    Request,
    Samples,
    Statistics,
    Stop,
    Stopped,
    Targets,
    ToWorker,
    Watch,
)
from urbihw.buses.ticker import Ticker

_FIRST_BACK_OFF = 0.2
_LAST_BACK_OFF = 2.0
_STATISTICS_PERIOD = 1.0
# With less than this until the next tick, posting waits until the wire is busy again.
_TIME_TO_POST = 0.0005


PULSE_PERIOD: Final = 0.1
PULSE_ALLOWANCE: Final = 0.4
"""Seconds in which a worker that works is heard of again."""
SLOW_ALLOWANCE: Final = 20.0
"""The same while it opens its link, finds the devices, or does one of the slow requests of its driver."""
_URGENT = (Stop, EmergencyStop)


class Engine:
    """See the head of this file. `asked_to_end` is looked at each tick."""

    def __init__(
        self,
        url: str,
        driver: Driver,
        mailbox: Mailbox,
        begin: Begin,
        context: Context,
        asked_to_end: Callable[[], bool] = lambda: False,
    ) -> None:
        self._url, _ = take_off(url, driver.url_parameters)
        self._driver = driver
        self._mailbox = mailbox
        self._settings = begin.settings
        self._context = context
        self._asked_to_end = asked_to_end
        self._clock = context.clock
        now = self._clock.now()
        self._link: Port | None = None
        self._announced: bool | None = None
        self._back_off = BackOff(_FIRST_BACK_OFF, _LAST_BACK_OFF)
        self._retry_at = now
        self._heard_at = now
        self._stopped_for_silence = False
        self._stop_owed = ""
        self._first_link = True
        self._inbox: deque[ToWorker] = deque()
        self._urgent: deque[Stop | EmergencyStop | Order] = deque()
        self._orders: deque[Order] = deque()
        self._requests: list[Request] = []
        self._unposted: list[FromWorker] = []
        self._ticker = Ticker(1 / begin.settings.rate, now)
        self._tally = _Tally(now)
        self._pulse_at = now
        control = Path(begin.control) if begin.control else None
        self._authority = Authority(begin.epoch, control.with_suffix(".estop") if control is not None else None)
        self._gate = Gate(driver, self._authority)
        driver.configure(begin.settings)
        driver.expect(begin.devices)
        for watch in begin.watches:
            driver.watch(watch, now)
        self._control = None if control is None else self._listen_at(control)
        if begin.instead:
            self._post_all([Stopped(begin.instead, begin.epoch)])
        if self._authority.latched:
            self._post_all([Latched(self._authority.latched)])

    def _listen_at(self, path: Path) -> ControlSocket | None:
        """The control socket; a worker that cannot have it works all the same, and says so."""
        try:
            return ControlSocket(path)
        except Unavailable as error:
            self._mailbox.post(Refused("control socket", str(path), str(error)))
            return None

    def run(self) -> None:
        """Work until the end; posts `Ended` as the last message. Does not raise: a bug becomes its reason."""
        reason = ""
        try:
            while self.step():
                pass
        except Exception as error:  # The robot must be stopped whatever happens, and the parent told.
            reason = f"our bug in the bus worker: {type(error).__name__}: {error}"
        self._post_unposted()
        self._stop("the worker ends")
        if self._link is not None:
            self._link.close()
        if self._control is not None:
            self._control.close()
        self._mailbox.post(Ended(reason))
        self._mailbox.close()

    def step(self) -> bool:
        """Do one tick and wait until the next; False when it is time to end."""
        now = self._clock.now()
        self._listen(self._readable(now))
        self._obey_urgent()
        while self._inbox:
            self._obey(self._inbox.popleft(), now)
        if self._mailbox.ended or self._asked_to_end():
            return False
        self._watch_master(now)
        if self._link is None:
            self._try_link(now)
        self._guarded(self._tick)
        self._obey_urgent()
        self._serve_requests()
        self._serve_orders()
        self._tally.ticks += 1
        now = self._clock.now()
        self._report(now)
        self._tally.late += self._ticker.advance(now)
        if self._ticker.due > now + _TIME_TO_POST:
            self._post_unposted()
        self._wait()
        return True

    def _tick(self) -> None:
        now = self._clock.now()
        given = self._gate.set_points.step(now)
        if given:
            self._post_all(self._driver.targets(Targets(given)))
        news = self._driver.tick(now, self._post_unposted, self._is_urgent)
        self._post_unposted()
        self._unposted = news
        for message in news:
            if isinstance(message, DeviceState) and message.new == "back":
                self._device_back(message.device)
            elif isinstance(message, Samples):
                self._look_at(message)
        if self._driver.halted:
            reason, self._driver.halted = self._driver.halted, ""
            self._stop(reason)

    def _look_at(self, samples: Samples) -> None:
        """Act on values that have gone too far."""
        measures = self._gate.look(samples)
        if measures is None:
            return
        if measures.stopped:
            self._guarded(lambda: self._driver.safe_stop(measures.stopped))
        self._guarded(lambda: self._post_all(self._driver.targets(Targets(measures.targets))))
        self._post_all(measures.news)

    def _device_back(self, device: Any) -> None:
        """A device is back: it stays where it is, and its movement is taken up from there."""
        self._guarded(lambda: self._driver.safe_stop((device,)))
        self._take_up(device)

    def _take_up(self, device: Any) -> None:
        """The movements of a device, None for all, go on from where it is; or they are over."""
        if self._settings.resume:
            self._gate.set_points.returned(device, self._clock.now())
        else:
            self._gate.set_points.forget(None if device is None else (device,))

    def _post_unposted(self) -> None:
        """Post what the last tick brought: right after it, or, when the next one is due, while its wire is busy."""
        unposted, self._unposted = self._unposted, []
        for message in unposted:
            self._post(message)

    def _post(self, message: FromWorker) -> None:
        self._mailbox.post(message)
        if self._control is not None:
            self._control.publish(message)

    # Listening.

    def _descriptors(self) -> list[int]:
        mine = [] if self._mailbox.ended else [self._mailbox.fd]
        return mine if self._control is None else mine + self._control.descriptors()

    def _readable(self, until: float) -> list[int]:
        return self._clock.wait_readable(self._descriptors(), until)

    def _listen(self, ready: list[int]) -> None:
        """Take in what has come: what is urgent goes before all that waits."""
        if not ready:
            return
        if self._mailbox.fd in ready:
            for message in self._mailbox.take():
                self._heard_at = self._clock.now()
                self._stopped_for_silence = False
                if isinstance(message, _URGENT) and getattr(message, "devices", None) is None:
                    if isinstance(message, EmergencyStop):
                        self._forget_releases()
                    self._urgent.append(message)
                else:
                    self._inbox.append(message)
        if self._control is not None:
            for order in self._control.poll(ready):
                if order.verb == ESTOP:
                    self._forget_releases()
                (self._urgent if order.verb in (STOP, ESTOP) else self._orders).append(order)

    def _forget_releases(self) -> None:
        """An emergency stop overtakes the releases that wait: they were asked before it, so they must not end it."""
        self._inbox = deque(message for message in self._inbox if not isinstance(message, Release))
        for order in [order for order in self._orders if order.verb == RELEASE]:
            self._orders.remove(order)
            order.answer(self._state())

    def _is_urgent(self) -> bool:
        """Whether a stop has come; a driver asks between two transactions."""
        self._listen(self._readable(0.0))
        return bool(self._urgent)

    def _wait(self) -> None:
        """Wait for the next tick; a stop that comes meanwhile is obeyed at once."""
        due = self._ticker.due
        while ready := self._readable(due):
            self._listen(ready)
            self._obey_urgent()
            self._serve_orders()
            if self._mailbox.ended or self._clock.now() >= due:
                return

    # The master.

    def _obey_urgent(self) -> None:
        while self._urgent:
            message = self._urgent.popleft()
            if isinstance(message, Stop):
                self._stop(message.reason, message.epoch)
            elif isinstance(message, EmergencyStop):
                self._emergency_stop(message.who)
            else:
                if message.verb == ESTOP:
                    self._emergency_stop(message.who)
                else:
                    self._stop(f"stop asked by {message.who}")
                message.answer(self._state())

    def _obey(self, message: ToWorker, now: float) -> None:
        match message:
            case Targets():
                self._targets(message, now)
            case Watch():
                self._post_all(self._driver.watch(message, now))
            case Request():
                self._take_request(message)
            case Stop():
                self._stop_some(message)
            case Release():
                self._release(message.who)
            case Limits():
                self._gate.limit(message)
            case Configure():
                self._settings = message
                self._driver.configure(message)
                self._ticker = Ticker(1 / message.rate, now)
            case Alive() | EmergencyStop():
                pass

    def _targets(self, message: Targets, now: float) -> None:
        given, news = self._gate.targets(message, now)
        self._post_all(news)
        if given:
            self._guarded(lambda: self._post_all(self._driver.targets(Targets(given))))

    def _take_request(self, message: Request) -> None:
        request, news = self._gate.request(message)
        self._post_all(news)
        if request is not None:
            self._requests.append(request)

    def _watch_master(self, now: float) -> None:
        patience = self._settings.dead_man
        if patience and not self._stopped_for_silence and now - self._heard_at > patience:
            self._stopped_for_silence = True
            self._stop(f"no sign of life from the master for {patience:g} s")

    # Stopping.

    def _stop(self, reason: str, epoch: int | None = None) -> None:
        """Stop the robot now, or as soon as the link is back; what was asked for before counts no more."""
        self._authority.advance(epoch)
        self._gate.set_points.forget()
        self._requests, stale = [], self._requests
        for request in stale:
            self._take_request(request)
        if self._link is None or not self._guarded(self._driver.safe_stop):
            self._stop_owed = reason
        self._post_all([Stopped(reason, self._authority.epoch)])

    def _stop_some(self, message: Stop) -> None:
        """Stop some devices.  Those whose link is down are at rest when it is back: nothing of theirs is kept."""
        self._gate.set_points.forget(message.devices)
        if self._link is not None:
            self._guarded(lambda: self._driver.safe_stop(message.devices))
        self._post_all([Stopped(message.reason, self._authority.epoch, message.devices)])

    def _emergency_stop(self, who: str) -> None:
        problem = self._authority.latch(who)
        self._stop(f"emergency stop by {who}")
        self._post_all([Latched(self._authority.latched, who)])
        if problem:
            self._post_all([Refused("emergency stop", "latch", problem)])

    def _release(self, who: str) -> None:
        if self._authority.latched:
            self._authority.release()
            self._post_all([Latched("", who)])

    def _serve_orders(self) -> None:
        """What the control socket wants that can wait."""
        while self._orders:
            order = self._orders.popleft()
            if order.verb == RELEASE:
                self._release(order.who)
            elif order.verb == SUBSCRIBE:
                order.client.subscribed = True
            order.answer(self._state())

    def _state(self) -> dict[str, Any]:
        return {
            "epoch": self._authority.epoch,
            "estop": self._authority.latched,
            "link": self._link is not None,
            "time": self._clock.now(),
        }

    def _serve_requests(self) -> None:
        while self._requests:
            request = self._requests.pop(0)
            if request.verb in self._driver.slow_verbs:
                self._post_all([Pulse(SLOW_ALLOWANCE)])
            if not self._guarded(lambda request=request: self._post_all(self._driver.request(request))):  # type: ignore[misc]
                self._post_all([Reply(request.reply_id, False, error="the link went down")])
            if request.verb in self._driver.slow_verbs:
                # Those ticks were given away on purpose; they are not late.
                self._ticker = Ticker(self._ticker.period, self._clock.now())
            if self._is_urgent():
                self._obey_urgent()

    # The link.

    def _try_link(self, now: float) -> None:
        if now < self._retry_at:
            return
        self._post_all([Pulse(SLOW_ALLOWANCE)])
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
        self._back_off.reset()
        self._announced = True
        self._settle()
        if self._link is None:
            return
        self._post_all([LinkState(True), *messages])
        self._take_up(None)
        now = self._clock.now()
        self._ticker = Ticker(self._ticker.period, now)
        self._tally.restart(now)

    def _settle(self) -> None:
        """The link is open: first of all the robot stops, for nobody knows what has become of what it was told."""
        if not self._first_link or self._stop_owed:
            if self._guarded(self._driver.safe_stop if self._stop_owed else self._driver.rest):
                self._stop_owed = ""
            return
        self._first_link = False
        moved: list[Any] = []
        if self._guarded(lambda: moved.extend(self._driver.stop_what_moves())) and moved:
            self._authority.advance()
            which = ", ".join(map(str, moved))
            self._post_all([Stopped(f"{which} moved when the link was opened", self._authority.epoch)])

    def _down(self, reason: str) -> None:
        link, self._link = self._link, None
        if link is not None:
            link.close()
            self._driver.detach()
        if self._announced is not False:
            self._announced = False
            self._post_all([LinkState(False, reason)])
        self._retry_at = self._clock.now() + self._back_off.next_pause()

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
            self._post(message)

    def _report(self, now: float) -> None:
        if now >= self._pulse_at:
            self._pulse_at = now + PULSE_PERIOD
            self._mailbox.post(Pulse(PULSE_ALLOWANCE))
        if now - self._tally.since >= _STATISTICS_PERIOD:
            statistics = self._tally.close(now, self._link, self._driver.errors(), self._mailbox.take_dropped())
            self._post(statistics)


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
