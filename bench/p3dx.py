"""What a Pioneer costs: `python -m bench.p3dx [--seconds 10]`.

First, in this process: microseconds of processor for one SIP (16 sonars) to be cut out of the stream and decoded, for a
whole tick of the driver with it, and for the robot object to serve it to urbiscript, once without a listener and
once with an `at` on each sonar. Then the whole daemon with its worker, a process of its own, before a simulated robot
in a third one, at 10 and at 50 SIPs a second: share of a core of each. Last, the planner on a grid of 200 by 200 with a
wall to go around twice, and how long a thread that wants to run every millisecond has to wait meanwhile.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from bench import ROOT
from bench.quick import add_quick
from urbihw.buses import messages as m
from urbihw.buses.link import Context, Link, Url
from urbihw.kernel import Kernel
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.uobject import DeviceError, RobotSettings
from urbihw.navigation.grid import Grid
from urbihw.navigation.planner import Room, plan
from urbihw.platforms import find
from urbihw.platforms.p3dx import sip
from urbihw.platforms.p3dx.driver import ArcosDriver
from urbihw.platforms.p3dx.handshake import ArcosRobotInfo
from urbihw.platforms.p3dx.packets import parse_config
from urbihw.platforms.p3dx.protocol import ArcosFramer
from urbihw.platforms.p3dx.robot import P3dx
from urbihw.robot import ROBOT_LIBRARY
from urbihw_fakes.p3dx.codec import arcos_packet
from urbihw_fakes.p3dx.sips import SipFields

TICK_PER_SECOND = os.sysconf("SC_CLK_TCK")


def sips(count: int) -> list[bytes]:
    """SIPs of a robot that drives, all of its sonars in each."""
    tail = {"battery_x10": 125, "charge_state": 0, "rotation": 12, "faults": 0}
    return [
        arcos_packet(
            SipFields(
                moving=True, x=number * 20 & 0x7FFF, y=7, theta=number % 2000, left=200, right=210, battery=125,
                flags=0x1F, sonars=[(sonar, 1000 + (number * 7 + sonar) % 4000) for sonar in range(16)], tail=tail,
            ).body()
        )
        for number in range(count)
    ]  # fmt: skip


def cost(work: Callable[[int], object], rounds: int) -> float:
    """Microseconds of processor of one call, the best of five runs."""
    best = float("inf")
    for _ in range(5):
        start = time.process_time()
        for number in range(rounds):
            work(number)
        best = min(best, time.process_time() - start)
    return best / rounds * 1e6


class Canned(Link):
    """A link that gives a packet at each read."""

    def __init__(self, packets: list[bytes]) -> None:
        super().__init__(Url.parse("pipe://canned"), Context())
        self._packets = packets
        self._next = 0

    def _open(self) -> None:
        pass

    def _close(self) -> None:
        pass

    def _read(self, size: int, deadline: float) -> bytes:
        self._next = (self._next + 1) % len(self._packets)
        return self._packets[self._next]

    def _write(self, data: bytes) -> None:
        pass


class Deaf:
    """A worker that does nothing."""

    def send(self, message: m.ToWorker) -> None:
        """Take a message."""

    def stop(self) -> None:
        """End."""


def served(packets: list[bytes], script: str) -> Callable[[int], object]:
    """What serves the n-th packet to urbiscript, on a kernel in simulated time."""
    clock = SimClock()
    kernel = Kernel(clock, libraries=(ROBOT_LIBRARY,))
    manifest = find("p3dx")
    for kind in (P3dx, *P3dx.classes):
        kernel.host.register(kind)
    for path in manifest.library_files():
        kernel.host.run(path.read_text("latin-1"), path.name)
        kernel.scheduler.run_simulated(clock.now())
    robot = kernel.host.create(P3dx, "P3dx")
    posts: list[Callable[[m.FromWorker], None]] = []

    def start_worker(url: str, *, post: Callable[[m.FromWorker], None], **rest: object) -> Deaf:
        posts.append(post)
        return Deaf()

    robot.start_worker = start_worker
    answers: list[DeviceError | None] = []
    robot.open(RobotSettings("pipe://canned"), answers.append)
    (post,) = posts
    post(m.LinkState(True))
    post(m.Found((ArcosRobotInfo("canned", "Pioneer", "p3dx-sh", parse_config(b"")),)))
    kernel.scheduler.run_simulated(clock.now() + 0.1)
    driver = ArcosDriver()
    link = Canned(packets)
    link.open()
    driver._link = link
    samples = [message for _ in packets for message in driver.tick(0.0, lambda: None) if isinstance(message, m.Samples)]
    lobby = kernel.open_lobby()
    kernel.feed(lobby, script.encode())
    kernel.scheduler.run_simulated(clock.now() + 0.1)
    said = lobby.output.take_bytes()
    assert b"!!!" not in said, said

    def serve(number: int) -> None:
        post(samples[number % len(samples)])
        kernel.scheduler.run_simulated(clock.now() + 0.0001)

    serve(0)
    assert answers == [None], answers
    return serve


def small_costs(rounds: int) -> None:
    """The first part: see the head of this file."""
    packets = sips(500)
    framer = ArcosFramer()

    def decode(number: int) -> None:
        for body in framer.feed(packets[number % 500]):
            sip.parse(body)

    driver = ArcosDriver()
    link = Canned(packets)
    link.open()
    driver._link = link
    every = "for (var e : robot.named) if (e.names.back == \"sonar\") { var s = e.part; at (s.val < 0.01) nil };"
    rows = [
        ("SIP decoded", cost(decode, rounds)),
        ("tick of the driver with a SIP", cost(lambda number: driver.tick(0.0, lambda: None), rounds)),
        ("SIP served, nobody listens", cost(served(packets, ""), rounds)),
        ("SIP served, an `at` on each of 16 sonars", cost(served(packets, every), rounds)),
    ]
    for name, microseconds in rows:
        print(f"  {name:42} {microseconds:7.0f} us")


@contextlib.contextmanager
def fake(cycle: int) -> Iterator[str]:
    """A simulated robot in a process of its own; its url."""
    options = ("--pty", "--any-baud", "--until-eof", "--cycle", str(cycle))
    command = (sys.executable, "-m", "urbihw_fakes", "p3dx", *options)
    process = subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdin is not None and process.stdout is not None
    try:
        yield process.stdout.readline().strip()
    finally:
        process.stdin.close()
        process.wait(10)
        process.stdout.close()


def used(pid: int) -> float:
    """Seconds of processor that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICK_PER_SECOND


