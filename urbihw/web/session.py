"""One browser: its WebSocket, its connections to the daemon, its subscriptions.

It has two connections.  One is for what the panel asks; its statements run in the background and never wait for one
another.  The other one, opened on first use, is the console of a browser of role full: an unfinished or endless
statement there holds up nothing else.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import math
import re
from collections.abc import Callable, Coroutine, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Final

from aiohttp import WSCloseCode, WSMsgType, web

from urbihw.backoff import BackOff
from urbihw.client.driving import PROGRAM as DRIVE_PROGRAM
from urbihw.client.lines import Line
from urbihw.client.literals import string_literal
from urbihw.client.values import value_of
from urbihw.web.asked import WebRefusal
from urbihw.web.browser_lease import BrowserLease
from urbihw.web.lobby import LobbyError, LobbyLink, utf8
from urbihw.web.outbox import KEPT, WebOutbox
from urbihw.web.pairing import Browser
from urbihw.web.pictures import frame_of
from urbihw.web.travel import Travel

if TYPE_CHECKING:
    from urbihw.web.gateway import Gateway

PROTOCOL: Final = 1
REQUESTS_PER_S: Final = 200.0
BURST: Final = 400.0
"""Requests in a second, and at once, beyond which a browser is refused."""
EXCESS_PAUSE_S: Final = 0.001
"""Seconds for which a browser that is too fast is not read: others have their turn, and it has to wait."""
MAX_PENDING: Final = 64
"""Requests of a browser that are not answered yet."""
PANEL: Final = " (panel)"
"""The end of the names that browsers have for the daemon."""
STOPS: Final = ("stop", "estop")
MAX_ID: Final = 100
MAX_STOPS: Final = 4
"""Stops of a browser that are not answered yet."""
OPENING_S: Final = 3.0
"""Seconds after its opening for which the requests of a browser wait for its connection to the daemon."""
FIRST_PAUSE_S: Final = 0.25
MAX_PAUSE_S: Final = 2.0
SAMPLES, PICTURE, EVENTS, LOG = "samples", "picture", "events", "log"
"""The kinds of subscriptions."""
_CHANNEL: Final = re.compile(r"__web_(\d{1,9})(?:_(\d{1,4}))?")
_PLACE: Final = re.compile(r"^\d+\.\d+(?:-\d+(?:\.\d+)?)?: ")
"""The place in the program of an error, which is one of the server's own here."""
_PROGRAM: Final = (
    files("urbihw.web").joinpath("session.u").read_text("ascii")
    + files("urbihw.client").joinpath("assistant.u").read_text("ascii")
)


@dataclass
class Sub:
    """A subscription: its number in the protocol, its kind, its slots, the statement that makes it, and what the daemon
    tells of it; ``head`` belongs to the next picture, ``errors`` are those of its slots, and ``begun`` is set when they
    are known: with the first values.  ``early`` is a picture that came before the answer with
    the number (``is_answered``): a browser would not know whose picture it is, and never ask for the next one."""

    number: int
    kind: str
    slots: Sequence[str]
    body: str = ""
    header: asyncio.Future[dict[str, Any]] = field(default_factory=lambda: asyncio.get_running_loop().create_future())
    head: Mapping[str, Any] = field(default_factory=dict)
    errors: dict[str, str] = field(default_factory=dict)
    begun: asyncio.Event = field(default_factory=asyncio.Event)
    early: bytes | None = None
    is_answered: bool = False

    @property
    def failed(self) -> bool:
        """Whether none of its slots can be read."""
        return bool(self.errors) and self.errors.keys() >= set(self.slots)

    @property
    def channel(self) -> str:
        """The channel of its lines."""
        return f"__web_{self.number}"


