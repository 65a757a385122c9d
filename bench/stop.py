"""How long a stop takes: `python -m bench.stop [--trials 100]`.

A real daemon drives a simulated Bioloid behind a pseudo terminal of this process.  Measured is the time from the
bytes of the request (at the control socket, or typed by a client on the TCP port) to the last byte of the stop at the
robot's end of the wire.

    idle        one wheel turns, nothing else is done
    full load   18 joints swing, all positions are read a hundred times a second
    beside loop the same, while a program never gives way (`loop|{}`); a stop that is typed waits for it, so the dead
                man is what stops the robot then
    command     `urbihw estop`, from the start of its process: idle, and beside eight processes that are always busy

The goal for the control socket is 5 ms at the 99th percentile, in all three; for the command 40 ms on an idle machine
and 0.2 s on the busy one.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from bench.quick import add_quick
from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.device import Answer
from urbihw_fakes.endpoint import PtyEndpoint

TIMEOUT_S = 20.0
SETTLE = 0.12
"""Seconds after a request in which all of its stop is out."""
BUSY = 8
"""Busy processes beside the command."""
SYNC_WRITE, GOAL, SPEED = 0x83, 30, 32
SWING = "for| (var m : motors) detach({ m.val = 0 sin:1s ampli:20deg });"
WHEEL = "motor1.speed = 1|;"


class Stamped(Bioloid):
    """A kit that remembers when goals and speeds came."""

    def __init__(self) -> None:
        super().__init__(baud=1_000_000)
        self.stamps: list[float] = []

    def receive(self, data: bytes, now: float) -> list[Answer]:
        """Take bytes of the host."""
        at = data.find(bytes((0xFE,)))
        while 0 <= at < len(data) - 3:
            if data[at - 2 : at] == b"\xff\xff" and data[at + 2] == SYNC_WRITE and data[at + 3] in (GOAL, SPEED):
                self.stamps.append(time.monotonic())
            at = data.find(bytes((0xFE,)), at + 1)
        return super().receive(data, now)


class Session:
    """A daemon, a client that drives, and a client that stops."""

    def __init__(self, folder: Path, kit: Stamped, url: str) -> None:
        self._kit = kit
        self.control = folder / "control.sock"
        port_file, config = folder / "port", folder / "config.toml"
        config.write_text(f'platform = "bioloid"\nurl = "{url}"\ncontrol = "{self.control}"\nquiet = true\nport = 0\n')
        self.process = subprocess.Popen(
            (sys.executable, "-m", "urbihw.cli.main", "serve", "--config", str(config), "--port-file", str(port_file)),
            stderr=subprocess.DEVNULL,
        )
        end = time.monotonic() + TIMEOUT_S
        while not (port_file.exists() and port_file.read_text().endswith("\n")):
            if self.process.poll() is not None or time.monotonic() > end:
                raise SystemExit("the daemon did not start")
            time.sleep(0.01)
        self.port = int(port_file.read_text())
        self.driver = self.client()
        self.stopper = self.client()
        self.orders = socket.socket(socket.AF_UNIX)
        self.orders.connect(str(self.control))
        self.say("motor1.cwLimit = 0|; motor1.ccwLimit = 0|;")
        time.sleep(0.5)

    def client(self) -> socket.socket:
        """A connection to the port."""
        made = socket.create_connection(("127.0.0.1", self.port))
        made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return made

    def say(self, text: str) -> None:
        """Type something as the client that drives."""
        self.driver.sendall(text.encode() + b"\n")

    def order(self, verb: str) -> None:
        """Ask the control socket, and wait for its answer."""
        self.orders.sendall(json.dumps({"do": verb, "who": "bench"}).encode() + b"\n")
        self.orders.recv(4096)

    def estop(self) -> None:
        """An emergency stop at the control socket."""
        self.order("estop")

    def run_command(self) -> None:
        """`urbihw estop`, as a shell starts it."""
        command = (str(Path(sys.executable).with_name("urbihw")), "estop", "--socket", str(self.control))
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)

    def type_stop(self) -> None:
        """A stop as somebody types it."""
        self.stopper.sendall(b"bioloid.stop;\n")

    def measured(self, motion: str, stop: str) -> float:
        """Seconds from a request to the last byte of the stop."""
        self.order("release")
        self.say(motion)
        time.sleep(0.5)
        began = time.monotonic()
        {"estop": self.estop, "command": self.run_command, "typed": self.type_stop}[stop]()
        time.sleep(SETTLE)
        last = [stamp for stamp in self._kit.stamps if stamp >= began]
        if stop == "command":
            # The stop of a wheel, which is sent twice; while the process ends, an emergency stop is repeated.
            last = last[:2]
        self._kit.stamps.clear()
        self._drain()
        return last[-1] - began if last else float("nan")

    def _drain(self) -> None:
        for client in (self.driver, self.stopper):
            client.setblocking(False)
            with contextlib.suppress(BlockingIOError):
                while client.recv(65536):
                    pass
            client.setblocking(True)

    def close(self) -> None:
        """End the daemon."""
        self.process.kill()
        self.process.wait()
        for each in (self.driver, self.stopper, self.orders):
            each.close()


@contextlib.contextmanager
def session() -> Iterator[Session]:
    """A fresh robot and a daemon for it."""
    kit = Stamped()
    for unit in kit:
        unit.registers.put("return_delay", 0)
    with tempfile.TemporaryDirectory() as folder, PtyEndpoint(kit, pace=1_000_000) as endpoint:
        endpoint.start()
        made = Session(Path(folder), kit, endpoint.url)
        try:
            yield made
        finally:
            made.close()


@contextlib.contextmanager
def busy_processes(count: int) -> Iterator[None]:
    """Processes that never wait."""
    busy = [subprocess.Popen((sys.executable, "-c", "while True: pass")) for _ in range(count)]
    try:
        yield
    finally:
        for each in busy:
            each.kill()
            each.wait()


def row(name: str, times: list[float]) -> str:
    """A line of the table, in milliseconds."""
    good = sorted(value * 1000 for value in times if value == value)
    if not good:
        return f"{name:34} no stop was seen"
    p99 = good[min(len(good) - 1, int(len(good) * 0.99))]
    missing = f"  ({len(times) - len(good)} of {len(times)} not seen)" if len(good) < len(times) else ""
    return f"{name:34} {statistics.median(good):8.2f} {p99:8.2f} {good[-1]:8.2f}{missing}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--held", type=int, help="trials beside a loop, each with a daemon of its own (a tenth)")
    add_quick(parser, trials=1, held=1)
    wanted = parser.parse_args()
    trials, held = wanted.trials, wanted.held or max(5, wanted.trials // 10)
    print(f"{'ms from request to last stop byte':34} {'p50':>8} {'p99':>8} {'worst':>8}   {trials} trials each")
    for stop in ("estop", "typed"):
        for name, motion in (("idle", WHEEL), ("full load", SWING)):
            with session() as made:
                print(row(f"{stop}, {name}", [made.measured(motion, stop) for _ in range(trials)]), flush=True)
    with session() as made:
        print(row("urbihw estop, idle", [made.measured(WHEEL, "command") for _ in range(trials)]), flush=True)
        with busy_processes(BUSY):
            times = [made.measured(WHEEL, "command") for _ in range(trials)]
        print(row(f"urbihw estop, {BUSY} busy processes", times), flush=True)
    times = []
    for _ in range(held):
        # A program that never gives way cannot be ended but with its daemon.
        with session() as made:
            made.client().sendall(b"sleep(0.4s); loop|{};\n")
            times.append(made.measured(SWING, "estop"))
    print(row("estop, beside loop|{}", times), flush=True)


if __name__ == "__main__":
    main()
