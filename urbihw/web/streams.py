"""Requests for what comes again and again: samples, values of devices, pictures, events, the log."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from urbihw.client.literals import literal, string_literal, written_path
from urbihw.web.asked import WebRefusal, number_of, path_of, paths_of
from urbihw.web.lobby import LobbyError
from urbihw.web.session import EVENTS, LOG, PICTURE, SAMPLES, Sub, WebSession

MAX_SUBS: Final = 32
MAX_SLOTS: Final = 1000
MAX_HZ: Final = 200.0
MAX_DEVICE_HZ: Final = 50.0
HEADER_TIMEOUT_S: Final = 3.0
LOOKED_S: Final = 0.2
"""Seconds in which the server has usually looked at all slots; later errors come as events."""
MAX_TOLD: Final = 10
"""Errors in the answer to a subscription of which nothing can be read."""
Request = Mapping[str, Any]


async def subscribe(session: WebSession, request: Request) -> dict[str, Any]:
    """Samples of slots at a rate."""
    slots = paths_of(request, "slots", MAX_SLOTS)
    hz = number_of(request, "hz", 0, MAX_HZ, 20)
    sub, told = await _begin(session, slots, hz)
    await _know_errors(session, sub)
    answer = {"sub": sub.number, "names": told.get("names", slots), "units": told.get("units", [])}
    return {**answer, "errors": sub.errors} if sub.errors else answer


async def picture(session: WebSession, request: Request) -> dict[str, Any]:
    """Pictures, the next one after ``ack``."""
    slot = path_of(request, "slot")
    hz = number_of(request, "hz", 0.1, 60, 10)
    sub = _new(session, PICTURE, lambda sub: f'__web.picture("{sub.channel}", {string_literal(slot)}, {hz:g}) | 1')
    await _ask(session, sub)
    await _know_errors(session, sub)
    session.begin_pictures(sub)
    return {"sub": sub.number}


async def ack(session: WebSession, request: Request) -> None:
    """The picture was drawn: the next one may come.  It has no answer."""
    sub = session.subs.get(int(number_of(request, "sub", 0, 1e9)))
    if sub is not None and sub.kind == PICTURE:
        session.link.begin(f'__web.ready("{sub.channel}") | 1')


async def unsubscribe(session: WebSession, request: Request) -> dict[str, Any]:
    """End samples, pictures or events."""
    session.drop_sub(int(number_of(request, "sub", 0, 1e9)))
    return {}


async def events(session: WebSession, request: Request) -> dict[str, Any]:
    """Events as they happen."""
    slots = paths_of(request, "slots", 100)
    tree = session.gateway.robot.tree
    for slot in slots:
        if session.role != "full" and not tree.is_event(slot):
            raise WebRefusal(f"{slot} is no event of the robot", "role")
    sub = _new(session, EVENTS, lambda sub: " | ".join(
        f'lobby.answerEvents("{sub.channel}_{number}", {written_path(slot)})' for number, slot in enumerate(slots)
    ) + " | 1", slots)  # fmt: skip
    await _ask(session, sub)
    return {"sub": sub.number}


async def values(session: WebSession, request: Request) -> dict[str, Any]:
    """Values of the devices from the worker, which need no interpreter; 0 Hz ends them."""
    hz = number_of(request, "hz", 0, MAX_DEVICE_HZ, 20)
    running = session.tasks.pop("values", None)
    if running is not None:
        running.cancel()
    session.outbox.forget("values")
    worker = session.gateway.robot.worker
    if hz and worker.path is None:
        raise WebRefusal("the bus worker is on another machine", "gone")
    if hz:
        session.tasks["values"] = session.spawn(worker.values(hz, lambda told: _hear_values(session, told)))
    return {}


def _hear_values(session: WebSession, told: Mapping[str, Any]) -> None:
    time = told.get("time")
    if isinstance(time, int | float):
        time = round(session.gateway.robot.server_time(time), 4)
    rows = {"time": time, "lost": told.get("dropped", 0), "values": told.get("values")}
    session.outbox.put_newest("values", {"event": "values", **rows}, 4)


async def log(session: WebSession, request: Request) -> dict[str, Any]:
    """The log of the daemon behind row ``since``, and new rows as they come."""
    since = number_of(request, "since", 0, 1e15, 0)
    if all(sub.kind != LOG for sub in session.subs.values()):
        await _ask(session, _new(session, LOG, lambda sub: f'lobby.answerEvents("{sub.channel}_0", System.logged) | 1'))
    for row in await session.link.json(f"System.logText({since:.0f})"):
        session.say_log(row)
    return {}


def _new(session: WebSession, kind: str, body: Callable[[Sub], str], slots: Sequence[str] = ()) -> Sub:
    if len(session.subs) >= MAX_SUBS:
        raise WebRefusal(f"there are {MAX_SUBS} subscriptions: end one", "limit")
    return session.new_sub(kind, body, slots)


async def _begin(session: WebSession, slots: list[str], hz: float) -> tuple[Sub, dict[str, Any]]:
    """Make a subscription of samples; what the server tells of it."""
    sub = _new(
        session, SAMPLES, lambda made: f'__web.subscribe("{made.channel}", {literal(slots)}, {hz:g}) | 1', slots
    )
    await _ask(session, sub)
    try:
        async with asyncio.timeout(HEADER_TIMEOUT_S):
            told = await asyncio.shield(sub.header)
    except TimeoutError:
        session.drop_sub(sub.number)
        raise LobbyError("the daemon told nothing of the subscription", "gone") from None
    return sub, told


async def _know_errors(session: WebSession, sub: Sub) -> None:
    """Wait until the server has looked at all slots.  Raises LobbyError, and ends the subscription, when none of them
    can be read."""
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(LOOKED_S):
            await sub.begun.wait()
    if sub.failed:
        session.drop_sub(sub.number)
        raise LobbyError("; ".join(f"{slot}: {text}" for slot, text in list(sub.errors.items())[:MAX_TOLD]), "language")


async def _ask(session: WebSession, sub: Sub) -> None:
    try:
        await session.link.ask(sub.body)
    except LobbyError:
        session.drop_sub(sub.number)
        raise
