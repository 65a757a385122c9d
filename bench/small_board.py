"""What a small board will do: `python -m bench.small_board [--share 0.25]`, on a part of a core.

The process that is measured gets a quarter of a core, one millisecond at a time: by a group of the system's scheduler
where this user may make one, else it is stopped and continued.  So a core is imitated that does a quarter of this one's
work.  All else, such as the simulated robot, has the other cores: the machine must be idle and have two.

    bus      18 servos, written and read each time: our worker, and the loop of dynamixel-sdk, which spins meanwhile
    server   the start, reactions of `at`, and lines that are sent without waiting.  A single answer takes less than a
             slice, so it is as quick as on a whole core here

Beside each figure stands the one with a whole core.  `--page FILE` also writes the table into a page, between its lines
`<!-- small board -->`: `make small-board` does that with docs/performance.md.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import platform
import signal
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from bench import ROOT
from bench.dynamixel_cycle import FLAT_OUT, fake, rate_of, sdk, worker_numbers
from bench.kernel_server import OURS, ask, pipeline, served
from bench.quick import add_quick

SLICE_S = 0.001
"""Seconds for which the process runs at a time."""
ROW = "| {:62} | {:>12} | {:>12} |"
MARK = "<!-- small board -->\n"
Adder = Callable[[int], object]
"""Gives the process with this id its part of a core from now on."""
Figures = dict[str, str]
"""What was measured, in words, and how much."""

STOPPER = """
import contextlib, os, signal, sys, time
pid, running, standing = int(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3])
with contextlib.suppress(OSError):
    os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(2))
with contextlib.suppress(ProcessLookupError):
    while True:
        os.kill(pid, signal.SIGCONT)
        time.sleep(running)
        os.kill(pid, signal.SIGSTOP)
        time.sleep(standing)
