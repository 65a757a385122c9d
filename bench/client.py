"""The client library against a server in another process: round trips beside a bare socket, and watching 60 slots.

    .venv/bin/python -m bench.client

The server is `urbi` in a process of its own.  Goals: a read at most 0.1 ms above the same statement on a bare socket;
50 samples a second of 60 slots below 3 % of a core for the client.
"""

from __future__ import annotations

import argparse
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

import urbihw
from bench.quick import add_quick
from urbihw.client.robot import Robot

SLOTS = 60
RATE_HZ = 50


def start_server(folder: Path) -> tuple[subprocess.Popen[bytes], int]:
    """A server without a robot, and its port."""
    port_file = folder / "port"
    program = "from urbihw.cli.entry import urbi; urbi()"
    server = subprocess.Popen([sys.executable, "-c", program, "--quiet", "--port", "0", "--port-file", str(port_file)])
    while not (port_file.exists() and port_file.read_text().strip()):
        time.sleep(0.05)
    return server, int(port_file.read_text())


def bare_round_trip(port: int, text: str, rounds: int) -> float:
    """Median seconds from a statement to its line."""
    with socket.create_connection(("127.0.0.1", port)) as link:
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        link.sendall(b"var Global.bench = 0|;")
        times = []
        warm_up = rounds // 10
        for _ in range(rounds + warm_up):
            began = time.perf_counter()
            link.sendall(text.encode())
            link.recv(4096)
            times.append(time.perf_counter() - began)
    return median(times[warm_up:])


def library_round_trip(robot: Robot, write: bool, rounds: int) -> float:
    """Median seconds of a read, or of a write of another number each time."""
    slot = robot.slot("bench")
    times, warm_up = [], rounds // 10
    for number in range(rounds + warm_up):
        began = time.perf_counter()
        if write:
            slot.set(number + 0.5)
        else:
            slot.get()
        times.append(time.perf_counter() - began)
    return median(times[warm_up:])


def watch_share(robot: Robot, seconds: float) -> tuple[float, int, int]:
    """The share of a core that this process takes, the samples that came, those lost."""
    names = [f"slot{number}" for number in range(SLOTS)]
    robot.run(" | ".join(f"var Global.{name} = {number}.25" for number, name in enumerate(names)))
    robot.run("loop { slot0 += 1; slot7 += 0.125; sleep(10ms) },", tag="changes")
    with robot.watch(*names, hz=RATE_HZ) as samples:
        next(samples)
        cpu, end, count = time.process_time(), time.monotonic() + seconds, 0
        while time.monotonic() < end:
            next(samples)
            count += 1
        return (time.process_time() - cpu) / seconds, count, samples.lost


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=2000, help="round trips of each kind (%(default)s)")
    parser.add_argument("--seconds", type=float, default=10.0, help="for which 60 slots are watched (%(default)s)")
    add_quick(parser, rounds=10, seconds=0.2)
    wanted = parser.parse_args()
    rounds = wanted.rounds
    with tempfile.TemporaryDirectory() as folder:
        server, port = start_server(Path(folder))
        try:
            typed = bare_round_trip(port, "bench;\n", rounds)
            bare = bare_round_trip(port, 'lobby.answerSlot("c", "bench"),\n', rounds)
            with urbihw.connect("127.0.0.1", port) as robot:
                read, write = (library_round_trip(robot, writes, rounds) for writes in (False, True))
                share, count, lost = watch_share(robot, wanted.seconds)
        finally:
            server.terminate()
            server.wait(10)
    print(f"bare socket: {typed * 1e3:.3f} ms for `bench;`, {bare * 1e3:.3f} ms for what the library sends")
    print(f"library: read {read * 1e3:.3f} ms, write {write * 1e3:.3f} ms")
    print(f"{SLOTS} slots at {RATE_HZ} Hz: {share:.1%} of a core, {count} samples in {wanted.seconds:g} s, {lost} lost")


if __name__ == "__main__":
    main()
