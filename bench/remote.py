"""What a program of the C++ SDK costs the server: its writes as text and as frames, and calls of its functions.

    .venv/bin/python -m bench.remote

The program is a socket that says what the SDK says (remote UObject protocol, sections 5 to 7): ten thousand writes of
one callback are one statement in text mode.  Figures are the processor time of the server's thread for each write and
call, which hold on a loaded machine; for calls also the median of the time that the caller waits.
"""

from __future__ import annotations

import argparse
import socket
import statistics
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from bench.quick import add_quick
from bench.rows import COLUMNS, row

TEXT_BUDGET_US = 1e6 / 12_000
BINARY_BUDGET_US = 1e6 / 60_000
CALL_BUDGET_US = 250.0
DECLARED = b"""class Lamp{}|
external object Lamp|
if (!isdef(Lamp.val)) var Lamp.val|
external var Lamp.val from Lamp|
external function (1) Lamp.blink from Lamp|
;
"""


class Line:
    """A connection, read by lines."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=60)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._file = self._socket.makefile("rb")

    def send(self, data: bytes) -> None:
        """Send bytes."""
        self._socket.sendall(data)

    def read(self) -> bytes:
        """The next line."""
        return self._file.readline()


@contextmanager
def server() -> Iterator[tuple[int, int]]:
    """A server; its port and the number of its process."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    code = f"from urbihw.cli.urbi import main; main(['-q', '-P', '{port}'])"
    process = subprocess.Popen([sys.executable, "-c", code])
    try:
        for _ in range(300):
            try:
                socket.create_connection(("127.0.0.1", port)).close()
                break
            except OSError:
                time.sleep(0.05)
        yield port, process.pid
    finally:
        process.terminate()
        process.wait()


def processor_us(pid: int) -> float:
    """Processor time of the main thread of a process, in microseconds."""
    return int(Path(f"/proc/{pid}/schedstat").read_text().split()[0]) / 1000


def call(user: Line, remote: Line, answer: Callable[[bytes], bytes]) -> float:
    """One call; the seconds for which the user waits.  ``answer`` makes what the remote says of the ticket."""
    began = time.perf_counter()
    user.send(b"Lamp.blink(1);")
    remote.send(answer(remote.read().split(b'"')[3]))
    said = user.read()
    assert b"!!!" not in said, said
    return time.perf_counter() - began


def as_text(count: int) -> Callable[[bytes], bytes]:
    """The answer to a call after ``count`` writes, as text."""
    writes = b"".join(b'Lamp.getSlot("val").update_timed(%d.5, 2342450%07d)|' % (n, n) for n in range(count))
    return lambda ticket: writes + b'Global.UObject.funCall("' + ticket + b'", 5),\n;\n'


def as_frames(count: int) -> Callable[[bytes], bytes]:
    """The answer to a call after ``count`` writes, as frames."""
    head = b"\x01\x00\x08Lamp.val\x02"
    writes = b"".join(head + struct.pack("<d", n + 0.5) + struct.pack(">II", n, 5) for n in range(count))
    number = struct.pack("<d", 5.0)
    return lambda ticket: writes + b"\x0a" + struct.pack(">H", len(ticket)) + ticket + b"\x02" + number


def measure(text: bool, count: int, calls: int) -> tuple[float, float, float]:
    """Processor time of a write, of a call, in microseconds; median wait of a call, in microseconds."""
    with server() as (port, pid):
        user, remote = Line(port), Line(port)
        remote.send(DECLARED + (b"" if text else b'binaryMode(1, "mode");\n'))
        if not text:
            remote.read()
            remote.send(b"\x02\x04\x08\x08")
        user.send(b'waituntil(uobjects.hasSlot("Lamp"))|; 1;')
        user.read()
        answer = as_text if text else as_frames
        call(user, remote, answer(100))
        writes = answer(count)
        best = float("inf")
        for _ in range(3):
            before = processor_us(pid)
            call(user, remote, writes)
            best = min(best, (processor_us(pid) - before) / count)
        before, plain = processor_us(pid), answer(0)
        waits = [call(user, remote, plain) for _ in range(calls)]
        return best, (processor_us(pid) - before) / calls, statistics.median(waits) * 1e6


def main() -> None:
    """Measure, and print one line each."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--writes", type=int, default=10_000, help="writes of one callback (default: %(default)s)")
    options.add_argument("--calls", type=int, default=2000, help="calls (default: %(default)s)")
    add_quick(options, writes=100, calls=20)
    wanted = options.parse_args()
    print(COLUMNS.format("what", "a second", "median", "cost", "budget", ""))
    for text, name, budget in ((True, "text", TEXT_BUDGET_US), (False, "frames", BINARY_BUDGET_US)):
        write, each, wait = measure(text, wanted.writes, wanted.calls)
        row(f"a write of a C++ remote, {name}", f"{1e6 / write:.0f}", "", write, round(budget, 1), " us")
        row(f"a call of its function, {name}", f"{1e6 / each:.0f}", f"{wait:.0f} us", each, CALL_BUDGET_US, " us")


if __name__ == "__main__":
    main()
