"""``Fleet`` in urbiscript: its library in simulated time, and the bridge that serves it."""

from __future__ import annotations

import asyncio
import re
import threading
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from fleet_lab import FleetLab, ask, fleet_lab, until
from lang.transcript import Player, read

from urbihw.cli import fleet
from urbihw.client.credentials import Credentials
from urbihw.client.streams import EventSample
from urbihw.client.where import Where
from urbihw.fleets import script
from urbihw.fleets.script import PROGRAM, FleetScript
from urbihw.fleets.settings import FleetSettings

TRANSCRIPT = Path(__file__).with_name("fleet.chk")
LIBRARY_LINES = PROGRAM.count("\n") + 2


def test_the_library_of_urbiscript() -> None:
    text = TRANSCRIPT.read_text()
    outcomes = Player().play(read(TRANSCRIPT, f"//-- library\n{PROGRAM}\n{text}"))
    answered = [line for each in outcomes for line in each.answered]
    expected = [line for line in text.splitlines() if line.startswith("[")]
    assert [_placed(line) for line in answered] == expected


def _placed(line: str) -> str:
    """An answer whose places in the library are named so, and whose others are those of the transcript."""
    def place(match: re.Match[str]) -> str:
        number = int(match[1]) - LIBRARY_LINES
        return f"{number}.{match[2]}:" if number > 0 else "FLEET:"

    return re.sub(r"\b(\d+)\.(\d+-\d+):", place, line)


class PlayedDaemon:
    """The daemon: `said` is what it was told; what it asks is put into `asked`; it is `held` or answers."""

    def __init__(self) -> None:
        self.said: list[str] = []
        self.asked: asyncio.Queue[tuple[Any, ...]] = asyncio.Queue()
        self.held = asyncio.Event()
        self.watched: list[Any] = []

    async def __aenter__(self) -> PlayedDaemon:
        return self

    async def __aexit__(self, *_: object) -> None: ...

    async def run(self, text: str, timeout: float = 0.0) -> Any:
        while self.held.is_set():
            await asyncio.sleep(0.01)
        if text != "1":
            self.said.append(text)
        return self.watched if text == "Fleet.watched" else []

    def events(self, path: str) -> PlayedEvents:
        assert path == "Fleet.asked"
        return PlayedEvents(self.asked)

    def heard(self, begin: str) -> list[str]:
        return [text.removeprefix(begin) for text in self.said if text.startswith(begin)]


class PlayedEvents:
    """Emissions of ``Fleet.asked``."""

    def __init__(self, asked: asyncio.Queue[tuple[Any, ...]]) -> None:
        self._asked = asked

    async def __aenter__(self) -> PlayedEvents:
        return self

    async def __aexit__(self, *_: object) -> None: ...

    async def __aiter__(self) -> AsyncIterator[EventSample]:
        while True:
            yield EventSample(0.0, await self._asked.get())


def played(
    scene: Callable[[FleetLab, PlayedDaemon, FleetScript], Awaitable[None]], watched: Sequence[Any] = ()
) -> None:
    """Play a scene: alice, and the script of bob, whose daemon knows ``watched``."""

    async def play() -> None:
        async with fleet_lab() as lab:
            await lab.join("alice", drive=("bob",))
            daemon, line = PlayedDaemon(), await lab.line("bob")
            daemon.watched.extend(watched)

            async def connect() -> Any:
                return daemon

            script = FleetScript(connect, line)
            line.is_alive = script.is_alive
            running = asyncio.create_task(script.run())
            try:
                await scene(lab, daemon, script)
            finally:
                running.cancel()
                await asyncio.wait((running,))

    asyncio.run(play())


def test_who_comes_and_goes_is_told() -> None:
    async def scene(lab: FleetLab, daemon: PlayedDaemon, script: FleetScript) -> None:
        await until(lambda: daemon.heard("Fleet.met(") == ['"alice")|'])
        await lab.join("carol")
        await until(lambda: daemon.heard("Fleet.met(") == ['"alice")|', '"carol")|'])
        await lab.leave("carol")
        await until(lambda: daemon.heard("Fleet.missed(") == ['"carol")|'])

    played(scene)


