"""What goes wrong with a simulated world is one clear line, and the daemon lives: real processes."""

from __future__ import annotations

import contextlib
import importlib.util
import math
import os
import signal
import stat
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from test_serve import URBIHW, Client, Daemon, until

pytestmark = pytest.mark.e2e

HOME = Path(__file__).resolve().parents[1] / "platforms" / "webots_home"
needs_mujoco = pytest.mark.skipif(
    importlib.util.find_spec("mujoco") is None, reason="the package mujoco is not installed"
)
ARM = """<mujoco><custom><numeric name="basic step" data="20"/>{custom}</custom><worldbody>
<body name="arm" pos="0 0 1"><joint name="arm"/><geom size=".1"/>{inside}</body></worldbody>
<actuator><velocity name="arm" joint="arm" kv="1"/></actuator></mujoco>"""


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Callable[..., Daemon]]:
    """Start a daemon with a world."""
    with contextlib.ExitStack() as stack:
        yield lambda url: stack.enter_context(
            contextlib.closing(Daemon(tmp_path, "--platform", "webots", "--quiet", "--url", url))
        )


def number(client: Client, expression: str) -> float:
    """A value; nan while the robot is not there yet."""
    try:
        return float(client.ask(f"{expression};"))
    except ValueError:
        return math.nan


def started(daemon: Daemon) -> Client:
    """A connection, when the robot is there."""
    client = daemon.client()
    until(lambda: client.ask("webots.time;") not in ("", "0") and "!!!" not in client.ask("joint[0];"), log=daemon.log)
    return client


def said(daemon: Daemon, words: str) -> None:
    """Until the log says something, in one line, with no traceback; the daemon goes on answering."""
    until(lambda: words in daemon.log(), log=daemon.log)
    assert "Traceback" not in daemon.log()
    assert daemon.client().ask("1 + 1;") == "2"


@needs_mujoco
@pytest.mark.parametrize(
    ("model", "words"),
    [
        ("<mujoco><worldbody>", "XML parse error"),
        ('<mujoco><include file="world.xml"/></mujoco>', "already included"),
        ('<mujoco><option gravity="nan 0 0"/></mujoco>', "a number is nan or inf"),
        ('<mujoco><worldbody><replicate count="1000000000" offset="1 0 0"><body><joint/><geom size=".1"/></body>'
         "</replicate></worldbody></mujoco>", "it takes longer than 6 s to load"),
    ],
    ids=["cut", "loop", "nan", "bodies"],
)  # fmt: skip
def test_a_wrong_model_is_one_line_and_a_right_one_is_taken(
    serve: Callable[..., Daemon], tmp_path: Path, model: str, words: str
) -> None:
    path = tmp_path / "world.xml"
    path.write_text(model)
    daemon = serve(f"mujoco://{path}")
    said(daemon, words)
    path.write_text(ARM.format(custom="", inside=""))
    client = daemon.client()
    until(lambda: "arm" in client.ask("webots.deviceNames;"), log=daemon.log)


@needs_mujoco
def test_a_model_that_is_spoilt_between_two_loads_is_one_line(serve: Callable[..., Daemon], tmp_path: Path) -> None:
    path = tmp_path / "world.xml"
    path.write_text(ARM.format(custom="", inside=""))
    daemon = serve(f"mujoco://{path}")
    client = started(daemon)
    client.say("joint[0].speed = 2|;")
    until(lambda: number(client, "joint[0].angle") > 0.2, log=daemon.log)
    path.write_text("<mujoco><worldbody>")
    client.say("SimulationController.new.revert|;")
    said(daemon, "the world is not loaded again: ")
    said(daemon, "XML parse error")
    # The old one goes on; to try the file may have taken longer than the dead-man time, after which motors stand.
    client.say("joint[0].speed = 2|;")
    at = number(client, "joint[0].angle")
    until(lambda: number(client, "joint[0].angle") > at + 0.2, log=daemon.log)
    path.write_text(ARM.format(custom="", inside=""))
    client.say("SimulationController.new.revert|;")
    daemon.wait_for_link(0)
    # It stands.
    until(lambda: abs(number(client, "joint[0].angle")) < 0.01, log=daemon.log)


@needs_mujoco
@pytest.mark.parametrize(
    ("program", "words"),
    [
        (
            'var Global.arm = Servo.new("amr");',
            "arm.u:1.18-33: new: no motor 'amr'; did you mean 'arm'?; there are: arm",
        ),
        ("var Global.arm = ;", "arm.u:1.18: syntax error: unexpected ;"),
    ],
    ids=["name", "syntax"],
)
def test_a_mistake_in_a_binding_file_is_one_line(tmp_path: Path, program: str, words: str) -> None:
    path = tmp_path / "world.xml"
    (tmp_path / "arm.u").write_text(program)
    path.write_text(ARM.format(custom='<text name="program" data="arm.u"/>', inside=""))
    command = (*URBIHW, "serve", "--platform", "webots", "--quiet", "--port", "0", "--url", f"mujoco://{path}")
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 78
    assert done.stderr == f"urbihw: the objects of the world cannot be made: {words}\n"


