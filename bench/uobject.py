"""What UObjects cost: an owned variable plugged in, a round trip to another process, a film from another process.

    .venv/bin/python -m bench.uobject [--film SECONDS]

Server and remote run as processes of their own on this machine; their processor time is that of the operating system.
"""

from __future__ import annotations

import argparse
import os
import socket
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from bench.quick import add_quick
from urbihw.kernel import Kernel
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.uobject import UImage, UObject, function, owned, reading, variable

WIDTH, HEIGHT, RATE = 640, 480, 60


class Lamp(UObject):
    """Counts what is asked of it."""

    val = owned(0.0)

    def init(self) -> None:
        """Hear of every write."""
        self.count = 0
        self.notify_change(self.val, self.written)

    def written(self) -> None:
        """One more."""
        self.count += 1


class Echo(UObject):
    """Writes ``ping``; the server answers by ``pong``; and so on."""

    ping = variable(0.0)
    pong = variable(0.0)
    median = reading(0.0)

    def init(self) -> None:
        """Hear of the answers."""
        self.times: list[float] = []
        self.left = 0
        self.notify_change(self.pong, self.answered)

    @function
    def go(self, trips: int) -> None:
        """Begin."""
        self.times.clear()
        self.left = trips
        self._send()

    def _send(self) -> None:
        self.began = time.perf_counter()
        self.ping.sense(float(self.left))

    def answered(self) -> None:
        """The server has answered."""
        self.times.append(time.perf_counter() - self.began)
        self.left -= 1
        if self.left:
            self._send()
        else:
            self.median.sense(statistics.median(self.times))


class Film(UObject):
    """Shows 640 by 480 pixels, 60 times a second."""

    val = reading()

    def init(self) -> None:
        """Prepare two pictures."""
        self.pictures = [bytes([shade]) * (WIDTH * HEIGHT * 3) for shade in (40, 200)]
        self.shown = 0
        self.set_timer(1 / RATE, self.show)

    def show(self) -> None:
        """The next picture."""
        self.shown += 1
        self.val.sense(UImage.of(self.pictures[self.shown % 2], WIDTH, HEIGHT))


def plugged(writes: int) -> float:
    """Seconds of one write of an owned variable, its callback included."""
    kernel = Kernel(SimClock())
    lobby = kernel.open_lobby()
    lamp = kernel.host.create(Lamp, "lamp")
    best = float("inf")
    for _ in range(5):
        began = time.perf_counter()
        kernel.run_text(lobby, f"for| (var i: {writes}) lamp.val = i;")
        best = min(best, (time.perf_counter() - began) / writes)
    assert lamp.count == 5 * writes
    return best


# ---------------------------------------------------------------- two processes


class Client:
    """A connection to the server; ``ask`` gives the answer to one statement."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=60)
        self._file = self._socket.makefile("rb")

    def ask(self, text: str) -> str:
        """Send a statement that answers one line."""
        self._socket.sendall(text.encode())
        return self._file.readline().decode("latin-1").partition("] ")[2].strip()


@contextmanager
def processes(*more: str) -> Iterator[tuple[Client, int, int]]:
    """A server, this file as its remote with ``more`` modules, a client, and the numbers of the two processes."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    modules = [str(Path(__file__).resolve()), *more]
    server = _python(f"from urbihw.cli.urbi import main; main(['-q', '-P', '{port}'])")
    remote = _python(f"from urbihw.remote import run; run({modules!r}, port={port}, retry_first=True)")
    try:
        yield _joined(port), server.pid, remote.pid
    finally:
        for process in (remote, server):
            process.terminate()
            process.wait()


def _python(code: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, "-c", code])


def _joined(port: int) -> Client:
    for _ in range(200):
        try:
            client = Client(port)
            break
        except OSError:
            time.sleep(0.05)
    client.ask('waituntil(uobjects.hasSlot("Film"))|; 1;')
    return client


def round_trip(client: Client, trips: int) -> float:
    """Seconds from a write in the remote to the callback for the server's answer, at the median."""
    client.ask(
        'var Global.mirror = Echo.new|; mirror.getSlot("ping").notifyChange(uobjects_handle, closure() '
        "{ Global.mirror.pong = Global.mirror.ping })|; 1;"
    )
    medians = []
    for _ in range(3):
        client.ask(f"mirror.go({trips})|; waituntil(mirror.median->changed?)|; 1;")
        medians.append(float(client.ask("mirror.median * 1000000;")))
    return min(medians) / 1e6


def film(client: Client, pids: tuple[int, int], seconds: float) -> tuple[float, float, float]:
    """Pictures a second that a callback in the server sees, and the share of a core that server and remote take."""
    client.ask(
        'var Global.seen = 0|; var Global.movie = Film.new|; movie.getSlot("val").notifyChange(uobjects_handle, '
        "closure() { Global.seen++ })|; sleep(500ms)|; 1;"
    )
    used = [_processor(pid) for pid in pids]
    before, began = float(client.ask("seen;")), time.monotonic()
    time.sleep(seconds)
    after, took = float(client.ask("seen;")), time.monotonic() - began
    shares = [(_processor(pid) - was) / took for pid, was in zip(pids, used, strict=True)]
    return (after - before) / took, shares[0], shares[1]


def _processor(pid: int) -> float:
    """Seconds of processor time of a process."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main() -> None:
    """Measure, and print one line each."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--film", type=float, default=10.0, help="seconds of film (default: %(default)s)")
    options.add_argument("--trips", type=int, default=2000, help="round trips (default: %(default)s)")
    add_quick(options, film=0.2, trips=20)
    wanted = options.parse_args()
    seconds, trips = wanted.film, wanted.trips
    print(f"owned variable, write to callback: {plugged(50 * trips) * 1e6:.2f} us (aim: below 3)")
    with processes() as (client, server, remote):
        there_and_back = round_trip(client, trips) * 1e3
        print(f"remote write to callback and back: {there_and_back:.3f} ms at the median (aim: below 0.5)")
        print_film("film", film(client, (server, remote), seconds))
    with processes("urbi/rtp") as (client, server, remote):
        print_film("film by RTP", film(client, (server, remote), seconds))


def print_film(what: str, measured: tuple[float, float, float]) -> None:
    """One line."""
    rate, of_server, of_remote = measured
    print(f"{what}, {WIDTH}x{HEIGHT}: {rate:.1f} pictures a second (aim: {RATE}); "
          f"server {of_server:.0%}, remote {of_remote:.0%} of a core (aim: below 50% each)")


if __name__ == "__main__":
    main()