def test_questions_are_answered_and_errors_name_the_robot() -> None:
    async def scene(lab: FleetLab, daemon: PlayedDaemon, script: FleetScript) -> None:
        asked: list[tuple[Any, ...]] = [
            ("1", "alice", "describe", [], 2.0), ("2", "alice", "write", ["wheel.speed", 9.0], 2.0),
            ("3", "alice", "call", ["robot.go", 1.0], 2.0), ("4", "carol", "describe", [], 0.3),
            ("5", "alice", "write", ["hat", 1.0], 2.0), ("6", "alice", "dance", [], 2.0), ("7", "*", "estop", [], 2.0),
            ("8", "a/*", "watch", ["wheel.speed"], 2.0), ("9", "alice", "call", ["robot.go", None], 2.0),
        ]  # fmt: skip
        for each in asked:
            daemon.asked.put_nowait(each)
        await until(lambda: len(daemon.heard("Fleet.answered(")) == len(asked))
        told = dict(text.split(", ", 1) for text in daemon.heard("Fleet.answered("))
        assert told['"1"'] == 'true, [["sonar.val", "wheel.speed"], ["robot.go", "robot.stop"]])|'
        assert told['"2"'] == told['"3"'] == told['"7"'] == "true, nil)|"
        assert told['"4"'] == 'false, "carol is not in the fleet school")|'
        assert told['"5"'] == 'false, "alice: hat is no effector of the robot")|'
        assert told['"6"'] == 'false, "alice: there is no dance")|'
        assert "is no name in a fleet" in told['"8"']
        assert {"wheel.speed": 9.0} in lab.robots["alice"].did
        assert ("estop", "bob (fleet)") in lab.robots["alice"].played.asked

    played(scene)


def test_a_call_ends_with_the_job_that_has_made_it() -> None:
    async def scene(lab: FleetLab, daemon: PlayedDaemon, script: FleetScript) -> None:
        daemon.asked.put_nowait(("1", "alice", "call", ["robot.go", 9.0], 8.0))
        robot = lab.robots["alice"]
        await until(lambda: robot.did == [("robot.go", (9.0,))])
        daemon.asked.put_nowait(("2", "alice", "cancel", ["2"], 8.0))
        await until(lambda: daemon.heard("Fleet.answered(") == ['"2", true, nil)|'])
        assert "cancelled" not in robot.connections[0].did
        daemon.asked.put_nowait(("3", "alice", "cancel", ["1"], 8.0))
        await until(lambda: "cancelled" in robot.connections[0].did)

    played(scene)


def test_a_stop_waits_for_no_question() -> None:
    async def scene(lab: FleetLab, daemon: PlayedDaemon, script: FleetScript) -> None:
        robot = lab.robots["alice"]
        asked = list(robot.played.asked)
        for number in range(100):
            daemon.asked.put_nowait((str(number), "alice", "call", ["robot.go", 9.0], 8.0))
        await until(lambda: len(robot.did) >= 32)
        daemon.asked.put_nowait(("100", "*", "estop", [], 8.0))
        daemon.asked.put_nowait(("101", "alice", "call", ["robot.stop"], 8.0))
        await until(lambda: {'"100", true, nil)|', '"101", true, nil)|'} <= set(daemon.heard("Fleet.answered(")))
        assert {verb for verb, _ in robot.played.asked} == {"estop", "stop"} and not asked
        # To end a question takes no place of one, either.
        daemon.asked.put_nowait(("102", "alice", "cancel", ["0"], 8.0))
        await until(lambda: "cancelled" in robot.connections[0].did)

    played(scene)


def test_a_call_of_a_job_that_has_ended_is_not_sent() -> None:
    async def scene(lab: FleetLab, daemon: PlayedDaemon, script: FleetScript) -> None:
        line, says = lab.lines[0], threading.Event()
        hello = line.hello

        def slow(robot: str, *given: float) -> bool:
            return says.wait(9.0) and hello(robot, *given)

        line.hello = slow  # type: ignore[method-assign, assignment]
        daemon.asked.put_nowait(("1", "alice", "call", ["robot.go", 1.0], 8.0))
        daemon.asked.put_nowait(("2", "alice", "cancel", ["1"], 8.0))
        await until(lambda: '"2", true, nil)|' in daemon.heard("Fleet.answered("))
        says.set()
        told = '"1", false, "alice: the job that has asked has ended")|'
        await until(lambda: told in daemon.heard("Fleet.answered("))
        assert lab.robots["alice"].did == []

    played(scene)