@pytest.mark.long
@needs_mujoco
def test_a_binding_file_that_does_not_end_is_named_and_the_port_opens(
    serve: Callable[..., Daemon], tmp_path: Path
) -> None:
    path = tmp_path / "world.xml"
    (tmp_path / "arm.u").write_text("loop {};")
    path.write_text(ARM.format(custom='<text name="program" data="arm.u"/>', inside=""))
    daemon = serve(f"mujoco://{path}")
    said(daemon, "urbihw: the port is not open yet: arm.u has not ended: ")
    said(daemon, f"urbihw: waiting for the robot on mujoco://{path}: arm.u has not ended: ")


def test_a_loop_that_is_detached_does_not_hold_up_the_start(tmp_path: Path) -> None:
    program = tmp_path / "beat.u"
    program.write_text("var Global.beats = 0;\ndetach({ every (100ms) { Global.beats += 1 } });")
    with contextlib.closing(Daemon(tmp_path, "--fake", "--quiet", "--file", str(program))) as daemon:
        client = daemon.client()
        until(lambda: number(client, "Global.beats") > 2, log=daemon.log)
        assert "has not ended" not in daemon.log()


def test_a_file_that_does_not_end_is_named(tmp_path: Path) -> None:
    (tmp_path / "hold.u").write_text("every (1s) {};")
    command = (*URBIHW, "serve", "--platform", "bioloid", "--fake", "--quiet", "--port", "0", "--file", "hold.u")
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as daemon:
        assert daemon.stderr is not None
        line = daemon.stderr.readline()
        daemon.terminate()
    assert line.startswith("urbihw: the port is not open yet: hold.u has not ended: put what lasts")


@needs_mujoco
def test_without_opengl_a_camera_says_so_and_the_rest_works(
    serve: Callable[..., Daemon], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "nonsense")
    path = tmp_path / "world.xml"
    path.write_text(ARM.format(custom="", inside='<camera name="eye"/>'))
    daemon = serve(f"mujoco://{path}")
    client = started(daemon)
    client.say("joint[0].speed = 2|;")
    said(daemon, "camera 'eye' gives no pictures: no OpenGL")
    until(lambda: number(client, "joint[0].angle") > 0.2, log=daemon.log)


def test_a_controller_process_that_is_killed_is_replaced(
    serve: Callable[..., Daemon], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("WEBOTS_HOME", str(HOME))
    daemon = serve("ipc://1234/contract")
    client = started(daemon)
    client.say("joint[1].speed = 2|;")
    until(lambda: number(client, "joint[1].angle") > 0.2, log=daemon.log)
    os.kill(controller_of(daemon.process.pid), signal.SIGKILL)
    daemon.wait_for_link(0)
    assert "Webots has ended, or its controller library has" in daemon.log()
    until(lambda: abs(number(client, "joint[1].angle")) < 0.01, log=daemon.log)
    assert "Traceback" not in daemon.log()


def controller_of(pid: int) -> int:
    """The process below another one that runs the controller library."""
    for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        if b"controller_process" in Path(f"/proc/{child}/cmdline").read_bytes():
            return int(child)
        with contextlib.suppress(LookupError):
            return controller_of(int(child))
    raise LookupError(pid)


def test_webots_starts_the_controller_with_its_arguments_and_its_global_u(tmp_path: Path) -> None:
    """The folder of docs/webots.md, started as Webots starts a controller: in its folder, with the url of the robot in
    the environment, and with what is in controllerArgs."""
    page = (Path(__file__).parents[2] / "docs" / "webots.md").read_text("utf-8")
    script = next(
        block.replace("    ", "", 1) for block in page.split("\n\n") if block.lstrip().startswith("#!/bin/sh")
    ).replace("\n    ", "\n")
    assert "exec /path/to/urbihw/.venv/bin/urbihw serve" in script
    folder = tmp_path / "controllers" / "urbi"
    folder.mkdir(parents=True)
    controller = folder / "urbi"
    controller.write_text(script.replace("/path/to/urbihw/.venv/bin/urbihw", " ".join(URBIHW)) + "\n")
    controller.chmod(controller.stat().st_mode | stat.S_IXUSR)
    (folder / "global.u").write_text('var Global.motor = Servo.new("arm")|;')
    port = tmp_path / "port"
    environment = {**os.environ, "WEBOTS_HOME": str(HOME), "WEBOTS_CONTROLLER_URL": "ipc://1234/contract"}
    log = (tmp_path / "log").open("w+")
    process = subprocess.Popen(
        (str(controller), "--port", "0", "--port-file", str(port), "--file", "global.u"), cwd=folder, env=environment,
        stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
    )  # fmt: skip
    try:
        until(lambda: port.exists() and port.read_text().endswith("\n"), log=(tmp_path / "log").read_text)
        with contextlib.closing(Client(int(port.read_text()))) as client:
            client.say('motor.angle = 0.5|; sleep(1s); echo("at %s" % motor.angle);')
            client.wait("at 0.5")
        process.send_signal(signal.SIGTERM)
        assert process.wait(30) == 0
    finally:
        process.kill()
        process.wait()
        log.close()
