"""The worker: its engine step by step in simulated time, and its handle with the engine in a thread."""

from __future__ import annotations

import contextlib
import itertools
import math
import threading
from collections.abc import Callable, Iterator
from multiprocessing import Pipe
from typing import TypeVar

import pytest

from urbihw import buses
from urbihw.buses import messages as m
from urbihw.buses.clock import BusSimClock
from urbihw.buses.driver import driver_of
from urbihw.buses.engine import Engine
from urbihw.buses.errors import BadUrl, BadValue, LinkGone
from urbihw.buses.link import Context, Link, Port
from urbihw.buses.mailbox import Mailbox
from urbihw.buses.messages import FromWorker, ToWorker
from urbihw.buses.reports import HEARTBEAT_ALLOWANCE_S, SLOW_ALLOWANCE_S
from urbihw.buses.servos.device import DeviceInfo
from urbihw.buses.worker import Worker
from urbihw_fakes.bioloid import Bioloid

from .conftest import Rig, instruction_of

T = TypeVar("T")
ITEMS = ("present_position", "present_speed")


class Bench:
    """An engine that is stepped by hand, and the parent's end of its pipe."""

    def __init__(self, rig: Rig, settings: m.Configure | None = None, begin: m.Begin | None = None) -> None:
        rig.link.close()
        self.rig = rig
        self.pipe, theirs = Pipe()
        self.mailbox = Mailbox(theirs)
        self.asked_to_end = False
        self.engine = Engine(
            rig.url,
            driver_of("servos"),
            self.mailbox,
            begin or m.Begin(settings or m.Configure(dead_man=0)),
            rig.context,
            lambda: self.asked_to_end,
        )

    def tell(self, *told: ToWorker) -> None:
        for message in told:
            self.pipe.send(message)

    def run(self, seconds: float) -> list[FromWorker]:
        end = self.rig.clock.now() + seconds
        heard = []
        while self.rig.clock.now() < end:
            assert self.engine.step()
            heard += self.heard()
        return heard

    def heard(self) -> list[FromWorker]:
        heard: list[FromWorker] = []
        with contextlib.suppress(EOFError):
            while self.pipe.poll():
                heard.append(self.pipe.recv())
        return [message for message in heard if not isinstance(message, m.WorkerHeartbeat)]

    def close(self) -> None:
        self.pipe.close()
        self.mailbox.close()


def of(kind: type[T], heard: list[FromWorker]) -> list[T]:
    return [message for message in heard if isinstance(message, kind)]


@pytest.fixture
def bench(rig: Rig) -> Iterator[Bench]:
    made = Bench(rig)
    yield made
    made.close()


def test_start_finds_all_and_writes_nothing(bench: Bench) -> None:
    heard = bench.run(0.6)
    assert heard[0] == m.LinkState(True)
    (found,) = of(m.Found, heard)
    assert [info.id for info in found.devices] == [*range(1, 19), 100]
    assert found.devices[5] == DeviceInfo(6, 12, "AX-12A", "AX-12", 24, 1, "joint")
    # Instructions of protocol 1.0: only pings and reads.
    assert {instruction_of(line) for line in bench.rig.sent()} == {"01", "02"}


