"""Who keeps a wire in the hands of a worker that works, with workers that do what a test says."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator
from typing import ClassVar

import pytest

from urbihw.buses import messages as m
from urbihw.buses import supervisor as module
from urbihw.buses.driver import driver_of
from urbihw.buses.errors import LinkGone, Unavailable
from urbihw.buses.messages import FromWorker, ToWorker
from urbihw.buses.supervisor import FIRST_BACK_OFF_S, LAST_BACK_OFF_S, MOST_AT_ONCE, Supervisor
from urbihw.buses.worker import WorkerBusy

URL = "pipe://robot"


class FakeSpare:
    """A worker that stands for a spare one."""

    made: ClassVar[list[FakeSpare]] = []

    def __init__(self, url: str, family: str) -> None:
        assert (url, family) == (URL, "servos")
        self.taken = self.closed = False
        FakeSpare.made.append(self)

    def close(self) -> None:
        self.closed = True


class FakeWorker:
    """A worker of which a test says what it hears and when it dies."""

    made: ClassVar[list[FakeWorker]] = []
    failures: ClassVar[list[Exception]] = []
    """What the next starts fail with."""
    on_start: ClassVar[Callable[[FakeWorker], None] | None] = None

    def __init__(self, post: Callable[[FromWorker], None], begin: m.Begin) -> None:
        self.post = post
        self.begin = begin
        self.told: list[ToWorker] = []
        self.alive = True
        """Runs, as a real one, until its end was reported."""
        self.over = False
        self.silent = False
        self.killed = False
        self.hangs = False
        self.last_words = ""
        self.deaf = False
        self.calls: list[str] = []

    @classmethod
    def start(
        cls, url: str, *, post: Callable[[FromWorker], None], begin: m.Begin, family: str,
        spare: FakeSpare | None = None,
    ) -> FakeWorker:
        assert (url, family) == (URL, "servos")
        if spare is not None:
            spare.taken = True
        if cls.failures:
            raise cls.failures.pop(0)
        made = cls(post, begin)
        cls.made.append(made)
        if cls.on_start is not None:
            cls.on_start(made)
        return made

    def send(self, message: ToWorker) -> None:
        if self.deaf or self.over:
            raise LinkGone("the worker does not read")
        self.told.append(message)

    def stop(self, timeout: float = 3.0) -> None:
        self.calls.append("stop")
        if self.hangs:
            self.killed = True
        self.end(self.last_words)

    def kill(self) -> None:
        self.calls.append("kill")
        self.end("killed")

    def end(self, reason: str) -> None:
        """Its process is over."""
        if not self.over:
            self.over = True
            self.post(m.Ended(reason))
            self.alive = False


class Pauses:
    """Stands for the event that ends a supervisor: it does not wait, and notes each wait."""

    def __init__(self) -> None:
        self.waited: list[float] = []
        self.during: Callable[[], None] = lambda: None
        self._set = False

    def is_set(self) -> bool:
        return self._set

    def set(self) -> None:
        self._set = True

    def wait(self, seconds: float) -> bool:
        self.waited.append(seconds)
        self.during()
        return self._set


class Rig:
    """A supervisor, its workers, and what its robot hears."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.heard: list[FromWorker] = []
        self.supervisor = Supervisor.start(
            URL, post=self.heard.append, settings=m.Configure(rate=50), family="servos", control="/run/robot.sock"
        )
        self.pauses = Pauses()
        monkeypatch.setattr(self.supervisor, "_stopping", self.pauses)

    @property
    def worker(self) -> FakeWorker:
        """That of the moment."""
        return FakeWorker.made[-1]


@pytest.fixture
def rig(monkeypatch: pytest.MonkeyPatch) -> Iterator[Rig]:
    monkeypatch.setattr(module, "Worker", FakeWorker)
    monkeypatch.setattr(module, "SpareWorker", FakeSpare)
    FakeSpare.made.clear()
    monkeypatch.setattr(module, "LAST_STOP_TIMEOUT_S", 0.05)
    FakeWorker.made.clear()
    FakeWorker.failures.clear()
    FakeWorker.on_start = None
    yield Rig(monkeypatch)
    FakeWorker.on_start = None


def test_a_worker_begins_with_the_settings_and_the_control_socket(rig: Rig) -> None:
    assert rig.worker.begin == m.Begin(m.Configure(rate=50), control="/run/robot.sock")
    rig.supervisor.send(m.Heartbeat())
    assert rig.worker.told == [m.Heartbeat()]
    rig.worker.post(m.LinkState(True))
    assert rig.heard == [m.LinkState(True)]


def test_one_that_dies_is_replaced_at_once_and_then_with_back_off(rig: Rig) -> None:
    for _ in range(8):
        rig.worker.end("it died")
    assert len(FakeWorker.made) == 9
    backed_off = [min(FIRST_BACK_OFF_S * 2**n, LAST_BACK_OFF_S) for n in range(7)]
    assert rig.pauses.waited == [0.0, *backed_off]
    assert rig.heard == [m.WorkerState("it died; another one is started")] * 8


