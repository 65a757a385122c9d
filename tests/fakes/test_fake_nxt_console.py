"""What a person types at a running TriBot."""

from __future__ import annotations

import pytest

from urbihw_fakes.console import Console
from urbihw_fakes.endpoint import PtyEndpoint
from urbihw_fakes.nxt.console import commands
from urbihw_fakes.nxt.stream import NxtDevice


def test_the_words() -> None:
    times = iter(range(1000))
    device = NxtDevice()
    robot, brick = device.robot, device.brick
    with PtyEndpoint(device, clock=lambda: float(next(times))) as end:
        console = Console(end, commands(device, end.clock))
        for line in ("bump on", "obstacle 30", "sound 0.5 0.25", "light 0.9", "battery 7.2", "jam B", "put 80 90"):
            assert console.line(line) == "ok", line
        assert robot.touch.pressed and robot.obstacle == 0.3 and brick.millivolts == 7200 and brick.motor("B").jammed
        assert (robot.sound.loudness, robot.sound.audible) == (0.5, 0.25)
        assert console.line("obstacle none") == console.line("bump off") == console.line("jam B off") == "ok"
        assert console.line("state").startswith("on; A power 0 at 0, B power 0 at 0, C power 0 at 0; 80 cm before")
        assert console.line("power off") == "ok" and not brick.awake
        assert console.line("power on") == "ok" and brick.awake


@pytest.mark.parametrize("line", ["bump maybe", "obstacle", "sound 2", "battery 100", "jam D", "put here"])
def test_what_makes_no_sense_is_answered_by_the_usage(line: str) -> None:
    device = NxtDevice()
    with PtyEndpoint(device) as end:
        assert Console(end, commands(device, end.clock)).line(line).startswith("error: usage: ")
