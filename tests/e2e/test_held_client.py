"""A client with a lease that is held by SIGSTOP or leaves its block, and the body that it moves."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from faults_lab import ROOT, Client, Daemon, Watcher, wait_for
from moving_robots import RIGS

pytestmark = pytest.mark.e2e

PROGRAM = """
import select, sys, urbihw
robot = urbihw.connect("127.0.0.1", int(sys.argv[1]), timeout=60)
robot.run("while (!Global.hasSlot(\\"motor7\\")) sleep(50ms)")
try:
    with robot.lease(seconds=0.5):
        # A program in the server does not keep the lease of its client.
        robot.run("detach({ every| (100ms) { try { lobby.lease = 0.5 | motor7.speed = 2 } catch {} } })")
        # Again and again: a machine that is busy for half a second ends the lease, too.
        while not select.select([sys.stdin], [], [], 0.2)[0]:
            robot.run("motor7.cwLimit = 0|; motor7.ccwLimit = 0|; motor7.speed = 2")
        raise ValueError
except ValueError:
    sys.stdin.readline()
    sys.stdin.readline()
"""


def test_what_a_held_client_moves_stands_and_moves_again_when_it_goes_on(tmp_path: Path) -> None:
    (rig,) = (rig for rig in RIGS if rig.name == "Bioloid, a wheel")
    end, look = rig.make()
    with end, contextlib.ExitStack() as stack:
        end.start()
        daemon = Daemon(tmp_path, "bioloid", end.url)
        stack.callback(daemon.close)
        command = (sys.executable, "-c", PROGRAM, str(daemon.port))
        client = stack.enter_context(subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE))
        stack.callback(client.kill)
        watcher = stack.enter_context(contextlib.closing(Watcher(end, look)))
        for _ in range(2):
            wait_for(lambda: watcher.speed() > 1.5, "the wheel to turn")
            os.kill(client.pid, signal.SIGSTOP)
            wait_for(lambda: watcher.speed() == 0, "the wheel to stand")
            os.kill(client.pid, signal.SIGCONT)
        wait_for(lambda: watcher.speed() > 1.5, "the wheel to turn again")
        assert "has sent nothing for 0.5 s (lobby.lease)" in daemon.log()
        assert client.stdin is not None
        client.stdin.write(b"leave\n")
        client.stdin.flush()
        wait_for(lambda: watcher.speed() == 0, "the wheel to stand when the block has been left")
        assert client.poll() is None
        _check_backlog(daemon, watcher)


def _check_backlog(daemon: Daemon, watcher: Watcher) -> None:
    """What a client has sent before it was accepted, and before an emergency stop, does not move the body after the
    release."""
    os.kill(daemon.process.pid, signal.SIGSTOP)
    with contextlib.closing(Client(daemon.port)) as waiting:
        waiting.say('motor7.speed = 2; echo("first");')
        begun = time.monotonic()
        daemon.order(do="estop", who="test")
        answer = daemon.order(do="release", who="test")
        os.kill(daemon.process.pid, signal.SIGCONT)
        assert json.loads(answer)["released"]
        waiting.wait("first")
        time.sleep(0.3)
        assert watcher.peak(begun) == 0, waiting.heard
        waiting.say("motor7.speed = 2;")
        wait_for(lambda: watcher.speed() > 1.5, "the wheel to turn by what is sent after the release")
