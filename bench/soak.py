"""A long time of mixed work: `python -m bench.soak [--minutes 30]`; memory and descriptors must stay as they are.

Twenty clients of a daemon before a simulated Bioloid: some ask and look at each answer, some swing joints, some run
programs with events, tags, conditions and errors, some come and go, one reads much, one types nonsense.  Every ten
seconds something fails: a servo is silent, the wire is noisy, the adapter is pulled, the bus worker is killed, a client
is reset in the middle of an answer.  Each minute is a line:

    asked, late    answers of those that ask, and the slowest of them; ms
    memory, fds    of the daemon, in MB, and its open descriptors; behind the slash those of the bus worker
    jobs, lobbies  in the kernel
    log            lines so far
    faults         so far

The first third of the time is for warming up.  The exit code is 1 if memory then grew by more than 5 % and 3 MB, or
descriptors by more than 3, or if an answer was wrong.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import os
import re
import signal
import socket
import struct
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from faults_lab import Daemon

from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.endpoint import PtyEndpoint

TIMEOUT_S = 30.0
"""Seconds for which an answer is waited for."""
FAULT_EVERY = 10.0
"""Seconds between two faults."""
LASTS = 3.0
"""Seconds that a fault lasts."""
HEAD = f"{'minute':>7}{'asked':>8}{'late':>8}{'memory':>16}{'fds':>9}{'jobs / lobbies':>18}{'log':>6}{'faults':>8}"
GROWTH, LEAST_GROWTH, MORE_FILES = 1.05, 3.0, 3

PROGRAMS = (
    'var n = 0|; at (n > 3) echo("high") onleave echo("low"); for (8) n += 1; n = 0;',
    "var e = Event.new|; at (e?(var x) if x > 2) echo(x); for (var i : [1, 2, 3, 4]) e!(i);",
    "var t = Tag.new|; t: every (10ms) { 1 }, sleep(50ms); t.freeze; t.unfreeze; t.stop;",
    "function f(n) { if (n < 2) 1 else n * f(n - 1) }|; f(50);",
    "class A { var x = 1; function up() { x += 1 } }|; var a = A.new|; for (20) a.up; a.x;",
    'try { nothing } catch (var e) { e.message }; throw 1; [1].nope; "a" + 1;',
    "var l = []|; for| (var i : 500) l << i; l.map(closure (x) { x * 2 }).size; l.sort.head;",
    'var d = ["k" => 1]|; for| (var i : 200) d[i.asString] = i; d.size; d.keys.size;',
    "{ sleep(10ms); 1 } & { sleep(20ms); 2 }; timeout (20ms) sleep(1s); waituntil (true);",
    'detach({ sleep(30ms); echo("done") })|; whenever (false) 1; sleep(40ms);',
    'eval("1 + 2"); Regexp.new("(a+)b").match("aaab"); Date.now.asString.size; motors.size;',
    'function deep(n) { deep(n + 1) }|; deep(0); var s = "x" * 10000|; s.size; wall("all");',
)
"""What the clients with programs run in turn."""


class Line:
    """A connection that reads its output."""

    def __init__(self, port: int) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port), TIMEOUT_S)
        self._rest = b""

    def say(self, text: str) -> None:
        """Send a line."""
        self.socket.sendall(text.encode() + b"\n")

    def until(self, wanted: str) -> str:
        """Read lines until one ends with this; it.  Raises OSError when none comes or the server hangs up."""
        while True:
            *lines, self._rest = self._rest.split(b"\n")
            for place, line in enumerate(lines):
                if line.decode("latin-1").endswith(wanted):
                    self._rest = b"\n".join([*lines[place + 1 :], self._rest])
                    return line.decode("latin-1")
            data = self.socket.recv(1 << 16)
            if not data:
                raise ConnectionError("the server hung up")
            self._rest += data

    def close(self, reset: bool = False) -> None:
        """Hang up."""
        if reset:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.socket.close()


@dataclass
class Soak:
    """What all clients share; ``wrong`` says what went wrong with them."""

    port: int
    over: threading.Event = field(default_factory=threading.Event)
    times: list[float] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)


Work = Callable[[Soak, int], None]


def _turns(soak: Soak, pause: float, first: int = 0) -> Iterator[int]:
    """Numbers, until it is over; ``pause`` in seconds before each."""
    for turn in itertools.count(first):
        if soak.over.wait(pause):
            return
        yield turn


def _talk(soak: Soak, pause: float, says: Callable[[int], str], first: int = 0, begins: str = "") -> None:
    """Say something each turn, ``begins`` before all others, and wait until it is done."""
    line = Line(soak.port)
    if begins:
        line.say(begins)
    for turn in _turns(soak, pause, first):
        line.say(f'{says(turn)}; echo("turn {turn}");')
        line.until(f"*** turn {turn}")
    line.close()


def _ask(soak: Soak, number: int) -> None:
    line = Line(soak.port)
    for turn in _turns(soak, 0.02, number):
        began = time.monotonic()
        line.say(f'echo("{number}-{turn}-%s" % ({turn} * 2));')
        line.until(f"*** {number}-{turn}-{turn * 2}")
        soak.times.append(time.monotonic() - began)
    line.close()


def _run(soak: Soak, number: int) -> None:
    # Under a tag, else each `at` would stay, as the client wants it.
    def says(turn: int) -> str:
        return f"var all = Tag.new|; all: {{ {PROGRAMS[turn % len(PROGRAMS)]} }}; all.stop"

    _talk(soak, 0.05, says, number)


def _swing(soak: Soak, number: int) -> None:
    motor = f"motor{number % 18 + 1}"

    def says(turn: int) -> str:
        return (
            f"var swing = Tag.new|; swing: {motor}.val = 0 sin:{1 + turn % 3}s ampli:20deg,\n"
            f"swing: at ({motor}.val > 0) {{ 1 }}; sleep(4s); swing.stop; {motor}.val = 0.1 time:200ms"
        )

    _talk(soak, 0.5, says)


def _come_and_go(soak: Soak, number: int) -> None:
    for _ in _turns(soak, 0.1):
        line = Line(soak.port)
        line.say("every (10ms) { 1 }, var t = Tag.new|; { t: sleep(1h) }, at (System.ndebug) {}; 40 + 2;")
        line.until("] 42")
        line.close(reset=number % 2 == 0)


def _read(soak: Soak, number: int) -> None:
    _talk(soak, 0.2, lambda turn: 'for (20) echo("x" * 20000)')


def _nonsense(soak: Soak, number: int) -> None:
    _talk(soak, 0.1, lambda turn: '1 + ; ) { [ } ; ;;, "\\q"; 12abc; var; function;\n')


def _watch(soak: Soak, number: int) -> None:
    begins = "var seen = 0|; every (20ms) { for| (var m : motors) seen += m.val },"
    _talk(soak, 1.0, lambda turn: "sensor100.IRCenter; motor6.state; robot.link", begins=begins)


CLIENTS: tuple[Work, ...] = (
    *(_ask,) * 6, *(_run,) * 5, *(_swing,) * 3, *(_come_and_go,) * 3, _read, _nonsense, _watch,
)  # fmt: skip
"""What the twenty do."""


def _guarded(work: Work, soak: Soak, number: int) -> None:
    try:
        work(soak, number)
    except (OSError, ConnectionError) as error:
        if not soak.over.is_set():
            soak.wrong.append(f"client {number} ({work.__name__.strip('_')}): {error or 'no answer'}")


# ---------------------------------------------------------------- what fails


def _workers(pid: int) -> list[int]:
    """The bus workers of a daemon."""
    found = []
    with contextlib.suppress(OSError):
        for task in Path(f"/proc/{pid}/task").iterdir():
            for child in (task / "children").read_text("ascii").split():
                if b"urbihw.buses.child" in Path(f"/proc/{child}/cmdline").read_bytes():
                    found.append(int(child))
    return found


def _faults(daemon: Daemon, end: PtyEndpoint, kit: Bioloid, soak: Soak) -> Iterator[None]:
    """One after the other; each takes ``LASTS`` seconds."""
    while True:
        for word, who in (("silence", 6), ("noise", None), ("checksum", 3), ("cut", None)):
            end.call(lambda word=word, who=who: kit.faults.start(word, who))  # type: ignore[misc]
            soak.over.wait(LASTS)
            end.call(kit.faults.stop)
            yield
        end.unplug()
        soak.over.wait(LASTS)
        end.plug()
        yield
        for worker in _workers(daemon.process.pid):
            with contextlib.suppress(ProcessLookupError):
                os.kill(worker, signal.SIGKILL)
        yield
        line = Line(daemon.port)
        line.say('motor9.val = 0 sin:1s ampli:20deg, for (1000) echo("x" * 1000);')
        soak.over.wait(0.05)
        line.close(reset=True)
        yield


# ---------------------------------------------------------------- what is looked at


@dataclass(frozen=True)
class State:
    """Memory in MB, and open descriptors."""

    memory: float
    files: int

    @classmethod
    def of(cls, pid: int) -> State:
        """The memory and open files of a process; 0 for one that is gone."""
        with contextlib.suppress(OSError):
            found = re.search(r"^VmRSS:\s*(\d+)", Path(f"/proc/{pid}/status").read_text("ascii"), re.M)
            return cls(int(found[1]) / 1000 if found else 0.0, len(os.listdir(f"/proc/{pid}/fd")))
        return cls(0.0, 0)


def _census(port: int) -> str:
    line = Line(port)
    line.say('echo("census %s / %s" % [System.jobs.size, Lobby.instances.size]);')
    heard = line.until("").partition("census ")[2]
    line.close()
    return heard


def verdict(states: list[State]) -> list[str]:
    """What grew after the first third of the time."""
    if len(states) < 3:
        return []
    begin, end = states[len(states) // 3], states[-1]
    grown = []
    if end.memory > begin.memory * GROWTH and end.memory > begin.memory + LEAST_GROWTH:
        grown.append(f"memory grew from {begin.memory:.1f} to {end.memory:.1f} MB")
    if end.files > begin.files + MORE_FILES:
        grown.append(f"descriptors grew from {begin.files} to {end.files}")
    return grown


def main() -> int:
    """Soak, print, and judge."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--every", type=float, default=60.0, metavar="S", help="seconds of a line")
    wanted = parser.parse_args()
    kit = Bioloid(baud=1_000_000)
    states = []
    with tempfile.TemporaryDirectory(prefix="soak-") as name, contextlib.ExitStack() as stack:
        end = stack.enter_context(PtyEndpoint(kit))
        end.start()
        daemon = Daemon(Path(name), "bioloid", end.url)
        stack.callback(daemon.close)
        soak = Soak(daemon.port)
        threads = []
        for number, work in enumerate(CLIENTS):
            threads.append(threading.Thread(target=_guarded, args=(work, soak, number), daemon=True))
            threads[-1].start()
        print(HEAD)
        faults = _faults(daemon, end, kit, soak)
        began = time.monotonic()
        fault_due, count = began + FAULT_EVERY, 0
        for turn in itertools.count(1):
            while (now := time.monotonic()) < began + turn * wanted.every:
                if now >= fault_due:
                    next(faults)
                    count += 1
                    fault_due += FAULT_EVERY
                time.sleep(0.1)
            state = State.of(daemon.process.pid)
            bus = [State.of(pid) for pid in _workers(daemon.process.pid)]
            states.append(state)
            times, soak.times = soak.times, []
            memory = f"{state.memory:.1f}/{sum(one.memory for one in bus):.1f}"
            files = f"{state.files}/{sum(one.files for one in bus)}"
            late, log = 1000 * max(times, default=0), len(daemon.log().splitlines())
            print(
                f"{turn * wanted.every / 60:7.1f}{len(times):8}{late:8.0f}{memory:>16}{files:>9}"
                f"{_census(daemon.port):>18}{log:6}{count:8}",
                flush=True,
            )
            if turn * wanted.every >= wanted.minutes * 60 or daemon.process.poll() is not None:
                break
        soak.over.set()
        for thread in threads:
            thread.join(TIMEOUT_S)
        log_text = daemon.log()
    wrong = [*soak.wrong, *verdict(states)]
    if re.search(r"Traceback|bug in urbihw", log_text):
        wrong.append("a traceback or a bug of ours in the log")
    for line in wrong:
        print(f"wrong: {line}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
