"""Calls of the client library that are given up: the body stands as soon as the server hears of it."""

from __future__ import annotations

import pytest
from bioloid_lab import BAUD, Lab

from urbihw.client.dialect import Native
from urbihw_fakes.bioloid import Bioloid as Kit

SAYS = Native()


@pytest.mark.parametrize("text", [
    SAYS.evaluate("c1", "motor6.val = 1.5 time:4s"),
    SAYS.run("c1", "motor6.val = 1.5 time:4s", ""),
    SAYS.run("c1", "{ motor6.val = 1.5 time:4s, sleep(1h) }", "own"),
    SAYS.run("c1", "loop { motor6.val = 1 time:2s | motor6.val = -1 time:2s },", ""),
])  # fmt: skip
def test_a_call_that_is_given_up_moves_the_body_no_more(text: str) -> None:
    lab = Lab.ready(Kit(servos=(6,), sensors=(), baud=BAUD))
    lab.say(text, 1.0)
    moved = lab.register(6, "present_position")
    assert moved != 512
    lab.say(SAYS.end("c1"), 0.2)
    stood = lab.register(6, "present_position")
    lab.run(2.5)
    assert lab.register(6, "present_position") == stood
    lab.say(text, 1.0)  # the channel can be used again
    assert lab.register(6, "present_position") != stood
