"""Real daemons before simulated robots, what may befall them, and what becomes of the body.

For ``test_faults`` and ``bench/safety.py``; the robots are in ``moving_robots``.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import re
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import starts
from moving_robots import Look, Rig

from urbihw_fakes.serving import Endpoint

ROOT = Path(__file__).resolve().parents[1]
TIMEOUT_S = 60.0
PERIOD = 0.004
"""Seconds between two looks at the body."""
SPAN = 0.2
"""Seconds over which the speed of a movement is looked at that goes on."""
STILL = 3.0
"""Seconds for which a body must stand."""
LIMIT = 10.0
"""Seconds after an event, and after the time that it takes, after which nothing will stand any more."""

class Sample(NamedTuple):
    """The body at a moment."""

    time: float
    speed: float


@dataclass
class Outcome:
    """What an event did: times in seconds after it; ``peaks`` are the greatest speeds before it and after its end."""

    standstill: float = math.inf
    moved: float = 0.0
    stays: bool = False
    reads: str = ""
    peaks: tuple[float, float] = (0.0, 0.0)


# ---------------------------------------------------------------- the processes


class Client:
    """A connection that remembers what it reads."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), TIMEOUT_S)
        self._pieces: list[str] = []
        self.ended = False
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    @property
    def heard(self) -> str:
        """All that was read since ``forget_heard``."""
        return "".join(self._pieces)

    def forget_heard(self) -> None:
        """Begin anew with what is read."""
        self._pieces.clear()

    def say(self, text: str) -> None:
        """Send a line."""
        self._socket.sendall(text.encode() + b"\n")

    def wait(self, text: str) -> None:
        """Until something was read."""
        wait_for(lambda: text in self.heard, f"{text!r}, but: {self.heard}")

    def errors(self) -> list[str]:
        """The errors read so far, without time stamps and places."""
        return [re.sub(r"^[\w.]*:?\d+\.[\d.-]+: ", "", line) for line in re.findall(r"!!! (.*)", self.heard)]

    def close(self) -> None:
        """Hang up."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._thread.join(TIMEOUT_S)
        self._socket.close()

    def _listen(self) -> None:
        with contextlib.suppress(OSError):
            self._socket.settimeout(None)
            while data := self._socket.recv(65536):
                self._pieces.append(data.decode("latin-1"))
        self.ended = True


_LINK_IS_UP = "urbihw: link to "
_ROUGH = "import socket,sys,time;s=socket.create_connection(('127.0.0.1',int(sys.argv[1])));"
_ROUGH += "s.sendall(sys.argv[2].encode()+b'\\n');time.sleep(600)"


class Daemon:
    """``urbihw serve`` in a process of its own."""

    def __init__(self, folder: Path, platform: str, url: str, settings: str = "") -> None:
        """``settings`` are further lines of the settings file."""
        self.control = folder / "control"
        config, port_file = folder / "config.toml", folder / "port"
        config.write_text(f'control = "{self.control}"\n{settings}')
        self._log = (folder / "log").open("w+")
        command = (sys.executable, "-m", "urbihw.cli.main", "serve", "--platform", platform, "--url", url, "--quiet")
        self.process = starts.Forked(
            (*command, "--port", "0", "--port-file", str(port_file), "--config", str(config)),
            cwd=ROOT, stdin=subprocess.DEVNULL, stderr=self._log,
        )  # fmt: skip
        self.workers: list[int] = []
        try:
            wait_for(lambda: port_file.exists() and port_file.read_text().endswith("\n"), "a port")
        except BaseException as error:
            error.add_note(f"the log of the daemon: {self.log()}")
            self.close()
            raise
        self.port = int(port_file.read_text())
        self.workers = [self.worker()]

    def log(self) -> str:
        """What it has logged."""
        self._log.seek(0)
        return self._log.read()

    def rough_client(self, text: str) -> subprocess.Popen[bytes]:
        """A client in a process of its own, to be killed."""
        return subprocess.Popen((sys.executable, "-c", _ROUGH, str(self.port), text), stdin=subprocess.DEVNULL)

    def order(self, **words: str) -> str:
        """Tell the control socket something; its answer."""
        with socket.socket(socket.AF_UNIX) as line:
            line.settimeout(TIMEOUT_S)
            line.connect(str(self.control))
            line.sendall(json.dumps(words).encode() + b"\n")
            return line.recv(4096).decode()

    def worker(self) -> int:
        """The process that owns the wire now: it listens at the control socket."""
        with socket.socket(socket.AF_UNIX) as line:
            line.settimeout(TIMEOUT_S)
            line.connect(str(self.control))
            raw = line.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i"))
        return int(struct.unpack("3i", raw)[0])

    def replace_worker(self) -> None:
        """Kill the worker, and wait until another one has reached the robot."""
        old = self.worker()
        os.kill(old, signal.SIGKILL)

        def replaced() -> bool:
            with contextlib.suppress(OSError, ValueError):
                return self.worker() != old and json.loads(self.order(do="state"))["link"]
            return False

        wait_for(replaced, "another worker")
        self.workers = [self.worker(), *self.workers]

    def close(self) -> None:
        """End it, whatever state it is in."""
        workers = {*self.workers, *self.children()}
        for pid in (self.process.pid, *workers):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self.process.wait(TIMEOUT_S)
        self._log.close()

    def children(self) -> list[int]:
        """The workers of the daemon, and the spare one."""
        found = []
        for task in Path(f"/proc/{self.process.pid}/task").glob("*/children"):  # each thread has its own
            with contextlib.suppress(OSError):
                for child in task.read_text("ascii").split():
                    if b"urbihw.buses." in Path(f"/proc/{child}/cmdline").read_bytes():
                        found.append(int(child))
        return found


def wait_for(done: Callable[[], object], what: str) -> None:
    """Until something holds.  Raises TimeoutError."""
    end = time.monotonic() + TIMEOUT_S
    while not done():
        if time.monotonic() > end:
            raise TimeoutError(f"waited for {what}")
        time.sleep(0.01)


class Watcher:
    """Looks at the body every few milliseconds, in a thread."""

    def __init__(self, end: Endpoint, look: Look) -> None:
        self.samples: list[Sample] = []
        self._end, self._look = end, look
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def _watch(self) -> None:
        while not self._over.wait(PERIOD):
            speed = self._end.call(self._look)
            self.samples.append(Sample(time.monotonic(), speed))

    def speed(self) -> float:
        """As last seen."""
        return self.samples[-1].speed if self.samples else 0.0

    def peak(self, since: float, until: float = math.inf) -> float:
        """The greatest speed in some time, each time over ``SPAN``: a busy machine lets movements halt and hurry."""
        seen = [one for one in self.samples if since <= one.time <= until]
        ways = [0.0]
        for one, other in zip(seen, seen[1:], strict=False):
            ways.append(ways[-1] + one.speed * (other.time - one.time))
        peak, first = 0.0, 0
        for last in range(len(seen)):
            while seen[last].time - seen[first].time > SPAN:
                first += 1
            peak = max(peak, (ways[last] - ways[first]) / SPAN)
        return peak

    def last_moved(self, rest: float) -> float:
        """When the body was last seen moving."""
        return next((one.time for one in reversed(self.samples) if one.speed > rest), 0.0)

    def way(self, since: float) -> float:
        """How far it has moved since."""
        seen = [one for one in self.samples if one.time >= since]
        return sum(a.speed * (b.time - a.time) for a, b in zip(seen, seen[1:], strict=False))

    def close(self) -> None:
        """Look no more."""
        self._over.set()
        self._thread.join(TIMEOUT_S)


# ---------------------------------------------------------------- one case


@dataclass
class Case:
    """A robot that moves, just before something happens."""

    rig: Rig
    end: Endpoint
    watcher: Watcher
    daemon: Daemon
    client: Client
    rough: subprocess.Popen[bytes] | None = None
    began: float = field(default_factory=time.monotonic)

    def prepare(self) -> None:
        """Let the robot be ready to move."""
        if self.rig.prepare:
            self.client.say(self.rig.prepare)
            self.client.say(f'waituntil({self.rig.until}); echo("ready");')
            self.client.wait("ready")
            self.client.forget_heard()

    def signal_worker(self, number: signal.Signals) -> None:
        """Send something to the owner of the wire, if it is still there: one that was held is killed as hung."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.daemon.workers[0], number)

    def go(self, rough: bool, other: bool = False) -> None:
        """Set it moving, by a client that can be killed if that is wanted, or by another master."""
        if other:
            push, device = self.rig.other, self.end.device
            assert push is not None
            self.end.call(lambda: push(device))
        elif rough:
            self.rough = self.daemon.rough_client(self.rig.go)
        else:
            self.client.say(self.rig.go)
        wait_for(lambda: self.watcher.speed() > self.rig.moving, f"motion, but: {self.client.heard}")
        self.began = time.monotonic()
        time.sleep(2.2 if self.rig.live else 1.2)