class WebSession:
    """One browser.  ``run`` serves it until it is gone.

    Attributes:
        browser: who it is.
        outbox: what it gets.
        subs: its subscriptions by number.
        name: its name for the log and for ``driver``.
        lease: how long it may say nothing while it moves the robot.
    """

    def __init__(self, gateway: Gateway, browser: Browser, socket: web.WebSocketResponse) -> None:
        self.gateway = gateway
        self.browser = browser
        self.name = browser.name
        self.outbox = WebOutbox(self._flow)
        self.subs: dict[int, Sub] = {}
        self.console_uid = ""
        self.server_ahead: float | None = None
        """The server's time minus that of this process, s; None while it is not known."""
        self.travel = Travel()
        self.tasks: dict[str, asyncio.Task[None]] = {}
        """Tasks that serve the browser, by name: each ends with it."""
        self._socket = socket
        self._link: LobbyLink | None = None
        self._connected = asyncio.Event()
        self._console: LobbyLink | None = None
        self.lease = BrowserLease(self._links)
        self._opening = asyncio.Lock()
        self._next_sub = 1
        self._pending: set[asyncio.Task[None]] = set()
        self._stopping: set[asyncio.Task[None]] = set()
        self._allowance = BURST
        self._opened = self._refilled = asyncio.get_running_loop().time()

    @property
    def role(self) -> str:
        """The role of the browser: what it may do."""
        return self.browser.role

    @property
    def title(self) -> str:
        """Its name for the robot: in ``why``, in the list of jobs, and for who has stopped it."""
        return self.name + PANEL

    def is_among(self, holders: Sequence[Mapping[str, str]]) -> bool:
        """Whether this browser holds the robot by an emergency stop, or by one that anybody may release."""
        # Behind its name stands the place in the program, where the daemon of another machine tells it.
        return any(each["user"] == "" or each["user"].startswith(self.title) for each in holders)

    # ---------------------------------------------------------------- life

    async def run(self) -> None:
        """Serve the browser until it is gone."""
        sending = asyncio.create_task(self._send())
        connecting = asyncio.create_task(self._keep_connected())
        try:
            await self._read()
        finally:
            tasks = (sending, connecting, *self._pending, *self._stopping, *self.tasks.values())
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            for link in (self._link, self._console):
                if link is not None:
                    link.close()

    async def close(self, why: str, code: int = WSCloseCode.GOING_AWAY) -> None:
        """Disconnect the browser, and tell it why."""
        await self._socket.close(code=code, message=why.encode())

    async def _send(self) -> None:
        with contextlib.suppress(ConnectionError, RuntimeError):
            await self.outbox.run(self._socket)
        if self.outbox.overflowed:
            await self.close("too much waits to be read", WSCloseCode.TRY_AGAIN_LATER)

    async def _read(self) -> None:
        async for message in self._socket:
            if message.type != WSMsgType.TEXT:
                continue
            self.lease.pass_on_life()
            is_too_fast = self._is_too_fast()
            try:
                request = parse_request(message.data)
            except WebRefusal as error:
                self._answer(_id_in(message.data), error)
            else:
                self._take(request, is_too_fast)
            # The next message may be here already: all other browsers have their turn before it is looked at.
            await asyncio.sleep(EXCESS_PAUSE_S if is_too_fast else 0)

    def _take(self, request: Mapping[str, Any], is_too_fast: bool) -> None:
        """Begin to serve a request, or refuse it: a stop has a lane of its own, whatever else has been asked."""
        number, pending = request.get("id"), self._pending
        if request.get("do") in STOPS:
            pending = self._stopping
            if len(pending) >= MAX_STOPS:
                self._answer(number, WebRefusal(f"{MAX_STOPS} stops of this browser are on their way", "limit"))
                return
        elif is_too_fast:
            self._answer(number, WebRefusal("too many requests: slow down", "limit"))
            return
        elif len(pending) >= MAX_PENDING:
            self._answer(number, WebRefusal("too many requests wait for an answer", "limit"))
            return
        # Each begins at once and in order; one that waits holds up no other.
        task = asyncio.create_task(self._serve(number, request))
        pending.add(task)
        task.add_done_callback(pending.discard)

    def _links(self) -> list[LobbyLink]:
        """The connections by which this browser moves the robot."""
        return [link for link in (self._link, self._console) if link is not None]

    def _is_too_fast(self) -> bool:
        now = asyncio.get_running_loop().time()
        self._allowance = min(BURST, self._allowance + REQUESTS_PER_S * (now - self._refilled)) - 1
        self._refilled = now
        if self._allowance >= 0:
            return False
        self._allowance += 1
        return True

    async def _serve(self, number: Any, request: Mapping[str, Any]) -> None:
        try:
            answer = await self.gateway.serve(self, request)
        except WebRefusal as error:
            self._answer(number, error)
        except LobbyError as error:
            self._answer(number, WebRefusal(str(error), error.code))
        except Exception as error:
            self.gateway.limited_log.say(
                "bug", "our bug in the gateway: %s: %s at a request of %s", type(error).__name__, error, self.name,
                level=logging.ERROR,
            )  # fmt: skip
            self._answer(number, WebRefusal("the gateway failed at this request: this is our bug"))
        else:
            if answer is not None:
                self.outbox.put({"id": number, "ok": True, **answer})

    def _answer(self, number: Any, error: WebRefusal) -> None:
        self.outbox.put({"id": number, "ok": False, "error": str(error), "code": error.code})

    # ---------------------------------------------------------------- telling

    def say_hello(self) -> None:
        """Tell who is who; again when that changes."""
        self.outbox.put({
            "event": "hello", "protocol": PROTOCOL, "version": self.gateway.version, **self.gateway.robot.about,
            "role": self.role, "you": self.name, "limits": self.gateway.limits_of(self.role),
        })  # fmt: skip

    def _flow(self, full: bool) -> None:
        """Let the daemon keep the output of programs while the browser does not read it."""
        if self._console is not None:
            self._console.pause() if full else self._console.resume()

    def tell_end(self, ended: asyncio.Future[Line]) -> None:
        """Tell the error with which a movement has ended, if there is one."""
        error = None if ended.cancelled() else ended.exception()
        if isinstance(error, LobbyError) and error.code == "language":
            self.outbox.put({"event": "output", "channel": "", "stamp": None, "kind": "error", "text": f"!!! {error}"})

    def spawn(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        """A task that is ended with the browser, if it is in ``tasks``."""
        return asyncio.get_running_loop().create_task(work)

    def stop_driving(self) -> None:
        """Let the base stand and end the movements of this browser: another one drives."""
        with contextlib.suppress(LobbyError):
            self.link.begin("__web.endAll | 1")

    # ---------------------------------------------------------------- the daemon

    @property
    def daemon(self) -> LobbyLink | None:
        """The connection for questions; None while there is none."""
        return self._link

    @property
    def link(self) -> LobbyLink:
        """The connection for questions.  Raises LobbyError while there is none."""
        if self._link is None:
            raise LobbyError("the daemon is not connected", "gone")
        return self._link

    async def wait_connected(self) -> None:
        """Wait for the first connection, which a program cannot see, until ``OPENING_S`` after the opening.

        Later, requests of a browser whose daemon is away are refused at once: nothing old is done when it comes back.
        """
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout_at(self._opened + OPENING_S):
                await self._connected.wait()

    async def console(self) -> LobbyLink:
        """The connection of the console, opened if needed.  Raises LobbyError."""
        async with self._opening:
            if self._console is None:
                self._console = await self._open(self._hear_console, self._lose_console)
                self.console_uid = str(await self._console.value("lobby.uid"))
            return self._console

    def _lose_console(self, reason: str) -> None:
        self._console, self.console_uid = None, ""

    async def _open(self, heard: Callable[[Line], None], closed: Callable[[str], None]) -> LobbyLink:
        settings = self.gateway.settings
        link = await LobbyLink.open(settings.where, settings.credentials, heard, closed)
        link.send(f"lobby.introduce({string_literal(self.title)})|;\n")
        self.lease.begin(link)
        return link

    async def _keep_connected(self) -> None:
        """Connect to the daemon, and again when the connection was lost, with all subscriptions."""
        pauses = BackOff(FIRST_PAUSE_S, MAX_PAUSE_S)
        while True:
            ended = asyncio.Event()
            with contextlib.suppress(LobbyError):
                link = await self._open(self._hear, partial(_end, ended))
                link.send(DRIVE_PROGRAM + _PROGRAM)
                self._link = link
                self._connected.set()
                pauses.reset()
                for sub in self.subs.values():
                    link.begin(sub.body)
                await ended.wait()
            self._link = self.server_ahead = None
            await asyncio.sleep(pauses.next_pause())

    def new_sub(self, kind: str, body: Callable[[Sub], str], slots: Sequence[str]) -> Sub:
        """A subscription with the next number; ``body(sub)`` is the statement that makes it."""
        sub = Sub(self._next_sub, kind, slots)
        sub.body = body(sub)
        self._next_sub += 1
        self.subs[sub.number] = sub
        return sub

    def begin_pictures(self, sub: Sub) -> None:
        """Let the pictures through, the answer with their number goes out now: the outbox sends answers first."""
        sub.is_answered = True
        if sub.early is not None:
            self.outbox.put_newest(sub.number, sub.early)

    def drop_sub(self, number: int) -> None:
        """End a subscription, if there is one of this number."""
        sub = self.subs.pop(number, None)
        if sub is not None:
            self.outbox.forget(number)
            count = len(sub.slots) if sub.kind == EVENTS else 1
            channels = ", ".join(f'"{sub.channel}_{each}"' for each in range(count))
            with contextlib.suppress(LobbyError):
                self.link.begin(f'__web.unsubscribe("{sub.channel}", [{channels}]) | 1')

    def _hear(self, line: Line) -> None:
        """A line of the connection for questions that is no answer."""
        match = _CHANNEL.fullmatch(line.channel)
        if match is None:
            if line.is_error and self.role != "view":
                self.say_output(line)
            return
        sub = self.subs.get(int(match[1]))
        if sub is not None and line.stamp is not None:
            with contextlib.suppress(ValueError):  # no JSON, no value: of a daemon of another version
                if match[2] is None:
                    self._hear_samples(sub, line)
                else:
                    self._hear_event(sub, int(match[2]), utf8(value_of(line)))

    def _hear_samples(self, sub: Sub, line: Line) -> None:
        """Samples, a picture, or the line before it."""
        if line.binaries:
            picture = frame_of(sub.number, line, sub.head, self.outbox.lost(sub.number))
            if sub.is_answered:
                self.outbox.put_newest(sub.number, picture)
            else:
                sub.early = picture
            return
        told = json.loads(line.text)
        if "names" in told:
            if not sub.header.done():
                sub.header.set_result(told)
        elif "error" in told:
            slot, text = str(told["error"]), _PLACE.sub("", str(told.get("text", "")))
            if not sub.begun.is_set():
                sub.errors[slot] = text
                if sub.failed:
                    sub.begun.set()
            self.outbox.put({"event": "sub-error", "sub": sub.number, "slot": slot, "text": text})
        elif sub.kind == PICTURE:
            sub.begun.set()
            sub.head = told
        else:
            sub.begun.set()
            self.outbox.put_newest(sub.number, {"event": "samples", "sub": sub.number, **told}, KEPT)

    def _hear_event(self, sub: Sub, number: int, told: Any) -> None:
        """An emission: its time, how many were lost, what it carries."""
        time, lost, payload = told
        if sub.kind == LOG:
            for row in payload:
                self.say_log(row)
        elif number < len(sub.slots):
            self.outbox.put({
                "event": "happened", "sub": sub.number, "slot": sub.slots[number], "t": time, "lost": lost,
                "args": payload,
            })  # fmt: skip

    def say_log(self, row: Any) -> None:
        """Tell a row of the log."""
        if isinstance(row, Mapping):
            self.outbox.put({"event": "log", **row})

    def _hear_console(self, line: Line) -> None:
        if self.console_uid:  # what comes before is the server's greeting
            self.say_output(line)

    def say_output(self, line: Line) -> None:
        """Tell the browser a line of output."""
        text = line.shown
        kind = "more" if line.stamp is None else "error" if line.is_error else "value"
        if kind == "value" and text.startswith("***"):
            kind = "message"
        self.outbox.put(
            {"event": "output", "channel": line.channel, "stamp": line.stamp, "kind": kind, "text": text}
        )


def _end(ended: asyncio.Event, reason: str) -> None:
    ended.set()


def parse_request(text: str) -> dict[str, Any]:
    """A request.  Raises WebRefusal."""
    try:
        request = json.loads(text, parse_constant=_refuse_number, parse_float=_finite)
    except (ValueError, RecursionError):
        raise WebRefusal("a request is a line of JSON") from None
    if not isinstance(request, dict):
        raise WebRefusal("a request is a JSON object")
    if request.get("id") != _plain_id(request):
        raise WebRefusal(f"id wants a number, or a text of at most {MAX_ID} characters")
    return request


def _plain_id(request: Mapping[str, Any]) -> int | float | str | None:
    """The number of a request, which its answer repeats; None without a valid one."""
    number = request.get("id")
    return number if isinstance(number, int | float) or isinstance(number, str) and len(number) <= MAX_ID else None


def _finite(text: str) -> float:
    value = float(text)
    return value if math.isfinite(value) else _refuse_number(text)


def _refuse_number(text: str) -> float:
    raise WebRefusal(f"{text[:40]} is no number of a request: JSON has no infinite ones and no NaN")


def _id_in(text: str) -> Any:
    """The number of a request that is refused unread; None without one."""
    with contextlib.suppress(ValueError, RecursionError):
        request = json.loads(text)
        if isinstance(request, Mapping):
            return _plain_id(request)
    return None
