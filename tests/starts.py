"""Starts programs of urbihw for tests in real time as forks of one process that has imported them.

Hundreds of tests start ``python -m urbihw...``, which imports modules for 0.1 to 0.2 s of processor time.  So the
process that runs tests has a *template*: a process that has imported the programs, has one thread, and waits.  For
each start it forks a child, which takes the arguments, the environment, the folder, standard input and outputs, and
the session of the start, and runs the module as ``python -m`` does.

What differs from a real start: the parent is the template, and ``/proc/PID/cmdline`` has its command line.  Tests that
judge the start itself, signals during it, descriptors or memory use ``subprocess``.
"""

from __future__ import annotations

import array
import contextlib
import gc
import importlib
import os
import pickle
import runpy
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple, NoReturn

MODULES: Final = (
    "urbihw.cli.serve", "urbihw.cli.urbi", "urbihw.cli.console", "urbihw.cli.panel", "urbihw.cli.control",
    "urbihw.cli.launch", "urbihw.cli.send", "urbihw.cli.status", "urbihw.cli.health", "urbihw.web.gateway",
    "urbihw_fakes.__main__",
)  # fmt: skip
"""What the template imports, besides the robots."""
ROBOTS: Final = ("bioloid", "nxt", "p3dx", "segway", "so101", "spykee", "nao", "cia402")
MOST_BYTES: Final = 1 << 20
"""Size of a request, in bytes."""
UNBUFFERED: Final = "PYTHONUNBUFFERED"
"""The only variable for the interpreter that a child follows; the others are those of the template."""


class _Start(NamedTuple):
    """A request to the template; its descriptors for standard input, output and errors go with it."""

    module: str
    arguments: Sequence[str]
    environment: Mapping[str, str]
    folder: str
    new_session: bool


class Forked(subprocess.Popen[Any]):
    """A ``Popen`` of ``(sys.executable, "-m", "urbihw...", ...)`` that forks the template.

    It takes the standard streams, ``cwd``, ``env``, ``text`` and ``start_new_session``.
    """

    def _execute_child(
        self, args: Sequence[str], executable: object, preexec_fn: object, close_fds: bool, pass_fds: Sequence[int],
        cwd: object, env: Mapping[str, str] | None, startupinfo: object, creationflags: object, shell: bool,
        p2cread: int, p2cwrite: int, c2pread: int, c2pwrite: int, errread: int, errwrite: int, *others: Any,
    ) -> None:  # fmt: skip
        if not can_fork(args) or preexec_fn or pass_fds or shell or executable:
            raise ValueError(f"this start wants subprocess.Popen: {args}")
        # Behind `errwrite`: restore_signals, gid, gids, uid, umask, start_new_session, process_group.
        start = _Start(
            str(args[2]), [str(each) for each in args[3:]], dict(os.environ if env is None else env),
            os.fspath(cwd) if cwd is not None else os.getcwd(), others[5],  # type: ignore[call-overload]
        )  # fmt: skip
        streams = [own if given == -1 else given for own, given in enumerate((p2cread, c2pwrite, errwrite))]
        self.pid = _template().ask(start, streams)
        self._child_created = True
        self._close_pipe_fds(p2cread, p2cwrite, c2pread, c2pwrite, errread, errwrite)  # type: ignore[attr-defined]

    def _internal_poll(self, _deadstate: int | None = None, **_of_popen: Any) -> int | None:
        if _deadstate is None and self.returncode is None and (status := _template().ask(self.pid)) is not None:
            self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode

    def _try_wait(self, flags: int) -> tuple[int, int]:
        if not flags:
            with contextlib.closing(_Handle(self.pid)) as handle:
                handle.wait()
        status = _template().ask(self.pid)
        return (0, 0) if status is None else (self.pid, status)


class _Handle:
    """The end of a process that is not a child."""

    def __init__(self, pid: int) -> None:
        self._descriptor = os.pidfd_open(pid)

    def wait(self) -> None:
        select.select([self._descriptor], [], [])

    def close(self) -> None:
        os.close(self._descriptor)


def can_fork(words: Sequence[str]) -> bool:
    """Whether the template can run a command."""
    return len(words) > 2 and words[0] == sys.executable and words[1] == "-m" and words[2].startswith("urbihw")


