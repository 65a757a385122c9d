"""The beginning of a packet whose rest never comes: it is dropped in time and counted, and the next packet is read."""

from __future__ import annotations

from typing import Any

import pytest
from p3dx_lab import Lab as Pioneer
from spykee_lab import Lab as Spykee

from urbihw.platforms.p3dx.driver import HALF_PACKET_S
from urbihw.platforms.p3dx.protocol import HEADER
from urbihw.platforms.spykee import protocol as p

POWER = b"PK" + bytes([p.POWER, 0, 1])
CASES = [
    # Of a picture of 60 000 bytes two have come; the beginning of a packet that would swallow three others.
    pytest.param(Spykee, b"PK\x02\xea\x60ab", 1.5, POWER, id="spykee"),
    pytest.param(Pioneer, HEADER + b"\xc8\x32", 2 * HALF_PACKET_S, b"", id="p3dx"),
]


@pytest.mark.parametrize(("make", "half", "seconds", "then"), CASES)
def test_half_a_packet_makes_nobody_deaf_twice(make: Any, half: bytes, seconds: float, then: bytes) -> None:
    lab: Any = make.ready()
    lab.run(2.0)
    end, worker = (lab.robot_line.end, lab.workers[0]) if make is Pioneer else (lab.end, lab.worker)
    send, say = end.send, lab.robot.on_samples
    for number in (1, 2):
        end.send = lambda data, at: None  # the robot says nothing more
        send(half, lab.bus_clock.now())
        lab.run(seconds)
        end.send = send
        shown: list[Any] = []
        lab.robot.on_samples = shown.append
        if then:
            send(then + bytes([40 + number]), lab.bus_clock.now())
        lab.run(0.25)
        lab.robot.on_samples = say
        assert shown
        assert worker._engine._driver.errors()["incomplete"] == number
        assert lab.look("robot.link") == "true"
