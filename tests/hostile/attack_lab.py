"""Plays a row of the hostile list: a fresh server before a simulated robot, a neighbour, an attacker, and a look at
what becomes of them.

Server, neighbour and attacker are processes of their own; the robot is in this one, so that its body can be looked at.
"""

from __future__ import annotations

import contextlib
import json
import re
import resource
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from attacks import BEGINS, Attack
from innocent_client import Seen

HERE = Path(__file__).parent
sys.path.append(str(HERE.parent / "e2e"))

from faults_lab import Client, Daemon  # noqa: E402
from moving_robots import RIGS  # noqa: E402

ENDS = 20.0
"""Seconds after which a server that was told to end is killed."""
TELLS = 60.0
"""Seconds for which the neighbour may wait for answers, and tell what it saw."""
ANSWERS = 60.0
"""Seconds for which a new connection waits for an answer."""
STILL = 3.0
"""Seconds within which a body must stand when its server is gone."""
MOST_LOST = 25
"""Questions that may stay without an answer when the server ends: those of a quarter of a second."""
BEFORE = 0.3
"""Seconds for which the neighbour asks before anybody attacks."""

CHECKS: tuple[tuple[str, str], ...] = (
    ("1 + 1;", "2"),
    ('"a" + "b";', '"ab"'),
    ("[1, 2, 3].size;", "3"),
    ('["k" => 7]["k"];', "7"),
    ('echo("x");', r"\*\*\* x"),
    ("Object.new.isA(Object);", "true"),
    ("lobby.isA(Lobby);", "true"),
    ("{ var s = 0; for (var i : [1, 2, 3]) s += i; s };", "6"),
    ("function twice(x) { 2 * x }|; twice(21);", "42"),
    ("try { throw 1 } catch (var e) { e + 1 };", "2"),
    ("{ var e = Event.new; var n = 0; at (e?) n += 1; e!; sleep(20ms); n };", "1"),
    ("{ var n = 0; at (n > 1) n = 7; n = 2; sleep(20ms); n };", "7"),
    ("{ var t = Tag.new; t: sleep(1h), t.stop; 3 };", "3"),
    ("sleep(10ms) | 4;", "4"),
    ("timeout (10ms) sleep(1h) | 5;", "5"),
    ("1 + ;", r"!!! .*syntax error.*"),
    ("nonsense;", r"!!! .*lookup failed.*"),
    ('System.hasSlot("shutdown");', "true"),
    ("System.jobs.size > 0;", "true"),
    ("motors.size > 0;", "true"),
    ("motor7.val.isA(Float);", "true"),
    ("robot.stop | 6;", "6"),
)
"""What must be right in a new connection: what is typed, and the line that answers, as a regular expression."""


@dataclass
class Outcome:
    """What an attack did; sizes in MB, times in seconds.

    Attributes:
        neighbour: what it saw.
        idle, peak: memory of the server before the attack, and the most of it until the end.
        whole: "yes", or what is wrong with a new connection.
        told: what that connection was told without having asked.
        moved: whether the innocent could still set its wheel turning.
        ended: how long SIGTERM took; infinite when it had to be killed.
        stands: whether the body of the robot stood in the end.
        log: lines of the log since the server was ready.
        reads: the beginning of what the attacker was told.
        pwned: something ran that must not.
        died: the server ended before it was told to.
    """

    neighbour: Seen = field(default_factory=Seen)
    idle: float = 0.0
    peak: float = 0.0
    whole: str = ""
    told: str = ""
    moved: bool = False
    ended: float = float("inf")
    stands: bool = False
    log: list[str] = field(default_factory=list)
    reads: str = ""
    pwned: bool = False
    died: bool = False

    def faults(self, attack: Attack, patience: float = ENDS) -> list[str]:
        """What is wrong, in words; times are judged by the reader, but ``patience`` for the end of the server."""
        seen = self.neighbour
        unanswered = seen.asked - seen.answered
        found = {
            "something ran that must not": self.pwned,
            "the server lives" if attack.ends else "the server died": self.died is not attack.ends,
            "the neighbour was hung up on": seen.closed and not self.died,
            f"{unanswered} of {seen.asked} questions unanswered": unanswered > (MOST_LOST if attack.ends else 0),
            f"{seen.wrong} wrong answers, such as {seen.examples}": seen.wrong > 0 and not attack.spoils,
            f"{self.peak - self.idle:.0f} MB more memory": self.peak - self.idle > attack.memory,
            f"a new connection: {self.whole}": self.whole != "yes" and not self.died,
            "the neighbour's wheel does not turn": not self.moved and not self.died,
            f"SIGTERM took {self.ended:.1f} s": self.ended > patience,
            "the robot does not stand": not self.stands,
            "a traceback or a bug of ours in the log": any(_OURS.search(line) for line in self.log),
        }
        return [words for words, wrong in found.items() if wrong]