@contextlib.contextmanager
def case_of(rig: Rig) -> Iterator[Case]:
    """A robot that is ready to move."""
    with tempfile.TemporaryDirectory(prefix="safety-") as name, contextlib.ExitStack() as stack:
        end, look = rig.make()
        stack.enter_context(end)
        end.start()
        daemon = Daemon(Path(name), rig.platform, end.url)
        stack.callback(daemon.close)
        client = Client(daemon.port)
        stack.callback(client.close)
        watcher = Watcher(end, look)
        stack.callback(watcher.close)
        case = Case(rig, end, watcher, daemon, client)
        case.prepare()
        yield case


def run(rig: Rig, event: Event) -> Outcome:
    """Let something happen to a robot that moves."""
    with case_of(rig) as case:
        event.before(case)
        case.go(event.kills_client, event.by_other)
        watcher = case.watcher
        begin = time.monotonic()
        event.do(case)
        end = time.monotonic()
        while time.monotonic() < end + LIMIT + STILL:
            quiet = max(watcher.last_moved(rig.rest), end)
            if time.monotonic() > quiet + STILL or time.monotonic() > end + LIMIT and quiet > end + LIMIT - STILL:
                break
            time.sleep(0.02)
        moved = watcher.last_moved(rig.rest)
        outcome = Outcome(max(0.0, moved - begin), watcher.way(begin))
        outcome.stays = time.monotonic() - max(moved, end) >= STILL - 0.1
        if not outcome.stays:
            outcome.standstill = math.inf
        outcome.peaks = watcher.peak(case.began, begin), watcher.peak(end)
        outcome.reads = "; ".join(case.client.errors()) or ("connection closed" if case.client.ended else "")
        if case.rough is not None:
            case.rough.wait(TIMEOUT_S)
        return outcome


