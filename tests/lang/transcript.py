"""Reads a transcript and plays it in a kernel of its own, on a simulated clock.

A transcript is what a user sees at the console: lines typed, and lines answered, which begin with ``[``::

    //#timed
    //-- a comment line with two dashes opens a unit and gives its title
    echo("one"); sleep(1.5); echo("two");
    [00000000] *** one
    [00001500] *** two

- ``[:]rest`` goes on with the answer before it, on a line of its own (an answer may hold line ends); after a backslash
  at the end of that answer, on the same line.
- The units of a file share one kernel and one lobby and run in order.  A unit is fed as a whole; it is over when its
  last statement is and nothing is left to do at that instant.  What background jobs say later belongs to later units.
- The lines answered are fed as empty ones, so that the line numbers in error messages are those of the file.
- Time stamps are exact.  They are not compared in a unit all of whose stamps are zero, unless the file says
  ``//#timed``.
- ``//#needs NAME`` skips a file while Global has no slot NAME, ``//#skip-if EXPRESSION`` where it is true.

Bytes and characters are the same thing here (latin-1), as they are in the server.
"""

from __future__ import annotations

import contextlib
import difflib
import re
import signal
import tempfile
import threading
from dataclasses import dataclass
from pathlib import Path

from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.sched.signals import JobKilled
from urbihw.robot import ROBOT_LIBRARY
from urbihw.ros.script import ROS_LIBRARY

TIMEOUT_S = 3600.0
"""Simulated seconds a unit may take."""

EFFORT = 10.0
"""Seconds of processor time a unit may take at one instant: a busy loop is ended, not waited for."""

THREADS = 2.0
"""Real seconds that the work of a thread may take, such as the start of a program."""

_TITLE = re.compile(r"^(?=//-- )", re.MULTILINE)
_HEADER = re.compile(r"^//#(timed|needs|skip-if)\b[ \t]*(.*)$", re.MULTILINE)
_ANSWER = re.compile(r"^\[(?:\d{8,}(?::[^\]]*)?|:[^\]]*)\]")
_STAMP = re.compile(r"^\[(\d{8,})")


@dataclass(frozen=True)
class Unit:
    """One dialogue: ``typed`` has an empty line where ``expected`` stood; ``line`` is where it begins in the file."""

    title: str
    line: int
    text: str
    typed: str
    expected: tuple[str, ...]


@dataclass(frozen=True)
class Transcript:
    """A file: its units, whether all its stamps count, and what decides if it is run at all."""

    path: Path
    units: tuple[Unit, ...]
    timed: bool
    needs: tuple[str, ...]
    skip_if: tuple[str, ...]


@dataclass(frozen=True)
class Outcome:
    """What a unit answered; ``problem`` is empty when it is what the transcript says."""

    unit: Unit
    answered: tuple[str, ...]
    problem: str


# ---------------------------------------------------------------- reading


def read(path: Path, text: str | None = None) -> Transcript:
    """The transcript in a file, or in a text that may come to stand in that file."""
    whole = path.read_bytes().decode("latin-1") if text is None else text
    headers = [(found[1], found[2].strip()) for found in _HEADER.finditer(whole)]
    units, line = [], 1
    for part in _TITLE.split(whole):
        if part:
            units.append(_unit(part, line))
            line += part.count("\n")
    return Transcript(
        path,
        tuple(units),
        any(word == "timed" for word, _ in headers),
        tuple(rest for word, rest in headers if word == "needs"),
        tuple(rest for word, rest in headers if word == "skip-if"),
    )


def _unit(text: str, line: int) -> Unit:
    first = text.partition("\n")[0]
    title = first[5:].strip() if first.startswith("//-- ") else "(before the first title)"
    typed, expected = [], list[str]()
    for row in text.split("\n"):
        if not _ANSWER.match(row):
            typed.append(row)
            continue
        typed.append("")
        if not row.startswith("[:]"):
            expected.append(row)
        elif not expected:
            raise ValueError(f"line {line + len(typed) - 1}: [:] goes on with an answer, and there is none before it")
        elif expected[-1].endswith("\\"):
            expected[-1] = expected[-1][:-1] + row[3:]
        else:
            expected.append(row[3:])
    return Unit(title, line, text, "\n".join(typed), tuple(expected))


# ---------------------------------------------------------------- playing


