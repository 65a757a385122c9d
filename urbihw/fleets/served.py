"""The robot of a bridge: what the daemon and the bus worker tell of it.

The daemon sends values at a bounded rate and events; the bus worker tells the health, whatever the interpreter does.
"""

from __future__ import annotations

import asyncio
import json
import logging
import socket
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Final

from urbihw.backoff import BackOff
from urbihw.buses.verdict import judge, level_of
from urbihw.client.aio import AsyncRobot
from urbihw.client.aio_connection import AsyncConnection
from urbihw.client.errors import ClientError
from urbihw.client.streams import Sample
from urbihw.daemon.control_client import ControlledWorker, NoWorker
from urbihw.fleets.settings import FleetSettings
from urbihw.release import installed_version
from urbihw.web.tree import EMPTY, SAFE_CALLS, Tree
from urbihw.web.worker import worker_state

log = logging.getLogger("urbihw.fleets")

STATE_PERIOD_S: Final = 0.5
KEY_PERIOD_S: Final = 2.0
"""Seconds between two looks whether the robot has other devices now."""
FIRST_PAUSE_S: Final = 0.25
MAX_PAUSE_S: Final = 2.0
ANSWER_TIMEOUT_S: Final = 10.0
_IF_THERE: Final = 'if (Global.hasLocalSlot("robot")) %s else "null"'


class ServedRobot:
    """Watches the robot.  ``run`` runs until it is cancelled.

    Attributes:
        worker: the control socket.
        tree: what may be read, written and called, ``EMPTY`` while it is not known.
        overview: what moves and what measures, as the daemon tells it.
        values: the last sample, by the paths of the slots; ``sampled_at`` is its time, seconds since 1970.
        state: link, emergency stop, battery, verdict.
        writers: who moved each device last, by the name of the device.
    """

    def __init__(self, settings: FleetSettings) -> None:
        self.worker = ControlledWorker(settings.control)
        self.tree: Tree = EMPTY
        self.overview: Mapping[str, Any] = {}
        self.values: dict[str, Any] = {}
        self.sampled_at = 0.0
        self.state: dict[str, Any] = {"link": False, "verdict": "bad", "reasons": ["not asked yet"]}
        self.writers: dict[str, str] = {}
        self.on_values: Callable[[], None] = lambda: None
        self.on_state: Callable[[], None] = lambda: None
        self.on_event: Callable[[str, float, tuple[Any, ...]], None] = lambda name, time, args: None
        self._settings = settings

    # ---------------------------------------------------------------- what is known

    def info(self) -> dict[str, Any]:
        """What the robot is and has, for the fleet."""
        slots = {
            row["slot"]: {key: row[key] for key in ("unit", "min", "max") if key in row} | {"effector": effector}
            for kind, effector in (("effectors", True), ("sensors", False))
            for row in self.overview.get(kind, ())
        }
        return {
            "robot": self._settings.name, "platform": self._settings.platform, "version": installed_version(),
            "host": socket.gethostname(), "type": self.overview.get("type", ""), "slots": slots,
            "calls": self._calls(), "hz": self._settings.hz,
            "dead_man": self._settings.dead_man, "drive": list(self._settings.drive),
        }  # fmt: skip

    def _calls(self) -> list[str]:
        """The functions that others may call, by their shortest names."""
        owners = {"robot", self.tree.platform_path, *(slot.rpartition(".")[0] for slot in self.values)}
        paths = (f"{owner}.{name}" for owner in owners for name in SAFE_CALLS)
        return sorted(path for path in paths if path in self.tree.slots)

    async def connect(self) -> AsyncRobot:
        """A connection of its own to the daemon.  Raises ClientError."""
        settings = self._settings
        connection = AsyncConnection(
            settings.where, settings.credentials, ANSWER_TIMEOUT_S, False, lambda line, at: None
        )
        await connection.open()
        return AsyncRobot(connection, deque())

    # ---------------------------------------------------------------- watching

    async def run(self) -> None:
        """Watch the robot until the task is cancelled."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._watch_worker())
            tasks.create_task(self._watch_daemon())

    async def look(self) -> None:
        """Ask the bus worker for the health now."""
        try:
            told = await self.worker.ask("health")
        except NoWorker as error:
            self.state = {"link": False, "verdict": "bad", "reasons": [str(error)], "estop": ""}
        else:
            found = judge(told)
            known = worker_state(told)
            self.state = {key: known[key] for key in ("link", "estop", "battery", "charge", "rate")}
            self.state |= {"verdict": level_of(found).word, "reasons": [str(each) for each in found]}
            self.writers = {
                str(row.get("name") or row.get("device")): str(row.get("who") or "")
                for row in told.get("devices") or () if isinstance(row, dict)
            }  # fmt: skip
        self.on_state()

    async def _watch_worker(self) -> None:
        while True:
            await self.look()
            await asyncio.sleep(STATE_PERIOD_S)

    async def _watch_daemon(self) -> None:
        pauses = BackOff(FIRST_PAUSE_S, MAX_PAUSE_S)
        while True:
            try:
                async with await self.connect() as robot:
                    key = await self._learn(robot)
                    if key:
                        pauses.reset()
                        await self._watch_devices(robot, key)
            except* ClientError as errors:
                log.debug("the daemon: %s", errors.exceptions[0])
            self.values = {}
            await asyncio.sleep(pauses.next_pause())

    async def _learn(self, robot: AsyncRobot) -> str:
        """Learn what the robot has; returns the key of its tree, "" while there is no robot."""
        await robot.run('lobby.introduce("fleet")|')
        tree = json.loads(await robot.run(_IF_THERE % "System.treeText(robot)"))
        if not isinstance(tree, dict):
            return ""
        self.tree, self.overview = Tree(tree), await robot.overview()
        return str(await robot.run("System.treeKey(robot)"))

    async def _watch_devices(self, robot: AsyncRobot, key: str) -> None:
        """Pass on values and events until the robot has other devices, or the connection ends."""
        slots = [str(row["slot"]) for kind in ("effectors", "sensors") for row in self.overview.get(kind, ())]
        async with asyncio.TaskGroup() as tasks:
            watching = [tasks.create_task(self._pass_events(robot, path)) for path in self._events()]
            if slots:
                watching.append(tasks.create_task(self._pass_values(robot, slots)))
            while await robot.run("System.treeKey(robot)") == key:
                await asyncio.sleep(KEY_PERIOD_S)
            for each in watching:
                each.cancel()

    def _events(self) -> list[str]:
        """The events of the robot itself: those of each device are too many for a network."""
        platform = self.tree.platform_path
        return [path for path in self.tree.slots if path.rpartition(".")[0] == platform and self.tree.is_event(path)]

    async def _pass_values(self, robot: AsyncRobot, slots: list[str]) -> None:
        async with robot.watch(*slots, hz=self._settings.hz) as watch:
            async for sample in watch:
                self.take(slots, sample)

    def take(self, slots: list[str], sample: Sample) -> None:
        """Keep a sample, and pass it on."""
        self.sampled_at = sample.time
        self.values = dict(zip(slots, sample.values, strict=True))
        self.on_values()

    async def _pass_events(self, robot: AsyncRobot, path: str) -> None:
        async with robot.events(path) as events:
            async for sample in events:
                self.on_event(path.rpartition(".")[2], sample.time, sample.args)
