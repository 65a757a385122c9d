"""A real worker process on a pty: its life, its death, and the death of its parent."""

from __future__ import annotations

import os
import queue
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

import pytest

from urbihw.buses import messages as m
from urbihw.buses.errors import LinkGone
from urbihw.buses.messages import FromWorker
from urbihw.buses.worker import SpareWorker, Worker
from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.endpoint import PtyEndpoint

pytestmark = pytest.mark.e2e

T = TypeVar("T")
TIMEOUT_S = 60.0

PARENT = """
import sys, threading
from urbihw.buses import messages as m
from urbihw.buses.worker import Worker

def post(message):
    if isinstance(message, m.Found):
        worker.send(m.Watch(6, ("present_position",)))
    elif isinstance(message, m.Samples) and 6 in message.values:
        if message.values[6]["present_position"] > 560:
            print("moving", flush=True)
        else:  # again and again: a target is dropped while its servo is lost, as on a busy machine
            worker.send(m.Targets({(6, "moving_speed"): 20, (6, "goal_position"): 1000}))
settings = m.Configure(dead_man=float(sys.argv[2]), options={"protocol": 1})
worker = Worker.start(sys.argv[1], post=post, settings=settings)
threading.Event().wait()
"""


class Heard:
    """What a worker posted, waited for with a bound."""

    def __init__(self) -> None:
        self.queue: queue.Queue[FromWorker] = queue.Queue()

    def wait(
        self, kind: type[T], accept: Callable[[T], bool] = lambda _: True, before: list[FromWorker] | None = None
    ) -> T:
        """The first message of a kind; ``before`` gets those that came before it."""
        end = time.monotonic() + TIMEOUT_S
        while True:
            message = self.queue.get(timeout=max(end - time.monotonic(), 0.001))
            if isinstance(message, kind) and accept(message):
                return message
            if before is not None:
                before.append(message)


@pytest.fixture
def robot() -> Iterator[PtyEndpoint]:
    kit = Bioloid(baud=1_000_000)
    for unit in kit:
        unit.registers.put("return_delay", 0)
    with PtyEndpoint(kit) as endpoint:
        endpoint.start()
        yield endpoint


def kit_of(robot: PtyEndpoint) -> Bioloid:
    assert isinstance(robot.device, Bioloid)
    return robot.device


def goal(robot: PtyEndpoint) -> int:
    return robot.call(lambda: kit_of(robot).servo(6).registers.get("goal_position"))


def wait_for_stop(robot: PtyEndpoint) -> None:
    """The goal must leave 1000 for the place where the servo is, well before it would arrive, in 9 s."""
    end = time.monotonic() + TIMEOUT_S
    while goal(robot) == 1000:
        assert time.monotonic() < end, "the robot was not stopped"
        time.sleep(0.01)
    assert 540 < goal(robot) < 990


def start_parent(robot: PtyEndpoint, dead_man: float) -> subprocess.Popen[str]:
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[2])}
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT, robot.url, str(dead_man)], stdout=subprocess.PIPE, text=True, env=environment
    )
    assert parent.stdout is not None
    assert parent.stdout.readline() == "moving\n"
    return parent


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "hung"])
def test_a_parent_that_dies_or_hangs_leaves_a_stopped_robot(robot: PtyEndpoint, end: signal.Signals) -> None:
    # A killed parent is noticed by the end of its pipe, without any dead-man time; a hung one only by its silence.
    parent = start_parent(robot, dead_man=0.0 if end is signal.SIGKILL else 2.0)
    try:
        parent.send_signal(end)
        wait_for_stop(robot)
    finally:
        parent.kill()
        parent.communicate()


def test_life_of_a_worker_process(robot: PtyEndpoint) -> None:
    heard = Heard()
    with Worker.start(robot.url, post=heard.queue.put, settings=m.Configure(options={"protocol": 1})) as worker:
        heard.wait(m.LinkState, lambda state: state.up)
        found = heard.wait(m.Found)
        assert len(found.devices) == 19
        worker.send(m.Watch(6, ("present_position", "present_voltage")))
        sample = heard.wait(m.Samples)
        assert set(sample.values[6]) == {"present_position", "present_voltage"}
        assert abs(time.monotonic() - sample.time) < TIMEOUT_S

        robot.unplug()
        assert "unplugged" in heard.wait(m.LinkState).reason
        robot.plug()
        assert heard.wait(m.LinkState).up
        worker.send(m.Heartbeat())
        assert heard.wait(m.Samples).values[6]
        worker.send(m.Request(7, "read", 6, "model_number"))
        assert heard.wait(m.Reply) == m.Reply(7, True, 12)
    heard.wait(m.Stopped, lambda stopped: stopped.reason == "the worker ends")
    assert heard.wait(m.Ended) == m.Ended("")
    assert not worker.alive


