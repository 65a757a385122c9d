"""Topics that move the robot: each publisher of them is a client of its own.

What a publisher moves belongs to its connection to the server: limits, leases, stops of others and reasons hold.
``/cmd_vel`` has a dead man: without an order for ``DEAD_MAN_S`` the base stands (``drive.u`` in the server), and it
stands at once when the publisher has gone.  A trajectory ends, and its joints hold, when its publisher has gone or
sends another one.
"""

from __future__ import annotations

import asyncio
import logging
import math
import re
from collections.abc import Awaitable, Callable, Mapping
from typing import Any, Final

from urbihw.client.aio import AsyncRobot
from urbihw.client.driving import PROGRAM, order_text, parse_answer
from urbihw.client.errors import ClientError
from urbihw.repeats import LimitedLog
from urbihw.ros.rpc import cancel_all

log = logging.getLogger("urbihw.ros")

DEAD_MAN_S: Final = 0.5
"""Seconds without an order of a publisher after which the base stands."""
MAX_PUBLISHERS: Final = 8
"""Maximum number of publishers that move the robot; more have to wait until others have gone."""
MAX_POINTS: Final = 1000
MAX_DURATION_S: Final = 600.0
MAX_NUMBER: Final = 1e4
Connect = Callable[[], Awaitable[AsyncRobot]]


class WrongOrder(Exception):
    """An order that cannot be carried out; the text is for the log and for /diagnostics."""


class MovingPublisher:
    """One publisher: its connection, made with its first order, and the newest order that waits."""

    def __init__(self, name: str, connect: Connect, refused: Callable[[str], None]) -> None:
        """``refused`` gets the reason why an order was not carried out, "" when one was."""
        # ``why`` of what it moves shows the tag.
        self._tag = "ros_" + re.sub(r"\W", "_", name.strip("/"), flags=re.ASCII)[:80]
        self._connect, self._refused = connect, refused
        self._robot: AsyncRobot | None = None
        self._server_ahead = 0.0
        self._newest: Callable[[AsyncRobot], Awaitable[None]] | None = None
        self._news = asyncio.Event()
        self._task = asyncio.get_running_loop().create_task(self._obey())
        self._trajectory: asyncio.Task[None] | None = None

    def order(self, work: Callable[[AsyncRobot], Awaitable[None]]) -> None:
        """Carry out an order after the one in progress; an older one that still waits is dropped."""
        self._newest = work
        self._news.set()

    def drive(self, x: float, yaw: float) -> None:
        """Order speeds, m/s and rad/s."""
        made = asyncio.get_running_loop().time()

        async def work(robot: AsyncRobot) -> None:
            text = order_text(x, yaw, DEAD_MAN_S, made + self._server_ahead)
            driven = parse_answer(str(await robot.run(text, self._tag)))
            # The answer was on its way meanwhile: orders may seem older than they are, but never younger.
            self._server_ahead = driven.time - asyncio.get_running_loop().time()
            if driven.deferred:
                raise WrongOrder("somebody else has stopped or moved the base: send zero speeds first")

        self.order(work)

    def follow(self, text: str) -> None:
        """Run a trajectory in place of the one before."""

        async def work(robot: AsyncRobot) -> None:
            await self._end_trajectory()
            self._trajectory = asyncio.get_running_loop().create_task(self._run_trajectory(robot, text))

        self.order(work)

    async def close(self) -> None:
        """End the connection: what it moves stops."""
        await cancel_all({self._task})
        await self._end_trajectory()
        if self._robot is not None:
            await self._robot.close()

    async def _run_trajectory(self, robot: AsyncRobot, text: str) -> None:
        """The statement ends on the server when this is cancelled."""
        try:
            await robot.run(text, self._tag)
        except ClientError as error:
            self._refused(_line(error))

    async def _end_trajectory(self) -> None:
        if self._trajectory is not None:
            await cancel_all({self._trajectory})

    async def _obey(self) -> None:
        while True:
            await self._news.wait()
            self._news.clear()
            work = self._newest
            if work is None:
                continue
            try:
                await work(await self._connected())
                self._refused("")
            except (ClientError, WrongOrder, ValueError) as error:
                self._refused(_line(error))
                if self._robot is not None and not self._robot.connected:
                    await self._robot.close()
                    self._robot = None

    async def _connected(self) -> AsyncRobot:
        """The connection; a new one gets what an order needs."""
        if self._robot is None:
            robot = await self._connect()
            try:
                now = float(await robot.run(f'{PROGRAM}; System.time'))
            except BaseException:
                await robot.close()
                raise
            self._server_ahead = now - asyncio.get_running_loop().time()
            self._robot = robot
        return self._robot