_OURS = re.compile(r"Traceback|bug in urbihw|internal error|Exception ignored|Fatal Python error|File \".*\.py\"")


class _Process:
    """A program of this folder."""

    def __init__(self, *arguments: str) -> None:
        self.inner = subprocess.Popen(
            (sys.executable, str(HERE / arguments[0]), *arguments[1:]),
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )  # fmt: skip

    def end(self, text: bytes | None = None) -> bytes:
        """Let it end by a text, or kill it; what it wrote."""
        if text is None:
            self.inner.kill()
        try:
            return self.inner.communicate(text, TELLS)[0]
        except subprocess.TimeoutExpired:
            self.inner.kill()
            return self.inner.communicate()[0]

    def __enter__(self) -> _Process:
        return self

    def __exit__(self, *failure: object) -> None:
        if self.inner.poll() is None:
            self.end()


def _memory(pid: int, key: str) -> float:
    """``VmRSS`` or ``VmHWM`` of a process, in MB; 0 when it is gone."""
    with contextlib.suppress(OSError):
        found = re.search(rf"^{key}:\s*(\d+) kB", Path(f"/proc/{pid}/status").read_text("ascii"), re.M)
        if found is not None:
            return int(found[1]) / 1000
    return 0.0


def _answer(line: socket.socket, come: bytearray, wanted: str) -> str:
    """The line that answers; what others say to all is passed over.  Raises OSError when none comes.

    ``come`` is what was received and not looked at.
    """
    end = time.monotonic() + ANSWERS
    while time.monotonic() < end:
        one, newline, rest = come.partition(b"\n")
        if newline:
            come[:] = rest
            answer = one.decode("latin-1").partition("] ")[2]
            if re.fullmatch(wanted, answer) or not answer.startswith("***"):
                return answer
            continue
        data = line.recv(1 << 16)
        if not data:
            raise ConnectionError("the connection is closed")
        come += data
    raise TimeoutError("no line of its own")


def _whole(port: int, checks: tuple[tuple[str, str], ...] = CHECKS) -> tuple[str, str]:
    """Whether a new connection has all that it should, and what it gets before it asks."""
    try:
        line = socket.create_connection(("127.0.0.1", port), ANSWERS)
    except OSError as error:
        return f"cannot connect: {error}", ""
    with line:
        line.settimeout(0.3)
        told, come = b"", bytearray()
        with contextlib.suppress(OSError):
            told = line.recv(1 << 16)
            come += told[told.rfind(b"\n") + 1 :]
        line.settimeout(ANSWERS)
        for text, wanted in checks:
            try:
                line.sendall(text.encode() + b"\n")
                answer = _answer(line, come, wanted)
            except OSError as error:
                return f"{text} is not answered: {error}", told.decode("latin-1")
            if not re.fullmatch(wanted, answer):
                return f"{text} is {answer}", told.decode("latin-1")
    return "yes", told.decode("latin-1")


