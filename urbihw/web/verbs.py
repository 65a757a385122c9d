"""What a browser may ask: the verbs of the protocol, and the roles that may use each."""

from __future__ import annotations

import time
from collections.abc import Awaitable, Callable, Mapping
from typing import Any, Final, NamedTuple

from urbihw.daemon.control_client import NoWorker
from urbihw.web import language, moving, streams
from urbihw.web.asked import WebRefusal, names_of
from urbihw.web.lobby import LobbyError
from urbihw.web.session import WebSession

_ALL: Final = ("view", "drive", "full")
_DRIVING: Final = ("drive", "full")
_FULL: Final = ("full",)
MAX_OTHERS: Final = 64
"""Emergency stops of others that may be released at a time."""
Request = Mapping[str, Any]


class Verb(NamedTuple):
    """A verb: the roles that may use it, the function that does it, and whether it waits for the daemon right behind
    the opening.  What the worker does, and orders of a pad, which must not be old, do not wait."""

    roles: tuple[str, ...]
    run: Callable[[WebSession, Request], Awaitable[dict[str, Any] | None]]
    waits: bool = True


async def tree(session: WebSession, request: Request) -> dict[str, Any]:
    """The tree of the robot; null while it is not known."""
    return {"tree": session.gateway.robot.tree.told}


async def figure(session: WebSession, request: Request) -> dict[str, Any]:
    """The figure of the robot: its links with their joints and shapes; null while there is no robot."""
    return {"figure": await session.gateway.robot.figure()}


async def obey(session: WebSession, request: Request) -> dict[str, Any]:
    """Stop, emergency stop and release: by the worker, which does not need the interpreter; for a robot of another
    machine by the daemon.  ``of``: the names of others whose emergency stops are released, too."""
    robot, verb = session.gateway.robot, str(request["do"])
    others = names_of(request, "of", MAX_OTHERS) if "of" in request and verb == "release" else []
    if others and session.role not in _FULL:
        raise WebRefusal("the role full releases the emergency stops of others", "role")
    began = time.monotonic()
    try:
        told = await robot.obey(verb, session.title, session.daemon, others)
    except (NoWorker, LobbyError) as error:
        if verb == "release" and isinstance(error, LobbyError) and error.code == "language":
            raise WebRefusal(str(error), "held") from error
        raise WebRefusal(f"NOT CONFIRMED: {error}", "gone") from error
    milliseconds = round(1000 * (time.monotonic() - began), 1)
    looking = session.tasks.get("look")
    if looking is None or looking.done():
        session.tasks["look"] = session.spawn(robot.look())
    return {"confirmed": True, "ms": milliseconds, "by": "daemon" if robot.is_remote else "worker", **told}


VERBS: Final[dict[str, Verb]] = {
    "stop": Verb(_ALL, obey, waits=False),
    "estop": Verb(_ALL, obey, waits=False),
    "release": Verb(_DRIVING, obey, waits=False),
    "tree": Verb(_ALL, tree, waits=False),
    "figure": Verb(_ALL, figure, waits=False),
    "subscribe": Verb(_ALL, streams.subscribe),
    "unsubscribe": Verb(_ALL, streams.unsubscribe, waits=False),
    "values": Verb(_ALL, streams.values, waits=False),
    "picture": Verb(_ALL, streams.picture),
    "ack": Verb(_ALL, streams.ack, waits=False),
    "events": Verb(_ALL, streams.events),
    "log": Verb(_ALL, streams.log),
    "get": Verb(_ALL, moving.get),
    "set": Verb(_DRIVING, moving.set_slot),
    "sound": Verb(_DRIVING, moving.play_sound),
    "call": Verb(_DRIVING, moving.call),
    "drive": Verb(_DRIVING, moving.drive, waits=False),
    "go": Verb(_DRIVING, moving.go),
    "lease": Verb(_DRIVING, moving.lease, waits=False),
    "jobs": Verb(_ALL, language.jobs),
    "tag": Verb(_FULL, language.tag),
    "run": Verb(_FULL, language.run),
    "complete": Verb(_FULL, language.complete),
    "fake": Verb(_FULL, language.fake),
}