"""
SDK = "from bench.small_board import measure_sdk; measure_sdk()"


@contextlib.contextmanager
def group_with_share(share: float) -> Iterator[Adder]:
    """A group of processes that together get a share of a core.  Raises OSError where that is not allowed."""
    root = Path("/sys/fs/cgroup")
    quota, period = round(SLICE_S * 1e6), round(SLICE_S * 1e6 / share)
    first = not (root / "cgroup.controllers").exists()
    group = (root / "cpu" if first else root) / "urbihw-bench"
    limits = {"cpu.cfs_period_us": period, "cpu.cfs_quota_us": quota} if first else {"cpu.max": f"{quota} {period}"}
    group.mkdir(exist_ok=True)
    try:
        for name, value in limits.items():
            (group / name).write_text(str(value), encoding="ascii")
        yield lambda pid: (group / "cgroup.procs").write_text(str(pid), encoding="ascii")
    finally:
        for pid in (group / "cgroup.procs").read_text(encoding="ascii").split():  # what has not ended yet
            with contextlib.suppress(OSError):
                (group.parent / "cgroup.procs").write_text(pid, encoding="ascii")
        group.rmdir()


@contextlib.contextmanager
def stopped_and_continued(share: float) -> Iterator[Adder]:
    """Processes that each run for a slice, and stand for the rest of its period."""
    stoppers: dict[int, subprocess.Popen[bytes]] = {}

    def add(pid: int) -> None:
        times = (str(SLICE_S), str(SLICE_S / share - SLICE_S))
        stoppers[pid] = subprocess.Popen((sys.executable, "-c", STOPPER, str(pid), *times))

    try:
        yield add
    finally:
        for pid, stopper in stoppers.items():
            stopper.kill()
            stopper.wait()
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGCONT)  # it may have been stopped last


@contextlib.contextmanager
def part_of_a_core(share: float) -> Iterator[Adder]:
    """Whichever of the two is possible; a whole core for 1."""
    if share == 1:
        yield lambda pid: None
        return
    with contextlib.ExitStack() as stack:
        try:
            add = stack.enter_context(group_with_share(share))
        except OSError:
            add = stack.enter_context(stopped_and_continued(share))
        yield add


# ---------------------------------------------------------------- the bus


def bus(protocol: int, share: float, seconds: float, paced: bool) -> Figures:
    """Cycles a second of the worker and of dynamixel-sdk."""
    told: Figures = {}
    name = f"bus, protocol {protocol}.0: "
    with fake(protocol, paced, spins=False) as kit:
        kit.take_real_time()
        for asked, wanted in ((50.0, "50 cycles a second"), (100.0, "100"), (FLAT_OUT, "as many as it can")):
            with part_of_a_core(share) as add:
                rate, used = worker_numbers(kit, protocol, asked, seconds, begun=add)
            told[f"{name}worker, asked for {wanted}"] = f"{rate:.1f} Hz"
            if asked == FLAT_OUT and rate:
                told[f"{name}its processor time for a cycle"] = f"{used / rate * 1e3:.2f} ms"
        with part_of_a_core(share) as add:
            command = (sys.executable, "-c", SDK, kit.path, str(protocol), str(seconds))
            with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
                add(process.pid)
                said = process.stdout.read() if process.stdout else ""
        told[f"{name}loop of dynamixel-sdk"] = f"{float(said or 0):.1f} Hz"
    return told


def measure_sdk() -> None:
    """Print the whole cycles a second of dynamixel-sdk; the arguments are the device, the protocol and the seconds."""
    path, protocol, seconds = sys.argv[1:]
    full = 0
    with sdk(path, int(protocol)) as loop:

        def counted(count: int) -> None:
            nonlocal full
            full += loop(count)

        begun = time.perf_counter()
        rate_of(counted, float(seconds))
        print(full / (time.perf_counter() - begun))


# ---------------------------------------------------------------- the server


def server(share: float, turns: int, lines: int) -> Figures:
    """What clients of a server notice."""
    told: Figures = {}
    with part_of_a_core(share) as add:
        starts = []
        for _ in range(turns):
            with served(*OURS, begun=add) as (_, connection, took):
                starts.append(took)
        told["server: start to open port"] = f"{statistics.median(starts):.2f} s"
        with served(*OURS, begun=add) as (_, connection, _):
            ask(connection, b"1;\n", 1, 100)
            connection.sendall(b'var x = 0|; at (x > 0) echo("on");\n')
            reactions = pipeline(connection, [b"x = 0|; x = 1|;\n"] * (lines // 10))
            told["server: reactions of an at, a second"] = f"{reactions:.0f}"
            told["server: lines a second, the same text"] = f"{pipeline(connection, [b'1;'] * lines):.0f}"
            texts = [b"%d;" % number for number in range(1, lines)]
            told["server: lines a second, all different"] = f"{pipeline(connection, texts):.0f}"
    return told


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--share", type=float, default=0.25, help="part of a core (%(default)s)")
    parser.add_argument("--seconds", type=float, default=5.0, help="of each measurement of the bus (%(default)s)")
    parser.add_argument("--turns", type=int, default=5, help="starts of the server; the median counts (%(default)s)")
    parser.add_argument("--lines", type=int, default=10_000, help="lines sent without waiting (%(default)s)")
    parser.add_argument("--page", type=Path, metavar="FILE", help="a page to write the table into")
    add_quick(parser, seconds=0.2, turns=1, lines=100)
    options = parser.parse_args()
    load = os.getloadavg()[0]
    lines = [ROW.format("what", "a core", f"{options.share:g} of it"), "|---|---|---|"]
    print("\n".join(lines), flush=True)
    parts: tuple[Callable[[float], Figures], ...] = (
        lambda share: bus(1, share, options.seconds, not options.quick),
        lambda share: bus(2, share, options.seconds, not options.quick),
        lambda share: server(share, options.turns, options.lines),
    )
    for part in parts:
        whole, small = part(1.0), part(options.share)
        for what, figure in whole.items():
            lines.append(ROW.format(what, figure, small.get(what, "-")))
            print(lines[-1], flush=True)
    with_what = f"Python {platform.python_version()}, {machine()}, load {load:.2f} before"
    print(with_what)
    if options.page is not None:
        write_page(options.page, "\n".join([*lines, "", f"{with_what}.", ""]))


def machine() -> str:
    """The processor of this machine, in the words of the system."""
    known = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    names = [line.partition(":")[2].strip() for line in known.splitlines() if line.startswith("model name")]
    return names[0] if names else platform.machine()


def write_page(page: Path, table: str) -> None:
    """Put a table between the marks of a page."""
    before, _, after = page.read_text(encoding="utf-8").split(MARK)
    page.write_text(f"{before}{MARK}\n{table}\n{MARK}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