def run(
    words: Sequence[str], *, input: Any = None, timeout: float | None = None, check: bool = False,
    capture_output: bool = False, **options: Any,
) -> subprocess.CompletedProcess[Any]:  # fmt: skip
    """``subprocess.run`` by a fork."""
    if input is not None:
        options["stdin"] = subprocess.PIPE
    if capture_output:
        options["stdout"] = options["stderr"] = subprocess.PIPE
    with Forked(words, **options) as process:
        try:
            out, errors = process.communicate(input, timeout)
        except BaseException:
            process.kill()
            raise
    done = subprocess.CompletedProcess(process.args, process.returncode, out, errors)
    if check:
        done.check_returncode()
    return done


# ------------------------------------------------------------------ the process that runs tests


class _Line:
    """The template of this process, and the socket to it."""

    def __init__(self) -> None:
        self._end, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            number = theirs.fileno()
            # It leaves its parent, since some tests count the children of this process; it ends with the socket.
            subprocess.run((sys.executable, __file__, str(number)), pass_fds=[number], check=True)
        self._lock = threading.Lock()

    def ask(self, request: _Start | int, streams: Sequence[int] = ()) -> Any:
        """A start gives the process id, the id of a process its status or None."""
        with self._lock:
            data = pickle.dumps(tuple(request) if isinstance(request, _Start) else request)
            rights = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array("i", streams))] if streams else []
            self._end.sendmsg([data], rights)
            answer = self._end.recv(MOST_BYTES)
        if not answer:
            raise RuntimeError("the template has ended: see its errors above")
        return pickle.loads(answer)


_LINES: Final[list[_Line]] = []


def _template() -> _Line:
    if not _LINES:
        _LINES.append(_Line())
    return _LINES[0]


# ------------------------------------------------------------------ the template


def _import_programs() -> None:
    for module in MODULES:
        importlib.import_module(module)
    from urbihw.platforms import find, load

    for robot in ROBOTS:
        load(find(robot))
    threads = os.listdir("/proc/self/task")
    if len(threads) > 1:
        raise RuntimeError(f"a module of the template has started a thread, and forks lose it: {len(threads)}")


def _serve(line: socket.socket) -> _Start:
    """Fork for each request; returns the request, in the child."""
    while True:
        data, rights, _, _ = line.recvmsg(MOST_BYTES, socket.CMSG_SPACE(3 * 4))
        if not data:
            os._exit(0)
        request = pickle.loads(data)
        if isinstance(request, int):
            ended, status = os.waitpid(request, os.WNOHANG)
            line.send(pickle.dumps(status if ended else None))
            continue
        streams = array.array("i")
        streams.frombytes(rights[0][2])
        child = os.fork()
        if not child:
            _become(request := _Start(*request), streams)
            return request
        line.send(pickle.dumps(child))
        for descriptor in streams:
            os.close(descriptor)


def _become(start: _Start, streams: Sequence[int]) -> None:
    """Turn a fork into what the interpreter is when it begins a program."""
    for number, descriptor in enumerate(streams):
        os.dup2(descriptor, number)
    os.closerange(3, max(map(int, os.listdir("/proc/self/fd"))) + 1)
    if start.new_session:
        os.setsid()
    os.chdir(start.folder)
    os.environ.clear()
    os.environ.update(start.environment)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    direct = UNBUFFERED in os.environ
    streams_of_python = {
        "stdin": open(0, closefd=False),  # noqa: SIM115
        "stdout": open(1, "w", buffering=1 if os.isatty(1) else -1, closefd=False),  # noqa: SIM115
        "stderr": open(2, "w", buffering=1, errors="backslashreplace", closefd=False),  # noqa: SIM115
    }
    for name, stream in streams_of_python.items():
        stream.reconfigure(write_through=direct)
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)
    sys.argv = [start.module, *start.arguments]
    sys.path[0] = start.folder


def _main() -> NoReturn:
    line = socket.socket(fileno=int(sys.argv[1]))
    if os.fork():
        os._exit(0)
    _import_programs()
    gc.collect()
    start = _serve(line)
    line.detach()
    sys.modules.pop(start.module, None)  # as in a process that has not imported it
    runpy.run_module(start.module, run_name="__main__", alter_sys=True)
    sys.exit(0)


if __name__ == "__main__":
    _main()
