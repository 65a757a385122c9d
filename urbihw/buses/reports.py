"""What a worker tells: messages to its parent, events to the clients of its control socket, heartbeats, statistics."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import Final

from urbihw.buses.clock import BusClock
from urbihw.buses.control import ControlSocket
from urbihw.buses.counter import StatisticsCounter
from urbihw.buses.driver import Driver
from urbihw.buses.health import HealthRecord
from urbihw.buses.inventory import Inventory
from urbihw.buses.journal import WorkerJournal
from urbihw.buses.link import Port
from urbihw.buses.mailbox import Mailbox
from urbihw.buses.messages import FromWorker, WorkerHeartbeat
from urbihw.buses.processor import Processor
from urbihw.buses.traffic import TrafficLog

HEARTBEAT_PERIOD_S: Final = 0.1
HEARTBEAT_ALLOWANCE_S: Final = 0.4
"""Seconds within which a healthy worker sends its next heartbeat."""
SLOW_ALLOWANCE_S: Final = 20.0
"""The same while it opens its link, searches the devices, or executes one of the `slow_verbs` of its driver."""
_STATISTICS_PERIOD_S: Final = 1.0


class Reports:
    """Posts messages in their order, and shows each of them to the health record, the inventory and the traffic log.

    Attributes:
        tally: the statistics of the present second.
        step_begun_at: when the present step of the loop began, in seconds of the worker's clock.
    """

    def __init__(
        self,
        mailbox: Mailbox,
        control: ControlSocket | None,
        health: HealthRecord,
        inventory: Inventory,
        traffic: TrafficLog,
        journal: WorkerJournal,
        clock: BusClock,
        processor: Processor,
    ) -> None:
        now = clock.now()
        self._mailbox = mailbox
        self._control = control
        self._health = health
        self._inventory = inventory
        self._traffic = traffic
        self._journal = journal
        self._clock = clock
        self._kept: Iterable[FromWorker] = ()
        self._pulse_at = self._allowed_until = now
        self.tally = StatisticsCounter(now, processor)
        self.step_begun_at = now

    def post(self, messages: Iterable[FromWorker]) -> None:
        """Post messages, after those that are kept."""
        self.post_kept()
        for message in messages:
            self._post(message)

    def keep(self, messages: Iterable[FromWorker]) -> None:
        """Keep the messages of a tick for `post_kept`: right after the tick, or during the next while the wire is busy.

        Pickling them takes time that would delay a tick which is due now.
        """
        self.post_kept()
        self._kept = messages

    def post_kept(self) -> None:
        """Post the messages that were kept."""
        kept, self._kept = self._kept, ()
        for message in kept:
            self._post(message)

    def _post(self, message: FromWorker) -> None:
        self._mailbox.post(message)
        if self._control is not None:
            self._control.publish(message)
            self._journal.note(message)
            self._traffic.hear(message)
            self._health.hear(message, self._clock.now())
        differences = self._inventory.hear(message)
        if differences is not None:
            self._mailbox.post(differences)

    def publish(self, link: Port | None) -> None:
        """Send the bytes of the last tick and the present values to the clients that asked for them."""
        self.publish_traffic(link)
        if self._control is not None:
            self._control.publish_values(partial(self._health.values, link is not None))

    def begin_traffic(self, port: Port, kept: bool) -> None:
        """Observe a link that was just opened, and keep its first bytes (``kept``) if anybody could ask for them."""
        if self._control is not None and kept:
            self._traffic.begin(port)
        self.publish_traffic(port)

    def publish_traffic(self, link: Port | None) -> None:
        """Send the bytes that the link has moved to the clients that trace them."""
        if self._control is not None:
            self._traffic.observe(link, self._control.is_traced)
            self._control.publish_backlogs()
            event = self._traffic.take()
            if event is not None:
                self._control.publish_traffic(event)

    def post_statistics(self, now: float, link: Port | None, driver: Driver, wanted: float) -> None:
        """Post a heartbeat if it is time, and the statistics once a second; `wanted` is the rate of the settings."""
        self.post_heartbeat(now)
        if now - self.tally.since >= _STATISTICS_PERIOD_S:
            self._post(self.tally.close(now, link, driver, self._mailbox.pop_dropped_count(), wanted))

    def post_heartbeat(self, now: float, pause: float = 0.0) -> None:
        """Post a heartbeat if it is time, or if the last one does not allow a pause of so many seconds."""
        allowance = HEARTBEAT_ALLOWANCE_S + pause
        if now >= self._pulse_at or now + pause > self._allowed_until:
            self._pulse_at, self._allowed_until = now + HEARTBEAT_PERIOD_S, now + allowance
            self._mailbox.post(WorkerHeartbeat(allowance))

    def post_heartbeat_before_wait(self, deadline: float) -> None:
        """The link waits for a device: that is no silence of this worker, however often it happens in one step.

        Unless the step lasts longer than anything slow: a driver that never ends to ask hangs, too.
        """
        now = self._clock.now()
        if now - self.step_begun_at < SLOW_ALLOWANCE_S:
            self.post_heartbeat(now, min(max(deadline - now, 0.0), SLOW_ALLOWANCE_S))

    def begin_slow_work(self) -> None:
        """Announce work during which nothing may be heard for long; `end_slow_work` ends it."""
        self.post([WorkerHeartbeat(SLOW_ALLOWANCE_S)])
        self._pulse_at = self._allowed_until = self._clock.now() + SLOW_ALLOWANCE_S

    def end_slow_work(self) -> None:
        """From now on heartbeats come again as usual."""
        self._pulse_at = self._clock.now()
