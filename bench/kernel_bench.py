"""What the language and the server cost, beside plain Python, in one run: ``python -m bench.kernel_bench``.

Three parts: work done in a kernel of this process, as a ratio to the same work in Python (the two take turns, medians);
what events, watched variables and crowds of jobs cost in microseconds; a server in a process of its own, asked over
loopback, beside a bare asyncio echo.  Each row is printed beside its budget; what is over it is marked.

Ratios are of processor time and last; other times are of one machine and of the load it had.
"""

from __future__ import annotations

import argparse
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from bench.kernel_server import server
from bench.kernel_works import WORKS
from bench.quick import add_quick
from bench.rows import COLUMNS, row
from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby

TURNS = 7


# ---------------------------------------------------------------- the language beside Python


class Machine:
    """A kernel in this process, driven by hand."""

    def __init__(self) -> None:
        self.kernel = Kernel()
        self.lobby: Lobby = self.kernel.open_lobby()

    def run(self, text: str, clock: Callable[[], float] = time.perf_counter) -> float:
        """Run statements to their end: the seconds it took.  What they answer must be no error."""
        began = clock()
        self.lobby.feed(text.encode())
        while self.kernel.run() is not None and self.kernel.scheduler.ready:
            pass
        took = clock() - began
        answer = self.lobby.output.take_bytes()
        if b":error]" in answer:
            raise RuntimeError(f"{text}: {answer.decode()}")
        return took


def timed(work: Callable[[], object]) -> float:
    """The seconds of processor time that some work takes."""
    began = time.process_time()
    work()
    return time.process_time() - began


def language(turns: int) -> None:
    """The rows that are ratios to plain Python."""
    print(COLUMNS.format("work", "urbihw", "Python", "ratio", "budget", ""))
    for work in WORKS:
        machine = Machine()
        if work.elsewhere:
            machine.kernel.open_lobby().feed(work.elsewhere.encode())
            machine.run("")
        machine.run(f"{work.before}\nfunction work() {{ {work.urbi} }}|;\nwork()|;\n")
        ours, theirs = [], []
        for _ in range(turns):
            ours.append(machine.run("work()|;\n", time.process_time))
            theirs.append(timed(work.python))
        mine, peer = statistics.median(ours), statistics.median(theirs)
        row(work.name, f"{mine * 1e3:.2f} ms", f"{peer * 1e3:.2f} ms", mine / peer, work.budget)


# ---------------------------------------------------------------- events, watched variables, many jobs


def concurrency(turns: int) -> None:
    """The rows in microseconds."""
    print()
    print(COLUMNS.format("what", "", "", "measured", "budget", ""))
    rows = (
        ("emit an event with one at", 10_000, 5.0,
         "var e = Event.new|; at (e?) {}; function work() { for (10000) e! }|;"),
        ("the same with twenty, for each of them", 10_000, 3.0,
         "var e = Event.new|; for (20) { at (e?) {} }; function work() { for (500) e! }|;"),
        ("change of a variable watched by at (expr)", 10_000, 8.0,
         "var x = 0|; at (x == -1) {}; function work() { for| (var i = 0; i < 10000; i += 1) x = i }|;"),
        ("change of one of 50 variables of an at", 2000, 20.0,
         "".join(f"var v{n} = 0|; " for n in range(50)) + "at (" + " + ".join(f"v{n}" for n in range(50))
         + " == -1) {}; function work() { for| (var i = 0; i < 2000; i += 1) v7 = i }|;"),
        ("change of a variable of 50 ats, for each of them", 10_000, 4.0,
         "var x = 0|; " + "at (x == -1) {};" * 50 + " function work() { for| (var i = 0; i < 200; i += 1) x = i }|;"),
        ("detach", 2000, 15.0, "function work() { for (2000) detach({}) }|;"),
        ("one statement of one of 1000 jobs", 100_000, 3.0,
         "function work() { for& (1000) { for (100) 1 } }|;"),
    )  # fmt: skip
    for name, count, budget, text in rows:
        machine = Machine()
        machine.run(text + "\nwork()|;\n")
        took = statistics.median(machine.run("work()|;\n", time.process_time) for _ in range(turns))
        row(name, "", "", took / count * 1e6, budget, " us")
    row("one turn of one of 1000 loops every(100ms)", "", "", loops(turns), 10.0, " us")
    compiling(turns)
    taken, whole = sleepers()
    row("10 000 sleeping jobs, what they add", "", "", taken, 100, " MB")
    row("10 000 sleeping jobs, the whole process", "", "", whole, 100, " MB")


