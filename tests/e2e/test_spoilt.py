"""What one client may do to the library and the robot that all share, against the real daemon."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from test_serve import TIMEOUT_S, Daemon, serve

__all__ = ["serve"]


def test_a_client_that_spoils_what_it_can_leaves_the_others_their_robot(serve: Callable[..., Daemon]) -> None:
    daemon = serve("--fake", "--quiet")
    saboteur, innocent = daemon.client(), daemon.client()
    assert innocent.ask("motor6.val = 1;") == "1"
    for text in (
        'Global.removeSlot("System")', 'Global.removeSlot("bioloid")', "robot.stop = 3", "Object.protos = []",
        "Global.robot = nil", "Lobby.instances.each(closure (l) { if (l !== Lobby) l.connectionTag.freeze })",
    ):  # fmt: skip
        assert saboteur.ask(f"{text};").startswith("!!! "), text
    for text in (
        'Global.removeSlot("motors")', 'Global.removeSlot("motor6")', 'Object.removeSlot("hasSlot")',
        'Object.removeSlot("asToplevelPrintable")', "Float.asString = 3", "Exception.protos = []",
    ):  # fmt: skip
        saboteur.say(f"{text};")
    saboteur.say("System.jobs.reverse.each(closure (j) { j.terminate });")
    saboteur.wait("received interruption")
    assert innocent.ask("1 + 1;") == "2"
    innocent.say("robot.stop; bioloid.estop = true;")
    innocent.wait("true")
    newcomer = daemon.client()
    newcomer.wait("*** urbihw: put back in the library: ")
    assert newcomer.ask("bioloid.estop = false;") == "false"
    assert newcomer.ask("motors.size;") == "18"
    assert newcomer.ask("nowhere;").endswith(": lookup failed: nowhere")
    told = [line for line in daemon.log().splitlines() if "library: put back what a program spoilt: " in line]
    for slot in ("Global.motors", "Global.motor6", "Object.hasSlot"):
        assert any(slot in line for line in told), told
    newcomer.say("shutdown;")
    assert daemon.process.wait(TIMEOUT_S) == 0, daemon.log()


@pytest.mark.parametrize("body", ["loop| {}", "loop {}", "try { loop| {} } catch {}; loop {}"])
def test_a_printing_without_end_costs_the_others_one_answer(serve: Callable[..., Daemon], body: str) -> None:
    daemon = serve("--fake", "--quiet")
    saboteur, innocent = daemon.client(), daemon.client()
    saboteur.say(f"Float.asToplevelPrintable = function () {{ {body} }}|; echo(\"{body}\");")
    saboteur.wait(f"*** {body}")
    innocent.say("1 + 1;")
    innocent.wait("*** urbihw: put back in the library, since ")
    innocent.wait("] 2\n")
    innocent.heard = ""
    assert innocent.ask("1 + 2;") == "3"
    assert "Float.asToplevelPrintable" in daemon.log()