def test_those_that_had_reached_the_robot_are_replaced_at_once_by_spare_workers(rig: Rig) -> None:
    for number in range(MOST_AT_ONCE + 3):
        rig.worker.post(m.LinkState(True))
        assert len(FakeSpare.made) == number + 1
        rig.worker.end("it died")
        assert FakeSpare.made[-1].taken
    assert rig.pauses.waited == [0.0] * (MOST_AT_ONCE + 1) + [FIRST_BACK_OFF_S, LAST_BACK_OFF_S]


def test_what_cannot_move_needs_no_spare_worker(rig: Rig) -> None:
    rig.supervisor._can_move = driver_of("urbihw.navigation.lasers.scipdriver:ScipDriver").can_move
    rig.worker.post(m.LinkState(True))
    assert FakeSpare.made == []


def test_a_spare_worker_ends_with_the_supervisor_and_there_is_one_at_a_time(rig: Rig) -> None:
    for up in (True, False, True):
        rig.worker.post(m.LinkState(up))
    rig.supervisor.stop()
    assert [(spare.taken, spare.closed) for spare in FakeSpare.made] == [(False, True)]


def test_one_that_worked_for_a_while_is_replaced_at_once_again(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    rig.worker.end("it died")
    rig.worker.end("it died")
    monkeypatch.setattr(module, "STEADY_AFTER_S", -1.0)
    rig.worker.end("it died")
    assert rig.pauses.waited == [0.0, FIRST_BACK_OFF_S, 0.0]


def test_one_that_ends_without_a_reason_was_not_asked_to(rig: Rig) -> None:
    rig.worker.end("")
    assert rig.heard == [m.WorkerState("the bus worker has ended; another one is started")]
    assert rig.worker.begin.instead == "the bus worker has ended"
    assert rig.worker.begin.restarts == 1


def test_a_start_that_fails_is_tried_again(rig: Rig) -> None:
    FakeWorker.failures += [Unavailable("no more processes"), OSError("no memory")]
    rig.worker.end("it died")
    assert rig.worker.begin.instead == "no bus worker can be started: no memory"
    assert rig.pauses.waited == [0.0, 1.0, 2.0]
    assert len(FakeWorker.made) == 2


def test_the_next_one_knows_what_the_last_one_knew(rig: Rig) -> None:
    limits = m.Limits({(6, "goal_position"): m.Limit(0, 500)})
    for message in (
        m.Watch(6, ("present_position", "present_load")),
        m.Watch(7, ("present_voltage",), 1.0),
        m.Watch(8, (), 2.0),
        m.Watch(6, ("present_load",), None),
        m.Limits({}),
        limits,
        m.Configure(rate=20),
        m.Targets({(6, "goal_position"): 1}, 3),
        m.Request(1, "ping", 6),
    ):
        rig.supervisor.send(message)
    rig.worker.post(m.Found(("a device",)))
    rig.worker.end("it died")
    begin = rig.worker.begin
    assert begin.settings == m.Configure(rate=20)
    assert begin.devices == ("a device",)
    assert begin.control == "/run/robot.sock"
    assert begin.instead == "it died"
    first, second, third = begin.watches
    assert first == m.Watch(6, ("present_position",))
    assert (second, third) == (m.Watch(7, ("present_voltage",), 1.0), m.Watch(8, (), 2.0))
    # What would move it, and what somebody waits for, is lost.
    assert rig.worker.told == [limits]


def test_the_next_one_is_held_by_the_emergency_stops_of_the_last_one(rig: Rig) -> None:
    ann, bob = ("ann", "Ann at the desk"), ("bob", "Bob")
    rig.worker.post(m.Latched("Ann at the desk", ann[1], (ann,)))
    rig.supervisor.send(m.EmergencyStop("Bob", "bob"))
    rig.worker.end("it died")
    assert [*rig.worker.begin.holders] == [ann, bob]
    # Only the worker knows what a release has released.
    rig.supervisor.send(m.Release("Bob", "bob"))
    rig.worker.end("it died")
    assert [*rig.worker.begin.holders] == [ann, bob]
    rig.worker.post(m.Latched("Ann at the desk", "Bob", (ann,), ("Bob",)))
    rig.worker.end("it died")
    assert [*rig.worker.begin.holders] == [ann]
    rig.worker.post(m.Latched("", "Ann", (), (ann[1],)))
    rig.worker.end("it died")
    assert [*rig.worker.begin.holders] == []


def test_an_older_report_does_not_undo_an_emergency_stop(rig: Rig) -> None:
    """The worker dies before it has read the press: the next one is held by it all the same."""
    rig.supervisor.send(m.Release("Bob", "bob", order=1))
    rig.supervisor.send(m.EmergencyStop("Ann", "ann", order=2))
    rig.worker.post(m.Latched("", "Bob", (), ("Bob",), order=1))
    rig.worker.end("it died")
    assert [*rig.worker.begin.holders] == [("ann", "Ann")]
    assert rig.worker.begin.order == 2
    rig.worker.post(m.Latched("", "Ann", (), ("Ann",), order=2))
    rig.worker.end("it died")
    assert [*rig.worker.begin.holders] == []


def test_what_waits_for_a_worker_that_does_not_read_is_not_for_the_next_one(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    def busy(message: ToWorker) -> None:
        raise WorkerBusy("the pipe is full")

    monkeypatch.setattr(rig.worker, "send", busy)
    rig.supervisor.send(m.Request(1, "write", 6, "goal_position", 900))
    rig.worker.end("it died")
    rig.supervisor.send(m.Watch(6, ("present_position",)))
    assert rig.worker.told == [m.Watch(6, ("present_position",))]


def test_each_one_begins_a_later_epoch_than_all_that_was_heard(rig: Rig) -> None:
    rig.supervisor.send(m.Targets({}, 3))
    rig.worker.end("it died")
    assert rig.worker.begin.epoch == 4
    rig.worker.post(m.Stopped("by the control socket", 9))
    rig.worker.end("it died")
    assert rig.worker.begin.epoch == 10
    rig.supervisor.send(m.Stop(12))
    rig.worker.end("it died")
    assert rig.worker.begin.epoch == 13


def test_one_that_dies_as_it_is_told_the_limits_is_replaced_once(rig: Rig) -> None:
    rig.supervisor.send(m.Limits({}))

    def deaf(worker: FakeWorker) -> None:
        worker.deaf = True
        FakeWorker.on_start = None

    FakeWorker.on_start = deaf
    rig.worker.end("it died")
    assert len(FakeWorker.made) == 2
    rig.worker.end("it died too")
    assert len(FakeWorker.made) == 3
    assert sum(not worker.over for worker in FakeWorker.made) == 1


def test_what_a_dead_worker_does_not_take_is_no_error(rig: Rig) -> None:
    rig.worker.deaf = True
    rig.supervisor.send(m.Watch(6, ("present_position",)))
    rig.worker.end("it died")
    assert rig.worker.begin.watches == (m.Watch(6, ("present_position",)),)


def test_a_message_that_no_process_can_get_is_refused_and_the_next_one_goes_through(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    send = FakeWorker.send

    def pickling(worker: FakeWorker, message: ToWorker) -> None:
        pickle.dumps(message)
        send(worker, message)

    monkeypatch.setattr(FakeWorker, "send", pickling)
    rig.supervisor.send(m.Request(7, "call", "ALMemory", "getData", (lambda: None,)))
    (refused,) = [each for each in rig.heard if isinstance(each, m.Reply)]
    assert refused.reply_id == 7 and not refused.ok and refused.error.startswith("this cannot be sent")
    rig.supervisor.send(m.Stop())
    assert isinstance(rig.worker.told[-1], m.Stop)


def test_one_that_falls_silent_gets_a_stop_and_the_robot_is_told_again_what_is_there(rig: Rig) -> None:
    rig.worker.post(m.LinkState(True))
    rig.worker.post(m.Found((6,)))
    rig.heard.clear()
    rig.worker.post(m.WorkerState("it has not answered for 0.5 s"))
    assert rig.worker.told == [m.Stop(1, "it has not answered for 0.5 s")]
    rig.worker.post(m.WorkerState(""))
    assert rig.heard == [
        m.WorkerState("it has not answered for 0.5 s"), m.WorkerState(""), m.LinkState(True), m.Found((6,))
    ]


# ---------------------------------------------------------------- the end


def opens(worker: FakeWorker) -> None:
    worker.post(m.LinkState(True))


def test_one_that_works_stops_the_robot_itself(rig: Rig) -> None:
    rig.supervisor.stop()
    assert len(FakeWorker.made) == 1
    assert rig.worker.calls == ["stop"]
    assert rig.heard == [m.Ended("")]


@pytest.mark.parametrize("how", ["silent", "dead", "hangs at the end", "dies at the end"])
def test_in_the_place_of_one_that_cannot_another_stops_the_robot(rig: Rig, how: str) -> None:
    first = rig.worker
    first.silent = how == "silent"
    first.hangs = how == "hangs at the end"
    first.last_words = "it died" if how == "dies at the end" else ""
    FakeWorker.on_start = opens
    if how == "dead":
        # It died, and while the supervisor waits before it starts the next one, the daemon ends.
        rig.pauses.during = rig.supervisor.stop
        first.end("it died")
    else:
        rig.supervisor.stop()
    assert len(FakeWorker.made) == 2
    second = rig.worker
    assert (second.begin.control, second.begin.instead, second.begin.epoch) == ("", "the daemon ends", 1)
    assert second.calls == ["stop"]
    assert m.Ended("") in rig.heard
    assert all(worker.over for worker in FakeWorker.made)


def test_a_robot_that_could_not_be_stopped_is_told(rig: Rig) -> None:
    rig.worker.silent = True
    rig.supervisor.stop()
    assert rig.heard[-1] == m.Ended("the robot could not be stopped: its bus worker was dead")


def test_after_the_end_nothing_is_started(rig: Rig) -> None:
    rig.supervisor.stop()
    rig.worker.over = False
    rig.worker.end("it died")
    assert len(FakeWorker.made) == 1
