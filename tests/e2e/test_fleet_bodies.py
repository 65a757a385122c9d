"""Two daemons in a fleet, judged by the bodies of their simulated robots."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing
from pathlib import Path

import pytest
from faults_lab import Watcher, wait_for
from moving_robots import RIGS, Rig

from urbihw.fleets.line import FleetError, FleetLine
from urbihw.fleets.meeting import NoMeeting

from test_serve import TIMEOUT_S, URBIHW, Daemon  # isort: skip
import starts

pytestmark = pytest.mark.e2e

TEACHER = """
import sys, time, urbihw
from urbihw.fleets.line import FleetError
with urbihw.fleet("school", "teacher", sys.argv[1]) as school:
    for _ in range(100):  # an order that was too long on its way moves nothing
        try:
            school["alice"].robot.xSpeed = float(sys.argv[2])
            break
        except FleetError as error:
            print(error, file=sys.stderr)
    else:
        sys.exit(1)
    time.sleep(600)
"""
MOST_SAID = 100
"""Times that a motion is said, and answered, before it counts as one that does not begin."""
PIONEER = next(rig for rig in RIGS if rig.name == "Pioneer 3-DX")
WHEEL = next(rig for rig in RIGS if rig.name == "Bioloid, a wheel")


class Member:
    """A robot with its daemon."""

    def __init__(self, folder: Path, name: str, rig: Rig, endpoint: str, stack: ExitStack) -> None:
        self.rig = rig
        end, look = self.rig.make()
        stack.enter_context(end)
        end.start()
        self.watcher = stack.enter_context(closing(Watcher(end, look)))
        folder.mkdir()
        (folder / "urbihw.toml").write_text(
            f'url = "{end.url}"\nfleet = "school"\nname = "{name}"\nfleet_endpoint = "{endpoint}"\n'
            'fleet_drive = ["teacher", "bob"]\nquiet = true\nhold_limit = 0\ndead_man = 30\n'
        )
        arguments = ("--platform", self.rig.platform, "--config", str(folder / "urbihw.toml"))
        self.daemon = stack.enter_context(closing(Daemon(folder, *arguments)))
        self.client = self.daemon.client()
        if self.rig.prepare:
            self.client.say(f"{self.rig.prepare} waituntil({self.rig.until}); echo(\"it is ready\");")
            self.client.wait("it is ready")

    @property
    def moves(self) -> bool:
        return self.watcher.speed() > self.rig.moving

    @property
    def stands(self) -> bool:
        return self.watcher.speed() <= self.rig.rest

    def drive(self, go: str = "", driven: Member | None = None) -> None:
        """Set the robot in motion, or another one, and wait until it moves.

        What is said while the bus worker takes the daemon for dead moves nothing: it is said again after each answer.
        """
        driven, said = driven or self, 0
        while not driven.moves:
            said += 1
            assert said <= MOST_SAID, f"{driven.rig.name} does not move: {self.client.heard[-500:]}"
            end = f"said {said} of {len(self.client.heard)}"
            self.client.say(f"{go or self.rig.go} sleep(100ms); echo(\"{end}\");")
            self.client.wait(end)

    def bridge(self) -> int:
        """The process of its bridge."""
        # A process is a child of the thread that has started it.
        for children in Path(f"/proc/{self.daemon.process.pid}/task").glob("*/children"):
            for child in children.read_text().split():
                if b"\0fleet\0bridge\0" in Path(f"/proc/{child}/cmdline").read_bytes():
                    return int(child)
        raise AssertionError("there is no bridge")


@pytest.fixture(scope="module")
def members(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, Member, Member]]:
    """The endpoint of a fleet, alice and bob."""
    folder = tmp_path_factory.mktemp("fleet")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    with ExitStack() as stack:
        pool = stack.enter_context(ThreadPoolExecutor(2))
        begun = [
            pool.submit(Member, folder / name, name, rig, endpoint, stack)
            for name, rig in (("alice", PIONEER), ("bob", WHEEL))
        ]
        alice, bob = [each.result() for each in begun]
        wait_for(lambda: names(endpoint) == ["alice", "bob"], "both robots")
        yield endpoint, alice, bob


def command(endpoint: str, *words: str) -> subprocess.CompletedProcess[str]:
    line = (*URBIHW, "fleet", *words, "--endpoint", endpoint)
    return starts.run(line, capture_output=True, text=True, timeout=TIMEOUT_S)


def names(endpoint: str) -> list[str]:
    try:
        with FleetLine("school", "looker", endpoint) as line:
            # A bridge is there before it has learnt what its robot has.
            return [name for name in line.robots() if line.info(name)["calls"]]
    except (NoMeeting, FleetError):
        return []


def test_what_a_far_client_moves_stops_when_he_is_held_or_killed(members: tuple[str, Member, Member]) -> None:
    endpoint, alice, bob = members
    # To and fro: there are walls.
    for number, speed in ((signal.SIGSTOP, "0.3"), (signal.SIGKILL, "-0.3")):
        with subprocess.Popen((sys.executable, "-c", TEACHER, endpoint, speed)) as teacher:
            try:
                while not alice.moves:
                    assert teacher.poll() is None, "the teacher has ended"
                    time.sleep(0.01)
                os.kill(teacher.pid, number)
                wait_for(lambda: alice.stands, f"alice to stand after signal {number}")
            finally:
                teacher.kill()
    # A program of bob, whose daemon is held then.
    bob.drive('Fleet["alice"].robot.xSpeed = -0.3;', alice)
    bob.daemon.process.send_signal(signal.SIGSTOP)
    try:
        wait_for(lambda: alice.stands, "alice to stand while bob is held")
    finally:
        bob.daemon.process.send_signal(signal.SIGCONT)


def test_one_stop_holds_all_while_a_program_holds_an_interpreter(members: tuple[str, Member, Member]) -> None:
    endpoint, alice, bob = members
    bob.drive()
    # The death of the bridges stops no program of the robots themselves.
    bridges = [each.bridge() for each in (alice, bob)]
    for pid in bridges:
        os.kill(pid, signal.SIGKILL)
    wait_for(lambda: names(endpoint) == ["alice", "bob"], "both robots again")
    assert {alice.bridge(), bob.bridge()}.isdisjoint(bridges)
    wait_for(lambda: bob.moves, "bob, who goes on")
    alice.drive()
    alice.client.say("loop|{},")
    time.sleep(0.3)
    told = command(endpoint, "stop")
    assert told.returncode == 0 and told.stderr == ""
    assert sorted(line.split()[0] for line in told.stdout.splitlines()) == ["alice", "bob"]
    for each in (alice, bob):
        wait_for(lambda each=each: each.stands, "the robot to stand")  # type: ignore[misc]
    bob.client.say(bob.rig.go)
    bob.client.wait("emergency stop")
    assert bob.stands