def _state(port: int) -> tuple[str, str]:
    """As ``_whole``; a library that is told to be spoilt gets the cure it names, once."""
    whole, told = _whole(port)
    if whole != "yes" and "System.resetLibrary" in told:
        _whole(port, (("System.resetLibrary | 1;", "1"),))
        again, _ = _whole(port)
        whole = again if again == "yes" else f"{whole}; after System.resetLibrary: {again}"
    return whole, told


@contextlib.contextmanager
def _robot() -> Iterator[tuple[str, Callable[[], float]]]:
    """A simulated Bioloid: its url, and how fast its wheel turns."""
    (rig,) = (rig for rig in RIGS if rig.name == "Bioloid, a wheel")
    end, look = rig.make()
    with end:
        end.start()
        yield end.url, lambda: end.call(look)


def _until(done: Callable[[], bool], seconds: float) -> bool:
    end = time.monotonic() + seconds
    while not done():
        if time.monotonic() > end:
            return False
        time.sleep(0.01)
    return True


def run(attack: Attack, seconds: float | None = None, most_owed: int = sys.maxsize) -> Outcome:
    """Play a row, the attack for so many seconds or as long as it says.

    ``most_owed``: the neighbour asks nothing while so many answers are owed.
    """
    outcome = Outcome()
    with tempfile.TemporaryDirectory(prefix="hostile-") as name, contextlib.ExitStack() as stack:
        folder = Path(name)
        url, speed = stack.enter_context(_robot())
        daemon = Daemon(folder, "bioloid", url)
        stack.callback(daemon.close)
        _play(attack, seconds or attack.seconds, most_owed, folder, daemon, speed, outcome, stack)
    return outcome


def _play(
    attack: Attack,
    seconds: float,
    most_owed: int,
    folder: Path,
    daemon: Daemon,
    speed: Callable[[], float],
    outcome: Outcome,
    stack: contextlib.ExitStack,
) -> None:
    server = daemon.process
    innocent = stack.enter_context(contextlib.closing(Client(daemon.port)))
    innocent.say("motor7.cwLimit = 0|; motor7.ccwLimit = 0|; motor7.speed = 2;")
    _until(lambda: speed() > 1, ANSWERS)
    if attack.descriptors:
        resource.prlimit(server.pid, resource.RLIMIT_NOFILE, (attack.descriptors, attack.descriptors))
    before = len((folder / "log").read_text().splitlines())
    neighbour = stack.enter_context(_Process("innocent_client.py", str(daemon.port), str(server.pid), str(most_owed)))
    time.sleep(BEFORE)
    Path(f"/proc/{server.pid}/clear_refs").write_text("5")  # the peak is counted anew
    outcome.idle = _memory(server.pid, "VmRSS")
    attacker = stack.enter_context(_Process("attacks.py", attack.name, str(daemon.port), str(folder)))
    _until((folder / BEGINS).exists, ANSWERS)
    time.sleep(seconds)
    if attack.leaves:
        outcome.reads = attacker.end().decode("latin-1")
    outcome.whole, outcome.told = _state(daemon.port)
    innocent.say("motor7.cwLimit = 0|; motor7.ccwLimit = 0|; motor7.speed = 2;")
    outcome.moved = _until(lambda: speed() > 1 or server.poll() is not None, ANSWERS) and speed() > 1
    outcome.neighbour = Seen(**json.loads(neighbour.end(b"\n") or "{}"))
    outcome.peak = _memory(server.pid, "VmHWM")
    outcome.died = server.poll() is not None
    began = time.monotonic()
    if outcome.died:
        outcome.ended = 0.0
    else:
        server.send_signal(signal.SIGTERM)
        with contextlib.suppress(subprocess.TimeoutExpired):
            server.wait(ENDS)
            outcome.ended = time.monotonic() - began
    if not attack.leaves:
        outcome.reads = attacker.end().decode("latin-1")
    outcome.stands = _until(lambda: speed() < 0.5, STILL)
    outcome.log = (folder / "log").read_text("utf-8", "replace").splitlines()[before:]
    outcome.pwned = (folder / "pwned").exists()
