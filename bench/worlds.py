"""What simulated worlds cost: `python -m bench.worlds [--seconds 10]`.

First, in this process: how many steps of the physics one core makes in a second, and how many times faster than real
time that is; of each body that a simulated robot can have, in the world "room", and of each bundled world of the
platform webots. Motors are at rest, sensors are not read.

Then whole daemons, each process with its share of a core. A simulated Bioloid with its body, whose bus is read at 100
Hz: the cycles a second that the worker makes, and the factor of real time at which its body moves. The same for the
platform webots, in the mode "real", and in the mode "fast": simulated seconds in a second.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import mujoco

from bench import ROOT
from bench.p3dx import children, used
from bench.quick import add_quick
from urbihw.platforms.webots.mujoco_world import MujocoWorld
from urbihw.platforms.webots.port import WORLDS, bundled_worlds
from urbihw_fakes.bodies.simulation import Simulation

MODELS = ROOT / "fakes" / "urbihw_fakes" / "bodies" / "models"
BODY_STEP_S = 0.002
"""Step of all bodies here, s, so that they compare; the fakes make steps of 2 to 5 ms."""
WARM_UP_S = 2.0
PORT_TIMEOUT_S = 60.0


def steps_of_bodies(seconds: float) -> None:
    """Print a line for each body in the room."""
    for name in sorted(path.stem for path in MODELS.glob("*.xml")):
        simulation = Simulation(name, "room", BODY_STEP_S)
        count, begun = 0, time.perf_counter()
        while time.perf_counter() - begun < seconds:
            simulation.step(50)
            count += 50
        _print_steps(f"body {name}", count / (time.perf_counter() - begun), BODY_STEP_S)


def steps_of_worlds(seconds: float) -> None:
    """Print a line for each bundled world; its steps are those of the physics."""
    for name in bundled_worlds():
        world = MujocoWorld(WORLDS / f"{name}.xml")
        each = float(mujoco.MjModel.from_xml_path(str(WORLDS / f"{name}.xml")).opt.timestep)
        ms = world.world.step_ms
        count, begun = 0, time.perf_counter()
        while time.perf_counter() - begun < seconds:
            world.run(ms, ())
            count += 1
        _print_steps(f"world {name}", count * ms / 1000 / each / (time.perf_counter() - begun), each)
        world.close()


def _print_steps(name: str, steps: float, step: float) -> None:
    print(f"  {name:24} {steps:9.0f} steps/s of {step * 1000:g} ms {steps * step:8.1f} times real time", flush=True)


class Client:
    """One connection, which asks for one value at a time."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), 10)
        self._file = self._socket.makefile("r", encoding="latin-1")
        self._count = 0

    def number(self, expression: str) -> float:
        """The value of an expression."""
        self._count += 1
        mark = f"answer{self._count}"
        self._socket.sendall(f'echo("{mark} %s" % ({expression}));\n'.encode("latin-1"))
        for line in self._file:
            if mark in line:
                return float(line.rpartition(" ")[2])
        raise SystemExit("the daemon has ended")

    def close(self) -> None:
        """Hang up."""
        self._file.close()
        self._socket.close()


@contextlib.contextmanager
def daemon(*arguments: str, options: str = "") -> Iterator[tuple[int, Client]]:
    """A daemon: its process and a connection."""
    with tempfile.TemporaryDirectory() as name:
        port, settings = Path(name) / "port", Path(name) / "settings.toml"
        settings.write_text(options)
        serve = (sys.executable, "-m", "urbihw.cli.main", "serve", "--quiet", "--config", str(settings))
        command = (*serve, "--port", "0", "--port-file", str(port), *arguments)
        process = subprocess.Popen(command, cwd=ROOT, stdin=subprocess.DEVNULL)
        try:
            end = time.monotonic() + PORT_TIMEOUT_S
            while not (port.exists() and port.read_text().endswith("\n")):
                if process.poll() is not None or time.monotonic() > end:
                    raise SystemExit("the daemon does not start")
                time.sleep(0.05)
            with contextlib.closing(Client(int(port.read_text()))) as client:
                yield process.pid, client
        finally:
            process.terminate()
            process.wait(10)


def processes_of(pid: int) -> dict[str, int]:
    """The processes of a daemon by what they are."""
    found = {"daemon": pid}
    for child in children(pid):
        words = Path(f"/proc/{child}/cmdline").read_text("utf-8")
        kind = "worker" if "urbihw.buses.child" in words else "fake" if "urbihw_fakes" in words else ""
        if kind:
            found[kind] = child
    return found


def measure(title: str, pid: int, client: Client, clock: str, rate: str, seconds: float) -> None:
    """Print the factor of real time of ``clock`` (simulated s), the ``rate`` and the share of each process."""
    time.sleep(WARM_UP_S)
    parts = processes_of(pid)
    before = {name: used(each) for name, each in parts.items()}
    simulated, begun = client.number(clock), time.monotonic()
    time.sleep(seconds)
    simulated, elapsed = client.number(clock) - simulated, time.monotonic() - begun
    shares = ", ".join(f"{name} {(used(each) - before[name]) / elapsed:.0%}" for name, each in parts.items())
    factor, hertz = simulated / elapsed, client.number(rate)
    print(f"  {title:34} {factor:7.2f} times real time, {hertz:5.0f} Hz; {shares}", flush=True)


def daemons(seconds: float) -> None:
    """The second part: see the head of this file."""
    body = ("--platform", "bioloid", "--fake", "--world", "room")
    with daemon(*body, options="rate = 100.0\n") as (pid, client):
        measure("Bioloid with its body, 100 Hz", pid, client, 'fake.tell("time").asFloat', "bioloid.rate", seconds)
    world = ("--platform", "webots")
    for mode in ("real", "fast"):
        with daemon(*world, options=f'[options]\nmode = "{mode}"\n') as (pid, client):
            measure(f"pioneer-wander, mode {mode}", pid, client, "webots.time", "webots.rate", seconds)


def main() -> int:
    """Run both parts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=10.0, help="of each daemon; models take a tenth (%(default)s)")
    add_quick(parser, seconds=0.1)
    seconds = parser.parse_args().seconds
    print(f"load of this machine before: {os.getloadavg()[0]:.1f}")
    print("physics alone, one core")
    steps_of_bodies(seconds / 10)
    steps_of_worlds(seconds / 10)
    print("daemons: real time, rate of the bus or of the steps, share of a core")
    daemons(seconds)
    return 0


if __name__ == "__main__":
    sys.exit(main())