class Player:
    """A kernel and a lobby for the units of one file."""

    def __init__(self, effort: float = EFFORT) -> None:
        self.effort = effort
        self.clock = SimClock()
        self.kernel = Kernel(self.clock, libraries=(ROBOT_LIBRARY, ROS_LIBRARY))
        self._posted = threading.Event()
        self.kernel.scheduler.set_wake_host(self._posted.set)

    def play(self, transcript: Transcript) -> list[Outcome]:
        """Run all units, in an empty folder; after one that does not end the others are not tried."""
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            return self._play(transcript)

    def _play(self, transcript: Transcript) -> list[Outcome]:
        lobby = self.kernel.open_lobby()
        outcomes: list[Outcome] = []
        stuck = ""
        for unit in transcript.units:
            if stuck:
                outcomes.append(Outcome(unit, (), f"not run: {stuck}"))
                continue
            ended = self.run(lobby, unit.typed)
            answered = tuple(_lines(lobby.output.take_bytes()))
            problem = compare(unit.expected, answered, transcript.timed)
            if ended:
                stuck = f'the unit in line {unit.line} ("{unit.title}") {ended}'
                problem = f"it {ended}\n{problem}".rstrip()
            outcomes.append(Outcome(unit, answered, problem))
        lobby.close()
        self.kernel.run()
        return outcomes

    def run(self, lobby: Lobby, typed: str) -> str:
        """Feed a text and let time pass until its last statement is over; what went wrong with that, or nothing."""
        idle: list[bool] = []
        limit = self.clock.now() + TIMEOUT_S
        lobby.feed(typed.encode("latin-1"))
        lobby.shell.when_idle(lambda: idle.append(True))
        while True:
            deadline, finished = self._run_instant()
            if not finished:
                return f"is busy for more than {self.effort:g} s of processor time at {self.clock.now():g} s"
            if idle:
                return ""
            if deadline is None:
                if not self._posted.wait(THREADS):
                    return "waits for ever"
                self._posted.clear()
                continue
            if deadline > limit:
                return f"takes more than {TIMEOUT_S:g} s of simulated time"
            self.clock.idle(deadline)

    def reason_to_skip(self, transcript: Transcript) -> str:
        """Why this kernel cannot run the transcript, or nothing."""
        lobby = self.kernel.open_lobby()
        for name in transcript.needs:
            if self._ask(lobby, f'Global.hasSlot("{name}");\n') != "true":
                return f"needs {name}"
        for expression in transcript.skip_if:
            if self._ask(lobby, f"{expression};\n") != "false":
                return f"skipped if {expression}"
        return ""

    def _ask(self, lobby: Lobby, question: str) -> str:
        self.run(lobby, question)
        return lobby.output.take_bytes().decode("latin-1").partition("] ")[2].strip()

    def _run_instant(self) -> tuple[float | None, bool]:
        """Run what is ready now: when to go on, and whether it came to an end by itself."""
        alarms: list[int] = []

        def alarm(number: int, frame: object) -> None:
            # A job that never yields does not see the interruption: it is ended by the second alarm.
            alarms.append(number)
            self.kernel.scheduler.interrupt()
            if len(alarms) > 1:
                raise JobKilled

        before = signal.signal(signal.SIGVTALRM, alarm)
        signal.setitimer(signal.ITIMER_VIRTUAL, self.effort, self.effort)
        try:
            return self.kernel.run(), not alarms
        finally:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0)
            signal.signal(signal.SIGVTALRM, before)


def _lines(data: bytes) -> list[str]:
    text = data.decode("latin-1")
    return text.removesuffix("\n").split("\n") if text else []


# ---------------------------------------------------------------- comparing


def stamped(lines: tuple[str, ...]) -> bool:
    """Whether any line has a time stamp that is not zero."""
    return any(found and int(found[1]) for found in map(_STAMP.match, lines))


def unstamped(line: str) -> str:
    """The line with its time stamp, if it has one, set to zero."""
    return _STAMP.sub("[00000000", line)


def compare(expected: tuple[str, ...], answered: tuple[str, ...], timed: bool) -> str:
    """The differences, as a diff; empty if there are none."""
    if not timed and not stamped(expected):
        answered = tuple(map(unstamped, answered))
    if expected == answered:
        return ""
    return "\n".join(difflib.unified_diff(expected, answered, "expected", "answered", lineterm="", n=2))


# ---------------------------------------------------------------- writing


def rewrite(transcript: Transcript, outcomes: list[Outcome]) -> str:
    """The text of the file with each unit that differs answering what it answered."""
    timed = transcript.timed or any(stamped(unit.expected) for unit in transcript.units)
    return "".join(_rewritten(outcome, timed) if outcome.problem else outcome.unit.text for outcome in outcomes)


def _rewritten(outcome: Outcome, timed: bool) -> str:
    """What was typed, then all that was answered, then the empty lines that part the unit from the next."""
    text = outcome.unit.text
    typed = [row for row in text.split("\n") if not _ANSWER.match(row)]
    body = "\n".join(typed).rstrip("\n")
    end = text[len(text.rstrip("\n")) :]
    answers = []
    for line in outcome.answered:
        if not _ANSWER.match(line) or line.startswith("[:"):
            answers.append("[:]" + line)
        else:
            answers.append(line if timed else unstamped(line))
    return "\n".join([body, *answers]) + end
