"""A client holds the interpreter of a real daemon, and the body that another client moves goes on."""

from __future__ import annotations

import contextlib
import time
from pathlib import Path

import pytest
from faults_lab import Client, Daemon, Watcher, wait_for
from moving_robots import RIGS

pytestmark = pytest.mark.e2e

HELD = "held the interpreter for more than 0.2 s"
ENDED = "is ended: it held the interpreter on"


def test_a_program_that_holds_on_is_ended_and_the_wheel_of_another_turns_on(tmp_path: Path) -> None:
    """The dead man has a margin here that no loaded machine uses up; ``tests/daemon/test_config.py`` has the order."""
    (rig,) = (rig for rig in RIGS if rig.name == "Bioloid, a wheel")
    end, look = rig.make()
    with end, contextlib.ExitStack() as stack:
        end.start()
        daemon = Daemon(tmp_path, "bioloid", end.url, "hold_limit = 0.2\ndead_man = 20\n")
        stack.callback(daemon.close)
        innocent, holder = (stack.enter_context(contextlib.closing(Client(daemon.port))) for _ in range(2))
        innocent.say("motor7.cwLimit = 0|; motor7.ccwLimit = 0|; motor7.speed = 2;")
        watcher = stack.enter_context(contextlib.closing(Watcher(end, look)))
        wait_for(lambda: watcher.speed() > 1.5, "the wheel to turn")
        began = time.monotonic()
        holder.say("loop| { try { loop| {} } catch {} };")
        holder.wait(ENDED)
        holder.say("loop| {};")
        holder.wait(HELD)
        innocent.say('echo("free");')
        innocent.wait("free")
        assert min(one.speed for one in watcher.samples if one.time > began) > 1.5
        assert "stopped" not in daemon.log()
