"""Supervision of a bus worker: the handle that a robot holds, with the interface of a ``Worker``.

A worker that has died, or hung and was killed, is replaced: at once if it had reached the robot, which may be moving,
some times in a row; otherwise at once the first time, then with back-off.  A spare worker waits for that, since a
process takes a quarter of a second to start, and seconds on a busy machine.  The new one gets the settings, the watches
and the devices of the old one, and first stops everything that moves.  It begins a new epoch, so that no write made for
the old worker moves the robot.

All of this happens in the thread that reads from the worker, so it works while a program holds the interpreter.
"""

from __future__ import annotations

import contextlib
import pickle
import threading
import time
from collections import deque
from dataclasses import replace
from typing import Any, Final

from urbihw.backoff import BackOff
from urbihw.buses.driver import driver_of
from urbihw.buses.errors import BusError, LinkGone
from urbihw.buses.latch_view import LatchView
from urbihw.buses.messages import (
    Begin,
    Configure,
    EmergencyStop,
    Ended,
    Found,
    FromWorker,
    Heartbeat,
    Latched,
    Limits,
    LinkState,
    Release,
    Reply,
    Request,
    Stop,
    Stopped,
    Targets,
    ToWorker,
    Watch,
    WorkerState,
)
from urbihw.buses.worker import Post, SpareWorker, Worker, WorkerBusy

FIRST_BACK_OFF_S: Final = 1.0
LAST_BACK_OFF_S: Final = 2.0
"""Longest pause in s: while there is no worker, nothing stops a moving robot."""
STEADY_AFTER_S: Final = 10.0
"""Seconds of work after which a worker that ends is replaced at once again."""
MOST_AT_ONCE: Final = 5
"""Workers that had reached the robot and are replaced at once; behind them the pauses bound the cost of starts."""
MAX_QUEUED: Final = 10_000
"""Messages that may be queued for a worker that does not read."""
LAST_STOP_TIMEOUT_S: Final = 3.0
"""Seconds in which a worker that was started only to stop the robot must have done so."""


