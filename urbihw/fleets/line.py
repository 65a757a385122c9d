"""The fleet as one who asks: who is there, what they tell, orders with answers.  Blocking, for any thread.

Each question has a time-out, and each error names the robot.
"""

from __future__ import annotations

import contextlib
import getpass
import json
import math
import secrets
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import Any, Final, NamedTuple

import zenoh

from urbihw.fleets.meeting import open_session, tokens
from urbihw.fleets.names import (
    ALL,
    DEFAULT_ENDPOINT,
    FleetKeys,
    checked_endpoint,
    checked_fleet_name,
    fleet_name_of,
    is_stop,
    owner_in,
)
from urbihw.fleets.told import NotTold, told_in, values_in

ANSWER_TIMEOUT_S: Final = 3.0
STOP_TIMEOUT_S: Final = 1.5
"""Seconds within which a bus worker has confirmed a stop, else it is named as one that has not."""
LOOK_TIMEOUT_S: Final = 0.5
HELLOS: Final = 3
"""Questions for the time of a robot before the first order, unless one is answered in ``QUICK_S``."""
QUICK_S: Final = 0.05
TRUSTED_S: Final = 60.0
"""Seconds for which the quickest answer about the clock of a robot counts: it may have started again."""
BEATS: Final = 5
"""Signs of life within a dead man's time."""


class FleetError(Exception):
    """A robot refused, or did not answer; the message is one line that names it."""


class FleetTooOld(FleetError):
    """An order was long on its way to a robot, and has moved nothing."""


class FleetTimedOut(FleetError, TimeoutError):
    """A robot is not in the fleet, or did not answer in time."""


class StopTold(NamedTuple):
    """What became of a stop: ``confirmed`` is the seconds until a robot's worker had done it, by the robot's name;
    ``failed`` tells for the others why it is not confirmed."""

    confirmed: dict[str, float]
    failed: dict[str, str]


