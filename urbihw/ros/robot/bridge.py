"""A robot of ours as a node: telemetry as topics, topics as orders, until the process is told to stop."""

from __future__ import annotations

import asyncio
import getpass
import logging
import time
from collections.abc import Callable, Coroutine
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

from urbihw.backoff import BackOff
from urbihw.buses.verdict import judge, level_of
from urbihw.client import aio
from urbihw.client.aio import AsyncRobot
from urbihw.client.errors import ClientError
from urbihw.daemon.control_client import ControlledWorker, NoWorker
from urbihw.repeats import LimitedLog
from urbihw.ros.errors import MessageError, RosError, RosNameTaken
from urbihw.ros.names import checked_name
from urbihw.ros.node import RosNode
from urbihw.ros.robot import readings
from urbihw.ros.robot.feeds import RunningFeed, feeds_of
from urbihw.ros.robot.motion import MovingPublishers
from urbihw.ros.robot.parts import RosParts, parts_of

log = logging.getLogger("urbihw.ros")

LOOK_PERIOD_S: Final = 5.0
"""Seconds between two looks at what the robot has."""
DIAGNOSTICS_PERIOD_S: Final = 1.0
FIRST_PAUSE_S: Final = 0.5
MAX_PAUSE_S: Final = 5.0
LEASE_S: Final = 1.0
"""Seconds of silence of this process after which the server stops what it has moved."""
Taking = Callable[[str, dict[str, Any]], None]
"""Takes the name of a node and its message."""
_LEVELS: Final = {"ok": readings.OK, "warning": readings.WARN, "bad": readings.ERROR}


class RosRobotSettings(NamedTuple):
    """What to serve: the server's host and port, or the path of its socket; the worker's control socket, None for none;
    the name of the node, "" for that of the robot."""

    host: str
    port: int
    control: Path | None
    node: str = ""


def _drop(who: str, said: dict[str, Any]) -> None:
    """Take a message that is too old."""


class RosStop:
    """The emergency stop of ROS at the control socket, which does not need the interpreter: one order at a time.

    Orders that come meanwhile wait as two: the last release counts only if no stop came after it.  A stop that waits
    goes before a release that waits, so that no flood and no order of arrival takes a stop away.
    """

    def __init__(self, worker: ControlledWorker) -> None:
        self._worker = worker
        self._waiting: dict[bool, str] = {}
        self._task: asyncio.Task[None] | None = None
        self._log = LimitedLog(log)

    def hold(self, who: str, held: bool) -> None:
        """A node presses the emergency stop (``held``), or releases it."""
        if held:
            self._waiting.pop(False, None)
        self._waiting[held] = who
        if self._task is None:
            self._task = asyncio.get_running_loop().create_task(self._obey())
            self._task.add_done_callback(self._end)

    def _end(self, task: asyncio.Task[None]) -> None:
        self._task = None

    async def _obey(self) -> None:
        while self._waiting:
            held = True in self._waiting
            who = self._waiting.pop(held)
            try:
                await self._worker.ask("estop" if held else "release", f"{getpass.getuser()} (ROS)")
            except NoWorker as error:
                self._log.say(who, "emergency stop of %s: %s", who, error, level=logging.ERROR)


