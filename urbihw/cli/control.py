"""The common part of ``urbihw stop``, ``urbihw estop`` and ``urbihw release``: they ask the bus workers, not the
interpreter.

Each robot has a control socket (``urbihw.buses.control``).  A stop is urgent, and imports take longer than the request:
so this module imports little more than ``socket``, and what is needed after the request only then.  The entry point of
the command calls ``run_at_once``, without a parser of options; what that does not understand goes the usual way.
"""

from __future__ import annotations

import os
import sys
import time

from urbihw.client.latch import write_latch
from urbihw.control_address import local_user
from urbihw.control_line import ANSWER_TIMEOUT_S, ControlLine, dial_control, question
from urbihw.daemon.runtime import SERVICE_FOLDER, control_socket_names, service_socket_names
from urbihw.exitcodes import EX_CONFIG, EX_UNAVAILABLE
from urbihw.started import as_typed

TYPE_CHECKING = False  # as ``typing`` has it, whose import a stop cannot wait for
if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable, Mapping, Sequence
    from typing import Any, Final, Protocol

    Path = str | os.PathLike[str]

    class Wishes(Protocol):
        """The options of all three commands: the socket of one robot, and who asks; None where not given.

        ``of`` and ``all``: whose emergency stops are released beside the own one.
        """

        socket: Path | None
        who: str | None
        of: Sequence[str]
        all: bool


OUTCOMES: Final = {"stop": "stopped", "estop": "emergency stop, held until: {release}", "release": "released"}
"""The text for a robot that has obeyed, by command."""
_READ_S: Final = 0.001
"""Seconds to read an answer that has come."""
_RIGHTS: Final = "use sudo, or join the group that it belongs to"


class Answer:
    """The answer of a robot: its ``state``, or ``problem``, in words.

    ``gone``: no process listens at the socket any more.
    """

    def __init__(self, name: str, state: Mapping[str, Any], problem: str = "", gone: bool = False) -> None:
        self.name, self.state, self.problem, self.gone = name, state, problem, gone


class Given:
    """The options that ``run_at_once`` has understood."""

    socket: Path | None = None
    who: str | None = None
    of: Sequence[str] = ()
    all: bool = False


def options(parser: argparse.ArgumentParser) -> None:
    """The options of all three commands."""
    from pathlib import Path

    parser.add_argument("--socket", type=Path, metavar="PATH", help="control socket of the robot (default: all found)")
    parser.add_argument("--who", metavar="TEXT", help="name of the requester, for the log (default: user and terminal)")
    parser.set_defaults(of=(), all=False)


def run_at_once(words: Sequence[str]) -> int | None:
    """Run a command line of one of the three commands if it is a plain one; None for one that needs a parser."""
    given = _given(words[1:])
    return None if given is None else run(words[0], given)


def _given(words: Iterable[str]) -> Given | None:
    given = Given()
    rest = iter(words)
    for word in rest:
        name, equals, value = word.partition("=")
        value = value if equals else next(rest, "")
        if name not in ("--socket", "--who") or not value or value.startswith("-"):
            return None
        setattr(given, name.removeprefix("--"), value)
    return given


def run(verb: str, options: Wishes) -> int:
    """Run a command; returns the exit code."""
    paths: Sequence[Path]
    try:
        paths = [options.socket] if options.socket is not None else control_socket_names()
    except ValueError as error:  # BadConfig; its module takes longer to import than all of this.
        paths = service_socket_names()
        if not paths:
            return complain(str(error), EX_CONFIG)
    if verb == "release" and len(paths) > 1:
        paths = [path for path in paths if _listens(path)]
        if len(paths) > 1:
            names = ", ".join(f"--socket {path}" for path in paths)
            return complain(f"which robot may move again? Give one of: {names}", EX_CONFIG)
    who = options.who or requester_name(verb)
    return report(verb, ask(paths, verb, who, options.of, options.all))


def report(verb: str, answers: Sequence[Answer]) -> int:
    """Print one line for each robot; 0 if at least one robot has answered and all that could have obeyed."""
    answers = [_still_held(answer) if verb == "release" else answer for answer in answers]
    for answer in answers:
        if not answer.problem:
            print(f"{answer.name}: {outcome(verb, answer.state)}")
    answered = any(not answer.problem for answer in answers)
    problems = [answer for answer in answers if answer.problem]
    if not answered and all(answer.gone for answer in problems):
        return complain(no_daemon_problem(verb), EX_UNAVAILABLE)
    for answer in problems:
        complain(f"{answer.name}: {answer.problem}", EX_UNAVAILABLE)
    return 0 if answered and all(answer.gone for answer in problems) else EX_UNAVAILABLE


def _still_held(answer: Answer) -> Answer:
    """A release frees the robot only if no other emergency stop holds."""
    holders = answer.state.get("estop")
    if answer.problem or not holders:
        return answer
    own = "your emergency stop is released, but that" if answer.state.get("released") else "an emergency stop"
    hint = f"who has pressed it releases it, or: {as_typed('urbihw release --all')}"
    return Answer(answer.name, answer.state, f"{own} of {holders} holds: {hint}")


