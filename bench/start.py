"""What a start costs and what it imports: `python -m bench.start [--modules 12]`.

Each command is started some times in a process of its own: the median of its processor time beside its budget, and
beside that of an empty Python program.  `urbihw serve` counts until clients can connect.

With `--modules` the modules follow that take most of it, each with the processor time of its own body, without the
imports in it: this is the place to see what is imported when.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Final, NamedTuple

from bench.kernel_server import INSTALLED, processor
from bench.quick import add_quick
from bench.rows import COLUMNS, row

SERVE: Final = ("serve", "--platform", "bioloid", "--fake", "--port", "0")


class StartedCommand(NamedTuple):
    """A command line of ``urbihw``, and its budget in seconds of processor time."""

    words: tuple[str, ...]
    budget: float


COMMANDS: Final = (
    StartedCommand(("--version",), 0.06),
    StartedCommand(("estop",), 0.06),
    StartedCommand(("status",), 0.2),
    StartedCommand(SERVE, 0.25),
)
MAIN: Final = "import sys; from urbihw.cli.entry import urbihw; sys.exit(urbihw())"
NOTING: Final = """
import atexit, importlib.machinery, os, sys, time
spent, stack = {}, []
body = importlib.machinery.SourceFileLoader.exec_module
def exec_module(self, module):
    began, inner = time.process_time(), 0.0
    stack.append(inner)
    try:
        body(self, module)
    finally:
        took = time.process_time() - began
        spent[module.__name__] = took - stack.pop()
        if stack:
            stack[-1] += took
importlib.machinery.SourceFileLoader.exec_module = exec_module
def tell_at_end(file):
    def tell():
        with open(file, "w") as told:
            told.writelines(f"{own} {name}\\n" for name, own in spent.items())
    def leave(code, leave=os._exit):
        tell()
        leave(code)
    os._exit = leave  # a daemon ends so
    atexit.register(tell)
"""


def until_it_ends(words: tuple[str, ...]) -> float:
    """The processor time of a command, in seconds."""
    before = os.times()
    subprocess.run((sys.executable, *words), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def until_it_serves(words: tuple[str, ...]) -> float:
    """The processor time of a daemon until it has written its port to a file, in seconds."""
    with tempfile.TemporaryDirectory() as folder:
        port_file = Path(folder) / "port"
        command = (sys.executable, *words, "--port-file", str(port_file))
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=INSTALLED) as process:
            try:
                while not port_file.exists():
                    if process.poll() is not None:
                        raise RuntimeError(f"it has ended: {' '.join(words)}")
                    time.sleep(0.002)
                return processor(process.pid)
            finally:
                process.terminate()


def start(words: tuple[str, ...]) -> float:
    """The processor time of a start, in seconds."""
    return until_it_serves(words) if "serve" in words else until_it_ends(words)


def modules(words: tuple[str, ...], number: int) -> None:
    """Print the modules that take most of the start of a command."""
    with tempfile.TemporaryDirectory() as folder:
        told = Path(folder) / "told"
        noted = f"{NOTING}\ntell_at_end({str(told)!r})\n{MAIN}"
        start(("-c", noted, *words))
        rows = [line.split() for line in told.read_text().splitlines()]
    rows.sort(key=lambda each: -float(each[0]))
    print(f"  {len(rows)} modules take {sum(float(own) for own, _ in rows):.3f} s; most of it:")
    for own, name in rows[:number]:
        print(f"    {float(own) * 1e3:6.1f} ms  {name}")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--turns", type=int, default=7, help="starts of each command (%(default)s); medians count")
    parser.add_argument("--modules", type=int, default=0, help="how many modules to show of each")
    add_quick(parser, turns=1)
    options = parser.parse_args()
    print(COLUMNS.format("processor time", "urbihw", "Python", "measured", "budget", ""))
    for words, budget in COMMANDS:
        ours, bare = [], []
        for _ in range(options.turns):
            bare.append(start(("-c", "pass")))
            ours.append(start(("-c", MAIN, *words)))
        took, empty = statistics.median(ours), statistics.median(bare)
        row(f"urbihw {' '.join(words[:1])}", f"{took:.3f} s", f"{empty:.3f} s", took, budget, " s")
        if options.modules:
            modules(words, options.modules)


if __name__ == "__main__":
    main()
