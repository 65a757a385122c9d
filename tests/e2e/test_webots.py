"""Simulated worlds with real processes: the time of programs, and a Webots that is a stand-in.  Few."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from test_serve import Daemon, until

from urbihw.buses.errors import LinkGone, Unavailable
from urbihw.platforms.webots.controller_process import ControllerProcess
from urbihw.platforms.webots.simulator import Outcome, StepOrder

pytestmark = pytest.mark.e2e

HOME = Path(__file__).resolve().parents[1] / "platforms" / "webots_home"
needs_mujoco = pytest.mark.skipif(
    importlib.util.find_spec("mujoco") is None, reason="the package mujoco is not installed"
)
TRACE = """
var Global.trace = []|;
detach({
  wander.start |
  for| (var i : 40) {
    trace << "%s %s %s" % [System.time, robot.body.gps.val, sonarFFL.distance] |
    sleep(250ms)
  } |
  trace << "end"
})|;
"""


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Callable[..., Daemon]]:
    """Start a daemon with a world; the last --platform counts."""
    with contextlib.ExitStack() as stack:
        count = iter(range(100))

        def start(*arguments: str, options: str = "") -> Daemon:
            folder = tmp_path / str(next(count))
            folder.mkdir()
            settings = folder / "settings.toml"
            settings.write_text(f"[options]\n{options}\n")
            made = Daemon(folder, "--platform", "webots", "--quiet", "--config", str(settings), *arguments)
            return stack.enter_context(contextlib.closing(made))

        yield start


@pytest.mark.long
@needs_mujoco
def test_the_same_program_twice_gives_the_same_trace(serve: Callable[..., Daemon], tmp_path: Path) -> None:
    program = tmp_path / "trace.u"
    program.write_text(TRACE)
    traces = []
    for held in (False, True):
        daemon = serve("--file", str(program), options='mode = "fast"')
        if held:
            # A machine that gives the daemon no processor for longer than dead_man and the patience of the simulation.
            os.kill(daemon.process.pid, signal.SIGSTOP)
            time.sleep(2)
            os.kill(daemon.process.pid, signal.SIGCONT)
        client = daemon.client()
        until(lambda client=client: client.ask("trace.back;") == '"end"')  # type: ignore[misc]
        traces.append(client.ask("trace;"))
    assert traces[0] == traces[1]
    assert len(set(traces[0].split('", "'))) == 41


@needs_mujoco
def test_time_is_that_of_the_simulation_and_pauses_with_it(serve: Callable[..., Daemon]) -> None:
    client = serve().client()
    client.say('webots.mode = "fast"|; var Global.begun = webots.time|; sleep(30s); echo("slept");')
    client.wait("slept")
    assert float(client.ask("webots.time - begun;")) == pytest.approx(30, abs=0.5)
    client.say('webots.mode = "pause"|;')
    client.listen(0.3)
    before = client.ask("webots.time;")
    client.say('detach({ sleep(100ms) | echo("awake") })|;')
    assert "awake" not in client.listen(1.0)
    assert client.ask("webots.time;") == before
    client.say('webots.mode = "real"|;')
    client.wait("awake")
    until(lambda: 0 < float(client.ask("webots.rate;")) < 60)


@needs_mujoco
def test_a_program_that_never_gives_way_does_not_hold_the_simulation_and_is_named(
    serve: Callable[..., Daemon],
) -> None:
    daemon = serve()
    client = daemon.client()
    client.say("wheelL.speed = 1|;")
    client.say("var Global.at0 = webots.time|; loop|{};")
    until(lambda: "holds the interpreter for more than 0.5 s at 2.32-38" in daemon.log(), log=daemon.log)
    client.close()
    other = daemon.client()
    until(lambda: float(other.ask("webots.time - at0;")) > 0.2)


@pytest.mark.long
@needs_mujoco
def test_a_world_that_is_reloaded_is_back_and_stands(serve: Callable[..., Daemon]) -> None:
    daemon = serve()
    client = daemon.client()
    client.say("robot.go(0.3) | echo(\"there\");")
    client.wait("there")
    before = float(client.ask("System.time;"))
    client.say("SimulationController.new.revert|;")
    daemon.wait_for_link(0)
    until(lambda: abs(float(client.ask("robot.body.gps.x;"))) < 0.05)
    assert float(client.ask("System.time;")) > before
    client.say("robot.go(0.3) | echo(\"again\");")
    client.wait("again")
    assert float(client.ask("robot.body.gps.x;")) == pytest.approx(0.3, abs=0.1)


@needs_mujoco
def test_a_worker_that_is_killed_is_replaced_and_the_robot_stands(serve: Callable[..., Daemon]) -> None:
    daemon = serve()
    client = daemon.client()
    client.say("wheelL.speed = 3 | wheelR.speed = 3|;")
    until(lambda: float(client.ask("wheelL.speed;")) > 2.5)
    before = float(client.ask("System.time;"))
    children = Path(f"/proc/{daemon.process.pid}/task/{daemon.process.pid}/children").read_text().split()
    for child in children:
        if b"urbihw.buses.child" in Path(f"/proc/{child}/cmdline").read_bytes():
            os.kill(int(child), signal.SIGKILL)
    until(lambda: any(line.startswith("urbihw: link to ") for line in daemon.link_news()), log=daemon.log)
    until(lambda: abs(float(client.ask("wheelL.speed;"))) < 0.01)
    assert float(client.ask("System.time;")) > before
    client.say('wheelL.speed = 3 | sleep(1s) | echo("turned %s" % (wheelL.angle > 1));')
    client.wait("turned true")


# ---------------------------------------------------------------- Webots


def outcome_of(process: ControllerProcess, ms: int, orders: list[StepOrder]) -> Outcome:
    found: list[Outcome] = []
    process.begin(ms, orders)

    def poll() -> bool:
        outcome = process.poll()
        found.extend([] if outcome is None else [outcome])
        return bool(found)

    until(poll)
    return found[0]


def test_a_controller_runs_in_a_process_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WEBOTS_HOME", str(HOME))
    process = ControllerProcess("ipc://1234/contract")
    try:
        assert process.world.name == "contract"
        outcome = outcome_of(process, 20, [StepOrder("enable", "acc", "", 20)])
        assert outcome.samples["acc"] == (0.0, 0.0, 9.81)
        os.kill(process._process.pid, signal.SIGKILL)
        process._process.wait()
        process.begin(20, [])
        with pytest.raises(LinkGone, match="^Webots has ended, or its controller library has$"):
            until(lambda: process.poll() is not None)
    finally:
        process.close()


def test_no_webots_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("WEBOTS_HOME", raising=False)
    with pytest.raises(Unavailable) as caught:
        ControllerProcess("ipc://1234")
    assert str(caught.value) in (
        "no Webots: set WEBOTS_HOME to the folder of its installation",
        "no Webots answers at ipc://1234: does it run, and is the controller <extern>?",
    )


def test_the_daemon_serves_a_robot_of_webots(serve: Callable[..., Daemon], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WEBOTS_HOME", str(HOME))
    daemon = serve("--url", "ipc://1234/contract")
    client = daemon.client()
    assert client.ask('webots.deviceNames["acc"];') == '"accelerometer"'
    client.say('joint[1].speed = 2|; sleep(1s); echo("turned %s" % joint[1].angle.round);')
    client.wait("turned 2")
    client.say("SimulationController.new.revert|;")
    daemon.wait_for_link(0)
    until(lambda: abs(float(client.ask("joint[1].angle;"))) < 0.1)


@needs_mujoco
def test_a_film_of_a_script_is_the_same_each_time(tmp_path: Path) -> None:
    pytest.importorskip("PIL", reason="films need Pillow")
    script = tmp_path / "tour.u"
    script.write_text('echo("on tour"); wander.start;')
    films = [tmp_path / "first.gif", tmp_path / "second.gif"]
    for film in films:
        command = (sys.executable, "-m", "urbihw.cli.main", "film", str(script), "-o", str(film), "--seconds", "1",
                   "--width", "64", "--height", "48")  # fmt: skip
        done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
        if "no OpenGL" in done.stderr:
            pytest.skip("no OpenGL here")
        assert done.returncode == 0, done.stderr
        assert done.stdout == f"{film}: 15 pictures\n"
        assert "*** on tour\n" in done.stderr
    assert films[0].read_bytes() == films[1].read_bytes()


@needs_mujoco
def test_a_film_of_a_script_with_a_mistake_is_none(tmp_path: Path) -> None:
    script = tmp_path / "wrong.u"
    script.write_text("noSuchThing;")
    command = (sys.executable, "-m", "urbihw.cli.main", "film", str(script), "-o", str(tmp_path / "film.gif"),
               "--seconds", "1")  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 70 and not (tmp_path / "film.gif").exists()
    assert f"{script}:1.1-11: lookup failed: noSuchThing" in done.stderr and "Traceback" not in done.stderr
