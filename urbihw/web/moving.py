"""Requests that read, write, call and drive.  Role drive has the effectors and some functions of the tree, slowly."""

from __future__ import annotations

import asyncio
import base64
import math
import re
from collections.abc import Mapping
from typing import Any, Final

from urbihw.client.driving import order_text, parse_answer
from urbihw.client.lines import Line
from urbihw.client.literals import literal, written_path
from urbihw.web.asked import WebRefusal, number_of, path_of, text_of, truth_of
from urbihw.web.lobby import LobbyError, plain_value
from urbihw.web.session import WebSession
from urbihw.web.tree import FREE_CALLS, PACED_CALLS, TELLING_CALLS

DEAD_MAN_S: Final = 0.3
"""Seconds without an order of the pad after which the base stands."""
MAX_SPEED: Final = 20.0
MAX_LEASE_S: Final = 3600.0
TAKEN_S: Final = 0.1
"""Seconds in which a movement that fails at once fails the answer; a later error comes as output."""
MAX_ARGUMENTS: Final = 8
MAX_NUMBER: Final = 1e9
"""Greatest number that role drive writes; nan, inf and numbers beyond a float are refused."""
_PER_RAD: Final = {"rad": 1.0, "deg": 180 / math.pi, "turn": 0.5 / math.pi}
_SOUND: Final = re.compile(r"raw [12] [0-9]{4,6} (8|16) [12]", re.ASCII)
Request = Mapping[str, Any]


async def get(session: WebSession, request: Request) -> dict[str, Any]:
    """The value of a slot."""
    slot = path_of(request, "slot")
    return {"value": await session.link.read(slot)}


async def set_slot(session: WebSession, request: Request) -> dict[str, Any]:
    """Write a slot; with ``speed`` or ``time`` as a movement."""
    slot = path_of(request, "slot")
    if "value" not in request:
        raise WebRefusal("value is missing")
    value, extra = request["value"], ""
    for name in ("speed", "time"):
        if request.get(name) is not None:
            extra = f" {name}:{number_of(request, name, 0.001, 1e6):g}"
    tree = session.gateway.robot.tree
    if session.role != "full":
        if not tree.may_write(slot):
            raise WebRefusal(f"{slot} is no effector of the robot", "role")
        value, extra = _limited(session, slot, value, extra, request)
    session.gateway.take_lease(session)
    try:
        text = literal(value)
    except (ValueError, TypeError, OverflowError) as error:
        raise WebRefusal(str(error)) from error
    if not extra:
        await session.link.ask(f"__web.end(\"{_plain(slot)}\") | {written_path(slot)} = {text} | 1")
    else:
        moving = session.link.begin(f"__web.move(\"{_plain(slot)}\"): {written_path(slot)} = {text}{extra} | 1")
        await _taken(session, moving)
    return {}


def _limited(session: WebSession, slot: str, value: Any, extra: str, request: Request) -> tuple[Any, str]:
    """A write of role drive: a goal is reached no faster than the limit, a speed is no higher."""
    about = session.gateway.robot.tree.slots.get(slot, {})
    unit, limits = str(about.get("unit") or ""), session.gateway.settings.limits
    kind = about.get("kind")
    if kind == "truth" and isinstance(value, bool) or kind == "text" and isinstance(value, str):
        return value, extra
    # Anything else than a number, such as true for 1 or a list of speeds, would pass by the limits.
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= MAX_NUMBER:
        raise WebRefusal(f"role {session.role} writes numbers to {slot}", "role")
    if unit in _PER_RAD or unit == "m":
        most = limits.x if unit == "m" else limits.speed * _PER_RAD[unit]
        asked = request.get("speed")
        speed = min(most, asked) if isinstance(asked, int | float) else most
        return value, f" speed:{speed:g}"
    angle, slash, second = unit.rpartition("/")
    if unit == "m/s":
        bound = limits.x
    elif slash and second == "s" and angle in _PER_RAD:
        bound = limits.yaw * _PER_RAD[angle]
    elif _is_speed(slot, about):
        bound = limits.share * max(abs(float(about.get(end) or 0.0)) for end in ("min", "max"))
    elif unit in ("", "ratio"):  # a light, say
        return value, extra
    else:  # a torque, a current, a share of the power
        bound = 0.0
    if not bound:
        raise WebRefusal(f"role {session.role} does not write {slot}: its speed would have no limit", "role")
    return max(-bound, min(bound, value)), extra


def _is_speed(slot: str, about: Mapping[str, Any]) -> bool:
    """Whether a slot without a unit of its own is a speed: by its name, or as a share of full power."""
    return "speed" in slot.rpartition(".")[2].lower() or about.get("unit") == "%"


async def play_sound(session: WebSession, request: Request) -> dict[str, Any]:
    """A piece of sound for a loudspeaker, which plays it behind what it has: samples as base64."""
    slot, keywords = path_of(request, "slot"), text_of(request, "keywords")
    if not _SOUND.fullmatch(keywords):
        raise WebRefusal('keywords wants raw, channels, samples a second, bits, and 1 for signed: "raw 1 16000 16 1"')
    try:
        samples = base64.b64decode(text_of(request, "data"), validate=True)
    except ValueError as error:
        raise WebRefusal("data wants samples as base64") from error
    if session.role != "full" and not session.gateway.robot.tree.may_write(slot):
        raise WebRefusal(f"{slot} is no effector of the robot", "role")
    session.gateway.take_lease(session)
    # The link encodes text as UTF-8, and leaves other bytes as they are.
    content = samples.decode("utf-8", "surrogateescape")
    await session.link.ask(f"{written_path(slot)} = BIN {len(samples)} {keywords};{content}; 1")
    return {}


