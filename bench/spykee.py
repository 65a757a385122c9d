"""What pictures and sound of a Spykee cost: `python -m bench.spykee [--seconds 10]`.

The whole daemon with its worker, a process of its own, before a simulated robot in a third one, over TCP: first with
no program, then with one program that follows the camera (20 pictures a second), then with one that follows the
microphone too and plays what it hears. For each the share of a core of daemon and worker, and how many pictures have
come to urbiscript of those that the robot has sent.
"""

from __future__ import annotations

import argparse
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from bench import ROOT
from bench.quick import add_quick
from urbihw_fakes.spykee.device import Spykee
from urbihw_fakes.spykee.endpoint import SpykeeEndpoint

TICKS_PER_SECOND = os.sysconf("SC_CLK_TCK")
READY_TIMEOUT_S = 15.0
WORK = (
    ("nobody looks", ""),
    ("camera", "at (camera.val->changed?) 1,"),
    ("camera, micro, speaker", "at (micro.val->changed?) speaker.val = micro.val,"),
)
"""What is measured, and what a client says before."""


def descendants(pid: int) -> Iterator[int]:
    """A process and all below it."""
    yield pid
    for thread in Path(f"/proc/{pid}/task").iterdir():
        for child in (thread / "children").read_text().split():
            yield from descendants(int(child))


def used(pid: int) -> float:
    """Seconds of processor of one process."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS_PER_SECOND


@contextmanager
def daemon(url: str, folder: Path) -> Iterator[tuple[int, socket.socket]]:
    """A daemon that serves the robot: its process, and a client of it."""
    socket_path, settings = folder / "client.sock", folder / "settings.toml"
    settings.write_text(
        f'platform = "spykee"\nurl = "{url}"\nport = 0\nsocket = "{socket_path}"\ncontrol = "{folder}/control.sock"\n'
    )
    process = subprocess.Popen(
        (sys.executable, "-m", "urbihw.cli.main", "serve", "--config", str(settings), "--quiet"), cwd=ROOT
    )
    try:
        with socket.socket(socket.AF_UNIX) as client:
            end = time.monotonic() + READY_TIMEOUT_S
            while client.connect_ex(str(socket_path)):
                if process.poll() is not None or time.monotonic() > end:
                    raise SystemExit("bench.spykee: the daemon does not start")
                time.sleep(0.05)
            yield process.pid, client
    finally:
        process.terminate()
        process.wait()


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0)
    add_quick(parser, seconds=0.2)
    seconds = parser.parse_args().seconds
    robot = Spykee()
    with tempfile.TemporaryDirectory(prefix="urbihw-") as name, SpykeeEndpoint(robot) as end:
        end.start()
        with daemon(end.url, Path(name)) as (pid, client):
            print(f"  {'':24} {'daemon':>8} {'worker':>8} {'sent':>6} {'shown':>6}")
            for what, text in WORK:
                client.sendall(f"{text}\n".encode())
                time.sleep(1.0)
                pids = list(descendants(pid))
                before, frames = [used(each) for each in pids], (robot.frames, shown(client))
                time.sleep(seconds)
                shares = [(used(each) - start) / seconds for each, start in zip(pids, before, strict=True)]
                sent, came = robot.frames - frames[0], shown(client) - frames[1]
                print(f"  {what:24} {shares[0]:8.1%} {sum(shares[1:]):8.1%} {sent:6} {came:6.0f}", flush=True)


def shown(client: socket.socket) -> float:
    """How many pictures urbiscript has seen."""
    client.settimeout(5.0)
    client.sendall(b'echo("frames " + camera.frames);\n')
    data = b""
    while b"*** frames " not in data or not data.endswith(b"\n"):
        data += client.recv(65536)
    return float(data.rpartition(b"*** frames ")[2].split()[0])


if __name__ == "__main__":
    main()
