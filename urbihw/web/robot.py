"""The robot as all browsers see it: whether daemon and worker answer, health, devices, tree.

The worker is asked for its health whatever the interpreter does; the daemon is asked for its time over a connection of
the gateway's own, and ``silent`` tells for how long it has not answered.  The worker of another machine is not reached:
then the daemon is asked for what it knows (``remote``).
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Final

from urbihw.backoff import BackOff
from urbihw.buses.verdict import judge, level_of
from urbihw.client.lines import Line
from urbihw.daemon.control_client import ControlledWorker, NoWorker
from urbihw.web import remote
from urbihw.web.asked import WebRefusal
from urbihw.web.lobby import LobbyError, LobbyLink
from urbihw.web.settings import WebSettings
from urbihw.web.tree import EMPTY, Tree
from urbihw.web.worker import worker_state

STATE_PERIOD_S: Final = 0.25
REMOTE_PERIOD_S: Final = 0.5
"""Seconds between two looks at a robot of another machine."""
DEVICES_PERIOD_S: Final = 0.5
PING_PERIOD_S: Final = 0.25
SILENT_S: Final = 1.0
"""Seconds without an answer after which the daemon counts as held."""
FIRST_PAUSE_S: Final = 0.25
MAX_PAUSE_S: Final = 2.0
TREE_TIMEOUT_S: Final = 10.0
_NO_WORKER: Final = {
    "worker": False, "link": False, "rate": 0, "late": 0, "load": 0, "estop": "", "holders": [],
    "battery": None, "charge": None, "stopped": None,
}  # fmt: skip
_PROGRAM: Final = '{ if (Global.hasLocalSlot("robot")) %s else "null" }'


class WatchedRobot:
    """Watches one robot.  ``run`` runs until it is cancelled.

    Attributes:
        worker: the control socket.
        tree: what the robot has, ``EMPTY`` while it is not known.
        about: name of the robot and of its platform, and whether it is simulated.
        devices: the devices as the worker tells them.
    """

    def __init__(self, settings: WebSettings) -> None:
        self.worker = ControlledWorker(settings.control)
        self.tree: Tree = EMPTY
        self.about: dict[str, Any] = {"robot": "", "platform": settings.platform, "fake": settings.fake}
        self.devices: list[Any] = []
        self.on_state: Callable[[], None] = lambda: None
        self.on_devices: Callable[[], None] = lambda: None
        self.on_tree: Callable[[], None] = lambda: None
        self.on_about: Callable[[], None] = lambda: None
        self._settings = settings
        self._link: LobbyLink | None = None
        self._asked_at: float | None = None
        self._last_answer = asyncio.get_running_loop().time()
        self._state: dict[str, Any] = {**_NO_WORKER, "health": _bad("the bus worker has not answered yet")}
        self._known_devices: object = None
        self._tree_wanted = asyncio.Event()
        self._server_ahead = -math.inf

    # ---------------------------------------------------------------- what is known

    @property
    def is_remote(self) -> bool:
        """Whether the robot is on another machine, whose bus worker is not reached."""
        return self.worker.path is None

    def server_time(self, time: float) -> float:
        """A time of the bus worker, which has the monotonic clock of this machine, by the clock of the server, s."""
        return time + self._server_ahead if math.isfinite(self._server_ahead) else time

    @property
    def silent(self) -> float:
        """Seconds since the daemon should have answered."""
        now = asyncio.get_running_loop().time()
        since = self._asked_at if self._link is not None else self._last_answer
        return 0.0 if since is None else round(now - since, 2)

    @property
    def link(self) -> LobbyLink:
        """The gateway's own connection.  Raises LobbyError while there is none."""
        if self._link is None:
            raise LobbyError("the daemon is not connected", "gone")
        return self._link

    def state(self) -> dict[str, Any]:
        """The fields of the event ``state`` that are the same for all browsers."""
        silent = self.silent
        daemon = self._link is not None and silent < SILENT_S
        return {"daemon": daemon, "silent": silent, "remote": self.is_remote, **self._state}

    async def figure(self) -> dict[str, Any] | None:
        """The figure of the robot (``robot.figure.text``); None if there is no robot.  Raises LobbyError."""
        told = await self.link.json(_PROGRAM % "System.figureText(robot)", TREE_TIMEOUT_S)
        return told if isinstance(told, dict) else None

    # ---------------------------------------------------------------- stopping

    async def obey(self, verb: str, who: str, link: LobbyLink | None, others: Sequence[str] = ()) -> dict[str, Any]:
        """Carry out stop, estop or release; who holds it then, and whether there is a link.

        A release is that of the stop of ``who``, and of the stops of ``others`` by their names.  The worker does it,
        which does not need the interpreter; for a robot of another machine the daemon does it, by ``link``.  Raises
        NoWorker or LobbyError when it is not confirmed, WebRefusal for a release while others hold the robot.
        """
        if not self.is_remote:
            told = await self.worker.ask(verb, who, others)
            holder = str(told.get("estop") or "")
            if told.get("released") is False:
                raise WebRefusal(f"an emergency stop of {holder} holds: it is not yours", "held")
            return {"estop": holder, "link": told.get("link") is True, "unkept": str(told.get("unkept") or "")}
        if link is None:
            raise LobbyError("the daemon is not connected", "gone")
        return await remote.obey(link, verb, self.tree.platform_path, others)

    # ---------------------------------------------------------------- watching

    async def run(self) -> None:
        """Watch the robot until the task is cancelled."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._watch_worker())
            tasks.create_task(self._watch_daemon())
            tasks.create_task(self._watch_tree())

    async def look(self) -> None:
        """Ask the worker now, and tell all browsers."""
        if self.is_remote:
            await self._look_remote()
            return
        try:
            told = await self.worker.ask("health")
        except NoWorker as error:
            self._state = {**_NO_WORKER, "health": _bad(str(error))}
        else:
            found = judge(told)
            reasons = [str(each) for each in found]
            self._state = {**worker_state(told), "health": {"verdict": level_of(found).word, "reasons": reasons}}
            self.devices = told.get("devices") or []
            self._note_devices(told)
        self.on_state()

    async def _look_remote(self) -> None:
        reasons = []
        try:
            told = await remote.look(self.link, self.tree.platform_path)
        except LobbyError as error:
            self._state, reasons = {**_NO_WORKER}, [str(error)]
        else:
            holders = [{"user": each, "who": each} for each in told["holders"]]
            self._state = {**_NO_WORKER, "link": told["link"], "estop": told["estop"], "holders": holders}
            reasons = told["problems"]
            if told["key"] != self._known_devices:
                self._known_devices = told["key"]
                self._tree_wanted.set()
        verdict = "ok" if not reasons else "warning" if self._state["link"] else "bad"
        self._state["health"] = {"verdict": verdict, "reasons": reasons}
        self.on_state()

    def _note_devices(self, told: dict[str, Any]) -> None:
        """Want the tree again when other devices are there."""
        known = told.get("link"), [(row.get("device"), row.get("name"), row.get("model")) for row in self.devices]
        if known != self._known_devices:
            self._known_devices = known
            self._tree_wanted.set()

    async def _watch_worker(self) -> None:
        turn = 0
        while True:
            await self.look()
            if turn % round(DEVICES_PERIOD_S / STATE_PERIOD_S) == 0:
                self.on_devices()
            turn += 1
            await asyncio.sleep(REMOTE_PERIOD_S if self.is_remote else STATE_PERIOD_S)

    async def _watch_daemon(self) -> None:
        pauses = BackOff(FIRST_PAUSE_S, MAX_PAUSE_S)
        while True:
            ended = asyncio.Event()
            try:
                with contextlib.suppress(LobbyError):
                    self._link = await LobbyLink.open(
                        self._settings.where, self._settings.credentials, _ignore, partial(_end, ended)
                    )
                    self._tree_wanted.set()
                    await self._ping(self._link, pauses, ended)
            finally:
                if self._link is not None:
                    self._link.close()
                self._link = self._asked_at = None
                self._server_ahead = -math.inf
            await asyncio.sleep(pauses.next_pause())

    async def _ping(self, link: LobbyLink, pauses: BackOff, ended: asyncio.Event) -> None:
        """Ask the daemon for an answer again and again, until the connection ends; one question at a time."""
        loop = asyncio.get_running_loop()
        while not ended.is_set():
            self._asked_at = loop.time()
            answer = await link.begin("1")
            self._asked_at, self._last_answer = None, loop.time()
            if answer.stamp is not None:
                # The quickest answer tells it best.
                self._server_ahead = max(self._server_ahead, answer.stamp / 1000 - self._last_answer)
            pauses.reset()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(PING_PERIOD_S):
                    await ended.wait()

    async def _watch_tree(self) -> None:
        while True:
            await self._tree_wanted.wait()
            self._tree_wanted.clear()
            try:
                tree = await self.link.json(_PROGRAM % "System.treeText(robot)", TREE_TIMEOUT_S)
            except LobbyError as error:
                if error.code == "gone":
                    await asyncio.sleep(MAX_PAUSE_S)
                    self._tree_wanted.set()
                continue
            if not isinstance(tree, dict) or tree == self.tree.told:
                continue
            self.tree = Tree(tree)
            about = {**self.about, "robot": self.tree.name or self.about["robot"]}
            if about != self.about:
                self.about = about
                self.on_about()
            self.on_tree()


def _bad(reason: str) -> dict[str, Any]:
    return {"verdict": "bad", "reasons": [reason]}


def _end(ended: asyncio.Event, reason: str) -> None:
    ended.set()


def _ignore(line: Line) -> None:
    """The gateway's own connection has no output but answers."""
