"""A simulated Pioneer behind the real daemon, on pseudo terminals and on TCP, on the real clock.  Few."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from test_serve import TIMEOUT_S, Client, Daemon, until

from urbihw_fakes.p3dx.kit import P3dx as Kit
from urbihw_fakes.p3dx.start import TwoPorts, TwoPtys

pytestmark = pytest.mark.e2e


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Callable[..., Daemon]]:
    with contextlib.ExitStack() as stack:
        # The last --platform counts.
        yield lambda *arguments: stack.enter_context(
            contextlib.closing(Daemon(tmp_path, "--platform", "p3dx", "--quiet", *arguments))
        )


def motors_on(client: Client) -> None:
    client.say("P3dx.body.load = 1;")
    client.say('waituntil(P3dx.body.load == 1); echo("motors on");')
    client.wait("motors on")


def test_the_session_of_the_manual_with_the_built_in_fake(serve: Callable[..., Daemon]) -> None:
    client = serve("--fake").client()
    assert client.ask("P3dx.model;") == '"p3dx-sh"'
    assert "the motors are off" in client.ask("P3dx.body.x.speed = 0.1;")
    motors_on(client)
    client.say("P3dx.go(0.3) | P3dx.turn(45deg) | echo(\"there\");")
    client.wait("there")
    assert float(client.ask("P3dx.body.odometry.yaw;")) == pytest.approx(-0.785, abs=0.06)
    client.say('P3dx.body.laser.load = 1; waituntil(P3dx.body.laser.load == 1); echo("laser on");')
    client.wait("laser on")
    assert client.ask("P3dx.body.laser.val.size;") == "181"
    until(lambda: float(client.ask("P3dx.body.laser.rate;")) == pytest.approx(10, abs=2))


@pytest.mark.long
def test_a_robot_that_drives_to_a_wall_stops_by_at_sonar(serve: Callable[..., Daemon]) -> None:
    kit = Kit()
    kit.body.set_pose(1.0, 0.0, 0.0)
    with TwoPorts(kit.robot, kit.laser) as end:
        end.start()
        client = serve("--url", end.url).client()
        motors_on(client)
        client.say('at (P3dx.body.sonar[front][front][left].val < 0.6) { P3dx.stop; echo("wall") };')
        client.say("P3dx.body.x.speed = 0.3;")
        client.wait("wall")
        until(lambda: not kit.body.moving)
        assert kit.body.pose[0] > 2.1
        assert not kit.body.front


def test_the_cable_pulled_and_put_back_while_a_behaviour_runs(serve: Callable[..., Daemon]) -> None:
    kit = Kit()
    with TwoPtys(kit.robot, kit.laser) as end:
        end.start()
        daemon = serve("--url", end.url)
        client = daemon.client()
        client.say('every (1s) { try { P3dx.body.load = 1; P3dx.speedAlpha = 0.4 } catch {} },')
        until(lambda: kit.body.moving)
        before = len(daemon.log().splitlines())
        end.unplug()
        client.listen(2.5)
        until(lambda: client.ask("P3dx.link;") == "false")
        assert end.call(lambda: kit.body.halted or not kit.body.moving)
        end.plug()
        daemon.wait_for_link(before)
        until(lambda: kit.body.moving and not kit.body.halted)
        assert len(daemon.link_news(before)) == 2


def test_a_killed_daemon_leaves_a_standing_robot(serve: Callable[..., Daemon], tmp_path: Path) -> None:
    kit = Kit()
    with TwoPtys(kit.robot, kit.laser) as end:
        end.start()
        daemon = serve("--url", end.url)
        client = daemon.client()
        motors_on(client)
        client.say("P3dx.body.yaw.speed = 0.5;")
        until(lambda: kit.body.moving)
        daemon.process.kill()
        until(lambda: not kit.body.moving)
        daemon.process.wait(TIMEOUT_S)
        # The old one's file must not be taken for that of the new one.
        (tmp_path / "port").unlink()
        again = serve("--url", end.url)
        assert again.client().ask("P3dx.link;") == "true"
        assert not kit.body.moving


def test_the_line_is_made_faster_if_that_is_wanted(serve: Callable[..., Daemon], tmp_path: Path) -> None:
    config = tmp_path / "urbihw.toml"
    config.write_text("[options]\nhost_baud = 38400\n")
    kit = Kit()
    with TwoPtys(kit.robot, kit.laser) as end:
        end.start()
        client = serve("--config", str(config), "--url", end.url).client()
        assert kit.robot.host_baud == 38400
        assert client.ask("P3dx.link;") == "true"
        # Pulled, it is found again at its new speed.
        client.say('at (P3dx.linkBack?) echo("back");')
        assert client.ask("1;") == "1"
        end.unplug()
        until(lambda: client.ask("P3dx.link;") == "false")
        end.plug()
        client.wait("back")
