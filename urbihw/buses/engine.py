"""The loop of a worker: one wire, its link, its ticks, the supervision of its master, and the authority over motion.

The same code runs in a thread and in a process.  One step of the loop:
  1. receive messages of the parent and commands of the control socket; stops are executed first;
  2. if the parent has been silent for too long, stop the robot, once; this is judged by the messages that were read, so
     a worker that was itself held up for as long stops the robot too;
  3. if the link is down, try to open it, with back-off;
  4. one tick of the driver, then the pending requests;
  5. statistics once a second, a heartbeat ten times a second;
  6. wait until the next tick. Ticks have absolute deadlines; one that is late begins at once, and missed ones are
     counted (`ticker`).

A stop does not wait for the next step: the wait of 6. ends when a message arrives, and a driver calls `urgent` between
two transactions and returns early from its tick.

The loop ends when the pipe is closed or on request (SIGTERM, death of the parent), always with a safe stop.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from urbihw.buses.authority import MotionAuthority
from urbihw.buses.control import ControlSocket
from urbihw.buses.control_client import ESTOP, HEALTH, RECORD, RELEASE, STATE, SUBSCRIBE, TRACE, VALUES
from urbihw.buses.driver import Driver
from urbihw.buses.errors import Unavailable
from urbihw.buses.gate import Gate, ThresholdActions
from urbihw.buses.health import HealthRecord, Key
from urbihw.buses.inbox import Inbox
from urbihw.buses.inventory import Inventory
from urbihw.buses.journal import WorkerJournal
from urbihw.buses.link import Context
from urbihw.buses.mailbox import Mailbox
from urbihw.buses.messages import (
    Begin,
    Configure,
    DeviceReport,
    DeviceState,
    EmergencyStop,
    Ended,
    Heartbeat,
    Latched,
    Limits,
    LinkState,
    Refused,
    Release,
    ReleaseKnown,
    Reply,
    Request,
    Samples,
    Stop,
    Stopped,
    Targets,
    ToWorker,
    Unusable,
    Watch,
    Writers,
)
from urbihw.buses.owed_releases import OwedReleases
from urbihw.buses.processor import Processor
from urbihw.buses.reports import Reports
from urbihw.buses.robot_link import RobotLink
from urbihw.buses.ticker import Ticker
from urbihw.buses.traffic import TrafficLog

_STOP_AGAIN_PERIOD_S: Final = 0.2
"""Seconds between two stops of the whole robot while an emergency stop holds: another master may move it."""
# With less than this left until the next tick, messages are posted during that tick, while the wire is busy.
_TIME_TO_POST_S: Final = 0.0005


class Engine:
    """The loop described at the head of this file. `asked_to_end` is called once per step."""

    def __init__(
        self,
        url: str,
        driver: Driver,
        mailbox: Mailbox,
        begin: Begin,
        context: Context,
        asked_to_end: Callable[[], bool] = lambda: False,
        processor: Processor | None = None,
    ) -> None:
        self._driver = driver
        self._mailbox = mailbox
        self._settings = begin.settings
        self._asked_to_end = asked_to_end
        self._clock = context.clock
        self._processor = processor or Processor()
        now = self._clock.now()
        self._stopped_for_silence_since: float | None = None
        self._pending_stop_reason = ""
        self._stop_again_at = now
        self._first_link = True
        self._identity = ""
        self._requests: list[Request] = []
        self._ticker = Ticker(1 / begin.settings.rate, now)
        control = Path(begin.control) if begin.control else None
        self._authority = MotionAuthority(
            begin.epoch, control.with_suffix(".estop") if control is not None else None, begin.holders
        )
        self._order = begin.order
        self._owed = OwedReleases(self._clock.now)
        self._gate = Gate(driver, self._authority)
        self._inventory = Inventory(begin.settings.expected)
        self._traffic = TrafficLog(url, self._clock)
        self._health = HealthRecord(driver, begin, now)
        driver.configure(begin.settings)
        driver.expect_devices(begin.devices)
        for watch in begin.watches:
            driver.watch(watch, now)
        self._control = None if control is None else self._open_control_socket(control)
        self._journal = WorkerJournal(self._control, begin, self._clock)
        self._reports = Reports(mailbox, self._control, self._health, self._inventory, self._traffic, self._journal,
                                self._clock, self._processor)
        self._link = RobotLink(url, driver, context, self._reports)
        self._inbox = Inbox(mailbox, self._control, self._clock, self._state_fields)
        if begin.instead:
            self._reports.post([Stopped(begin.instead, begin.epoch)])
        if self._authority.holders:
            self._reports.post([self._latched()])
        if self._authority.unreadable:
            self._reports.post([Refused("emergency stop", "latch", self._authority.unreadable)])

    def _open_control_socket(self, path: Path) -> ControlSocket | None:
        """Open the control socket; without it the worker still works, and reports the error."""
        try:
            return ControlSocket(path, self._clock.now)
        except Unavailable as error:
            self._mailbox.post(Refused("control socket", str(path), str(error)))
            return None

    def run(self) -> None:
        """Run until the end; posts `Ended` as the last message. Never raises: an exception becomes its reason."""
        reason = ""
        try:
            while self.step():
                pass
        except Exception as error:  # The robot must be stopped and the parent informed whatever happens.
            reason = f"our bug in the bus worker: {type(error).__name__}: {error}"
        self._reports.post_kept()
        self._stop_robot("the worker ends")
        self._reports.publish_traffic(self._link.port)
        self._link.end()
        if self._control is not None:
            self._control.close()
        self._mailbox.post(Ended(reason))
        self._mailbox.close()

    def step(self) -> bool:
        """Do one tick and wait until the next; False when it is time to end."""
        now = self._reports.step_begun_at = self._clock.now()
        self._inbox.receive(now)
        self._execute_urgent()
        # Before the messages: they may be targets that were sent before the silence.
        self._check_master(now)
        while self._inbox.messages:
            self._execute_message(self._inbox.messages.popleft(), now)
        if self._mailbox.ended or self._asked_to_end():
            return False
        if self._link.is_due(now):
            self._reports.begin_slow_work()
            self._try_open_link()
            self._end_slow_work()
        # `attempt` turns the loss of the link into news: the worker lives on, supervises, and opens the link again.
        self._link.attempt(self._tick)
        if self._authority.holders and now >= self._stop_again_at:
            self._stop_again_at = now + _STOP_AGAIN_PERIOD_S
            self._link.attempt(self._driver.stop_again)
        # The tick has ended early if a stop came: it goes out before any request.
        self._execute_urgent()
        self._execute_requests()
        self._execute_commands()
        self._reports.publish(self._link.port)
        self._reports.tally.ticks += 1
        now = self._clock.now()
        self._reports.post_statistics(now, self._link.port, self._driver, 1 / self._ticker.period)
        self._reports.tally.late += self._ticker.advance(now)
        if self._ticker.due > now + _TIME_TO_POST_S:
            self._reports.post_kept()
        self._wait_for_tick()
        return True

    def _tick(self) -> None:
        now = self._clock.now()
        if self._link.port is not None:
            self._link.port.beside = tuple(self._inbox.descriptors())
        points = self._gate.set_points
        given = points.next_targets(now)
        if given:
            self._note_applied(given)
            self._reports.post(self._driver.targets(Targets(given, rates=points.paces(given))))
        led = points.led_goals(now, still=bool(self._authority.latched))
        if led:
            self._driver.lead(led)
        news = self._driver.tick(now, self._reports.post_kept, self._is_tick_urgent)
        self._reports.keep(news)
        for message in news:
            if isinstance(message, DeviceState) and message.new == "back":
                self._handle_device_return(message.device)
            elif isinstance(message, Samples):
                self._check_thresholds(message)
        if self._driver.halted:
            reason, self._driver.halted = self._driver.halted, ""
            self._stop_robot(reason)
        if self._driver.stopped_devices:
            stopped, self._driver.stopped_devices = self._driver.stopped_devices, {}
            for device, reason in stopped.items():
                self._stop_devices(Stop(self._authority.epoch, reason, (device,)))
                self._reports.post([DeviceReport(device, "halted", reason)])

    def _check_thresholds(self, samples: Samples) -> None:
        """Execute the reactions to thresholds that these samples crossed."""
        measures = self._gate.check_samples(samples)
        if measures is not None:
            self._execute_threshold_actions(measures)

    def _execute_threshold_actions(self, measures: ThresholdActions) -> None:
        if measures.stopped:
            self._link.attempt(lambda: self._driver.safe_stop(measures.stopped))
        if measures.targets:
            paced = Targets(measures.targets, rates=self._gate.set_points.paces(measures.targets))
            self._link.attempt(lambda: self._reports.post(self._driver.targets(paced)))
        self._reports.post(measures.news)

    def _handle_device_return(self, device: Any) -> None:
        """A device is back: stop it where it is, then continue its movement from there."""
        self._link.attempt(lambda: self._driver.safe_stop((device,)))
        self._resume_movements(device)

    def _resume_movements(self, device: Any) -> None:
        """Continue the movements of a device (None: of all) from its position, or end them, as the settings say."""
        if self._settings.resume:
            self._gate.set_points.resume_courses(device, self._clock.now())
        else:
            self._gate.set_points.drop_courses(None if device is None else (device,))

    # Listening.

    def _is_tick_urgent(self) -> bool:
        """The same during a tick, which takes long when many devices are silent: send heartbeats meanwhile."""
        self._reports.post_heartbeat(self._clock.now())
        port = self._link.port
        if port is not None and port.is_quiet:
            # The port has just looked, while it waited for an answer.
            port.is_quiet = False
            return bool(self._inbox.urgent)
        urgent = self._inbox.is_urgent()
        if port is not None:
            # It may have accepted a client, whose stop must not wait for the end of the tick.
            port.beside = tuple(self._inbox.descriptors())
        return urgent

    def _wait_for_tick(self) -> None:
        """Wait for the next tick; a stop that arrives meanwhile is executed at once."""
        due = self._ticker.due
        while self._inbox.receive(due):
            self._execute_urgent()
            self._execute_commands()
            if self._mailbox.ended or self._clock.now() >= due:
                return

    # The master.

    def _execute_urgent(self) -> None:
        while self._inbox.urgent:
            message = self._inbox.urgent.popleft()
            if isinstance(message, Stop | EmergencyStop):
                self._journal.note(message)
            if isinstance(message, Stop):
                self._stop_robot(message.reason, message.epoch)
            elif isinstance(message, EmergencyStop):
                self._order = max(self._order, message.order)
                self._emergency_stop(message.who, message.user)
            else:
                if message.verb == ESTOP:
                    self._emergency_stop(message.who, message.user)
                else:
                    self._stop_robot(f"stop asked by {message.who}")
                message.answer(self._state_fields())

    def _execute_message(self, message: ToWorker, now: float) -> None:
        self._journal.note(message)
        match message:
            case Targets():
                self._accept_targets(message, now)
            case Watch():
                self._health.record_watch(message)
                self._link.attempt(lambda: self._reports.post(self._driver.watch(message, now)))
            case Request():
                self._accept_request(message)
            case Stop():
                self._stop_devices(message)
            case Release():
                self._order = max(self._order, message.order)
                self._release(message)
            case ReleaseKnown():
                self._owed.confirm()
            case Limits():
                self._execute_threshold_actions(self._gate.set_limits(message, now))
            case Writers():
                self._health.writers.update(message.names)
            case Unusable():
                self._health.record_unusable(message)
            case Configure():
                self._settings = self._health.settings = message
                self._driver.configure(message)
                self._ticker = Ticker(1 / message.rate, now)
            case Heartbeat() | EmergencyStop():
                pass

    def _accept_targets(self, message: Targets, now: float) -> None:
        given, news = self._gate.filter_targets(message, now)
        self._reports.post(news)
        if not self._authority.refusal(message.epoch):
            self._health.record_requested(message.values)
        if given:
            self._note_applied(given)
            fresh = Targets(given, message.epoch, message.time, rates=self._gate.set_points.paces(given))
            self._link.attempt(lambda: self._reports.post(self._driver.targets(fresh)))

    def _note_applied(self, given: Mapping[Key, Any]) -> None:
        """Record targets that the driver gets now."""
        self._health.record_applied(given)
        self._journal.note_applied(given)

    def _accept_request(self, message: Request) -> None:
        request, news = self._gate.filter_request(message, self._clock.now())
        self._reports.post(news)
        if request is not None:
            self._requests.append(request)

    def _check_master(self, now: float) -> None:
        timeout = self._settings.dead_man
        since = self._inbox.find_silence(timeout, now)
        if self._driver.waits_for_parent():
            self._inbox.excuse_pause()
        elif timeout and since is not None and self._stopped_for_silence_since != since:
            self._stopped_for_silence_since = since
            self._stop_robot(f"no sign of life from the master for {timeout:g} s")

    # Stopping.

    def _stop_robot(self, reason: str, epoch: int | None = None) -> None:
        """Stop the robot now, or as soon as the link is back; earlier targets and requests are dropped."""
        # The epoch comes first: from here on older targets are refused, also those that still wait in the pipe.
        self._authority.advance(epoch)
        self._gate.set_points.drop_courses()
        self._requests, stale = [], self._requests
        # They are of an older epoch now: those that move something are answered with the refusal.
        for request in stale:
            self._accept_request(request)
        if self._link.port is None or not self._link.attempt(self._driver.safe_stop):
            self._pending_stop_reason = reason
        # The stop may have taken long, and nothing was read meanwhile: that is no silence of the master.
        self._inbox.excuse_pause()
        self._reports.post([Stopped(reason, self._authority.epoch)])

    def _stop_devices(self, message: Stop) -> None:
        """Stop some devices.  While the link is down there is nothing to send: they are stopped when it is back."""
        self._gate.set_points.drop_courses(message.devices)
        if self._link.port is not None:
            self._link.attempt(lambda: self._driver.safe_stop(message.devices))
        self._reports.post([Stopped(message.reason, self._authority.epoch, message.devices)])

    def _emergency_stop(self, who: str, user: str) -> None:
        self._stop_again_at = self._clock.now() + _STOP_AGAIN_PERIOD_S
        self._authority.latch(who, user)
        self._stop_robot(f"emergency stop by {who}")
        # A disk may be slow, or full: the robot does not wait for it.
        self._keep_latches(who)

    def _release(self, release: Release, answer: Callable[[Mapping[str, Any]], None] = lambda told: None) -> None:
        """Release the latches that a user may release; ``answer`` is called when the daemon knows."""
        held = bool(self._authority.holders)
        freed = self._authority.release(release.user, release.others, release.everyone)
        if freed:
            self._keep_latches(release.who, freed)
        elif release.order:
            self._reports.post([self._latched()])
        done = bool(freed) or not held

        def tell() -> None:
            answer(self._state_fields() | {"released": done})

        if freed:
            self._owed.wait(tell)
        else:
            tell()

    def _keep_latches(self, who: str, freed: tuple[str, ...] = ()) -> None:
        problem = self._authority.keep_latches()
        self._reports.post([self._latched(who, freed)])
        if problem:
            self._reports.post([Refused("emergency stop", "latch", problem)])

    def _latched(self, who: str = "", freed: tuple[str, ...] = ()) -> Latched:
        order = max(self._order, self._inbox.dropped_order)
        return Latched(self._authority.latched, who, tuple(self._authority.holders.items()), freed, order)

    def _execute_commands(self) -> None:
        """Execute the commands of the control socket other than stops."""
        self._owed.answer_late()
        while self._inbox.commands:
            command = self._inbox.commands.popleft()
            if command.verb == RELEASE:
                self._release(command.release, command.answer)
                continue
            if command.verb == SUBSCRIBE:
                command.client.subscribed = True
            elif command.verb in (TRACE, RECORD):
                records = command.verb == RECORD
                command.client.records = command.client.records or records
                command.client.traces = command.client.traces or not (records and self._driver.logs_in)
            elif command.verb == VALUES:
                command.client.send_values_at(command.rate, self._clock.now())
            told = self._state_fields()
            if command.verb in (TRACE, RECORD):
                told |= self._traffic.fields(self._link.port)
            if command.verb == RECORD:
                told |= self._journal.fields() | {"wire": not self._driver.logs_in}
                told["writers"] = {str(device): name for device, name in self._health.writers.items()}
                command.client.backlog = self._traffic.opening()
            if command.verb in (STATE, HEALTH):
                told |= self._inventory.state_fields()
            if command.verb == HEALTH:
                told |= self._health.fields(self._clock.now(), self._inbox.heard_at, self._link.port is not None)
                told["scheduling"] = self._processor.scheduling
            command.answer(told)

    def _state_fields(self) -> dict[str, Any]:
        return {
            "epoch": self._authority.epoch,
            "estop": self._authority.latched,
            "holders": [{"user": user, "who": who} for user, who in self._authority.holders.items()],
            "unkept": self._authority.unkept,
            "link": self._link.port is not None,
            "time": self._clock.now(),
        }

    def _execute_requests(self) -> None:
        while self._requests:
            request = self._requests.pop(0)
            unheld = self._gate.explain_unheld(request)
            if unheld:
                self._reports.post([Reply(request.reply_id, False, error=unheld)])
                continue
            if request.verb in self._driver.slow_verbs:
                self._reports.begin_slow_work()
            if not self._link.attempt(lambda request=request: self._reports.post(self._driver.request(request))):  # type: ignore[misc]
                self._reports.post([Reply(request.reply_id, False, error="the link went down")])
            if request.verb in self._driver.slow_verbs:
                self._end_slow_work()
                # The ticks during a slow request were skipped on purpose; they do not count as late.
                self._ticker = Ticker(self._ticker.period, self._clock.now())
            if self._inbox.is_urgent():
                self._execute_urgent()

    # The link.

    def _try_open_link(self) -> None:
        messages = self._link.open()
        if messages is None:
            return
        self._stop_on_link_up()
        if self._link.port is None:
            return
        self._reports.post([LinkState(True), *messages])
        self._resume_movements(None)
        now = self._clock.now()
        self._ticker = Ticker(self._ticker.period, now)
        self._reports.tally.restart(now)

    def _stop_on_link_up(self) -> None:
        """Stop the robot before anything else on a link that was just opened.

        On the first link only devices that move are stopped.  Later, those that this worker has moved, since the fate
        of the last writes is unknown, and those that move without it.  If a stop is pending, or if it is another robot
        than the last one, all of them; nothing that was begun on the last one goes on.
        """
        last, self._identity = self._identity, self._driver.identity or self._identity
        if last not in ("", self._identity):
            self._link.attempt(self._stop_what_moves)
            self._pending_stop_reason = ""
            self._stop_robot(f"another robot answers: {self._identity}, not {last}; it is told to stop")
            return
        if self._pending_stop_reason:
            if self._link.attempt(self._driver.safe_stop):
                self._pending_stop_reason = ""
            return
        first, self._first_link = self._first_link, False
        if first:
            self._link.attempt(self._stop_what_moves)
        else:
            self._link.attempt(lambda: self._tell_what_moved(self._driver.stop_on_reconnect()))

    def _stop_what_moves(self) -> None:
        """Stop the devices that moved when the link was opened.  Raises LinkGone."""
        self._tell_what_moved(self._driver.stop_what_moves())

    def _tell_what_moved(self, moved: tuple[Any, ...]) -> None:
        if moved:
            self._authority.advance()
            which = ", ".join(map(str, moved))
            self._reports.post([Stopped(f"{which} moved when the link was opened", self._authority.epoch)])

    def _end_slow_work(self) -> None:
        self._inbox.excuse_pause()
        self._reports.end_slow_work()
