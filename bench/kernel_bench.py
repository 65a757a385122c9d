"""What the language and the server cost, beside plain Python, in one run: ``python -m bench.kernel_bench``.

Three parts: work done in a kernel of this process, as a ratio to the same work in Python (the two take turns, medians);
what events, watched variables and crowds of jobs cost in microseconds; a server in a process of its own, asked over
loopback, beside a bare asyncio echo.  Each row is printed beside its budget; what is over it is marked.

Times are of one machine and of the load it had; ratios last.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import platform
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from bench.quick import add_quick
from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby

TURNS = 7
COLUMNS = "{:46} {:>12} {:>12} {:>9} {:>9}  {}"


def row(what: str, ours: str, peer: str, measured: float, budget: float, unit: str = "") -> None:
    """Print a figure beside its budget; below is good."""
    verdict = "" if measured <= budget else "OVER"
    print(COLUMNS.format(what, ours, peer, f"{measured:.3g}{unit}", f"{budget:g}{unit}", verdict), flush=True)


# ---------------------------------------------------------------- the language beside Python


@dataclass(frozen=True)
class Work:
    """The same work twice: ``urbi`` is the body of a function, ``python`` a function."""

    name: str
    urbi: str
    python: Callable[[], object]
    budget: float
    before: str = ""


def fibo(n: float) -> float:
    """The peer of the recursive function."""
    return n if n < 2 else fibo(n - 1) + fibo(n - 2)


def empty_loop() -> None:
    """The peer of ``for| (100000) {}``."""
    for _ in range(100_000):
        pass


def c_loop() -> float:
    """The peer of a C-like for, which Python says as a while."""
    total, i = 0.0, 0.0
    while i < 100_000:
        total += i
        i += 1
    return total


class Box:
    """Has a method without arguments."""

    def method(self) -> float:
        """The peer of a method that gives a constant."""
        return 1.0


def call_method() -> None:
    """The peer of 100 000 calls."""
    box = Box()
    for _ in range(100_000):
        box.method()


class Holder:
    """Has a box."""

    def __init__(self) -> None:
        self.box = Box()

    def call(self) -> None:
        """The peer of 100 000 calls through a slot of this."""
        for _ in range(100_000):
            self.box.method()


def call_slot_method() -> None:
    """The peer of calls to an object that is itself looked up by name each time."""
    Holder().call()


def append() -> list[float]:
    """The peer of ``list << 1``."""
    made: list[float] = []
    for _ in range(100_000):
        made.append(1.0)  # one call a turn is what is measured
    return made


def concatenate() -> str:
    """The peer of ``string += "x"``."""
    made = ""
    for _ in range(10_000):
        made += "x"
    return made


C_FOR = "var s = 0; for{} (var i = 0; i < 100000; i += 1) s += i; s"
WORKS = (
    Work("recursive fibo(20)", "fibo(20)", lambda: fibo(20.0), 4,
         "function fibo(n) { if (n < 2) n else fibo(n - 1) + fibo(n - 2) }|;"),
    Work("for| (100000) {}", "for| (100000) {}", empty_loop, 3),
    Work("C-for| with a local sum, 100 000", C_FOR.format("|"), c_loop, 3),
    Work("C-for; with a local sum, 100 000", C_FOR.format(""), c_loop, 6),
    Work("method without arguments, 100 000", "var box = Box.new; for| (100000) box.method()", call_method, 5,
         "class Box { function method() { 1 } }|;"),
    Work("the same of an object that is a slot, 100 000", "for| (100000) box.method()", call_slot_method, 5,
         "class Box { function method() { 1 } }|; var box = Box.new|;"),
    Work("list << 1, 100 000", "var l = []; for| (100000) l << 1; l", append, 6),
    Work('string += "x", 10 000', 'var s = ""; for| (10000) s += "x"; s', concatenate, 6),
)  # fmt: skip


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
    """The seconds that some work takes."""
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def language(turns: int) -> None:
    """The rows that are ratios to plain Python."""
    print(COLUMNS.format("work", "urbihw", "Python", "ratio", "budget", ""))
    for work in WORKS:
        machine = Machine()
        machine.run(f"{work.before}\nfunction work() {{ {work.urbi} }}|;\nwork()|;\n")
        ours, theirs = [], []
        for _ in range(turns):
            ours.append(machine.run("work()|;\n"))
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
        ("one statement of one of 1000 jobs", 100_000, 3.0,
         "function work() { for& (1000) { for (100) 1 } }|;"),
    )  # fmt: skip
    for name, count, budget, text in rows:
        machine = Machine()
        machine.run(text + "\nwork()|;\n")
        took = statistics.median(machine.run("work()|;\n") for _ in range(turns))
        row(name, "", "", took / count * 1e6, budget, " us")
    compiling(turns)
    taken, whole = sleepers()
    row("10 000 sleeping jobs, what they add", "", "", taken, 100, " MB")
    row("10 000 sleeping jobs, the whole process", "", "", whole, 100, " MB")


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


# ---------------------------------------------------------------- the server


ECHO = """
import asyncio, sys
class Echo(asyncio.Protocol):
    def connection_made(self, transport): self.transport = transport
    def data_received(self, data): self.transport.write(data)
async def main():
    server = await asyncio.get_running_loop().create_server(Echo, "127.0.0.1", 0)
    open(sys.argv[1], "w").write(f"{server.sockets[0].getsockname()[1]}\\n")
    await server.serve_forever()