class Supervisor:
    """A supervised worker, replaced whenever it dies until ``stop`` is called.  Made by ``start``."""

    def __init__(self, url: str, post: Post, begin: Begin, family: str) -> None:
        self._url = url
        self._post = post
        self._begin = begin
        self._family = family
        self._lock = threading.RLock()
        self._watches: dict[tuple[Any, str], float] = {}
        self._limits: Limits | None = None
        self._epoch = begin.epoch
        self._latches = LatchView()
        self._order = 0
        self._backlog: deque[ToWorker] = deque()
        self._link_up = False
        self._found = Found(())
        self._back_off = BackOff(FIRST_BACK_OFF_S, LAST_BACK_OFF_S, at_once=True)
        self._stopping = threading.Event()
        self._started_at = time.monotonic()
        self._can_move = driver_of(family).can_move
        self._reached_robot = False
        self._replaced_at_once = 0
        self._spare: SpareWorker | None = None
        self._dead = False
        with self._lock:
            # The lock delays the end message of a worker that dies at once until ``_worker`` is set.
            self._worker = Worker.start(url, post=self._handle_message, begin=begin, family=family)

    @classmethod
    def start(cls, url: str, *, post: Post, settings: Configure, family: str, control: str = "") -> Supervisor:
        """Start a supervised worker; as ``Worker.start``.  ``control`` is the path of its control socket."""
        return cls(url, post, Begin(settings, control=control), family)

    def send(self, message: ToWorker) -> None:
        """Send a message to the present worker.

        Targets for which the pipe has no room are dropped, since newer ones follow.  All others are queued in order.
        """
        with self._lock:
            self._record_message(message)
            self._backlog.append(message)
            while self._backlog and self._try_send(self._backlog[0]):
                self._backlog.popleft()
            if self._backlog and isinstance(self._backlog[-1], Targets | Heartbeat):
                self._backlog.pop()

    def _try_send(self, message: ToWorker) -> bool:
        """Return whether a message is done with: sent, or dropped because the worker has ended."""
        try:
            self._worker.send(message)
        except WorkerBusy:
            return len(self._backlog) > MAX_QUEUED
        except LinkGone as error:
            self._refuse(message, str(error))
        except (TypeError, AttributeError, pickle.PicklingError, RecursionError) as error:
            # A value that no other process can get: nothing of the message was sent, and the next one goes through.
            self._refuse(message, f"this cannot be sent to the bus worker: {error}")
        return True

    def _refuse(self, message: ToWorker, reason: str) -> None:
        if isinstance(message, Request):
            self._post(Reply(message.reply_id, False, error=reason))

    def stop(self) -> None:
        """Let the worker stop the robot and end.  If it cannot, another worker is started only to stop the robot."""
        with self._lock:
            self._stopping.set()
            worker, dead = self._worker, self._dead
        try:
            if worker.alive and not worker.silent and not dead:
                worker.stop()
                if not worker.killed and not self._dead:
                    return
            else:
                worker.kill()
            self._stop_directly()
        finally:
            spare = self._take_spare()
            if spare is not None:
                spare.close()

    # ---------------------------------------------------------------- inside

    def _record_message(self, message: ToWorker) -> None:
        match message:
            case Watch():
                for item in message.items or ("",):
                    if message.period is None:
                        self._watches.pop((message.device, item), None)
                    else:
                        self._watches[message.device, item] = message.period
            case Limits():
                self._limits = message
            case EmergencyStop():
                self._order = message.order
                self._latches.order(message)
            case Release():
                # Not shown before the worker has granted it: a press that it has not read must outlive it.
                self._order = message.order
            case Configure():
                self._begin = replace(self._begin, settings=message)
            case Targets() | Stop():
                self._epoch = max(self._epoch, message.epoch)
            case _:
                pass

    def _handle_message(self, message: FromWorker) -> None:
        """Record and post a message; called in the reader thread of a worker's handle."""
        match message:
            case Found():
                self._begin = replace(self._begin, devices=message.devices)
                self._found = message
            case LinkState():
                self._link_up = message.up
                if message.up and self._can_move:
                    self._reached_robot = True
                    self._prepare_spare()
            case Stopped():
                self._epoch = max(self._epoch, message.epoch)
            case Latched():
                with self._lock:
                    self._latches.report(message)
            case WorkerState():
                self._handle_worker_state(message)
                return
            case Ended():
                self._handle_end(message)
                return
            case _:
                pass
        self._post(message)

    def _handle_worker_state(self, message: WorkerState) -> None:
        """The worker is silent, or answers again: begin a new epoch, since its present motion is no longer valid."""
        if message.reason:
            with self._lock, contextlib.suppress(LinkGone):
                self._epoch += 1
                self._worker.send(Stop(self._epoch, message.reason))
        self._post(message)
        if not message.reason and self._link_up:
            self._post(LinkState(True))
            self._post(self._found)

    def _handle_end(self, message: Ended) -> None:
        reason = message.reason or "the bus worker has ended"
        with self._lock:
            self._dead = bool(message.reason) or not self._stopping.is_set()
        while not self._stopping.is_set():
            self._link_up = False
            self._post(WorkerState(f"{reason}; another one is started"))
            if self._stopping.wait(self._next_pause()):
                break
            try:
                self._replace_worker(reason)
                return
            except (BusError, OSError) as error:
                reason = f"no bus worker can be started: {error}"
        self._post(message)

    def _next_pause(self) -> float:
        """Return the seconds to wait before the next worker is started."""
        if time.monotonic() - self._started_at > STEADY_AFTER_S:
            self._back_off.reset()
            self._replaced_at_once = 0
        reached, self._reached_robot = self._reached_robot, False
        if reached and self._replaced_at_once < MOST_AT_ONCE:
            self._replaced_at_once += 1
            return 0.0
        return self._back_off.next_pause()

    def _prepare_spare(self) -> None:
        """Start a spare worker if there is none; when the robot has been reached, so that it does not delay that."""
        with self._lock, contextlib.suppress(OSError):
            if self._spare is None and not self._stopping.is_set():
                self._spare = SpareWorker(self._url, self._family)

    def _take_spare(self) -> SpareWorker | None:
        with self._lock:
            spare, self._spare = self._spare, None
        return spare

    def _replace_worker(self, reason: str) -> None:
        with self._lock:
            if self._stopping.is_set():
                return
            self._started_at = time.monotonic()
            # The queue was meant for the worker that ended; its requests have been answered with an error.
            self._backlog.clear()
            self._epoch += 1
            self._begin = replace(self._begin, restarts=self._begin.restarts + 1)
            begin = replace(
                self._begin,
                epoch=self._epoch,
                instead=reason,
                watches=self._all_watches(),
                holders=tuple(self._latches.holders.items()),
                order=self._order,
            )
            self._worker = Worker.start(
                self._url, post=self._handle_message, begin=begin, family=self._family, spare=self._take_spare()
            )
            self._dead = False
            if self._limits is not None:
                # A worker that has died already posts its own ``Ended``.
                with contextlib.suppress(LinkGone):
                    self._worker.send(self._limits)

    def _all_watches(self) -> tuple[Watch, ...]:
        """Return the present watches in as few messages as possible."""
        alike: dict[tuple[Any, float], list[str]] = {}
        for (device, item), period in self._watches.items():
            alike.setdefault((device, period), []).extend([item] if item else [])
        return tuple(Watch(device, tuple(items), period) for (device, period), items in alike.items())

    def _stop_directly(self) -> None:
        """The worker died and may have left the robot moving: start another one to stop it."""
        opened = threading.Event()

        def hear(message: FromWorker) -> None:
            if isinstance(message, LinkState) and message.up:
                opened.set()

        with contextlib.suppress(BusError, OSError):
            begin = replace(self._begin, epoch=self._epoch + 1, instead="the daemon ends", control="")
            worker = Worker.start(
                self._url, post=hear, begin=begin, family=self._family, spare=self._take_spare()
            )
            opened.wait(LAST_STOP_TIMEOUT_S)
            worker.stop()
        self._post(Ended("" if opened.is_set() else "the robot could not be stopped: its bus worker was dead"))