def loops(turns: int) -> float:
    """Microseconds of processor time for each turn of 1000 loops, in simulated time."""
    kernel = Kernel(fast=True)
    lobby = kernel.open_lobby()
    kernel.run_text(lobby, "var n = 0|; for& (1000) { every (100ms) n += 1 },\n", until=0.45)
    began = time.process_time()
    kernel.run_text(lobby, "", until=0.45 + turns)
    return (time.process_time() - began) / (turns * 10 * 1000) * 1e6


def compiling(turns: int) -> None:
    """What new text costs, in processor time."""
    cpu = time.process_time
    for joint, separator in ((",", ", "), ("&", " & ")):
        each = []
        for count in (1000, 4000):
            text = separator.join(f"t: {number}" for number in range(count))
            machine = Machine()
            machine.run("var t = Tag.new|;\n")
            each.append(machine.run(f"{{ {text} }}|;\n", cpu) / count)
        row(f"each of 4000 tagged statements joined by {joint}", "", "", each[1] * 1e6, 350, " us")
        row("the same, beside each of 1000", "", "", each[1] / each[0], 1.5)
    machine = Machine()
    shapes = [machine.run(f"var v{number} = [{number}, nil.isNil].size|;\n", cpu) for number in range(200)]
    row("a statement of one line and of a new shape", "", "", statistics.median(shapes) * 1e3, 0.5, " ms")
    with tempfile.TemporaryDirectory() as folder:
        times = []
        for turn in range(turns):
            file = Path(folder) / f"{turn}.u"
            file.write_text("".join(f"var v{index} = [{index}, {turn}];\n" for index in range(1000)))
            times.append([Machine().run(f'load("{file}")|;\n', cpu) for _ in range(2)])
    for name, took, budget in zip(("first", "again"), zip(*times, strict=True), (0.25, 0.05), strict=True):
        row(f"load of 1000 different lines, {name}", "", "", statistics.median(took), budget, " s")


SLEEPERS = """
from urbihw.kernel import Kernel
def resident():
    return int(open("/proc/self/statm").read().split()[1]) * 4096 / 1e6
kernel = Kernel()
lobby = kernel.open_lobby()
lobby.feed(b"for& (10) { sleep(1h) },\\n")
while kernel.run() is not None and kernel.scheduler.ready: pass
before = resident()
lobby.feed(b"for& (10000) { sleep(1h) },\\n")
while kernel.run() is not None and kernel.scheduler.ready: pass
assert len(kernel.scheduler.jobs) > 10000, len(kernel.scheduler.jobs)
print(resident() - before, resident())
"""


def sleepers() -> tuple[float, float]:
    """Megabytes that 10 000 sleeping jobs add, and those of their whole process."""
    said = subprocess.run([sys.executable, "-c", SLEEPERS], check=True, capture_output=True, text=True).stdout
    taken, whole = map(float, said.split())
    return taken, whole


def main() -> None:
    """Measure and print everything."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition(":")[0])
    parser.add_argument("--turns", type=int, default=TURNS, help="repetitions of each row (%(default)s); medians count")
    parser.add_argument("--clients", type=int, default=1000, help="of the crowd that connects at once (%(default)s)")
    add_quick(parser, turns=1, clients=50)
    options = parser.parse_args()
    turns = options.turns
    print(f"Python {platform.python_version()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.2f} before\n")
    language(turns)
    concurrency(turns)
    server(turns, options.clients)
    print(f"\nload {os.getloadavg()[0]:.2f} after; figures taken beside other work are upper bounds")


if __name__ == "__main__":
    main()