def outcome(verb: str, state: Mapping[str, Any]) -> str:
    """The text for a robot, from its answer."""
    words = OUTCOMES[verb].format(release=as_typed("urbihw release"))
    if verb == "stop" and state.get("estop"):
        words += f"; an emergency stop holds ({state['estop']}) until: {as_typed('urbihw release')}"
    if verb == "estop" and state.get("unkept"):
        words += f"; {state['unkept']}"
    if verb != "release" and state.get("link") is False:
        words += "; its link is down: it will be stopped as soon as the link is back"
    return words


def no_daemon_problem(verb: str) -> str:
    """The message for the case that no daemon answers."""
    if os.path.isdir(SERVICE_FOLDER) and not os.access(SERVICE_FOLDER, os.R_OK | os.X_OK):
        return f"{SERVICE_FOLDER} may not be read: {_RIGHTS}"
    if verb == "health":
        return f"no daemon answers: start it ({as_typed('urbihw serve')})"
    if verb == "release":
        return f"no daemon answers: start it ({as_typed('urbihw serve')}), then release it"
    return (
        "no daemon answers; if the robot moves, cut its power, or: "
        f"{as_typed('urbihw stop --direct --config FILE')} "
        "(with control in its settings: --socket PATH)"
    )


def complain(text: str, code: int) -> int:
    """Print an error in one line; returns the exit code."""
    print(f"urbihw: {text}", file=sys.stderr)
    return code


def requester_name(verb: str) -> str:
    """The name of the requester: the user and terminal, or else the command."""
    import pwd

    for descriptor in range(3):
        try:
            terminal = os.ttyname(descriptor).removeprefix("/dev/")
            return f"{pwd.getpwuid(os.getuid()).pw_name}@{terminal}"
        except (OSError, KeyError):
            continue
    return f"urbihw {verb}"


def own_user() -> str:
    """Whose emergency stop it is that this process presses: of its user, also behind sudo."""
    number = os.getuid()
    before = os.environ.get("SUDO_UID", "")
    return local_user(int(before) if number == 0 and before.isdecimal() else number)


def ask(
    paths: Sequence[Path], verb: str, who: str, others: Sequence[str] = (), everyone: bool = False
) -> list[Answer]:
    """Send the command to all robots, then wait for the answers: a robot that hangs does not delay the others."""
    end = time.monotonic() + ANSWER_TIMEOUT_S
    # The worker knows who connects, but not who has called sudo.
    user = own_user()
    line = question(verb, who, user if user != local_user(os.getuid()) else "", others, everyone)
    calls = [_Query(path, line) for path in paths]
    answers = [call.answer(end) for call in calls]
    if verb == "estop":
        answers = [_latch_replacement(path, answer, who) for path, answer in zip(paths, answers, strict=True)]
    return answers


def _latch_replacement(path: Path, answer: Answer, who: str) -> Answer:
    """Set the latch of an emergency stop in its file: the worker that replaces a hanging one reads it first."""
    if not answer.problem or answer.gone or not write_latch(path, who, own_user()):
        return answer
    hint = f"whatever serves it next will hold it until: {as_typed('urbihw release')}"
    return Answer(answer.name, answer.state, f"{answer.problem}; {hint}")


class _Query:
    """A command to one robot."""

    def __init__(self, path: Path, line: bytes) -> None:
        self._path = os.fspath(path)
        self._line: ControlLine | None = None
        self._error: OSError | None = None
        try:
            self._line = ControlLine(path)
            self._line.send(line)
        except OSError as error:
            self._error = error

    def answer(self, end: float) -> Answer:
        """Wait for the answer until the time ``end``."""
        name = _name_of(self._path)
        try:
            if self._error is not None or self._line is None:
                raise self._error or OSError
            # Answers that came while another robot was waited for are still read.
            state = self._line.next_told(max(end, time.monotonic() + _READ_S))
        except (OSError, ValueError, RecursionError) as error:
            return self._failed(error)
        finally:
            if self._line is not None:
                self._line.close()
        if isinstance(state, dict) and state.get("ok"):
            return Answer(name, state)
        if isinstance(state, dict) and state.get("refused") is True:
            return Answer(name, {}, str(state.get("error")))
        return Answer(name, {}, f"it did not understand: {state}")

    def _failed(self, error: OSError | ValueError | RecursionError) -> Answer:
        name, path = _name_of(self._path), self._path
        if isinstance(error, FileNotFoundError | ConnectionRefusedError):
            hint = "if that robot moves, cut its power; if not, remove that file"
            return Answer(name, {}, f"no server listens at {path} any more: {hint}", True)
        if isinstance(error, PermissionError):
            return Answer(name, {}, f"no permission for {path}: {_RIGHTS}")
        if isinstance(error, TimeoutError | BlockingIOError):
            hint = "its bus worker hangs; cut the power, or try again"
            return Answer(name, {}, f"no answer in {ANSWER_TIMEOUT_S:g} s: {hint}")
        if isinstance(error, ConnectionError):
            return Answer(name, {}, "it ended before it answered; try again")
        if isinstance(error, OSError):
            return Answer(name, {}, f"cannot be asked at {path}: {error.strerror or error}")
        return Answer(name, {}, f"what answers at {path} is no bus worker, or one of another version")


def _listens(path: Path) -> bool:
    try:
        dial_control(path).close()
    except (FileNotFoundError, ConnectionRefusedError):
        return False
    except OSError:
        return True
    return True


def _name_of(path: str) -> str:
    return os.path.splitext(os.path.basename(path))[0]