asyncio.run(main())
"""
ROOMY = """
import asyncio, sys
from urbihw.kernel import Kernel
from urbihw.kernel.server.loop import LoopDriver
from urbihw.kernel.server.tcp import Server
async def main():
    kernel = Kernel()
    server = Server(LoopDriver(kernel.scheduler), kernel.open_lobby, max_clients=2000)
    open(sys.argv[1], "w").write(f"{await server.listen('127.0.0.1', 0)}\\n")
    await asyncio.Event().wait()
asyncio.run(main())
"""
OURS = ("-m", "urbihw.cli.urbi", "--quiet", "--port", "0", "--port-file")
INSTALLED = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
"""The environment of a server: an installed one finds Python's compiled files."""


@contextlib.contextmanager
def served(*arguments: str) -> Iterator[tuple[int, socket.socket, float]]:
    """A server process told to write its port to a file: its process id, a connection, and how long that took."""
    with tempfile.TemporaryDirectory() as folder:
        port_file = Path(folder) / "port"
        began = time.perf_counter()
        command = [sys.executable, *arguments, str(port_file)]
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, env=INSTALLED)
        try:
            while not port_file.exists() or not port_file.read_text().endswith("\n"):
                if process.poll() is not None or time.perf_counter() - began > 30:
                    raise RuntimeError(f"no server: {' '.join(arguments)[:60]}")
                time.sleep(0.002)
            with socket.create_connection(("127.0.0.1", int(port_file.read_text()))) as connection:
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                connection.settimeout(30)
                yield process.pid, connection, time.perf_counter() - began
        finally:
            process.terminate()
            process.wait()


def ask(connection: socket.socket, text: bytes, lines: int, count: int) -> float:
    """The median seconds from a command to the last of its lines."""
    times = []
    for _ in range(count):
        began = time.perf_counter()
        connection.sendall(text)
        missing = lines
        while missing > 0:
            missing -= connection.recv(4096).count(b"\n")
        times.append(time.perf_counter() - began)
    return statistics.median(times)


def pipeline(connection: socket.socket, statements: list[bytes]) -> float:
    """Answers a second when statements are sent without waiting."""
    data, missing = b"".join(statements), len(statements)
    sending = threading.Thread(target=connection.sendall, args=(data,))
    began = time.perf_counter()
    sending.start()
    while missing > 0:
        missing -= connection.recv(1 << 16).count(b"\n")
    took = time.perf_counter() - began
    sending.join()
    return len(statements) / took


def crowd(port: int, clients: int) -> float:
    """The seconds until so many clients have connected, and each has got an answer."""
    began = time.perf_counter()
    with contextlib.ExitStack() as open_until_here:
        asked = []
        for _ in range(clients):
            client = open_until_here.enter_context(socket.create_connection(("127.0.0.1", port), 30))
            client.sendall(b"1;\n")
            asked.append(client)
        for client in asked:
            while not client.recv(4096).endswith(b"1\n"):
                pass
        return time.perf_counter() - began


def resident(pid: int) -> float:
    """Megabytes of memory that a process holds."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def server(turns: int, clients: int) -> None:
    """The rows over loopback."""
    print()
    print(COLUMNS.format("what", "urbihw", "bare echo", "measured", "budget", ""))
    with served(*OURS):
        pass  # fills the cache of the compiled library
    starts, sizes = [], []
    for _ in range(turns):
        with served(*OURS) as (pid, connection, took):
            ask(connection, b"1;\n", 1, 1)
            starts.append(took)
            sizes.append(resident(pid))
    row("urbi start to open port, warm cache", "", "", statistics.median(starts), 0.4, " s")
    row("resident after the first statement", "", "", statistics.median(sizes), 60, " MB")
    with served(*OURS) as (_, ours, _), served("-c", ECHO) as (_, echo, _):
        for name, text, lines, budget in (
            ("command to a one-line answer, median", b"1;\n", 1, 0.15),
            ("command to a two-line answer, median", b"1;2;\n", 2, 0.2),
        ):
            reply = b"[00000000] 1\n" * lines
            ask(ours, text, lines, 200)
            pairs = [(ask(ours, text, lines, 300), ask(echo, reply, lines, 300)) for _ in range(11)]
            mine, bare = (statistics.median(times) for times in zip(*pairs, strict=True))
            row(name, f"{mine * 1e3:.3f} ms", f"{bare * 1e3:.3f} ms", mine * 1e3, budget, " ms")
        same = statistics.median(pipeline(ours, [b"1;\n"] * 20_000) for _ in range(3))
        number = iter(range(1, 10**9))
        fresh = statistics.median(pipeline(ours, [b"%d;\n" % next(number) for _ in range(5000)]) for _ in range(3))
        news = [ask(ours, b"%d;\n" % next(number), 1, 1) for _ in range(2000)]
        row("new text to a one-line answer, median", "", "", statistics.median(news) * 1e3, 0.1, " ms")
    with served("-c", ROOMY) as (_, connection, _):
        took = crowd(connection.getpeername()[1], clients)
        row(f"{clients} clients connect and are answered", "", "", took, 1.5, " s")
    for name, rate, least in (("the same text", same, 15_000), ("all different", fresh, 5_000)):
        verdict = "" if rate >= least else "UNDER"
        print(COLUMNS.format(f"pipelined 1; a second, {name}", "", "", f"{rate:.0f}", f"{least}", verdict))


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