async def call(session: WebSession, request: Request) -> dict[str, Any]:
    """Call a function.  One that takes long is answered at once; its end comes as output."""
    slot = path_of(request, "slot")
    arguments = request.get("args", [])
    if not isinstance(arguments, list) or len(arguments) > MAX_ARGUMENTS:
        raise WebRefusal(f"args wants a list of at most {MAX_ARGUMENTS} values")
    if session.role != "full":
        if not session.gateway.robot.tree.may_call(slot):
            raise WebRefusal(f"role {session.role} may not call {slot}", "role")
        arguments = _paced(session, slot, arguments)
    if slot.rpartition(".")[2] not in FREE_CALLS:
        session.gateway.take_lease(session)
    try:
        text = ", ".join(map(literal, arguments))
    except (ValueError, TypeError, OverflowError) as error:
        raise WebRefusal(str(error)) from error
    # A function without a value is no error.
    body = f"var __value = {written_path(slot)}({text}).acceptVoid | if (__value.isVoid) nil else __value"
    if slot.rpartition(".")[2] in TELLING_CALLS:
        # In a list, because nil alone is no line.
        return {"value": (await session.link.value(f"[{written_path(slot)}({text})]"))[0]}
    line = await _taken(session, session.link.begin(body))
    return {"running": True} if line is None else {"value": plain_value(line)}


def _paced(session: WebSession, slot: str, arguments: list[Any]) -> list[Any]:
    """The arguments of a call of role drive: a motion is played no faster than it was recorded."""
    if slot.rpartition(".")[2] not in PACED_CALLS or len(arguments) < 2:
        return arguments
    speed = arguments[1]
    if isinstance(speed, bool) or not isinstance(speed, int | float) or not 0 < speed <= MAX_NUMBER:
        raise WebRefusal(f"role {session.role} plays with a number above 0 as speed", "role")
    return [arguments[0], min(1.0, speed), *arguments[2:]]


async def go(session: WebSession, request: Request) -> dict[str, Any]:
    """Drive to a place, along a path where there is a map, else straight; without ``theta`` in any direction."""
    x, y = number_of(request, "x", -1e4, 1e4), number_of(request, "y", -1e4, 1e4)
    theta = number_of(request, "theta", -100, 100) if request.get("theta") is not None else None
    session.gateway.take_lease(session)
    ahead = f'Math.atan2({y:g} - robot.position["y"], {x:g} - robot.position["x"])' if theta is None else f"{theta:g}"
    straight = literal([x, y] if theta is None else [x, y, theta])
    path = (
        f'if (robot.hasSlot("planner") && robot.planner.ready) robot.moveTo([{x:g}, {y:g}, {ahead}]) '
        f"else robot.goToAbsolute({straight})"
    )
    await _taken(session, session.link.begin(f'__web.move("robot.go"): {{ {path} }} | 1'))
    return {}


async def drive(session: WebSession, request: Request) -> dict[str, Any]:
    """Drive a base while orders come: without one for ``DEAD_MAN_S`` it stands."""
    x, yaw = number_of(request, "x", -MAX_SPEED, MAX_SPEED), number_of(request, "yaw", -MAX_SPEED, MAX_SPEED)
    if session.role != "full":
        limits = session.gateway.settings.limits
        x, yaw = max(-limits.x, min(limits.x, x)), max(-limits.yaw, min(limits.yaw, yaw))
    at = number_of(request, "at", 0, 1e9) if request.get("at") is not None else None
    session.gateway.take_lease(session)
    loop = asyncio.get_running_loop()
    if x == yaw == 0:
        session.travel.begin_again()
    delay = 0.0 if at is None else session.travel.delay(at, loop.time())
    if session.server_ahead is None:
        session.server_ahead = float(await session.link.value("System.time")) - loop.time()
    made = session.server_ahead + loop.time() - delay
    line = await session.link.ask(order_text(x, yaw, DEAD_MAN_S, made), 1.0)
    try:
        driven = parse_answer(line.shown)
    except ValueError as error:
        raise LobbyError("this robot does not drive", "language") from error
    # The answer was on its way meanwhile: orders may seem older than they are, but never younger.
    session.server_ahead = driven.time - loop.time()
    return {"deferred": driven.deferred, "late": driven.late, "x": driven.x, "yaw": driven.yaw}


async def lease(session: WebSession, request: Request) -> dict[str, Any]:
    """Take the robot over from another browser, or leave it; with ``seconds`` for as long as the browser gives signs of
    life."""
    if truth_of(request, "take"):
        if request.get("seconds") is not None:
            await session.lease.set_length(number_of(request, "seconds", 0, MAX_LEASE_S))
        session.gateway.take_lease(session, over=True)
    else:
        session.gateway.end_lease(session)
        await session.lease.set_length(0.0)
    return {}


async def _taken(session: WebSession, running: asyncio.Future[Line]) -> Line | None:
    """The answer of what ends at once; None for what goes on: its error comes as output.  Raises LobbyError."""
    done, _ = await asyncio.wait((running,), timeout=TAKEN_S)
    if done:
        return running.result()
    running.add_done_callback(session.tell_end)
    return None


def _plain(slot: str) -> str:
    return slot.replace('"', "'")
