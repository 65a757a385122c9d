"""Robots with a body in MuJoCo behind the real daemon, on pseudo terminals, on the real clock.  Few."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from test_serve import Client, Daemon, until

from urbihw_fakes.bodies.humanoid import READY

pytest.importorskip("mujoco", reason="simulated worlds need the extra mujoco")

pytestmark = pytest.mark.e2e


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Callable[..., Daemon]]:
    """Start a daemon with a simulated robot in the room; the last --platform counts."""
    with contextlib.ExitStack() as stack:
        yield lambda *arguments: stack.enter_context(
            contextlib.closing(Daemon(tmp_path, "--fake", "--world", "room", "--quiet", *arguments))
        )


def where(client: Client) -> str:
    """Where the body is, as the simulated robot's console tells."""
    return client.ask('fake.tell("where");')


def test_a_bioloid_stands_falls_and_is_picked_up(serve: Callable[..., Daemon]) -> None:
    client = serve().client()
    until(lambda: float(client.ask("bioloid.rate;")) > 50)
    assert "fallen" not in where(client)
    # The knees carry the body.
    assert abs(float(client.ask("motor13.torque;"))) > 0.15
    client.say("motors.load = 0|;")
    until(lambda: "fallen" in where(client))
    client.say("motors.load = 1|;")
    client.say(f"var ready = {list(READY)}|; for (var i : 18) motors[i + 1].val = (ready[i] - 511.5) * 0.0051183|;")
    until(lambda: abs(float(client.ask("motor13.val;")) + 1.39) < 0.1)
    assert client.ask('fake.tell("stand");') == '"ok"'
    until(lambda: "fallen" not in where(client))


def test_a_pioneer_slips_and_its_bumper_ends_a_drive(serve: Callable[..., Daemon]) -> None:
    client = serve("--platform", "p3dx").client()
    assert client.ask('fake.tell("place 2.2 0 0");') == '"ok"'
    client.say('P3dx.body.load = 1; waituntil(P3dx.body.load == 1); echo("motors on");')
    client.wait("motors on")
    client.say('at (P3dx.body.frontBumpers[2]) { P3dx.stop; echo("bumped") };')
    client.say("P3dx.body.x.speed = 0.4;")
    client.wait("bumped")
    x, _, _, _, believed, *_ = where(client).strip('"').replace(",", "").split()
    assert 2.7 < float(x) < 2.75
    assert float(believed) + 2.2 > float(x)


def test_a_nao_wakes_up_walks_and_falls(serve: Callable[..., Daemon]) -> None:
    client = serve("--platform", "nao").client()
    until(lambda: "crouching" in where(client))
    client.say("motion.wakeUp|;")
    until(lambda: "standing" in where(client))
    before = float(where(client).strip('"').split()[0])
    client.say("robot.go(0.1);")
    until(lambda: float(where(client).strip('"').split()[0]) > before + 0.08)
    client.say("motors.load = 0|;")
    until(lambda: "fallen" in where(client))


@pytest.mark.parametrize("platform", ["nxt", "segway", "spykee"])
def test_the_others_are_served_in_their_world(platform: str, serve: Callable[..., Daemon]) -> None:
    client = serve("--platform", platform).client()
    assert client.ask('fake.tell("place 0.5 0.5 90");') == '"ok"'
    x, y, heading, *_ = map(float, where(client).strip('"').split())
    assert (x, y) == pytest.approx((0.5, 0.5), abs=0.02) and heading == pytest.approx(90, abs=2)
    client.say("robot.xSpeed = 0.1|;")
    until(lambda: float(where(client).strip('"').split()[1]) > 0.55)


def test_a_world_that_is_none_ends_the_start_with_a_line(tmp_path: Path) -> None:
    with pytest.raises(AssertionError) as caught:
        Daemon(tmp_path, "--fake", "--world", "attic")
    assert "--world attic: the worlds are flat and room" in str(caught.value)
    assert "Traceback" not in str(caught.value)
