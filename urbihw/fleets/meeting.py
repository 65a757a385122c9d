"""Where a fleet meets: sessions of zenoh, and the router through which they reach each other.

Scouting is off: robots of two classrooms must not find each other.  On one machine there is no router to start: each
bridge tries to be it, and the port says who is; when that one ends, the next one is, and all others come back by
themselves.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
from collections.abc import AsyncIterator, Iterator
from typing import Any, Final

import zenoh

log = logging.getLogger("urbihw.fleets")

LINK_LEASE_MS: Final = 2000
"""Silence after which a link counts as cut: a pulled plug ends no connection."""
CONNECT_MS: Final = 1000
"""For how long an attempt to connect lasts."""
RETRY: Final = {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 2}
LOOK_S: Final = 0.5
"""Seconds between two looks for a router."""
FIRST_LOOK_S: Final = 0.1
PATIENCE: Final = 30
"""Number of looks for a router in vain after which the log tells it."""


class NoMeeting(Exception):
    """There is no router at the endpoint, or it does not let this one in; the message is one line."""


def _config(mode: str, **rows: Any) -> zenoh.Config:
    config = zenoh.Config()
    for key, value in {"mode": mode, "scouting/multicast/enabled": False, **rows}.items():
        config.insert_json5(key, json.dumps(value))
    config.insert_json5("transport/link/tx/lease", str(LINK_LEASE_MS))
    return config


def open_session(endpoint: str) -> zenoh.Session:
    """A session at the router, which comes back by itself; close it, else the process does not end.  Raises
    NoMeeting."""
    rows = {
        "connect/endpoints": [endpoint], "connect/timeout_ms": CONNECT_MS, "connect/exit_on_failure": True,
        "connect/retry": RETRY,
    }  # fmt: skip
    try:
        return zenoh.open(_config("client", **rows))
    except zenoh.ZError as error:
        log.debug("no session at %s: %s", endpoint, error)
        raise NoMeeting(f"no fleet meets at {endpoint}") from error


def open_router(endpoint: str) -> zenoh.Session:
    """A router at an endpoint of this machine.  Raises NoMeeting, which is usual: another one is the router."""
    try:
        return zenoh.open(_config("router", **{"listen/endpoints": [endpoint]}))
    except zenoh.ZError as error:
        log.debug("no router at %s: %s", endpoint, error)
        raise NoMeeting(f"cannot listen at {endpoint}: it is in use") from error


async def keep_router(endpoint: str) -> None:
    """Take the place of the router as soon as it is free, and keep it until this is cancelled."""
    router = None
    try:
        while router is None:
            if not await is_listened_at(endpoint):
                with contextlib.suppress(NoMeeting):
                    router = open_router(endpoint)
            await asyncio.sleep(LOOK_S)
        await asyncio.get_running_loop().create_future()
    finally:
        if router is not None:
            router.close()


@contextlib.asynccontextmanager
async def joined(endpoint: str) -> AsyncIterator[zenoh.Session]:
    """A session, once there is a router."""
    tries = 0
    while True:
        # Only where somebody listens: an attempt to connect holds the loop.
        if await is_listened_at(endpoint):
            with contextlib.suppress(NoMeeting):
                session = open_session(endpoint)
                break
        tries += 1
        if tries == PATIENCE:
            log.warning("no fleet meets at %s; it is tried again", endpoint)
        await asyncio.sleep(FIRST_LOOK_S if tries < PATIENCE else LOOK_S)
    try:
        yield session
    finally:
        session.close()


async def is_listened_at(endpoint: str) -> bool:
    """Whether somebody listens at an endpoint."""
    host, _, port = endpoint.partition("/")[2].rpartition(":")
    try:
        async with asyncio.timeout(CONNECT_MS / 1000):
            _, writer = await asyncio.open_connection(host.strip("[]"), int(port))
    except OSError:  # TimeoutError, too
        return False
    writer.transport.abort()
    return True


def tokens(session: zenoh.Session, selector: str, timeout: float) -> Iterator[str]:
    """The keys of the tokens that are there, each once."""
    found = set()
    for reply in session.liveliness().get(selector, timeout=timeout):
        if reply.ok is not None:
            found.add(str(reply.ok.key_expr))
    yield from sorted(found)
