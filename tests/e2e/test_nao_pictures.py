"""Pictures of a simulated Nao through the real daemon and its worker, on the real clock."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from test_serve import Client, Daemon, until

from urbihw_nao_fakes.device import Nao
from urbihw_nao_fakes.endpoint import NaoEndpoint

pytestmark = pytest.mark.e2e


@pytest.fixture
def end() -> Iterator[NaoEndpoint]:
    with NaoEndpoint(Nao()) as made:
        made.start()
        yield made


@pytest.fixture
def daemon(tmp_path: Path, end: NaoEndpoint) -> Iterator[Daemon]:
    with contextlib.closing(Daemon(tmp_path, "--platform", "nao", "--quiet", "--url", end.url)) as made:
        yield made


def workers(daemon: Daemon) -> list[int]:
    """The processes of the daemon's workers."""
    children = (path / "children" for path in Path(f"/proc/{daemon.process.pid}/task").iterdir())
    return [int(pid) for path in children for pid in path.read_text().split()]


def kill_worker(daemon: Daemon) -> None:
    """Kill it, and wait for the next one."""
    worker = min(workers(daemon))  # the younger one is its spare
    os.kill(worker, signal.SIGKILL)
    until(lambda: worker not in workers(daemon) and workers(daemon) != [])


def wait_for_pictures(client: Client) -> None:
    """Wait for some more of them."""
    frames = float(client.ask("camera.frames;"))
    until(lambda: float(client.ask("camera.frames;")) > frames + 2)


def handles(end: NaoEndpoint) -> list[str]:
    """Who has subscribed to the robot's cameras."""
    return end.call(lambda: [*end.device.video.subscribers])


@pytest.mark.parametrize(
    ("detail", "name"), [("jpeg", "picture.jpg"), ("ppm", "picture.ppm"), ("ycrcb", "picture.png")]
)
def test_urbi_image_saves_a_picture(daemon: Daemon, end: NaoEndpoint, tmp_path: Path, detail: str, name: str) -> None:
    Image = pytest.importorskip("PIL.Image")
    end.call(end.device.body.put_on_feet)
    daemon.client().ask("camera.load = 1;")
    command = [sys.executable, "-m", "urbihw.cli.image", "-P", str(daemon.port), "-F", detail, "-R", "0", "-o", name]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=30)
    assert (done.returncode, done.stderr) == (0, "")
    with Image.open(tmp_path / name) as picture:
        assert picture.size == (640, 480)
        # The robot looks at the red wall.
        red, green, blue = picture.convert("RGB").getpixel((320, 300))
    assert red > 150 and green < 80 and blue < 80


@pytest.mark.long
def test_a_killed_worker_leaves_no_handle_behind_and_neither_does_the_end(daemon: Daemon, end: NaoEndpoint) -> None:
    client = daemon.client()
    client.ask("camera.formatDetail = 6; camera.load = 1; loop { camera.val | sleep(200ms) },")
    wait_for_pictures(client)
    for _ in range(2):
        kill_worker(daemon)
        wait_for_pictures(client)
        assert len(handles(end)) == 1
    daemon.close()
    until(lambda: handles(end) == [])