class RosRobot:
    """Serves one robot.  ``run`` runs until it is cancelled."""

    def __init__(self, settings: RosRobotSettings) -> None:
        """Raises RosError for an invalid name of the node."""
        if settings.node:
            checked_name(settings.node)
        self._settings = settings
        self._worker = ControlledWorker(settings.control)
        self._moving = MovingPublishers(self._connect)
        self._ended: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        self._tasks: set[asyncio.Task[None]] = set()
        self._stop = RosStop(self._worker)
        self._log = LimitedLog(log)

    async def run(self) -> None:
        """Serve, with a new connection after each loss of the server, or of the master, or a refusal.

        Raises RosNameTaken when another node has taken the name.
        """
        pauses, said = BackOff(FIRST_PAUSE_S, MAX_PAUSE_S), ""
        while True:
            try:
                await self._serve(pauses)
            except RosNameTaken:
                raise
            except (ClientError, RosError, OSError) as error:
                if str(error) != said:
                    said = str(error)
                    log.warning("%s; trying again", said)
            await asyncio.sleep(pauses.next_pause())

    async def _connect(self) -> AsyncRobot:
        """A connection for one publisher: what it moves ends with it, and with a second of silence."""
        return await aio.connect(self._settings.host, self._settings.port, reconnect=False, lease=LEASE_S,
                                 on_message=lambda message: None)

    async def _serve(self, pauses: BackOff) -> None:
        robot = await aio.connect(self._settings.host, self._settings.port, reconnect=False,
                                  on_message=lambda message: None)
        async with robot:
            parts = await self._look(robot)
            node = RosNode(self._settings.node or _node_name(parts.name))
            node.on_shutdown = self._end
            await node.start()
            try:
                await node.master.ask("getPid")
                log.info("node %s: %s", node.name, ", ".join(
                    topic for feed in feeds_of(parts, node) for topic in feed.topics) or "no sensors")
                pauses.reset()
                await self._serve_parts(robot, node, parts)
            finally:
                await self._moving.close()
                await node.close()

    def _end(self, reason: str) -> None:
        if not self._ended.done():
            self._ended.set_result(reason)

    async def _look(self, robot: AsyncRobot) -> RosParts:
        return parts_of(await robot.overview(), await robot.joints())

    async def _serve_parts(self, robot: AsyncRobot, node: RosNode, parts: RosParts) -> None:
        """Serve these parts until there are others, or the server is lost."""
        await self._listen(node, parts)
        jobs = [RunningFeed(robot, node, feed).run() for feed in feeds_of(parts, node)]
        jobs += [self._diagnose(node, parts), self._wait_for_change(robot, parts)]
        tasks: list[asyncio.Future[Any]] = [asyncio.ensure_future(job) for job in jobs]
        try:
            await asyncio.wait([*tasks, self._ended], return_when=asyncio.FIRST_COMPLETED)
            if self._ended.done():
                raise RosNameTaken(f"the node was ended: {self._ended.result()}")
            for task in tasks:
                if task.done():
                    task.result()
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def _wait_for_change(self, robot: AsyncRobot, parts: RosParts) -> None:
        """Return when the robot has other parts.  Raises ClientError when the server is lost."""
        while await self._look(robot) == parts:
            await asyncio.sleep(LOOK_PERIOD_S)
        log.info("the robot has other parts than before")

    # ---------------------------------------------------------------- what moves it

    async def _listen(self, node: RosNode, parts: RosParts) -> None:
        """Subscribe to what moves the robot, and to the emergency stop."""
        await self._follow(node, "/emergency_stop", "std_msgs/Bool", self._obey_stop, self._obey_latched_stop)
        if parts.drives:
            await self._follow(node, "/cmd_vel", "geometry_msgs/Twist", self._moving.drive)
        if parts.joints:
            await self._follow(node, "/joint_trajectory", "trajectory_msgs/JointTrajectory",
                               lambda who, said: self._moving.follow(who, said, parts.joints))

    def _obey_stop(self, who: str, said: dict[str, Any]) -> None:
        self._stop.hold(who, said["data"])

    def _obey_latched_stop(self, who: str, said: dict[str, Any]) -> None:
        """A release that was latched before the node came is too old, like a motion; a stop counts at any age."""
        if said["data"]:
            self._stop.hold(who, True)

    async def _follow(
        self, node: RosNode, topic: str, kind: str, take: Taking, take_old: Taking = _drop
    ) -> None:
        def receive(take: Taking, data: bytes, who: str) -> None:
            try:
                take(who, found.kind.decode(data))
            except MessageError as error:
                self._log.say((topic, who), "%s: %s: %s", topic, who, error)

        def gone(who: str) -> None:
            self._begin(self._moving.gone(who))

        found = await node.subscribe(topic, kind, partial(receive, take), gone, partial(receive, take_old))

    def _begin(self, work: Coroutine[Any, Any, None]) -> None:
        """Do something without waiting for it."""
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    # ---------------------------------------------------------------- diagnostics

    async def _diagnose(self, node: RosNode, parts: RosParts) -> None:
        """Publish the health of the robot, and why the last order was not carried out."""
        publication = await node.publish("/diagnostics", "diagnostic_msgs/DiagnosticArray")
        try:
            while True:
                if publication.subscribers:
                    publication.publish(publication.kind.encode(await self._health(parts.name)))
                await asyncio.sleep(DIAGNOSTICS_PERIOD_S)
        finally:
            await node.unpublish("/diagnostics")

    async def _health(self, name: str) -> dict[str, Any]:
        values: dict[str, Any] = {}
        try:
            told = await self._worker.ask("health")
        except NoWorker as error:
            level, reasons = readings.ERROR, [str(error)]
        else:
            found = judge(told)
            level, reasons = _LEVELS.get(level_of(found).word, readings.ERROR), [str(each) for each in found]
            values = {"estop": told.get("estop") or "", "link": told.get("link") is True}
        if self._moving.problem:
            level, reasons = max(level, readings.WARN), [*reasons, f"not carried out: {self._moving.problem}"]
        return readings.diagnostics(time.time(), name, level, reasons, values)


def _node_name(robot: str) -> str:
    """The name of the node: that of the robot, with signs that ROS takes."""
    return "urbihw_" + "".join(sign if sign.isascii() and sign.isalnum() else "_" for sign in robot)
