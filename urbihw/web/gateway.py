"""The process that serves browsers: one robot, all browsers, who drives."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Mapping
from typing import Any, Final

from aiohttp import WSCloseCode, web

from urbihw.release import installed_version
from urbihw.repeats import LimitedLog
from urbihw.web.asked import WebRefusal
from urbihw.web.connections import Handler
from urbihw.web.pages import Pages
from urbihw.web.pairing import Browser, Pairings
from urbihw.web.robot import WatchedRobot
from urbihw.web.session import WebSession
from urbihw.web.settings import WebSettings
from urbihw.web.verbs import VERBS

log = logging.getLogger("urbihw.web")

MAX_SESSIONS: Final = 32
MAX_TABS: Final = 16
"""WebSockets of one browser: others have room, too."""
MAX_MESSAGE_BYTES: Final = 64 * 1024
HEARTBEAT_S: Final = 5.0
"""Seconds between two signs of life of a browser; one without them is disconnected."""
SEND_BUFFER_BYTES: Final = 128 * 1024
"""Bytes that the system keeps for a slow browser: what waits there is old when it arrives."""
REMOVED_PERIOD_S: Final = 1.0
"""Seconds between two looks for browsers that were removed."""


class Gateway:
    """``await Gateway(settings).run()`` watches the robot until it is cancelled; ``app`` serves browsers meanwhile.

    Attributes:
        settings: what it serves.
        robot: the robot, as the worker and the daemon tell it.
        pairings: the browsers that may come in.
        sessions: the browsers that are there.
        driver: the browser that drives, None for none.
        port: the port on which browsers are served; it belongs to the cookies.
    """

    def __init__(self, settings: WebSettings, port: int) -> None:
        self.settings = settings
        self.port = port
        self.version = installed_version()
        self.limited_log = LimitedLog(log)
        self.pairings = Pairings(settings.folder)
        self.robot = WatchedRobot(settings)
        self.sessions: list[WebSession] = []
        self.driver: WebSession | None = None
        self.robot.on_state = self.tell_state
        self.robot.on_devices = self._tell_devices
        self.robot.on_tree = self._tell_tree
        self.robot.on_about = self._tell_about
        self.app = Pages(self).app

    async def run(self) -> None:
        """Watch the robot and the file of browsers."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self.robot.run())
            tasks.create_task(self._disconnect_removed())

    async def close(self) -> None:
        """Disconnect all browsers of the gateway."""
        self.limited_log.close()
        for session in list(self.sessions):
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(session.close("the gateway ends"), 1.0)

    async def _disconnect_removed(self) -> None:
        while True:
            await asyncio.sleep(REMOVED_PERIOD_S)
            if self.sessions:
                with contextlib.suppress(ValueError):  # BadConfig: no browser is removed while the file cannot be read
                    known = {each.digest for each in self.pairings.browsers()}
                    for session in list(self.sessions):
                        if session.browser.digest not in known:
                            await session.close("this browser was removed", WSCloseCode.POLICY_VIOLATION)

    # ---------------------------------------------------------------- browsers

    async def connect(self, request: web.Request, browser: Browser, connection: Handler) -> web.StreamResponse:
        """Serve the WebSocket of a browser until it is gone."""
        if len(self.sessions) >= MAX_SESSIONS:
            return web.Response(status=503, text=f"{MAX_SESSIONS} browsers are connected: close one\n")
        if sum(each.browser.digest == browser.digest for each in self.sessions) >= MAX_TABS:
            return web.Response(status=503, text=f"this browser has the panel open {MAX_TABS} times: close one\n")
        socket = web.WebSocketResponse(heartbeat=HEARTBEAT_S, max_msg_size=MAX_MESSAGE_BYTES, compress=False)
        await socket.prepare(request)
        connection.note_socket()
        _bound_buffer(request)
        session = WebSession(self, browser, socket)
        self.sessions.append(session)
        self.limited_log.say(
            browser.digest, "browser of %s (%s) from %s", session.name, session.role, request.remote,
            level=logging.INFO, most=3,
        )  # fmt: skip
        try:
            self._greet(session)
            await session.run()
        finally:
            self.sessions.remove(session)
            if self.driver is session:
                self.driver = None
                self.tell_state()
        return socket

    def _greet(self, session: WebSession) -> None:
        session.say_hello()
        session.outbox.put(self.state(session))
        session.outbox.put(self._devices())
        if self.robot.tree.told is not None:
            session.outbox.put({"event": "tree", "tree": self.robot.tree.told})

    async def serve(self, session: WebSession, request: Mapping[str, Any]) -> dict[str, Any] | None:
        """The answer to a request.  Raises WebRefusal or LobbyError."""
        verb = VERBS.get(str(request.get("do")))
        if verb is None:
            raise WebRefusal(f"there is no {str(request.get('do'))[:40]!r}; there are: {', '.join(VERBS)}")
        if session.role not in verb.roles:
            raise WebRefusal(f"role {session.role} may not {request['do']}", "role")
        if verb.waits:
            await session.wait_connected()
        return await verb.run(session, request)

    # ---------------------------------------------------------------- who drives

    def take_lease(self, session: WebSession, *, over: bool = False) -> None:
        """Let a browser drive.  Raises WebRefusal when another one does, unless it takes ``over``."""
        if self.driver is not None and self.driver is not session:
            if not over:
                raise WebRefusal(f"{self.driver.name} drives: take the robot over first", "lease")
            self.driver.stop_driving()
        if self.driver is not session:
            self.driver = session
            self.tell_state()

    def end_lease(self, session: WebSession) -> None:
        """End the lease of a browser, if it has it."""
        if self.driver is session:
            session.stop_driving()
            self.driver = None
            self.tell_state()

    def limits_of(self, role: str) -> dict[str, float]:
        """The limits of a role, by name; none for full."""
        limits = self.settings.limits
        if role != "drive":
            return {}
        return {"speed": limits.speed, "x": limits.x, "yaw": limits.yaw, "share": limits.share}

    # ---------------------------------------------------------------- events for all

    def state(self, session: WebSession) -> dict[str, Any]:
        """The event ``state``, as a browser gets it: two of its pages have the same name, and one of them drives."""
        driver = self.driver.name if self.driver is not None else ""
        told = self.robot.state()
        told |= {"driver": driver, "drives": self.driver is session, "holds": session.is_among(told["holders"])}
        told["holders"] = [each["who"] for each in told["holders"]]
        return {"event": "state", **told}

    def _devices(self) -> dict[str, Any]:
        return {"event": "devices", "devices": self.robot.devices}

    def tell_state(self) -> None:
        """Tell all browsers the state."""
        for session in self.sessions:
            session.outbox.put_newest("state", self.state(session))

    def _tell_devices(self) -> None:
        self._tell("devices", self._devices())

    def _tell_tree(self) -> None:
        self._tell("tree", {"event": "tree", "tree": self.robot.tree.told})

    def _tell_about(self) -> None:
        for session in self.sessions:
            session.say_hello()

    def _tell(self, key: str, message: Mapping[str, Any]) -> None:
        for session in self.sessions:
            session.outbox.put_newest(key, message)


def _bound_buffer(request: web.Request) -> None:
    import socket

    transport = request.transport
    plain = transport.get_extra_info("socket") if transport is not None else None
    if plain is not None:
        plain.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