def test_a_link_that_breaks_at_a_watch_is_a_lost_link(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    def watch(*_: object) -> list[FromWorker]:
        raise LinkGone("it broke")

    bench.run(0.5)
    monkeypatch.setattr(bench.engine._driver, "watch", watch)
    bench.tell(m.Watch(6, ITEMS))
    assert m.LinkState(False, "it broke") in bench.run(0.1)


def test_targets_samples_and_statistics(bench: Bench) -> None:
    bench.run(0.5)
    bench.tell(m.Watch(6, ITEMS), m.Watch(7, ("present_voltage",), 0.5), m.Targets({(6, "goal_position"): 600}))
    heard = bench.run(2.0)
    samples = of(m.Samples, heard)
    assert len(samples) == pytest.approx(200, abs=1)
    assert samples[-1].values[6]["present_position"] == pytest.approx(600, abs=4)
    assert sum(7 in sample.values for sample in samples) == 4
    assert all(s.time == max(s.times.values()) for s in samples)
    last = of(m.Statistics, heard)[-1]
    assert last.rate == pytest.approx(100, rel=0.02)
    assert (last.late, {*last.errors.values()}, last.dropped) == (0, {0}, 0)
    assert last.load == pytest.approx(100 * (8 + 10) * 10e-6, rel=0.1)


def test_requests(bench: Bench) -> None:
    bench.run(0.5)
    bench.tell(
        m.Request(1, "write", 6, "torque_limit", 500),
        m.Request(2, "read", 6, "torque_limit"),
        m.Request(3, "ping", 100),
        m.Request(4, "read", 6, "nose"),
        m.Request(5, "read", 50, "led"),
        m.Request(6, "write", 6, "present_position", 1),
        m.Request(7, "reboot", 6),
        m.Request(8, "write", 6, "led", 7),
    )
    replies = {reply.reply_id: reply for reply in of(m.Reply, bench.run(0.05))}
    assert [(replies[n].ok, replies[n].value) for n in (1, 2, 3)] == [(True, 500), (True, 500), (True, 13)]
    errors = [(replies[n].ok, replies[n].error) for n in range(4, 9)]
    assert not any(ok for ok, _ in errors)
    expected = ("no item 'nose'", "no device 50", "only be read", "rebooted", "0..1")
    for (_, error), words in zip(errors, expected, strict=True):
        assert words in error


def test_a_scan_on_request_finds_what_was_added(make_rig: Callable[[Bioloid], Rig]) -> None:
    from urbihw_fakes.dynamixel.ax12 import Ax12

    rig = make_rig(Bioloid(servos=(1,), sensors=(), baud=1_000_000))
    bench = Bench(rig)
    bench.run(0.6)
    rig.kit.add(Ax12(2))
    rig.kit[2].set_baud(1_000_000)
    bench.tell(m.Request(9, "scan"))
    heard = bench.run(0.6)
    assert [info.id for info in of(m.Found, heard)[0].devices] == [1, 2]
    assert of(m.Reply, heard) == [m.Reply(9, True, 2)]
    assert all(s.late == 0 for s in of(m.Statistics, heard))
    bench.close()


def test_a_tick_that_waits_for_many_silent_devices_is_no_silence_of_the_worker(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    beats: list[float] = []
    post = bench.mailbox.post

    def note(message: FromWorker) -> None:
        if isinstance(message, m.WorkerHeartbeat):
            beats.append(bench.rig.clock.now())
        post(message)

    bench.run(0.6)
    bench.tell(*(m.Watch(number, ITEMS) for number in range(1, 19)))
    bench.rig.kit.faults.start("late", amount=0.045)
    bench.run(5.0)
    bench.rig.kit.faults.stop()
    monkeypatch.setattr(bench.mailbox, "post", note)
    bench.rig.kit.faults.start("silence")
    bench.run(3.0)
    assert max(gaps(beats)) < HEARTBEAT_ALLOWANCE_S


def test_a_worker_that_waits_for_slow_devices_is_not_silent(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    beats: list[tuple[float, float]] = []
    post = bench.mailbox.post

    def note(message: FromWorker) -> None:
        if isinstance(message, m.WorkerHeartbeat):
            beats.append((bench.rig.clock.now(), message.allowance))
        post(message)

    bench.run(0.6)
    bench.tell(*(m.Watch(number, ITEMS) for number in range(1, 19)))
    bench.tell(m.Targets({(number, "goal_position"): 900 for number in range(1, 7)}))
    monkeypatch.setattr(bench.mailbox, "post", note)
    bench.rig.kit.faults.start("late", amount=0.05)
    bench.run(4.0)
    bench.tell(m.Stop(1, "a test"))
    bench.run(4.0)
    bench.rig.kit.faults.stop()
    bench.run(2.0)
    late = [after - before - allowance for (before, allowance), (after, _) in itertools.pairwise(beats)]
    assert max(late) < 0
    assert [number for number in range(1, 7) if bench.rig.kit.servo(number).speed] == []


def test_a_driver_that_never_ends_to_ask_is_silent(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.run(0.6)
    beats: list[float] = []
    monkeypatch.setattr(bench.mailbox, "post", lambda message: beats.append(bench.rig.clock.now()))
    link, begun = bench.rig.link, bench.rig.clock.now()
    engine_link = bench.engine._link.port
    assert isinstance(engine_link, Link) and engine_link is not link
    for _ in range(1000):
        engine_link.read(1, bench.rig.clock.now() + 0.05)
    assert max(beats) - begun <= SLOW_ALLOWANCE_S


def test_a_robot_that_is_switched_on_later_is_found(rig: Rig) -> None:
    rig.kit.power_off(rig.clock.now())
    bench = Bench(rig)
    assert of(m.Found, bench.run(2.0)) == [m.Found(())]
    rig.kit.power_on(rig.clock.now())
    (found,) = of(m.Found, bench.run(6.0))
    assert len(found.devices) == 19
    bench.close()


def test_nonsense_is_refused_with_a_reason(bench: Bench) -> None:
    bench.run(0.5)
    bench.tell(m.Targets({(6, "goal_position"): 5000, (50, "led"): 1}), m.Watch(6, ("nose",)))
    refused = of(m.Refused, bench.run(0.05))
    assert [(r.device, r.item) for r in refused] == [(6, "goal_position"), (50, "led"), (6, "nose")]
    assert "0..1023" in refused[0].reason


def test_stop_stops_and_later_targets_move_again(bench: Bench) -> None:
    bench.run(0.5)
    bench.tell(m.Targets({(6, "goal_position"): 900}))
    bench.run(0.2)
    bench.rig.sent()
    bench.tell(m.Stop())
    assert of(m.Stopped, bench.run(0.02)) == [m.Stopped("asked to stop")]
    assert [line for line in bench.rig.sent() if "83 1E 02 06" in line]
    place = bench.rig.kit.servo(6).registers.get("present_position")
    bench.run(0.5)
    assert bench.rig.kit.servo(6).registers.get("present_position") == pytest.approx(place, abs=2)
    bench.tell(m.Targets({(6, "goal_position"): 900}))
    bench.run(0.1)
    assert bench.rig.kit.servo(6).registers.get("goal_position") == 900


def test_a_silent_master_stops_the_robot_once(rig: Rig) -> None:
    bench = Bench(rig, m.Configure(dead_man=1.5))
    bench.run(0.5)
    for _ in range(6):
        bench.tell(m.Heartbeat(), m.Targets({(6, "goal_position"): 900}))
        assert of(m.Stopped, bench.run(0.5)) == []
    start = rig.clock.now()
    rig.kit.servo(6).registers.put("goal_position", 400)
    heard = bench.run(3.0)
    assert of(m.Stopped, heard) == [m.Stopped("no sign of life from the master for 1.5 s", 1)]
    assert rig.kit.servo(6).registers.get("goal_position") != 400
    assert rig.clock.now() - start == pytest.approx(3.0, abs=0.05)
    bench.close()


def test_unplugged_and_back_nothing_moves_and_watches_resume(bench: Bench) -> None:
    rig = bench.rig
    bench.run(0.5)
    bench.tell(m.Watch(6, ITEMS), m.Targets({(6, "goal_position"): 600}))
    bench.run(0.5)
    rig.end.unplug()
    heard = bench.run(3.0)
    assert [link.up for link in of(m.LinkState, heard)] == [False]
    assert "unplugged" in of(m.LinkState, heard)[0].reason
    bench.tell(m.Targets({(6, "goal_position"): 700}), m.Request(1, "read", 6, "led"))
    heard = bench.run(0.1)
    assert of(m.Reply, heard) == [m.Reply(1, False, None, "the link is down")]
    rig.kit.power_off(rig.clock.now(), 5)
    rig.end.replug()
    rig.sent()
    heard = bench.run(3.0)
    assert of(m.LinkState, heard) == [m.LinkState(True)]
    assert len(of(m.Found, heard)[0].devices) == 18
    assert of(m.DeviceState, heard)[0] == m.DeviceState(5, "ok", "lost", "it does not answer")
    assert len(of(m.Samples, heard)) > 50
    # No target was sent again, neither the old one nor the one of the dark time: the joint holds where it is.
    place = rig.kit.servo(6).registers.get("present_position")
    writes = [line for line in rig.sent() if instruction_of(line) not in ("01", "02")]
    assert len(writes) == 2
    assert all(line.startswith(f"FF FF FE 07 83 1E 02 06 {place & 255:02X} {place >> 8:02X}") for line in writes)
    bench.tell(m.Targets({(6, "goal_position"): 600}))
    bench.run(0.02)
    assert any("83 1E 02 06 58 02" in line for line in rig.sent())


def test_a_stop_while_unplugged_is_owed(bench: Bench) -> None:
    rig = bench.rig
    for item in ("cw_limit", "ccw_limit"):
        rig.kit.servo(3).registers.put(item, 0)
    bench.run(0.5)
    bench.tell(m.Targets({(3, "moving_speed"): 500}))
    bench.run(0.1)
    rig.end.unplug()
    bench.run(0.1)
    bench.tell(m.Stop())
    assert of(m.Stopped, bench.run(0.1)) == [m.Stopped("asked to stop")]
    assert rig.kit.servo(3).registers.get("moving_speed") == 500
    rig.end.replug()
    bench.run(3.0)
    assert rig.kit.servo(3).registers.get("moving_speed") == 0


def test_a_link_that_never_was_is_reported_once(bench: Bench) -> None:
    bench.rig.end.unplug()
    (state,) = of(m.LinkState, bench.run(5.0))
    assert (state.up, state.reason) == (False, "pipe robot is unplugged")


def test_a_link_that_stays_away_is_tried_ever_more_rarely(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[float] = []
    really = buses.open

    def tell(url: str, context: Context) -> Port:
        tried.append(bench.rig.clock.now())
        return really(url, context)

    monkeypatch.setattr(buses, "open", tell)
    bench.rig.end.unplug()
    bench.run(10.0)
    # Twice the wait each time, and never more than 1 s; a try waits for the next tick.
    assert gaps(tried) == pytest.approx([0.2, 0.4, 0.8] + 8 * [1.0], abs=0.011)
    bench.tell(m.Watch(6, ITEMS))
    bench.rig.end.replug()
    bench.run(3.0)
    tried.clear()
    bench.rig.end.unplug()
    bench.run(2.0)
    # A link that was there begins anew with short waits.
    assert gaps(tried) == pytest.approx([0.4, 0.8], abs=0.011)


def gaps(times: list[float]) -> list[float]:
    """Seconds between one time and the next."""
    return [later - earlier for earlier, later in zip(times, times[1:], strict=False)]


def test_the_end_of_the_pipe_stops_the_robot_and_ends(bench: Bench) -> None:
    bench.run(0.5)
    bench.tell(m.Targets({(6, "goal_position"): 900}))
    bench.run(0.1)
    bench.rig.sent()
    bench.pipe.close()
    bench.engine.run()
    assert [line for line in bench.rig.sent() if "83 1E 02 06" in line]


def test_being_asked_to_end_stops_the_robot_and_says_so(bench: Bench) -> None:
    bench.run(0.5)
    bench.tell(m.Targets({(6, "goal_position"): 900}))
    bench.run(0.1)
    bench.asked_to_end = True
    bench.engine.run()
    assert bench.heard()[-2:] == [m.Stopped("the worker ends", 1), m.Ended("")]


def test_a_bug_stops_the_robot_and_is_told(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.run(0.5)
    bench.tell(m.Targets({(6, "goal_position"): 900}))
    bench.run(0.1)
    monkeypatch.setattr(bench.engine._reports, "post_statistics", lambda *_: 1 // 0)
    bench.engine.run()
    stopped, ended = bench.heard()[-2:]
    assert stopped == m.Stopped("the worker ends", 1)
    assert isinstance(ended, m.Ended)
    assert ended.reason.startswith("our bug in the bus worker: ZeroDivisionError")


def test_a_parent_that_does_not_read_holds_nothing_up_and_then_gets_the_newest(bench: Bench) -> None:
    bench.run(0.5)
    bench.tell(m.Watch(6, ("present_voltage",), 100.0))
    for number in range(1, 19):
        bench.tell(m.Watch(number, ("present_position", "present_speed", "present_load")))
    bench.engine.step()
    for _ in range(1000):
        assert bench.engine.step()
    end = bench.rig.clock.now()
    backlog = bench.heard()
    heard = bench.run(1.5)
    newest = of(m.Samples, heard)[0]
    assert end - 0.02 < newest.time < end + 0.02
    assert newest.values.keys() == set(range(1, 19))
    assert sum(s.dropped for s in of(m.Statistics, backlog + heard)) > 500
    assert len(of(m.Statistics, backlog + heard)) >= 11


def test_configure_changes_the_rate(bench: Bench) -> None:
    bench.run(0.5)
    bench.tell(m.Configure(rate=50, dead_man=0))
    assert of(m.Statistics, bench.run(3.0))[-1].rate == pytest.approx(50, rel=0.05)


class GatedClock(BusSimClock):
    """A simulated clock whose sleepers wait until the test lets time go on."""

    def __init__(self, start: float) -> None:
        super().__init__(start)
        self._limit = start
        self._condition = threading.Condition()
        self._asleep = False

    def sleep_until(self, when: float) -> None:
        with self._condition:
            self._asleep = True
            self._condition.notify_all()
            assert self._condition.wait_for(lambda: when <= self._limit, 10)
            self._asleep = False
        super().sleep_until(when)

    def let_run(self, seconds: float) -> None:
        """Let time go on by `seconds`; return when everyone sleeps again."""
        with self._condition:
            self._limit += seconds
            self._asleep = False
            self._condition.notify_all()
            assert self._condition.wait_for(lambda: self._asleep, 10)

    def open_gate(self) -> None:
        """Let time go on for ever."""
        with self._condition:
            self._limit = math.inf
            self._condition.notify_all()


def test_a_worker_in_a_thread(rig: Rig) -> None:
    clock = GatedClock(rig.clock.now())
    heard: list[FromWorker] = []
    ended = threading.Event()

    def post(message: FromWorker) -> None:
        heard.append(message)
        if isinstance(message, m.Ended):
            ended.set()

    rig.link.close()
    rig.clock = clock
    context = Context(clock, rig.context.pipes)
    with Worker.start(rig.url, post=post, process=False, context=context, settings=m.Configure(dead_man=0)) as worker:
        clock.let_run(0.6)
        worker.send(m.Watch(6, ITEMS))
        worker.send(m.Targets({(6, "goal_position"): 900}))
        clock.let_run(0.2)
        assert worker.alive
        clock.open_gate()
    assert ended.wait(10)
    assert not worker.alive
    assert isinstance(heard[0], m.LinkState)
    assert of(m.Found, heard)
    assert of(m.Samples, heard)[-1].values.keys() == {6}
    assert heard[-2:] == [m.Stopped("the worker ends", 1), m.Ended("")]
    worker.stop()
    with pytest.raises(LinkGone, match="has ended; start another one"):
        worker.send(m.Heartbeat())


def test_a_worker_cannot_be_started_on_nonsense() -> None:
    with pytest.raises(BadUrl):
        Worker.start("", post=print)
    with pytest.raises(BadValue, match="known: servos"):
        Worker.start("/dev/ttyUSB0", post=print, family="teapot")
    with pytest.raises(BadValue, match="context"):
        Worker.start("/dev/ttyUSB0", post=print, context=Context())


def test_an_emergency_stop_is_not_ended_by_a_release_that_was_asked_before_it(bench: Bench) -> None:
    bench.run(0.5)
    bench.tell(m.EmergencyStop("one"), m.Release("one"), m.EmergencyStop("two"))
    assert of(m.Latched, bench.run(0.1))[-1].reason == "one, then two"
    place = bench.rig.kit.servo(6).position
    bench.tell(m.Targets({(6, "goal_position"): 900}, epoch=9))
    bench.run(1.0)
    assert bench.rig.kit.servo(6).position == pytest.approx(place, abs=2)
    bench.tell(m.Release("two"), m.Targets({(6, "goal_position"): 900}, epoch=9))
    bench.run(1.0)
    assert bench.rig.kit.servo(6).registers.get("goal_position") == 900