@dataclass(frozen=True)
class Event:
    """What may happen: ``do`` comes back when it is over; ``before`` is done to the robot that stands.

    ``by_other``: another master than the daemon has set the robot moving.
    """

    name: str
    do: Callable[[Case], None]
    kills_client: bool = False
    before: Callable[[Case], None] = lambda case: None
    by_other: bool = False

    def concerns(self, rig: Rig) -> bool:
        """Whether it may happen to a robot."""
        return rig.other is not None or not self.by_other


def _kill_client(case: Case) -> None:
    assert case.rough is not None
    case.rough.kill()


def _kill_worker(case: Case) -> None:
    case.signal_worker(signal.SIGKILL)


def _lose_a_worker(case: Case) -> None:
    case.daemon.replace_worker()
    time.sleep(1.0)
    case.prepare()


def _hold_worker(case: Case) -> None:
    case.signal_worker(signal.SIGSTOP)
    time.sleep(5)
    case.signal_worker(signal.SIGCONT)


def _hold_worker_and_spare(case: Case) -> None:
    """What is stopped stays so; another worker is started."""
    for worker in case.daemon.children():
        os.kill(worker, signal.SIGSTOP)


def _hold_daemon(case: Case) -> None:
    case.daemon.process.send_signal(signal.SIGSTOP)
    time.sleep(3)
    case.daemon.process.send_signal(signal.SIGCONT)


def _kill_both(case: Case) -> None:
    case.daemon.process.kill()
    case.signal_worker(signal.SIGKILL)


def _term_beside_loop(case: Case) -> None:
    other = Client(case.daemon.port)
    other.say("loop|{},")
    time.sleep(0.1)
    case.daemon.process.terminate()
    other.close()


def _stop(case: Case) -> None:
    other = Client(case.daemon.port)
    other.say("robot.stop;")
    time.sleep(0.05)
    other.close()


def _pull(case: Case) -> None:
    before = case.daemon.log().count(_LINK_IS_UP)
    case.end.unplug()
    time.sleep(3)
    case.end.plug()
    wait_for(lambda: case.daemon.log().count(_LINK_IS_UP) > before, f"the link: {case.daemon.log()}")


def _estop(case: Case) -> None:
    case.daemon.order(do="estop", who="test")


EVENTS = (
    Event("`robot.stop` by another client", _stop),
    Event("emergency stop by the control socket", _estop),
    Event("motion begun by another master, `robot.stop`", _stop, by_other=True),
    Event("motion begun by another master, emergency stop", _estop, by_other=True),
    Event("client killed", _kill_client, kills_client=True),
    Event("worker killed", _kill_worker),
    Event("two deaths of the worker within 10 s", _kill_worker, before=_lose_a_worker),
    Event("worker held for 5 s", _hold_worker),
    Event("worker and its spare held", _hold_worker_and_spare),
    Event("daemon killed", lambda case: case.daemon.process.kill()),
    Event("daemon and worker killed", _kill_both),
    Event("daemon held for 3 s", _hold_daemon),
    Event("SIGTERM", lambda case: case.daemon.process.terminate()),
    Event("SIGTERM beside `loop\\|{},`", _term_beside_loop),
    Event("adapter pulled for 3 s", _pull),
)
