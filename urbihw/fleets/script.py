"""The fleet as programs of this robot see it: the object ``Fleet`` of urbiscript (``fleet.u``).

The bridge defines it and serves it, as a client of the daemon: it hears what is asked as an event, and answers by
statements.  A slot of another robot is watched there once a program has read it, and each change becomes one assignment
here.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Awaitable, Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from importlib.resources import files
from typing import Any, Final

from urbihw.backoff import BackOff
from urbihw.client.aio import AsyncRobot
from urbihw.client.errors import ClientError
from urbihw.client.literals import literal, string_literal
from urbihw.fleets.line import FleetError, FleetLine, FleetTask
from urbihw.fleets.names import ALL, checked_fleet_name, is_stop

log = logging.getLogger("urbihw.fleets")

PROGRAM: Final = files("urbihw.fleets").joinpath("fleet.u").read_text("ascii")
FIRST_PAUSE_S: Final = 0.25
MAX_PAUSE_S: Final = 2.0
START_TIMEOUT_S: Final = 30.0
"""Seconds in which the daemon has learnt what ``Fleet`` is: the machine may be busy."""
MOST_AT_ONCE: Final = 8
"""Stops, and ends of questions, that are on their way at the same time; others wait."""
MOST_ASKED: Final = 32
"""Questions of programs that may wait for an answer."""
ALIVE_S: Final = 0.25
"""Seconds since an answer of the daemon for which it counts as alive: then what it drives elsewhere goes on."""
PING_PERIOD_S: Final = 0.1
MAX_WAIT_S: Final = 60.0


class FleetScript:
    """Serves ``Fleet`` in one daemon.  ``line`` asks the fleet under the name of the robot; ``run`` runs until it is
    cancelled.  Set ``is_alive`` of the line to that of this object.
    """

    def __init__(self, connect: Callable[[], Awaitable[AsyncRobot]], line: FleetLine) -> None:
        self._connect = connect
        self._line = line
        self._loop = asyncio.get_running_loop()
        self._answered_at = -1.0
        self._here: set[str] = set()
        self._wanted: dict[str, set[str]] = {}
        self._fresh: dict[str, dict[str, Any]] = {}
        self._changed = asyncio.Event()
        self._asked: set[asyncio.Task[None]] = set()
        self._tasks: dict[str, FleetTask] = {}
        # Stops wait for no question, and for no end of one.
        self._questions = ThreadPoolExecutor(MOST_ASKED, "fleet-question")
        self._ends = ThreadPoolExecutor(MOST_AT_ONCE, "fleet-end")
        self._stops = ThreadPoolExecutor(MOST_AT_ONCE, "fleet-stop")

    def is_alive(self) -> bool:
        """Whether the daemon answers: what a held program drives elsewhere must stop."""
        return time.monotonic() - self._answered_at < ALIVE_S

    async def run(self) -> None:
        """Serve until the task is cancelled; a daemon that has gone is waited for."""
        held = self._line.hear(lambda name, there: self._post(self._note, name, there)), self._line.hear_values(
            lambda name, values: self._post(self._take, name, values)
        )
        pauses = BackOff(FIRST_PAUSE_S, MAX_PAUSE_S)
        try:
            while True:
                try:
                    async with await self._connect() as robot:
                        await self._serve(robot, pauses)
                except* ClientError as errors:
                    log.debug("the daemon: %s", errors.exceptions[0])
                await asyncio.sleep(pauses.next_pause())
        finally:
            for task in self._asked:
                task.cancel()
            for each in (self._questions, self._ends, self._stops):
                each.shutdown(wait=False, cancel_futures=True)
            self._line.close()
            del held

    async def _serve(self, robot: AsyncRobot, pauses: BackOff) -> None:
        await robot.run('lobby.introduce("fleet")|')
        await robot.run(f'if (!Global.hasLocalSlot("Fleet")) {{ {PROGRAM} }}|', timeout=START_TIMEOUT_S)
        pauses.reset()
        for name in await robot.run("Fleet.robots.keys"):
            if name not in self._here:
                await robot.run(f"Fleet.missed({string_literal(name)})|")
        # Another bridge may have had them watched.
        self._wanted = {name: set(paths) for name, paths in await robot.run("Fleet.watched")}
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._ping(robot))
            tasks.create_task(self._tell(robot))
            async with robot.events("Fleet.asked") as asked:
                async for sample in asked:
                    self._begin(robot, sample.args)

    async def _ping(self, robot: AsyncRobot) -> None:
        while True:
            await robot.run("1")
            self._answered_at = time.monotonic()
            await asyncio.sleep(PING_PERIOD_S)

    # ---------------------------------------------------------------- what the fleet tells

    def _post(self, work: Callable[..., None], *args: Any) -> None:
        with contextlib.suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(work, *args)

    def _note(self, name: str, there: bool) -> None:
        if name != self._line.keys.name:
            (self._here.add if there else self._here.discard)(name)
            self._changed.set()

    def _take(self, name: str, values: Mapping[str, Any]) -> None:
        """Keep what has changed of the slots that programs have read; only the newest counts."""
        wanted = self._wanted.get(name)
        if wanted:
            self._fresh.setdefault(name, {}).update((path, values[path]) for path in wanted if path in values)
            self._changed.set()

    async def _tell(self, robot: AsyncRobot) -> None:
        """Tell the daemon who is there and what has changed, one statement at a time."""
        told: set[str] = set()
        sent: dict[str, dict[str, Any]] = {}
        self._changed.set()
        while True:
            await self._changed.wait()
            self._changed.clear()
            for name in sorted(self._here ^ told):
                verb = "met" if name in self._here else "missed"
                told ^= {name}
                await robot.run(f"Fleet.{verb}({string_literal(name)})|")
            while self._fresh:
                name, values = self._fresh.popitem()
                before = sent.setdefault(name, {})
                changed = {path: value for path, value in values.items() if before.get(path, before) != value}
                if changed:
                    before.update(changed)
                    await robot.run(f"Fleet.took({string_literal(name)}, {literal(changed)})|")

    # ---------------------------------------------------------------- what programs ask

    def _begin(self, robot: AsyncRobot, asked: tuple[Any, ...]) -> None:
        task = self._loop.create_task(self._answer(robot, asked))
        self._asked.add(task)
        task.add_done_callback(self._asked.discard)

    async def _answer(self, robot: AsyncRobot, asked: tuple[Any, ...]) -> None:
        number, name, verb, args, patience = asked
        number = str(number)
        try:
            value = await self._ask(FleetTask(number), str(name), str(verb), list(args), min(patience, MAX_WAIT_S))
            told = f"true, {literal(value)}"
        except (FleetError, ValueError, TypeError, ArithmeticError, LookupError) as error:
            told = f"false, {string_literal(str(error))}"
        with contextlib.suppress(ClientError):
            await robot.run(f"Fleet.answered({string_literal(number)}, {told})|")

    async def _ask(self, task: FleetTask, name: str, verb: str, args: list[Any], patience: float) -> Any:
        """What the fleet answers.  Raises FleetError, and ValueError for what cannot be asked."""
        work = partial(self._do, task, name, verb, args, patience)
        if verb in ("estop", "release") or (verb == "call" and is_stop(str(args[0]))):
            return await self._loop.run_in_executor(self._stops, work)
        if verb == "cancel":
            begun = self._tasks.get(str(args[0]))
            if begun is not None:
                begun.ended = True
            return await self._loop.run_in_executor(self._ends, work)
        if len(self._tasks) >= MOST_ASKED:
            raise FleetError(f"{name}: more than {MOST_ASKED} questions wait for an answer")
        self._tasks[task.number] = task
        try:
            value = await self._loop.run_in_executor(self._questions, work)
        finally:
            del self._tasks[task.number]
        if verb == "watch":
            self._wanted.setdefault(name, set()).add(args[0])
        return value

    def _do(self, task: FleetTask, name: str, verb: str, args: list[Any], patience: float) -> Any:
        """Ask, in a thread."""
        line = self._line
        if verb in ("estop", "release"):
            failed = line.stop(verb, ALL if name == ALL else checked_fleet_name(name)).failed
            if failed:
                raise FleetError("; ".join(f"{robot}: {why}" for robot, why in failed.items()))
            return None
        if verb == "describe":
            info = line.info(name)
            if not info["slots"] and not info["calls"]:
                raise FleetError(f"{name} has not told yet what it has")
            return [sorted(info["slots"]), info["calls"]]
        if verb == "watch":
            return line.value(name, args[0])["value"]
        if verb == "write":
            line.write(name, {args[0]: args[1]}, patience, task)
            return None
        if verb == "call":
            path, *rest = args
            return line.call(name, path, *rest, timeout=patience, task=task)
        if verb == "cancel":
            line.cancel(name, str(args[0]))
            return None
        raise FleetError(f"{name}: there is no {verb}")
