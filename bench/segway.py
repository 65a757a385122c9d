"""When the commands of an RMP leave: `python -m bench.segway [--seconds 20]`.

A worker in a process of its own drives the simulated base behind a pseudo terminal of this process, where commands
are stamped when they are read. The deadlines are a grid with the worker's period; its phase is that of the most
punctual command, so what is printed is how much later than the best the others came, reading included. Where it is
allowed to (as root), the reading thread goes before all others, so that it adds little.

On a busy machine the kernel's own thread behind a pseudo terminal comes late, too, and brings commands closer together
than they were sent.

The goal: on an idle machine 99 % within 5 ms, and no two closer than 10 ms. The last run has a process beside it on
each core that never rests.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

from bench.quick import add_quick
from urbihw.buses import messages as m
from urbihw.buses.worker import Worker
from urbihw.platforms.segway.driver import BASE
from urbihw_fakes.can.device import CanDevice
from urbihw_fakes.can.slcan import Slcan
from urbihw_fakes.can.slcan_pty import SlcanPty
from urbihw_fakes.device import Answer
from urbihw_fakes.segway.rmp import SegwayRmp
from urbihw_fakes.segway.start import UsbPty
from urbihw_fakes.segway.usb import UsbLink

FAMILY = "urbihw.platforms.segway.driver:RmpDriver"
GOAL = 0.005
SHORTEST = 0.010


class Stamped(CanDevice):
    """A base that remembers when each command came."""

    def __init__(self, codec: UsbLink | Slcan) -> None:
        super().__init__(SegwayRmp(), codec)
        self.stamps: list[float] = []

    def receive(self, data: bytes, now: float) -> list[Answer]:
        """Take bytes of the host."""
        before = self._heard()
        answers = super().receive(data, now)
        self.stamps += [now] * (self._heard() - before)
        return answers

    def _heard(self) -> int:
        assert isinstance(self.node, SegwayRmp)
        return self.node.heard


def go_first() -> None:
    """Let the calling thread go before all others, if that is allowed."""
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))


@contextlib.contextmanager
def load(processes: int) -> Iterator[None]:
    """Processes that never rest."""
    made = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(processes)]
    try:
        yield
    finally:
        for process in made:
            process.kill()
            process.wait()


def measure(link: str, rate: float, seconds: float, warm_up: float) -> tuple[list[float], float]:
    """When the commands came, and the worker's share of a core."""
    device = Stamped(UsbLink() if link == "usb" else Slcan())
    found = threading.Event()

    def post(message: m.FromWorker) -> None:
        if isinstance(message, m.Found):
            found.set()

    with (UsbPty if link == "usb" else SlcanPty)(device) as end:
        end.start()
        end.call(go_first)
        with Worker.start(end.url, post=post, settings=m.Configure(rate=rate, dead_man=0), family=FAMILY) as worker:
            if not found.wait(5):
                raise SystemExit("the worker does not hear the base")
            worker.send(m.Watch(BASE, (), 0.0))
            time.sleep(warm_up)
            begin, used = time.monotonic(), child_seconds()
            time.sleep(seconds)
            elapsed, used = time.monotonic() - begin, child_seconds() - used
            stamps = end.call(lambda: [stamp for stamp in device.stamps if begin <= stamp < begin + elapsed])
    return stamps, used / elapsed


def lateness(stamps: list[float], period: float) -> list[float]:
    """Seconds that each command came after its deadline, on the grid of the most punctual one."""
    usual = statistics.median((stamp - stamps[0] + period / 2) % period - period / 2 for stamp in stamps)
    # Earlier than usual by a quarter of a period at most; the rest of the circle is lateness.
    phases = [(stamp - stamps[0] - usual + period / 4) % period for stamp in stamps]
    first = min(phases)
    return [phase - first for phase in phases]


def child_seconds() -> float:
    """Processor time so far of the one worker process among our children."""
    total = 0.0
    for child in Path(f"/proc/self/task/{os.getpid()}/children").read_text(encoding="ascii").split():
        if "urbihw.buses.child" in Path(f"/proc/{child}/cmdline").read_text(encoding="utf-8"):
            fields = Path(f"/proc/{child}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
            total += (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return total


def report(title: str, link: str, rate: float, seconds: float, warm_up: float) -> None:
    """Print a line."""
    period = 1 / rate
    stamps, share = measure(link, rate, seconds, warm_up)
    late = sorted(lateness(stamps, period))
    gaps = [after - before for before, after in zip(stamps, stamps[1:], strict=False)]
    within = 100 * sum(value <= GOAL for value in late) / len(late)
    missing = round((stamps[-1] - stamps[0]) / period) + 1 - len(stamps)
    print(
        f"  {title:22} {link:6}{rate:4.0f} Hz {len(stamps):6} {1e3 * statistics.median(late):8.2f} "
        f"{1e3 * late[int(0.99 * len(late))]:7.2f} {1e3 * late[-1]:7.2f} {within:8.2f} % {1e3 * min(gaps):9.1f} "
        f"{1e3 * max(gaps):7.1f} {missing:8} {100 * share:7.1f} %",
        flush=True,
    )


def main() -> None:
    """Run everything and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0, help="of each measurement (%(default)s)")
    parser.add_argument("--warm-up", type=float, default=1.0, help="seconds before each (%(default)s)")
    add_quick(parser, seconds=0.3, warm_up=0.1)
    wanted = parser.parse_args()
    seconds, warm_up = wanted.seconds, wanted.warm_up
    print(f"commands to an RMP: ms after their deadline; goal: 99 % within {1e3 * GOAL:g} ms on an idle machine,")
    print(f"no two closer than {1e3 * SHORTEST:g} ms; load of this machine before: {os.getloadavg()[0]:.1f}")
    print(
        f"  {'':22} {'link':6}{'rate':>7} {'sent':>6} {'median':>8} {'99 %':>7} {'most':>7} {'in 5 ms':>10} "
        f"{'least gap':>9} {'most':>7} {'missing':>8} {'core':>9}"
    )
    for link, rate in (("usb", 50.0), ("slcan", 50.0), ("usb", 20.0)):
        report("no load of ours", link, rate, seconds, warm_up)
    with load(os.cpu_count() or 1):
        report("every core busy", "usb", 50.0, seconds, warm_up)


if __name__ == "__main__":
    main()