SLOW_START = """
import sys, time
if "urbihw.buses.child" in sys.orig_argv:
    time.sleep(3)
"""


def test_a_worker_that_takes_long_to_start_is_waited_for(
    robot: PtyEndpoint, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sitecustomize.py").write_text(SLOW_START)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    heard = Heard()
    with Worker.start(robot.url, post=heard.queue.put, settings=m.Configure(options={"protocol": 1})):
        told: list[FromWorker] = []
        heard.wait(m.Found, lambda _: True, told)
    assert not [message for message in told if isinstance(message, m.WorkerState | m.Ended)]


def test_sigint_is_for_the_parent_and_sigterm_stops_the_robot(robot: PtyEndpoint) -> None:
    heard = Heard()
    settings = m.Configure(dead_man=0, options={"protocol": 1})
    with Worker.start(robot.url, post=heard.queue.put, settings=settings) as worker:
        heard.wait(m.Found)
        worker.send(m.Watch(6, ("present_position",)))

        def moves(sample: m.Samples) -> bool:
            # Sent again and again: a target is dropped while the machine holds the simulated robot up.
            worker.send(m.Targets({(6, "moving_speed"): 20, (6, "goal_position"): 1000}))
            return bool(sample.values[6]["present_position"] > 560)

        heard.wait(m.Samples, moves)
        (child,) = children()
        os.kill(child, signal.SIGINT)
        worker.send(m.Request(1, "ping", 6))
        assert heard.wait(m.Reply).reply_id == 1
        os.kill(child, signal.SIGTERM)
        assert heard.wait(m.Ended) == m.Ended("")
        wait_for_stop(robot)


def test_a_worker_that_is_killed_is_reported(robot: PtyEndpoint) -> None:
    heard = Heard()
    settings = m.Configure(options={"protocol": 1})
    with Worker.start(robot.url, post=heard.queue.put, settings=settings) as worker:
        heard.wait(m.Found)
        (child,) = children()
        os.kill(child, signal.SIGKILL)
        assert heard.wait(m.Ended).reason == f"the bus worker of {robot.url} was ended by SIGKILL"
        assert not children()
        with pytest.raises(LinkGone, match="has ended"):
            worker.send(m.Heartbeat())


def children() -> list[int]:
    """The workers that this process has started and that still live."""
    pids = Path(f"/proc/self/task/{os.getpid()}/children").read_text(encoding="ascii").split()
    return [int(pid) for pid in pids if b"urbihw.buses.child" in Path(f"/proc/{pid}/cmdline").read_bytes()]


def test_a_worker_that_is_stopped_by_a_signal_is_killed_long_before_one_that_computes(robot: PtyEndpoint) -> None:
    heard = Heard()
    worker = Worker.start(robot.url, post=heard.queue.put, settings=m.Configure(options={"protocol": 1}))
    heard.wait(m.Found)
    # A request that takes long lets it be silent; but stopped is stopped.
    worker._allowance = TIMEOUT_S
    (child,) = children()
    os.kill(child, signal.SIGSTOP)
    assert "hung for" in heard.wait(m.Ended).reason


def test_a_spare_worker_that_is_stopped_by_a_signal_is_not_taken(robot: PtyEndpoint) -> None:
    heard = Heard()
    spare = SpareWorker(robot.url, "servos")
    os.kill(spare.process.pid, signal.SIGSTOP)
    os.waitid(os.P_PID, spare.process.pid, os.WSTOPPED | os.WNOWAIT)
    settings = m.Configure(options={"protocol": 1})
    with Worker.start(robot.url, post=heard.queue.put, settings=settings, spare=spare) as worker:
        before: list[FromWorker] = []
        heard.wait(m.Found, before=before)
        assert not [message for message in before if isinstance(message, m.WorkerState)]
        assert worker.alive
    assert spare.process.returncode == -signal.SIGKILL
