"""What a far client may ask of a robot, and what is answered: JSON in, JSON out.

Stops go to the bus worker, not through the interpreter; everybody in the fleet may stop.  What moves wants a right, by
the settings of the robot that is to move, and a lease.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import math
import time
import traceback
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from typing import Any, Final

from urbihw.client.errors import ClientError
from urbihw.client.literals import literal
from urbihw.daemon.control_client import NoWorker
from urbihw.fleets.drivers import FarDriver, FarDrivers, FleetRefusal, TooOld, made_in
from urbihw.fleets.names import FleetOrder, is_stop
from urbihw.fleets.served import ServedRobot
from urbihw.fleets.told import number_in
from urbihw.repeats import LimitedLog
from urbihw.web.tree import FREE_CALLS, TELLING_CALLS

log = logging.getLogger("urbihw.fleets")

MAX_BYTES: Final = 64 * 1024
MAX_WAIT_S: Final = 60.0
"""Seconds that a far client may wait for the end of a call."""
MAX_SLOTS: Final = 100
MAX_ARGUMENTS: Final = 8
MAX_SESSION_LENGTH: Final = 40
MOST_ENDED: Final = 1000
"""Ends of clients and calls that are remembered, for orders that come only then."""
Request = Mapping[str, Any]


class OrderDesk:
    """Answers the orders to one robot."""

    def __init__(self, robot: ServedRobot, drivers: FarDrivers) -> None:
        self._robot = robot
        self._drivers = drivers
        self._log = LimitedLog(log)
        self._verbs: Mapping[str, Callable[[str, Request], Awaitable[dict[str, Any]]]] = {
            "estop": lambda who, request: self._obey("estop", who),
            "stop": lambda who, request: self._obey("stop", who),
            "release": lambda who, request: self._obey("release", who),
            "hello": self._hello,
            "read": self._read,
            "write": self._write,
            "call": self._call,
            "cancel": self._cancel,
        }
        self._moving: dict[asyncio.Task[Any], tuple[str, ...]] = {}
        self._ended: dict[tuple[str, ...], float] = {}

    async def answer(self, order: FleetOrder, payload: bytes) -> bytes:
        """The answer to an order, also to one that is refused."""
        try:
            told = await self._do(order, payload)
        except TooOld as error:
            told = {"ok": False, "error": str(error), "old": True}
        except (FleetRefusal, NoWorker, ClientError) as error:
            told = {"ok": False, "error": str(error)}
        except Exception as error:
            text = "our bug in the bridge, at %s of %s: %s"
            self._log.say("bug", text, order.verb[:40], order.who, traceback.format_exc(), level=logging.ERROR)
            told = {"ok": False, "error": f"the bridge failed at this, which is our bug: {type(error).__name__}"}
        return json.dumps(told).encode()

    async def _do(self, order: FleetOrder, payload: bytes) -> dict[str, Any]:
        if not order.who:
            return self._told(order.verb)
        verb = self._verbs.get(order.verb)
        if verb is None:
            raise FleetRefusal(f"there is no {order.verb[:40]!r}; there are: {', '.join(self._verbs)}")
        return {"ok": True, **await verb(order.who, request_in(payload))}

    # ---------------------------------------------------------------- what everybody may

    def _told(self, path: str) -> dict[str, Any]:
        """What a key of the robot itself answers: what it is, its state, a value."""
        robot = self._robot
        if path == "info":
            return {"ok": True, **robot.info()}
        if path == "state":
            return {"ok": True, **robot.state, "drivers": self._drivers.names}
        if path not in robot.values:
            raise FleetRefusal(f"there is no value {path[:60]!r}")
        device = path.rpartition(".")[0]
        return {
            "ok": True, "value": robot.values[path], "t": robot.sampled_at,
            "age": round(time.time() - robot.sampled_at, 3), "who": robot.writers.get(device, ""),
        }  # fmt: skip

    async def _obey(self, verb: str, who: str) -> dict[str, Any]:
        """Stop, emergency stop and release, by the bus worker."""
        told = await self._robot.worker.ask(verb, f"{who} (fleet)")
        holder = str(told.get("estop") or "")
        if told.get("released") is False:
            raise FleetRefusal(f"an emergency stop of {holder} holds: it is not that of {who}")
        return {"estop": holder, "link": told.get("link") is True, "unkept": str(told.get("unkept") or "")}

    async def _hello(self, who: str, request: Request) -> dict[str, Any]:
        """The clock of this robot, by which orders say when they were made, and what the far client may do."""
        return {"now": time.monotonic(), "drive": self._drivers.may_drive(who)}

    async def _read(self, who: str, request: Request) -> dict[str, Any]:
        """The value of any slot of the tree that may be read, now."""
        path = _text_in(request, "slot")
        if not self._robot.tree.slots.get(path, {}).get("readable"):
            raise FleetRefusal(f"there is no slot {path[:60]!r} that can be read")
        async with await self._robot.connect() as robot:
            return {"value": await robot[path]}

    # ---------------------------------------------------------------- what moves

    async def _write(self, who: str, request: Request) -> dict[str, Any]:
        """Write effectors; the limits of the robot hold, and its answer tells what came of them."""
        slots = request.get("slots")
        if not isinstance(slots, dict) or not 0 < len(slots) <= MAX_SLOTS:
            raise FleetRefusal(f"slots: a dictionary of 1 to {MAX_SLOTS} values")
        self._drivers.check_right(who)
        for path, value in slots.items():
            if not self._robot.tree.may_write(path):
                raise FleetRefusal(f"{path[:60]} is no effector of the robot")
            number = number_in(value)
            if number is None or not math.isfinite(number):
                raise FleetRefusal(f"{path}: a number is written from elsewhere")
        wait = _wait_in(request)
        async with self._driver(who, request) as driver:
            written = await driver.robot.write(slots, timeout=wait)
        return {"applied": {path: _known(each.applied) for path, each in written.items()}}

    async def _call(self, who: str, request: Request) -> dict[str, Any]:
        """Call a function of the tree that others may call; what only tells or ends something wants no right."""
        path, args = _text_in(request, "function"), request.get("args", [])
        if not isinstance(args, list) or len(args) > MAX_ARGUMENTS:
            raise FleetRefusal(f"args: a list of at most {MAX_ARGUMENTS}")
        try:
            literal(args)
        except (ValueError, TypeError, OverflowError) as error:
            raise FleetRefusal(f"args: {error}") from None
        if not self._robot.tree.may_call(path):
            raise FleetRefusal(f"{path[:60]} cannot be called from elsewhere")
        name = path.rpartition(".")[2]
        if is_stop(path):
            return {"value": None, **await self._obey("stop", who)}
        if name in FREE_CALLS:
            async with await self._robot.connect() as robot:
                told = await robot[path](*args, timeout=_wait_in(request))
                return {"value": told if name in TELLING_CALLS else None}
        wait = _wait_in(request)
        self._drivers.check_right(who)
        async with self._driver(who, request) as driver:
            await driver.robot[path](*args, timeout=wait)
        return {"value": None}

    @contextlib.asynccontextmanager
    async def _driver(self, who: str, request: Request) -> AsyncIterator[FarDriver]:
        """The connection for an order that moves, which ends with its client, and by its number.

        It can be ended from its receipt on, and its age counts when it is carried out: to connect may take long.
        """
        key = (who, _session_in(request), str(request.get("number") or ""))
        made, task = request.get("made"), asyncio.current_task()
        assert task is not None
        self._drivers.check_age(made)
        if any(made_in(made) <= self._ended.get(end, -math.inf) for end in (key[:2], key)):
            raise FleetRefusal("who has given the order has ended it: it is not carried out any more")
        self._moving[task] = key
        try:
            driver = await self._drivers.driver(who, key[1])
            self._drivers.check_age(made)
            yield driver
        finally:
            del self._moving[task]

    def end(self, *key: str) -> None:
        """End what a far client moves, by its name and session, or the order of a number alone.

        What it has given before and what comes only now is not carried out, either; what it gives later is.
        """
        self._ended.pop(key, None)
        self._ended[key] = time.monotonic()
        if len(self._ended) > MOST_ENDED:
            del self._ended[next(iter(self._ended))]
        for task, of in self._moving.items():
            if of[: len(key)] == key:
                task.cancel()

    async def _cancel(self, who: str, request: Request) -> dict[str, Any]:
        """End a call, also one that is still under way; there may be none of this number any more."""
        number = _text_in(request, "number")
        if self._drivers.may_drive(who) and len(number) <= MAX_SESSION_LENGTH:
            self.end(who, _session_in(request), number)
        return {}


def request_in(payload: bytes) -> Request:
    """What an order says.  Raises FleetRefusal."""
    try:
        if len(payload) > MAX_BYTES:
            raise ValueError
        told = json.loads(payload or b"{}")
    except (ValueError, RecursionError):
        raise FleetRefusal(f"an order is an object of JSON of at most {MAX_BYTES} bytes") from None
    if not isinstance(told, dict):
        raise FleetRefusal("an order is an object of JSON")
    return told


def _text_in(request: Request, key: str) -> str:
    value = request.get(key)
    if not isinstance(value, str) or not value:
        raise FleetRefusal(f"{key}: a text")
    return value


def _session_in(request: Request) -> str:
    """The session of the far client, whose end is the end of what it moves.  Raises FleetRefusal."""
    session = _text_in(request, "session")
    if len(session) > MAX_SESSION_LENGTH or not session.isalnum():
        raise FleetRefusal("session: the last part of the token of the client")
    return session


def _wait_in(request: Request) -> float:
    wait = request.get("timeout", 5.0)
    if isinstance(wait, bool) or not isinstance(wait, int | float) or not 0 < wait <= MAX_WAIT_S:
        raise FleetRefusal(f"timeout: more than 0 and at most {MAX_WAIT_S:g} s")
    return float(wait)


def _known(value: float | None) -> float | None:
    """The value as JSON has it: None for nan, that of a device that is off."""
    return None if value is None or not math.isfinite(value) else value