class FleetLine:
    """A session in a fleet, under a name: ``with FleetLine("school", "teacher") as line``.

    ``fleet`` "" is the only one that meets there.  ``is_alive`` tells whether the one who asks through this session
    lives: without that, what it moves gets no signs of life.  Raises NoMeeting, BadEndpoint, BadFleetName; FleetError
    when there are several fleets.
    """

    def __init__(self, fleet: str = "", name: str = "", endpoint: str = DEFAULT_ENDPOINT) -> None:
        name = checked_fleet_name(name) if name else fleet_name_of(getpass.getuser())
        self._session = open_session(checked_endpoint(endpoint))
        try:
            self.keys = FleetKeys(checked_fleet_name(fleet or self._only_fleet(endpoint)), name)
            self._instance = secrets.token_hex(8)
            self._token = self._session.liveliness().declare_token(self.keys.client(self._instance))
        except BaseException:
            self._session.close()
            raise
        self._driven: dict[str, _Driven] = {}
        self._lock = threading.Lock()
        self._ending = threading.Event()
        self.is_alive: Callable[[], bool] = lambda: True

    def _only_fleet(self, endpoint: str) -> str:
        found = sorted({owner_in(key)[0] for key in tokens(self._session, f"{ALL}/{ALL}/robot/*", LOOK_TIMEOUT_S)})
        if len(found) != 1:
            known = f"several fleets meet there: {', '.join(found)}" if found else "no robot is there"
            raise FleetError(f"{endpoint}: {known}; name the fleet")
        return found[0]

    def close(self) -> None:
        """Leave: what this one moves stops.  Calling it twice is fine."""
        self._ending.set()
        if not self._session.is_closed():
            self._session.close()

    def __enter__(self) -> FleetLine:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # ---------------------------------------------------------------- who is there, what they tell

    def robots(self) -> list[str]:
        """The names of the robots that are there."""
        keys = FleetKeys(self.keys.fleet, ALL)
        return [owner_in(key)[1] for key in tokens(self._session, keys.robots, LOOK_TIMEOUT_S)]

    def info(self, robot: str) -> dict[str, Any]:
        """Platform, version, slots with units.  Raises FleetError."""
        return self._asked(robot, FleetKeys(self.keys.fleet, robot).info, {})

    def state(self, robot: str) -> dict[str, Any]:
        """Link, emergency stop, battery, verdict, who drives.  Raises FleetError."""
        return self._asked(robot, FleetKeys(self.keys.fleet, robot).state, {})

    def value(self, robot: str, path: str) -> dict[str, Any]:
        """The last published ``value`` of a slot, its time ``t``, its ``age`` in s, ``who`` moved the device.  Raises
        FleetError."""
        return self._asked(robot, FleetKeys(self.keys.fleet, robot).slot(path), {})

    def watch(self, robot: str, timeout: float) -> Iterator[tuple[str, Mapping[str, Any]]]:
        """What robots publish, as it comes: the name, and ``{"n", "t", "v"}``; ``ALL`` for all.  Ends after so many
        seconds without any."""
        heard: SimpleQueue[zenoh.Sample] = SimpleQueue()
        subscriber = self._session.declare_subscriber(FleetKeys(self.keys.fleet, robot).values, heard.put)
        try:
            while True:
                sample = heard.get(timeout=timeout)
                with contextlib.suppress(NotTold):
                    told = values_in(bytes(sample.payload))
                    yield owner_in(str(sample.key_expr))[1], told
        except Empty:
            return
        finally:
            if not self._session.is_closed():
                subscriber.undeclare()

    def hear(self, on_robot: Callable[[str, bool], None]) -> object:
        """Call a function, in a thread of zenoh, with each robot that comes (True) and goes; keep what is returned."""
        def heard(sample: zenoh.Sample) -> None:
            on_robot(owner_in(str(sample.key_expr))[1], sample.kind == zenoh.SampleKind.PUT)

        keys = FleetKeys(self.keys.fleet, ALL)
        return self._session.liveliness().declare_subscriber(keys.robots, heard, history=True)

    def hear_values(self, on_values: Callable[[str, Mapping[str, Any]], None]) -> object:
        """Call a function, in a thread of zenoh, with what each robot publishes; keep what is returned."""
        def heard(sample: zenoh.Sample) -> None:
            with contextlib.suppress(NotTold):
                on_values(owner_in(str(sample.key_expr))[1], values_in(bytes(sample.payload))["v"])

        return self._session.declare_subscriber(FleetKeys(self.keys.fleet, ALL).values, heard)

    # ---------------------------------------------------------------- stops

    def stop(self, verb: str = "estop", robot: str = ALL) -> StopTold:
        """Stop, emergency stop or release, of one robot or of all at once.

        Each robot's bus worker does it and answers; who is there and has not answered is named.  It overtakes all else
        in the network.
        """
        begin = time.monotonic()
        confirmed: dict[str, float] = {}
        failed: dict[str, str] = {}
        replies = self._session.get(
            self.keys.order(robot, verb), payload=b"{}", target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE, timeout=STOP_TIMEOUT_S, priority=zenoh.Priority.REAL_TIME,
            congestion_control=zenoh.CongestionControl.BLOCK, express=True,
        )  # fmt: skip
        for reply in replies:
            if reply.ok is not None:
                name, told = owner_in(str(reply.ok.key_expr))[1], _answer_in(reply.ok)
                if told.get("ok"):
                    confirmed[name] = time.monotonic() - begin
                else:
                    failed[name] = str(told.get("error"))
        silent = {*(self.robots() if robot == ALL else [robot])} - {*confirmed, *failed}
        failed |= dict.fromkeys(silent, f"has not confirmed it within {STOP_TIMEOUT_S:g} s")
        return StopTold(confirmed, failed)

    # ---------------------------------------------------------------- orders

    def read(self, robot: str, path: str, timeout: float = ANSWER_TIMEOUT_S) -> Any:
        """The value of any slot that may be read, now.  Raises FleetError."""
        return self._order(robot, "read", {"slot": path}, timeout)["value"]

    def write(
        self, robot: str, slots: Mapping[str, float], timeout: float = ANSWER_TIMEOUT_S, task: FleetTask | None = None
    ) -> dict[str, Any]:
        """Write effectors of a robot that lets this one drive: ``applied`` after its limits.  Raises FleetError."""
        task = task or FleetTask()
        told: dict[str, Any] = self._move(robot, "write", {"slots": dict(slots)}, timeout, task)["applied"]
        return told

    def call(
        self, robot: str, path: str, *args: Any, timeout: float = ANSWER_TIMEOUT_S, task: FleetTask | None = None
    ) -> Any:
        """Call a function of the robot that others may call, and wait for its end.  Raises FleetError.

        A function ``stop`` overtakes all else in the network, as ``FleetLine.stop`` does.
        """
        if is_stop(path):
            self._order(robot, "stop", {}, timeout, zenoh.Priority.REAL_TIME)
            return None
        task = task or FleetTask()
        request = {"function": path, "args": list(args)}
        if self.hello(robot):
            return self._move(robot, "call", request, timeout, task)["value"]
        return self._order(robot, "call", request, timeout)["value"]

    def cancel(self, robot: str, number: str) -> None:
        """End a call of this session that another thread waits for.  Raises FleetError."""
        self._order(robot, "cancel", {"number": number, "session": self._instance}, ANSWER_TIMEOUT_S)

    def hello(self, robot: str, timeout: float = ANSWER_TIMEOUT_S) -> bool:
        """Whether the robot lets this one drive.  Raises FleetError."""
        begin = time.monotonic()
        told = self._order(robot, "hello", {}, timeout)
        now = time.monotonic()
        with self._lock:
            driven = self._driven.setdefault(robot, _Driven())
            # The answer was under way: an order seems older to the robot than it is, never younger.  The quickest
            # answer tells it best.
            if now - begin <= driven.took or now > driven.until:
                driven.took, driven.until = now - begin, now + TRUSTED_S
                driven.ahead = float(told["now"]) - now
        return told["drive"] is True

    def _move(
        self, robot: str, verb: str, request: dict[str, Any], timeout: float, task: FleetTask
    ) -> dict[str, Any]:
        """Give an order that moves, and signs of life from then on."""
        for _ in range(HELLOS):
            if robot in self._driven and self._driven[robot].is_known(time.monotonic()):
                break
            self.hello(robot)
        driven = self._driven[robot]
        self._feed(robot, driven)
        made = time.monotonic() + driven.ahead
        # After the time was taken: an end that comes now comes to the robot as one behind this order.
        if task.ended:
            raise FleetError(f"{robot}: the job that has asked has ended")
        told = {**request, "number": task.number, "made": made, "session": self._instance}
        try:
            return self._order(robot, verb, told, timeout)
        except FleetTooOld:
            driven.until = 0.0  # its clock may be another one since it was started again: the next order asks for it
            raise

    def _feed(self, robot: str, driven: _Driven) -> None:
        if driven.thread is not None:
            return
        period = float(self.info(robot)["dead_man"]) / BEATS
        with self._lock:
            if driven.thread is None:
                work = threading.Thread(target=self._beat, args=(robot, driven, period), name="fleet", daemon=True)
                driven.thread = work
                work.start()

    def _beat(self, robot: str, driven: _Driven, period: float) -> None:
        key = self.keys.order(robot, "beat")
        while not self._ending.wait(period):
            if not self.is_alive():
                continue
            if time.monotonic() > driven.until - period:
                # Clocks run apart.  An answer that does not come at once must not keep the signs of life.
                try:
                    self.hello(robot, period)
                except (FleetError, zenoh.ZError):
                    driven.until = time.monotonic() + 1.0
            told = {"session": self._instance, "made": time.monotonic() + driven.ahead}
            try:
                self._session.put(
                    key, json.dumps(told), priority=zenoh.Priority.INTERACTIVE_HIGH, express=True,
                    congestion_control=zenoh.CongestionControl.DROP,
                )  # fmt: skip
            except zenoh.ZError:
                return  # the session is closed

    def _order(
        self, robot: str, verb: str, request: dict[str, Any], timeout: float,
        priority: zenoh.Priority = zenoh.Priority.DATA,
    ) -> dict[str, Any]:  # fmt: skip
        told = {**request, "timeout": timeout}
        return self._asked(robot, self.keys.order(checked_fleet_name(robot), verb), told, timeout, priority)

    def _asked(
        self, robot: str, key: str, request: dict[str, Any], timeout: float = ANSWER_TIMEOUT_S,
        priority: zenoh.Priority = zenoh.Priority.DATA,
    ) -> dict[str, Any]:  # fmt: skip
        """The answer of one robot.  Raises FleetError."""
        checked_fleet_name(robot)
        payload = json.dumps(request).encode()
        replies = self._session.get(
            key, payload=payload, target=zenoh.QueryTarget.ALL, timeout=timeout, express=True, priority=priority,
            congestion_control=zenoh.CongestionControl.BLOCK,
        )  # fmt: skip
        for reply in replies:
            if reply.ok is not None:
                told = _answer_in(reply.ok)
                if told.get("old"):
                    raise FleetTooOld(f"{robot}: {told.get('error')}")
                if not told.pop("ok", False):
                    raise FleetError(f"{robot}: {told.get('error')}")
                return told
        if robot not in self.robots():
            raise FleetTimedOut(f"{robot} is not in the fleet {self.keys.fleet}")
        raise FleetTimedOut(f"{robot} has not answered within {timeout:g} s")


def _answer_in(sample: zenoh.Sample) -> dict[str, Any]:
    """What a robot answers; rubbish is an answer with an error."""
    try:
        return told_in(bytes(sample.payload))
    except NotTold as error:
        return {"error": str(error)}


class FleetTask:
    """What one who asks can end, in another thread.  ``number`` names it for ``FleetLine.cancel``, "" for none; set
    ``ended``, then cancel."""

    def __init__(self, number: str = "") -> None:
        self.number = number
        self.ended = False


class _Driven:
    """A robot that this one drives: how far its clock is ahead, the time that the answer took which told it, until when
    that is trusted, in s, and the thread of the signs of life."""

    def __init__(self) -> None:
        self.ahead = 0.0
        self.took = math.inf
        self.until = 0.0
        self.thread: threading.Thread | None = None

    def is_known(self, now: float) -> bool:
        """Whether its clock is known well enough for an order."""
        return self.took < QUICK_S and now <= self.until