class MovingPublishers:
    """All publishers that move the robot."""

    def __init__(self, connect: Connect) -> None:
        self._connect = connect
        self._publishers: dict[str, MovingPublisher] = {}
        self._problems: dict[str, str] = {}
        self._log = LimitedLog(log)

    @property
    def problem(self) -> str:
        """Why the last order of each publisher was not carried out, "" if all were."""
        return "; ".join(f"{publisher}: {why}" for publisher, why in self._problems.items())

    def drive(self, publisher: str, message: Mapping[str, Any]) -> None:
        """An order of /cmd_vel, a geometry_msgs/Twist."""
        x, yaw = message["linear"]["x"], message["angular"]["z"]
        if not all(map(math.isfinite, (x, yaw))) or max(abs(x), abs(yaw)) > MAX_NUMBER:
            self._refuse(publisher, f"/cmd_vel: no speeds: {x}, {yaw}")
            return
        self._with(publisher, lambda moving: moving.drive(x, yaw))

    def follow(self, publisher: str, message: Mapping[str, Any], joints: tuple[str, ...]) -> None:
        """A trajectory, a trajectory_msgs/JointTrajectory."""
        try:
            text = trajectory_text(message, joints)
        except WrongOrder as error:
            self._refuse(publisher, f"/joint_trajectory: {error}")
            return
        self._with(publisher, lambda moving: moving.follow(text))

    async def gone(self, publisher: str) -> None:
        """A publisher has gone: what it moves stops."""
        self._problems.pop(publisher, None)
        found = self._publishers.pop(publisher, None)
        if found is not None:
            await found.close()

    async def close(self) -> None:
        """All publishers are over."""
        for name in list(self._publishers):
            await self.gone(name)

    def _with(self, publisher: str, act: Callable[[MovingPublisher], None]) -> None:
        found = self._publishers.get(publisher)
        if found is None:
            if len(self._publishers) >= MAX_PUBLISHERS:
                self._refuse(publisher, f"{MAX_PUBLISHERS} publishers move the robot already")
                return
            found = MovingPublisher(publisher, self._connect, lambda why: self._refuse(publisher, why))
            self._publishers[publisher] = found
        act(found)

    def _refuse(self, publisher: str, why: str) -> None:
        if not why:
            self._problems.pop(publisher, None)
            return
        if len(self._problems) < 2 * MAX_PUBLISHERS:
            self._problems[publisher] = why
        self._log.say((publisher, why), "%s: %s", publisher[:80], why)


def _line(error: Exception) -> str:
    """The first line of an error."""
    return (str(error).splitlines() or ["refused"])[0]


def trajectory_text(message: Mapping[str, Any], joints: tuple[str, ...]) -> str:
    """The urbiscript of a trajectory: all joints at the same time, each from point to point.  Raises WrongOrder."""
    names, points = message["joint_names"], message["points"]
    unknown = [name for name in names if name not in joints]
    if unknown:
        raise WrongOrder(f"no joint {unknown[0][:80]!r}; there are: {', '.join(joints) or 'none'}")
    if len(set(names)) != len(names) or not names:
        raise WrongOrder("the names of the joints are empty or not different")
    if not 0 < len(points) <= MAX_POINTS:
        raise WrongOrder(f"{len(points)} points: 1 to {MAX_POINTS} can be followed")
    steps: list[list[str]] = [[] for _ in names]
    last = 0.0
    for number, point in enumerate(points):
        at = point["time_from_start"]["secs"] + point["time_from_start"]["nsecs"] / 1e9
        if not last < at <= MAX_DURATION_S and not at == last == 0:
            raise WrongOrder(f"point {number} is at {at:g} s: times must grow, up to {MAX_DURATION_S:g} s")
        if len(point["positions"]) != len(names) or not all(map(math.isfinite, point["positions"])):
            raise WrongOrder(f"point {number} must have a position for each of the {len(names)} joints")
        for step, name, position in zip(steps, names, point["positions"], strict=True):
            time = f" time:{at - last:.6g}" if at > last else ""
            step.append(f"{name}.val = {position:.9g}{time}")
        last = at
    return " & ".join(f"{{ {' | '.join(step)} }}" for step in steps)
