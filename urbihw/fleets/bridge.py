"""The bridge of a robot to its fleet: tokens, values, events and state out, orders in.

Callbacks of zenoh come in threads of its own: they hand over to the event loop, in which all else happens.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import secrets
from collections.abc import Callable, Coroutine
from typing import Any, Final

import zenoh

from urbihw.fleets.drivers import FarDrivers, FleetRefusal
from urbihw.fleets.meeting import joined, keep_router, tokens
from urbihw.fleets.names import FleetKeys, FleetOrder, owner_in
from urbihw.fleets.orders import OrderDesk, request_in
from urbihw.fleets.served import ServedRobot
from urbihw.fleets.settings import FleetSettings

log = logging.getLogger("urbihw.fleets")

LOOK_TIMEOUT_S: Final = 0.5
"""Seconds within which those who are there are known."""
TAKEN_PATIENCE_S: Final = 3.0
"""Seconds for which a name may be taken by a bridge that has died with its machine: its link counts as cut then."""
MOST_PENDING: Final = 64
"""Orders that may wait for an answer; of others only stops are taken."""
STOPS: Final = ("estop", "stop")
MOST_STOPS: Final = 32
"""Emergency stops that may wait for an answer of the bus worker, and stops."""
BUSY: Final = json.dumps({"ok": False, "error": "too many orders wait for an answer"})


class NameTaken(Exception):
    """Another robot of the fleet has this name; the message is one line."""


class FleetBridge:
    """``await FleetBridge(settings, robot).run()`` until it is cancelled.  Raises NameTaken.

    Attributes:
        here: set while the robot is in the fleet.
    """

    def __init__(self, settings: FleetSettings, robot: ServedRobot) -> None:
        self.settings = settings
        self.robot = robot
        self.keys = FleetKeys(settings.fleet, settings.name)
        self.instance = secrets.token_hex(8)
        self.here = asyncio.Event()
        self._drivers = FarDrivers(robot.connect, settings.drive, settings.dead_man)
        self._desk = OrderDesk(robot, self._drivers)
        self._loop = asyncio.get_running_loop()
        self._pending: dict[asyncio.Task[None], str] = {}
        self._refused: asyncio.Future[None] = self._loop.create_future()
        self._sent = 0

    async def run(self) -> None:
        """Join the fleet, and serve it."""
        routing = self._loop.create_task(keep_router(self.settings.endpoint))
        try:
            async with joined(self.settings.endpoint) as session:
                await self._take_name(session)
                await self._serve(session)
        finally:
            routing.cancel()
            await asyncio.wait((routing,))

    async def _serve(self, session: zenoh.Session) -> None:
        held = self._declare(session)
        watching = self._loop.create_task(self.robot.run())
        log.info("in the fleet %s as %s, at %s", *self._place())
        self.here.set()
        try:
            await asyncio.wait((watching, self._refused), return_when=asyncio.FIRST_COMPLETED)
            for each in (watching, self._refused):
                if each.done():
                    each.result()
        finally:
            pending = [watching, *self._pending]
            for task in pending:
                task.cancel()
            await asyncio.gather(*pending, return_exceptions=True)
            await self._drivers.end_all()
            held.clear()

    def _place(self) -> tuple[str, str, str]:
        return self.settings.fleet, self.settings.name, self.settings.endpoint

    async def _take_name(self, session: zenoh.Session) -> None:
        """Wait for the name of a bridge that has just died.  Raises NameTaken while another one lives."""
        until = self._loop.time() + TAKEN_PATIENCE_S
        while (others := self._others(session)) and self._loop.time() < until:
            await asyncio.sleep(LOOK_TIMEOUT_S)
        if others:
            raise NameTaken(self._taken())

    def _others(self, session: zenoh.Session) -> list[str]:
        found = tokens(session, self.keys.robots, LOOK_TIMEOUT_S)
        return [each for each in found if owner_in(each)[2] != self.instance]

    def _taken(self) -> str:
        fleet, name, endpoint = self._place()
        return f"a robot of the fleet {fleet} at {endpoint} is called {name} already: give this one another name"

    # ---------------------------------------------------------------- out

    def _declare(self, session: zenoh.Session) -> list[object]:
        """Be there: publish, and answer; returns what must be kept for that."""
        drop, block = zenoh.CongestionControl.DROP, zenoh.CongestionControl.BLOCK
        values = session.declare_publisher(self.keys.values, congestion_control=drop, express=True)
        state = session.declare_publisher(self.keys.state, congestion_control=drop)

        def put_values() -> None:
            self._sent += 1
            told = {"n": self._sent, "t": self.robot.sampled_at, "v": self.robot.values}
            values.put(json.dumps(told))

        def put_state() -> None:
            state.put(json.dumps({**self.robot.state, "drivers": self._drivers.names}))

        def put_event(name: str, at: float, args: tuple[Any, ...]) -> None:
            told = json.dumps({"t": at, "args": args}, default=str)
            session.put(self.keys.event(name), told, congestion_control=block, express=True)

        self.robot.on_values, self.robot.on_state, self.robot.on_event = put_values, put_state, put_event
        return [
            values,
            state,
            session.declare_queryable(self.keys.everything, self._hear_query),
            session.declare_subscriber(self.keys.beats, self._hear_beat),
            session.liveliness().declare_subscriber(
                FleetKeys(self.settings.fleet, "*").clients, self._hear_client, history=False
            ),
            session.liveliness().declare_subscriber(self.keys.robots, self._hear_namesake, history=True),
            session.liveliness().declare_token(self.keys.robot(self.instance)),
        ]

    # ---------------------------------------------------------------- in, from threads of zenoh

    def _hear_query(self, query: zenoh.Query) -> None:
        order = self.keys.order_in(str(query.key_expr))
        if order is not None:
            self._post(self._begin, order, bytes(query.payload) if query.payload is not None else b"", query)

    def _hear_beat(self, sample: zenoh.Sample) -> None:
        order = self.keys.order_in(str(sample.key_expr))
        if order is not None:
            self._post(self._beat, order.who, bytes(sample.payload))

    def _hear_client(self, sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.DELETE:
            self._post(self._lose_client, str(sample.key_expr))

    def _hear_namesake(self, sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.PUT:
            self._post(self._meet_namesake, owner_in(str(sample.key_expr))[2])

    def _post(self, work: Callable[..., None], *args: Any) -> None:
        with contextlib.suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(work, *args)

    # ---------------------------------------------------------------- in, in the loop

    def _spawn(self, work: Coroutine[Any, Any, None], verb: str = "") -> None:
        task = self._loop.create_task(work)
        self._pending[task] = verb
        task.add_done_callback(self._pending.pop)

    def _begin(self, order: FleetOrder, payload: bytes, query: zenoh.Query) -> None:
        # Each kind of stop has its own bound: a flood of one keeps no other.
        same = sum(verb == order.verb for verb in self._pending.values())
        if same < MOST_STOPS if order.verb in STOPS else len(self._pending) < MOST_PENDING:
            self._spawn(self._answer(order, payload, query), order.verb)
            return
        with query:
            query.reply(self.keys.answer_to(order), BUSY, express=True)

    async def _answer(self, order: FleetOrder, payload: bytes, query: zenoh.Query) -> None:
        # The far side waits until the query is closed.
        with query:
            answer = await self._desk.answer(order, payload)
            query.reply(self.keys.answer_to(order), answer, express=True)

    def _beat(self, who: str, payload: bytes) -> None:
        try:
            request = request_in(payload)
        except FleetRefusal:
            return
        self._drivers.feed(who, str(request.get("session")), request.get("made"))

    def _lose_client(self, key: str) -> None:
        _, who, session = owner_in(key)
        self._desk.end(who, session)
        self._spawn(self._drivers.end(who, session))

    def _meet_namesake(self, instance: str) -> None:
        """Two have taken the name at the same moment: the one with the smaller number has it."""
        if instance < self.instance and not self._refused.done():
            self._refused.set_exception(NameTaken(self._taken()))
