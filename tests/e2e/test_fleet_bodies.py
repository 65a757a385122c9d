"""Two daemons in a fleet, judged by the bodies of their simulated robots."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import pytest
from faults_lab import Watcher, wait_for
from moving_robots import RIGS, Rig

from test_serve import TIMEOUT_S, URBIHW, Daemon  # isort: skip
import starts

pytestmark = pytest.mark.e2e

TEACHER = """
import sys, time, urbihw
with urbihw.fleet("school", "teacher", sys.argv[1]) as school:
    school["alice"].robot.xSpeed = float(sys.argv[2])
    time.sleep(600)
"""
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
        alice = Member(folder / "alice", "alice", PIONEER, endpoint, stack)
        bob = Member(folder / "bob", "bob", WHEEL, endpoint, stack)
        wait_for(lambda: names(endpoint) == ["alice", "bob"], "both robots")
        yield endpoint, alice, bob


def command(endpoint: str, *words: str) -> subprocess.CompletedProcess[str]:
    line = (*URBIHW, "fleet", *words, "--endpoint", endpoint)
    return starts.run(line, capture_output=True, text=True, timeout=TIMEOUT_S)


def names(endpoint: str) -> list[str]:
    return [line.split()[0] for line in command(endpoint, "ls").stdout.splitlines()]


def test_what_a_far_client_moves_stops_when_he_is_held_or_killed(members: tuple[str, Member, Member]) -> None:
    endpoint, alice, bob = members
    # To and fro: there are walls.
    for number, speed in ((signal.SIGSTOP, "0.3"), (signal.SIGKILL, "-0.3")):
        with subprocess.Popen((sys.executable, "-c", TEACHER, endpoint, speed)) as teacher:
            try:
                wait_for(lambda: alice.moves, "alice, whom the teacher drives")
                os.kill(teacher.pid, number)
                wait_for(lambda: alice.stands, f"alice to stand after signal {number}")
            finally:
                teacher.kill()
    # A program of bob, whose daemon is held then.
    bob.client.say('Fleet["alice"].robot.xSpeed = -0.3;')
    wait_for(lambda: alice.moves, "alice, whom bob drives")
    bob.daemon.process.send_signal(signal.SIGSTOP)
    try:
        wait_for(lambda: alice.stands, "alice to stand while bob is held")
    finally:
        bob.daemon.process.send_signal(signal.SIGCONT)


def test_one_stop_holds_all_while_a_program_holds_an_interpreter(members: tuple[str, Member, Member]) -> None:
    endpoint, alice, bob = members
    bob.client.say(bob.rig.go)
    wait_for(lambda: bob.moves, "bob")
    # The death of the bridges stops no program of the robots themselves.
    bridges = [each.bridge() for each in (alice, bob)]
    for pid in bridges:
        os.kill(pid, signal.SIGKILL)
    wait_for(lambda: names(endpoint) == ["alice", "bob"], "both robots again")
    assert {alice.bridge(), bob.bridge()}.isdisjoint(bridges)
    wait_for(lambda: bob.moves, "bob, who goes on")
    alice.client.say(alice.rig.go)
    wait_for(lambda: alice.moves, "alice")
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
