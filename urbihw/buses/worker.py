"""The parent's handle of a bus worker, which owns one wire. `engine` is the worker's own loop.

    def post(message: FromWorker) -> None:
        loop.call_soon_threadsafe(handle, message)           # `post` runs in a reader thread

    worker = Worker.start("/dev/ttyUSB0?baud=1000000", post=post)

    # ... post(LinkState(up=True)), post(Found(devices=(DeviceInfo(id=6, family="AX-12", mode="joint", ...), ...)))
    worker.send(Watch(6, ("present_position", "present_load"), 0.0))                   # every tick
    worker.send(Watch(6, ("present_voltage", "present_temperature"), 1.0))             # once a second

    goal = tables.table_named("AX-12").item("goal_position")
    worker.send(Targets({(6, goal.name): units.from_si(goal, 0.5)}))                   # 0.5 rad
    worker.send(Request(1, "write", 6, "torque_limit", 512))                           # ... post(Reply(1, True, 512))

    # ... post(Samples(time=81.25, values={6: {"present_position": 609, "present_load": 40}}, times={6: 81.25}))
    units.to_si(tables.table_named("AX-12").item("present_position"), 609)             # 0.4991 rad

    every(0.5, lambda: worker.send(Heartbeat()))             # after 1.5 s of silence the worker stops the robot
    worker.stop()                                            # safe stop, then the worker ends

Send `Heartbeat` from the loop that controls the robot, not from a thread of its own: when that loop dies or hangs, the
robot must stop.
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path

from urbihw.buses.driver import driver_of
from urbihw.buses.engine import Engine
from urbihw.buses.errors import BadValue, LinkGone
from urbihw.buses.link import Context, Url
from urbihw.buses.mailbox import Joiner, Mailbox
from urbihw.buses.messages import Begin, Configure, Ended, FromWorker, ToWorker, WorkerHeartbeat, WorkerState
from urbihw.buses.processor import held_up, is_stopped
from urbihw.buses.silence import CHECK_PERIOD_S, Silence

Post = Callable[[FromWorker], None]

HUNG_TIMEOUT_S = 2.0
"""Seconds of silence after which a worker process is killed; `WorkerHeartbeat` may allow more. Seconds in which it
waited for a processor do not count (`Silence`)."""
STOPPED_TIMEOUT_S = 0.4
"""The same for a worker process that was stopped by a signal."""
START_TIMEOUT_S = 10.0
"""The same until the first word of a process: on a busy machine, or a small one, it takes seconds to start."""
SPARE_TIMEOUT_S = 1.0
"""The same for a spare worker, which has only to begin."""
_SEND_TIMEOUT_S = 0.005
"""Seconds to wait for room in the pipe to a worker that does not read."""


class WorkerBusy(LinkGone):
    """The pipe to the worker is full: the worker hangs, or executes a slow request."""


class SpareWorker:
    """A worker process that has imported everything and waits to begin; `Worker.start` takes it.

    It saves the start of Python in the moment when nothing stops a moving robot, and costs the memory of a process.
    """

    def __init__(self, url: str, family: str) -> None:
        """Raises OSError when no process can be started."""
        self.process, self.pipe = _start_child("urbihw.buses.spare", url, family)

    @property
    def is_usable(self) -> bool:
        """Whether the process can begin; one that was stopped by a signal cannot."""
        return self.process.poll() is None and not is_stopped(self.process.pid)

    def close(self) -> None:
        """End the process, which has touched nothing; calling it twice is fine."""
        self.pipe.close()
        self.process.kill()
        self.process.wait()


def _start_child(module: str, url: str, family: str) -> tuple[subprocess.Popen[bytes], Connection]:
    """Start a process that waits for `Begin` at the other end of the connection. Raises OSError."""
    mine, theirs = Pipe()
    fd = theirs.fileno()
    # The child must find the same urbihw as we did, wherever it was imported from.
    root = str(Path(__file__).resolve().parents[2])
    path = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))
    process = subprocess.Popen(
        (sys.executable, "-m", module, str(fd), family, url),
        pass_fds=(fd,),
        stdin=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": path},
    )
    theirs.close()
    return process, mine


class Worker:
    """A running worker. Made by `Worker.start`; `with` stops it at the end."""

    def __init__(
        self,
        url: str,
        pipe: Connection,
        post: Post,
        join: Callable[[float], str | None],
        kill: Callable[[], None] = lambda: None,
        held_up: Callable[[], float | None] = lambda: None,
        is_stopped: Callable[[], bool] = lambda: False,
        allowance: float = START_TIMEOUT_S,
    ) -> None:
        self._url = url
        self._pipe = pipe
        self._post = post
        self._join = join
        self._kill = kill
        self._held_up = held_up
        self._is_stopped = is_stopped
        self._allowance = allowance
        """Seconds in which the worker is to be heard of again."""
        self._silent = False
        self.killed = False
        self._killed_after = 0.0
        self._lock = threading.Lock()
        self._closed = False
        self._reader = threading.Thread(target=self._read_messages, name=f"reader of {url}", daemon=True)
        self._reader.start()

    @classmethod
    def start(
        cls,
        url: str,
        *,
        post: Post,
        process: bool = True,
        settings: Configure | None = None,
        family: str = "servos",
        context: Context | None = None,
        begin: Begin | None = None,
        spare: SpareWorker | None = None,
    ) -> Worker:
        """Start a worker on the wire `url` and return at once; what it finds comes through `post`.

        `post` is called in a thread of this handle. `process`: give it a process of its own, as the daemon does;
        otherwise it runs in a thread, and only then may `context` bring a clock and pipes.
        `begin` says more than `settings` alone, and is taken instead of them.
        `spare` becomes the process, if it is usable.
        A port that cannot be opened is no error here: LinkState says why, and the worker keeps trying.
        Raises BadUrl for a url without sense, BadSetting and BadValue for settings, BadValue for an unknown family
        or a context with a process.
        """
        Url.parse(url)
        if begin is None:
            begin = Begin(settings if settings is not None else Configure())
        driver_of(family).configure(begin.settings)
        if not process:
            return cls._start_thread(url, post, begin, family, context if context is not None else Context())
        if context is not None:
            raise BadValue("a context cannot be given to a worker in a process of its own")
        return cls._start_process(url, post, begin, family, spare)

    @classmethod
    def _start_thread(cls, url: str, post: Post, begin: Begin, family: str, context: Context) -> Worker:
        mine, theirs = Pipe()
        engine = Engine(url, driver_of(family), Mailbox(theirs), begin, context)
        thread = threading.Thread(target=engine.run, name=f"bus worker of {url}", daemon=True)
        thread.start()

        def join(timeout: float) -> str | None:
            thread.join(timeout)
            return None if thread.is_alive() else ""

        return cls(url, mine, post, join)

    @classmethod
    def _start_process(cls, url: str, post: Post, begin: Begin, family: str, spare: SpareWorker | None) -> Worker:
        if spare is not None and not spare.is_usable:
            spare.close()
            spare = None
        if spare is None:
            process, mine = _start_child("urbihw.buses.child", url, family)
        else:
            process, mine = spare.process, spare.pipe
        try:
            mine.send(begin)
        except OSError:
            # The spare worker has died while it waited.
            mine.close()
            process.wait()
            return cls._start_process(url, post, begin, family, None)

        def join(timeout: float) -> str | None:
            try:
                status = process.wait(timeout)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                return f"the bus worker of {url} hung and was killed"
            return "" if status == 0 else f"the bus worker of {url} {_exit_words(status)}"

        number, allowance = process.pid, START_TIMEOUT_S if spare is None else SPARE_TIMEOUT_S
        return cls(
            url, mine, post, join, process.kill, lambda: held_up(number), lambda: is_stopped(number), allowance
        )

    @property
    def alive(self) -> bool:
        """False once `Ended` has been posted."""
        return self._reader.is_alive()

    @property
    def silent(self) -> bool:
        """True while the worker has been silent for longer than its heartbeat allows."""
        return self._silent

    def kill(self) -> None:
        """Kill the process without a safe stop."""
        self._kill()
        self._reader.join(HUNG_TIMEOUT_S)

    def send(self, message: ToWorker) -> None:
        """Send a message; safe from any thread. Raises LinkGone when the worker has ended, WorkerBusy when it
        does not read."""
        with self._lock:
            try:
                # A worker that hangs must not block the sender.
                full = not self._closed and not self._is_writable()
                if not self._closed and not full:
                    self._pipe.send(message)
                    return
            except OSError as error:
                raise LinkGone(f"the bus worker of {self._url} has ended; start another one") from error
        if full:
            raise WorkerBusy(f"the bus worker of {self._url} does not read its messages")
        raise LinkGone(f"the bus worker of {self._url} has ended; start another one")

    def _is_writable(self) -> bool:
        # Unlike `select`, `poll` takes the high numbers of descriptors of a daemon with many clients.
        poller = select.poll()
        poller.register(self._pipe, select.POLLOUT)
        return bool(poller.poll(_SEND_TIMEOUT_S * 1000))

    def stop(self, timeout: float = 3.0) -> None:
        """Let the worker stop the robot and end; kill it when that takes longer than `timeout`. Twice is fine.

        When this returns, `Ended` has been posted. Do not call it from `post`.
        """
        with self._lock:
            if not self._closed:
                self._closed = True
                # Only our direction: the worker's last messages still come through.
                with contextlib.suppress(OSError), socket.socket(fileno=os.dup(self._pipe.fileno())) as half:
                    half.shutdown(socket.SHUT_WR)
        self._reader.join(timeout)
        if self._reader.is_alive():
            self._join(0.0)
            self._reader.join(timeout)

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _read_messages(self) -> None:
        """Post the worker's messages until it ends, then join the process and post `Ended`."""
        ended: Ended | None = None
        joiner = Joiner()
        with contextlib.suppress(EOFError, OSError):
            while ended is None:
                self._wait_for_message()
                message = joiner.add(self._pipe.recv())
                if message is None:
                    continue
                if isinstance(message, Ended):
                    ended = message
                elif isinstance(message, WorkerHeartbeat):
                    self._allowance = message.allowance
                else:
                    self._post(message)
        with self._lock:
            self._closed = True
            self._pipe.close()
        reason = self._join(5.0)
        if self.killed:
            reason = f"the bus worker of {self._url} hung for {self._killed_after:.1f} s and was killed"
        if ended is None:
            ended = Ended(reason or f"the bus worker of {self._url} ended without a message")
        self._post(ended)

    def _longest_silence(self) -> float:
        """Seconds without a word after which the worker is killed."""
        return max(self._allowance, HUNG_TIMEOUT_S)

    def _wait_for_message(self) -> None:
        """Return when there is something to read; a worker that is silent too long is reported, then killed."""
        silence = Silence(time.monotonic(), self._held_up())
        while not self._pipe.poll(CHECK_PERIOD_S):
            silence.look(time.monotonic(), self._held_up())
            if silence.lasted >= self._allowance and not self._silent:
                self._silent = True
                self._post(WorkerState(f"the bus worker of {self._url} has not answered for {silence.lasted:.1f} s"))
            is_stopped = silence.lasted >= STOPPED_TIMEOUT_S and self._is_stopped()
            if (is_stopped or silence.hangs(self._longest_silence())) and not self.killed:
                self.killed, self._killed_after = True, silence.lasted
                self._kill()
        if self._silent and not self.killed:
            self._silent = False
            self._post(WorkerState(""))


def _exit_words(status: int) -> str:
    """How a process ended, in words."""
    if status >= 0:
        return f"ended with exit status {status}"
    try:
        return f"was ended by {signal.Signals(-status).name}"
    except ValueError:
        return f"was ended by signal {-status}"
