"""The server of ``bench.kernel_bench``: in a process of its own, over loopback, beside a bare asyncio echo.

What a line costs is the processor time of the server, as the operating system counts it: it holds on a loaded machine.
"""

from __future__ import annotations

import contextlib
import os
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from bench.rows import COLUMNS, row

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
TOY = """
import asyncio, sys
from urbihw.kernel import Kernel
from urbihw.kernel.server.loop import LoopDriver
from urbihw.kernel.server.tcp import Server
from urbihw.kernel.uobject import owned
from urbihw.kernel.uobject.effector import EffectorDevice
from urbihw.kernel.uobject.motion import Motion
class ToyMotor(EffectorDevice):
    val = owned(0.0)
    def init(self, motion):
        self.guard(motion, 6, self.val)
async def main():
    kernel = Kernel()
    kernel.programs.quiet = True
    kernel.host.create(ToyMotor, "motor6", Motion(kernel.host, "toy", lambda devices, reason: None))
    server = Server(LoopDriver(kernel.scheduler), kernel.open_lobby)
    open(sys.argv[1], "w").write(f"{await server.listen('127.0.0.1', 0)}\\n")
    await asyncio.Event().wait()
asyncio.run(main())
"""
OURS = ("-m", "urbihw.cli.urbi", "--quiet", "--port", "0", "--port-file")
INSTALLED = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
"""The environment of a server: an installed one finds Python's compiled files."""


@contextlib.contextmanager
def served(
    *arguments: str, begun: Callable[[int], object] = lambda pid: None
) -> Iterator[tuple[int, socket.socket, float]]:
    """A server process told to write its port to a file: its process id, a connection, and how long that took.

    ``begun`` is called with its process id at once.
    """
    with tempfile.TemporaryDirectory() as folder:
        port_file = Path(folder) / "port"
        began = time.perf_counter()
        command = [sys.executable, *arguments, str(port_file)]
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, env=INSTALLED)
        begun(process.pid)
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


def processor(pid: int) -> float:
    """Seconds of processor time that all threads of a process have had, to the nanosecond."""
    threads = Path(f"/proc/{pid}/task").glob("*/schedstat")
    return sum(int(thread.read_text().split()[0]) for thread in threads) / 1e9


def cost(pid: int, connection: socket.socket, lines: list[bytes]) -> float:
    """The server's seconds for each of some lines without an answer, sent one after the other."""
    began = processor(pid)
    for line in lines[:-1]:
        connection.sendall(line)
        time.sleep(0)
    connection.sendall(lines[-1] + b"1;\n")
    while not connection.recv(4096).endswith(b"1\n"):
        pass
    return (processor(pid) - began) / len(lines)


def written_lines(count: int, turns: int) -> None:
    """What a line costs the server: ratios of its processor time."""
    number = iter(range(1, 10**9))
    with served("-c", TOY) as (pid, connection, _):
        connection.sendall(b"var q = 1|; var x = 2|;\n")
        rounds = []
        for _ in range(turns + 1):  # the first one makes the templates
            plain = cost(pid, connection, [b"q = x|;\n"] * count)
            written = cost(pid, connection, [b"motor6.val = 0.%d|;\n" % next(number) for _ in range(count)])
            rounds.append((written, plain))
        written, plain = (statistics.median(each) for each in zip(*rounds[1:], strict=True))
        name = "a guarded write with a new literal, beside q = x"
        row(name, f"{written * 1e6:.0f} us", f"{plain * 1e6:.0f} us", written / plain, 2.5)


def typed_lines(count: int, turns: int) -> None:
    """What a line costs that is typed, and answered before the next one, beside an echo of the answer."""
    with served(*OURS) as (mine, ours, _), served("-c", ECHO) as (peer, echo, _):
        rounds = []
        for _ in range(turns + 1):
            pair = []
            for pid, connection, text in ((mine, ours, b"1;\n"), (peer, echo, b"[00000000] 1\n")):
                began = processor(pid)
                ask(connection, text, 1, count)
                pair.append((processor(pid) - began) / count)
            rounds.append(pair)
        typed, bare = (statistics.median(each) for each in zip(*rounds[1:], strict=True))
        row("a typed line, beside an echo", f"{typed * 1e6:.0f} us", f"{bare * 1e6:.0f} us", typed / bare, 2)


def shaped_lines(count: int, turns: int) -> None:
    """What a line costs the server whose shape it has not met."""
    number = iter(range(1, 10**9))
    with served(*OURS) as (pid, connection, _):
        costs = []
        for _ in range(turns + 1):
            shapes = [next(number) for _ in range(count)]
            costs.append(cost(pid, connection, [b"var v%d = [%d, nil.isNil].size|;\n" % (n, n) for n in shapes]))
        row("a typed line of a new shape", "", "", statistics.median(costs[1:]) * 1e3, 0.6, " ms")


def beside_loops(seconds: int) -> None:
    """How long an answer takes beside 1000 loops, and how many of their turns they get."""
    with served(*OURS) as (_, connection, _):
        connection.sendall(b"var n = 0|; for& (1000) { every (100ms) n += 1 },\n")
        time.sleep(1)
        connection.sendall(b"n = 0|; var from = System.time|;\n")
        asked, begun = [], time.perf_counter()
        while time.perf_counter() - begun < seconds:
            asked.append(ask(connection, b"1;\n", 1, 1))
            time.sleep(0.01)
        connection.sendall(b"n / (System.time - from);\n")
        turns = float(connection.recv(4096).split()[-1])
    asked.sort()
    slow = asked[len(asked) * 99 // 100]
    row("an answer beside 1000 loops every(100ms), 99 %", "", "", slow * 1e3, 20, " ms")
    verdict = "" if turns >= 9900 else "UNDER"
    print(COLUMNS.format("turns of these loops a second", "", "", f"{turns:.0f}", "9900", verdict))


def server(turns: int, clients: int) -> None:
    """The rows over loopback."""
    print()
    print(COLUMNS.format("what", "urbihw", "bare echo", "measured", "budget", ""))
    with served(*OURS):
        pass  # fills the cache of the compiled library
    written_lines(1500 if turns > 1 else 50, turns)
    typed_lines(1500 if turns > 1 else 50, turns)
    shaped_lines(300 if turns > 1 else 20, turns)
    beside_loops(turns)
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