def test_a_bridge_that_was_started_again_watches_what_programs_have_read() -> None:
    async def scene(lab: FleetLab, daemon: PlayedDaemon, script: FleetScript) -> None:
        await until(lambda: daemon.heard("Fleet.took(") == ['"alice", ["sonar.val" => 0.5])|'])

    played(scene, watched=[["alice", ["sonar.val"]]])


def test_only_changes_of_slots_that_were_read_are_told() -> None:
    async def scene(lab: FleetLab, daemon: PlayedDaemon, script: FleetScript) -> None:
        await until(lambda: daemon.heard("Fleet.met("))
        await asyncio.sleep(0.2)
        assert daemon.heard("Fleet.took(") == []
        daemon.asked.put_nowait(("1", "alice", "watch", ["sonar.val"], 2.0))
        await until(lambda: daemon.heard("Fleet.answered(") == ['"1", true, 0.5)|'])
        await asyncio.sleep(0.3)
        assert daemon.heard("Fleet.took(") in ([], ['"alice", ["sonar.val" => 0.5])|'])

    played(scene)


RUBBISH = (
    b"", b"[", b"7", b"{}", b"\xff", b"[" * 60000, b'{"t": 1, "v": 7}', b'{"t": {}, "v": {"sonar.val": 0.1}}',
    b'{"t": 1, "v": {"sonar.val": %s}}' % (b"9" * 400), b'{"t": 1, "v": {"sonar.val": {"a": 1}}}',
    b'{"t": 1, "v": {"sonar.val": %s}}' % (b"[" * 30 + b"]" * 30), b'{"t": 1, "v": {"sonar.val": "\\ud800"}}',
)  # fmt: skip


def test_rubbish_of_another_one_ends_nothing() -> None:
    async def scene(lab: FleetLab, daemon: PlayedDaemon, script: FleetScript) -> None:
        lab.robots["alice"].on_values = lambda: None
        line = await lab.line("ben")
        for payload in (*RUBBISH, b'{"t": 1, "v": {"sonar.val": 0.75}}'):
            await asyncio.sleep(0.02)
            line._session.put(line.keys.values.replace("ben", "alice"), payload)
        await until(lambda: '"alice", ["sonar.val" => 0.75])|' in daemon.heard("Fleet.took("))
        assert set(daemon.heard("Fleet.took(")) <= {f'"alice", ["sonar.val" => {each}])|' for each in (0.5, 0.75)}
        # An answer, too.
        lab.robots["alice"].values = {"sonar.val": 10**400}
        daemon.asked.put_nowait(("1", "alice", "watch", ["sonar.val"], 2.0))
        daemon.asked.put_nowait(("2", "alice", "watch", [], 2.0))
        await until(lambda: len([told for told in daemon.heard("Fleet.answered(") if ", false, " in told]) == 2)

    played(scene, watched=[["alice", ["sonar.val"]]])


def test_the_death_of_what_programs_see_leaves_the_bridge(monkeypatch: pytest.MonkeyPatch) -> None:
    begun = []

    class Script:
        def __init__(self, *_: object) -> None:
            self.is_alive = lambda: True

        async def run(self) -> None:
            begun.append(self)
            raise RuntimeError("it has died")

    async def play() -> None:
        async with fleet_lab() as lab:
            settings = FleetSettings(
                "school", "alice", Where("127.0.0.1", 1), Credentials(), Path("nowhere"), lab.endpoint
            )
            running = asyncio.create_task(fleet._run(settings))
            await until(lambda: len(begun) > 2 or running.done())
            assert not running.done()
            running.cancel()
            await asyncio.wait((running,))

    monkeypatch.setattr(script, "FleetScript", Script)
    monkeypatch.setattr(fleet, "RETRY_S", 0.01)
    asyncio.run(play())


def test_what_a_held_daemon_drives_elsewhere_gets_no_signs_of_life() -> None:
    async def scene(lab: FleetLab, daemon: PlayedDaemon, script: FleetScript) -> None:
        await until(script.is_alive)
        await ask(lab.lines[0].write, "alice", {"wheel.speed": 1.0})
        (connection,) = lab.robots["alice"].connections
        fed = connection.term.fed
        await until(lambda: connection.term.fed > fed + 2)
        daemon.held.set()
        await until(lambda: not script.is_alive())
        await asyncio.sleep(0.5)
        fed = connection.term.fed
        await asyncio.sleep(1.0)
        assert connection.term.fed == fed

    played(scene)