def children(pid: int) -> list[int]:
    """The processes that a process has started."""
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def daemon_share(cycle: int, seconds: float) -> tuple[float, float]:
    """Shares of a core: of the daemon, and of its worker."""
    with fake(cycle) as url, tempfile.TemporaryDirectory() as folder:
        port = Path(folder) / "port"
        serve = (sys.executable, "-m", "urbihw.cli.main", "serve", "--platform", "p3dx", "--quiet", "--url", url)
        command = (*serve, "--port", "0", "--port-file", str(port))
        daemon = subprocess.Popen(command, cwd=ROOT, stderr=subprocess.DEVNULL)
        try:
            while not (port.exists() and port.read_text().endswith("\n")):
                time.sleep(0.05)
            pids = [daemon.pid, *children(daemon.pid)]
            before = [used(pid) for pid in pids]
            time.sleep(seconds)
            shares = [(used(pid) - start) / seconds for pid, start in zip(pids, before, strict=True)]
        finally:
            daemon.terminate()
            daemon.wait(10)
    return shares[0], sum(shares[1:])


def planner() -> None:
    """The last part: see the head of this file."""
    grid = Grid(0, 0, 19, 19, 0.1)
    grid.block_line(-1, 6, 17, 6)
    grid.block_line(2, 13, 20, 13)
    start = time.perf_counter()
    grid.distances()
    measured = time.perf_counter() - start
    late: list[float] = []
    over = threading.Event()

    def wake() -> None:
        while not over.is_set():
            due = time.perf_counter() + 0.001
            time.sleep(0.001)
            late.append(time.perf_counter() - due)

    other = threading.Thread(target=wake)
    other.start()
    start = time.perf_counter()
    path = plan(grid, (1, 1), (18, 18), Room(0.3, 0.3))
    planned = time.perf_counter() - start
    over.set()
    other.join()
    usual, worst = statistics.median(late) * 1000, max(late) * 1000
    size = f"{grid.width} by {grid.height}"
    print(f"  grid of {size}: measured in {measured:.2f} s, path of {len(path)} corners in {planned:.2f} s")
    print(f"  another thread is late by {usual:.1f} ms (median), {worst:.1f} ms (worst) meanwhile")


def main() -> int:
    """Run all three parts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0, help="of each measurement of the daemon (%(default)s)")
    parser.add_argument("--rounds", type=int, default=5000, help="of each measurement in this process (%(default)s)")
    add_quick(parser, seconds=0.1, rounds=2)
    options = parser.parse_args()
    print("processor for one SIP of 16 sonars")
    small_costs(options.rounds)
    print("share of a core, robot standing, nobody connected")
    for cycle in (100, 20):
        daemon, worker = daemon_share(cycle, options.seconds)
        print(f"  {1000 // cycle:3} SIPs a second: daemon {daemon:6.1%}, worker {worker:6.1%}")
    print("planner")
    planner()
    return 0


if __name__ == "__main__":
    sys.exit(main())
