"""The control socket: by itself, and in an engine in simulated time that drives a fake kit."""

from __future__ import annotations

import json
import os
import socket
import stat
import time
from collections.abc import Callable, Iterator
from multiprocessing import Pipe
from pathlib import Path
from typing import Any

import pytest

from urbihw.buses import messages as m
from urbihw.buses.authority import MOST_HOLDERS
from urbihw.buses.clock import BusRealClock
from urbihw.buses.control import LOOK_PERIOD_S, MAX_CLIENTS, REST_S, ControlSocket
from urbihw.buses.control_client import MAX_LINE_BYTES, MAX_QUEUED_LINES, NAMELESS
from urbihw.buses.driver import driver_of
from urbihw.buses.engine import Engine
from urbihw.buses.errors import Unavailable
from urbihw.buses.mailbox import Mailbox
from urbihw.buses.owed_releases import LONGEST_WAIT_S
from urbihw.control_address import abstract_address, local_user

from .conftest import Rig
from .test_worker import Bench, of

Say = dict[str, Any]
GOAL = "goal_position"
ME = local_user(os.getuid())
LISTENERS = 2
"""At the file, and at the abstract name."""


class Caller:
    """A client of a control socket."""

    def __init__(self, address: Path | bytes) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.socket.connect(address if isinstance(address, bytes) else str(address))
        self.socket.setblocking(False)
        self.ended = False
        self._buffer = b""

    def say(self, verb: str, who: str = "a test") -> None:
        self.send(json.dumps({"do": verb, "who": who}).encode() + b"\n")

    def send(self, data: bytes) -> None:
        self.socket.sendall(data)

    def hear(self) -> list[Say]:
        """The lines that have come."""
        while not self.ended:
            try:
                data = self.socket.recv(1 << 16)
            except BlockingIOError:
                break
            except ConnectionResetError:
                data = b""
            self.ended = not data
            self._buffer += data
        *lines, self._buffer = self._buffer.split(b"\n")
        return [json.loads(line) for line in lines]

    def close(self) -> None:
        self.socket.close()


class ControlBench(Bench):
    """An engine with a control socket."""

    def __init__(self, rig: Rig, path: Path) -> None:
        super().__init__(rig)
        self.mailbox.close()
        self.path = path
        self.pipe, theirs = Pipe()
        self.mailbox = Mailbox(theirs)
        begin = m.Begin(m.Configure(dead_man=0), control=str(path))
        self.engine = Engine(
            rig.url, driver_of("servos"), self.mailbox, begin, rig.context, lambda: self.asked_to_end
        )
        self.callers: list[Caller] = []

    def call(self, address: Path | bytes | None = None) -> Caller:
        self.callers.append(Caller(self.path if address is None else address))
        return self.callers[-1]

    def order(self, verb: str, who: str = "a test", **more: Any) -> tuple[Say, list[m.FromWorker]]:
        """Say something as a new client: the answer, and what the parent heard meanwhile, which confirms releases."""
        caller = self.call()
        caller.send(json.dumps({"do": verb, "who": who, **more}).encode() + b"\n")
        heard = self.run(0.03)
        for latched in of(m.Latched, heard):
            if latched.freed:
                self.tell(m.ReleaseKnown())
        heard += self.run(0.02)
        (answer,) = caller.hear()
        return answer, heard

    def move(self, goal: int, epoch: int = 0) -> list[m.FromWorker]:
        """Let servo 6 go somewhere."""
        self.tell(m.Targets({(6, GOAL): goal}, epoch))
        return self.run(0.1)

    def register(self, name: str, number: int = 6) -> int:
        return self.rig.kit.servo(number).registers.get(name)

    def end(self) -> None:
        """What the end of the process does; twice is fine."""
        if self.asked_to_end:
            return
        self.asked_to_end = True
        self.engine.run()
        for caller in self.callers:
            caller.close()
        self.close()


@pytest.fixture
def bench(rig: Rig, tmp_path: Path) -> Iterator[ControlBench]:
    made = ControlBench(rig, tmp_path / "robot.sock")
    made.run(0.5)
    yield made
    made.end()


# ---------------------------------------------------------------- in an engine


def test_a_socket_whose_file_was_deleted_still_stops_the_robot_and_makes_its_file_again(bench: ControlBench) -> None:
    bench.move(900)
    bench.path.unlink()
    caller = bench.call(abstract_address(bench.path))
    caller.say("estop")
    bench.run(0.1)
    assert bench.register(GOAL) == pytest.approx(bench.register("present_position"), abs=3)
    bench.run(LOOK_PERIOD_S)
    assert bench.order("state")[0]["estop"] == "a test"
    assert stat.S_IMODE(bench.path.stat().st_mode) == 0o660


def test_a_file_that_somebody_else_has_put_there_stays(bench: ControlBench) -> None:
    bench.path.unlink()
    bench.path.write_text("mine")
    bench.run(2 * LOOK_PERIOD_S)
    assert bench.path.read_text() == "mine"


def test_an_abstract_name_that_is_taken_keeps_no_worker_from_its_file(tmp_path: Path) -> None:
    path = tmp_path / "x.sock"
    with socket.socket(socket.AF_UNIX) as other:
        other.bind(abstract_address(path))
        made = ControlSocket(path, time.monotonic)
        assert len(made.descriptors()) == 1
        made.close()


def test_the_robot_stands_before_the_latch_is_written(bench: ControlBench, monkeypatch: pytest.MonkeyPatch) -> None:
    authority = bench.engine._authority
    seen: list[int] = []

    def write() -> str:
        seen.append(bench.register(GOAL))
        return "no inode is left"

    monkeypatch.setattr(authority, "_write_latches", write)
    bench.move(900)
    answer, _ = bench.order("estop")
    bench.run(0.1)
    assert seen == [pytest.approx(bench.register("present_position"), abs=3)]
    assert answer["ok"] and answer["unkept"] == "no inode is left"


def test_stop_stops_and_what_was_asked_for_before_counts_no_more(bench: ControlBench) -> None:
    bench.move(900)
    answer, heard = bench.order("stop", "the tester")
    assert (answer["ok"], answer["do"], answer["epoch"], answer["estop"], answer["link"]) == (True, "stop", 1, "", True)
    assert of(m.Stopped, heard) == [m.Stopped("stop asked by the tester", 1)]
    place = bench.register(GOAL)
    assert place == pytest.approx(bench.register("present_position"), abs=3)
    assert of(m.Refused, bench.move(900, epoch=0)) == []
    assert bench.register(GOAL) == place
    bench.move(900, epoch=1)
    assert bench.register(GOAL) == 900


def test_a_stop_of_a_client_that_connects_in_mid_tick_ends_the_tick(
    bench: ControlBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    tick, port = bench.engine._driver.tick, bench.engine._link.port
    assert port is not None
    seen: list[bool] = []

    def interrupted(now: float, meanwhile: Callable[[], None], urgent: Callable[[], bool]) -> list[m.FromWorker]:
        if not seen:
            before = len(port.beside)
            caller = bench.call()
            seen.append(urgent())
            # The wait for the next answer ends when this client says something.
            assert len(port.beside) == before + 1
            caller.say("stop")
            seen.append(urgent())
        return tick(now, meanwhile, urgent)

    bench.move(900)
    monkeypatch.setattr(bench.engine._driver, "tick", interrupted)
    heard = bench.run(0.05)
    assert seen == [False, True]
    assert [stop.reason for stop in of(m.Stopped, heard)] == ["stop asked by a test"]
    assert bench.register(GOAL) == pytest.approx(bench.register("present_position"), abs=3)


def test_a_stop_goes_before_targets_that_came_with_it(bench: ControlBench) -> None:
    before = bench.register(GOAL)
    bench.tell(m.Targets({(6, GOAL): 900}), m.Request(1, "write", 6, GOAL, 901))
    _, heard = bench.order("stop")
    assert bench.register(GOAL) == before
    assert [reply.ok for reply in of(m.Reply, heard)] == [False]


def test_an_emergency_stop_holds_back_what_moves_and_nothing_else(bench: ControlBench) -> None:
    bench.move(900)
    answer, heard = bench.order("estop", "the red button")
    assert answer["estop"] == "the red button"
    assert of(m.Latched, heard) == [m.Latched("the red button", "the red button", ((ME, "the red button"),))]
    place = bench.register(GOAL)
    bench.tell(
        m.Targets({(6, GOAL): 900, (6, "led"): 1}, 5),
        m.Request(1, "write", 6, GOAL, 900, 5),
        m.Request(2, "write", 6, "torque_limit", 500, 5),
        m.Request(3, "write_all", 6, value=(("led", 1), ("torque_enable", 1)), epoch=5),
        m.Request(4, "read", 6, GOAL, epoch=5),
    )
    heard = bench.run(0.1)
    assert bench.register(GOAL) == place
    assert (bench.register("led"), bench.register("torque_limit")) == (1, 500)
    (refused,) = of(m.Refused, heard)
    assert (refused.device, refused.item) == (6, GOAL)
    replies = {reply.reply_id: reply for reply in of(m.Reply, heard)}
    assert [replies[number].ok for number in (1, 2, 3, 4)] == [False, True, False, True]
    for reason in (refused.reason, replies[1].error, replies[3].error):
        assert reason == "an emergency stop holds (the red button): release it first"


def test_an_emergency_stop_is_not_ended_by_a_release_of_the_master_that_came_before_it(bench: ControlBench) -> None:
    bench.order("estop", "one")
    bench.tell(m.Release("the master"))
    assert bench.order("estop", "two")[0]["estop"] == "one, then two"
    assert of(m.Refused, bench.move(900, epoch=9))


def test_an_emergency_stop_is_not_ended_by_a_release_that_came_at_the_same_moment(bench: ControlBench) -> None:
    bench.order("estop", "one")
    callers = [bench.call(), bench.call()]
    bench.run(0.03)
    for caller, verb in zip(callers, ("release", "estop"), strict=True):
        caller.say(verb, "two")
    bench.run(0.03)
    assert bench.order("state")[0]["estop"] == "one, then two"


def test_release_lets_it_move_again_but_moves_nothing(bench: ControlBench) -> None:
    bench.move(900)
    bench.order("estop")
    place = bench.register(GOAL)
    answer, heard = bench.order("release", "the tester")
    assert (answer["estop"], answer["released"]) == ("", True)
    assert of(m.Latched, heard) == [m.Latched("", "the tester", (), ("a test",))]
    bench.run(0.5)
    assert bench.register(GOAL) == place
    bench.move(900, epoch=answer["epoch"])
    assert bench.register(GOAL) == 900
    assert of(m.Latched, bench.order("release")[1]) == []


def test_a_release_is_answered_when_the_parent_knows_it(bench: ControlBench) -> None:
    """Else a write right behind the answer is refused by a parent that does not know of the release yet."""
    bench.order("estop")
    caller = bench.call()
    caller.say("release")
    heard = bench.run(0.1)
    assert [latched.freed for latched in of(m.Latched, heard)] == [("a test",)]
    assert caller.hear() == []
    bench.tell(m.ReleaseKnown())
    bench.run(0.02)
    assert [answer["released"] for answer in caller.hear()] == [True]


def test_a_release_is_answered_although_the_parent_is_held(bench: ControlBench) -> None:
    first, second = bench.call(), bench.call()
    for caller in (first, second):
        bench.order("estop")
        caller.say("release")
        bench.run(LONGEST_WAIT_S + 0.1)
        assert [(answer["released"], answer["estop"]) for answer in caller.hear()] == [(True, "")]
    # What the parent confirms late is no confirmation of the next release.
    bench.order("estop")
    first.say("release")
    bench.run(0.05)
    bench.tell(m.ReleaseKnown())
    bench.tell(m.ReleaseKnown())
    bench.run(0.05)
    assert first.hear() == []
    bench.tell(m.ReleaseKnown())
    bench.run(0.05)
    assert first.hear()[0]["released"]


def test_a_press_without_a_name_has_one(bench: ControlBench) -> None:
    # Who hears of the latch tells a press from a refused release by it.
    (latched,) = of(m.Latched, bench.order("estop", " ")[1])
    assert latched.who == latched.reason == NAMELESS


def test_the_latch_outlives_the_worker(bench: ControlBench, make_rig: Callable[..., Rig]) -> None:
    bench.order("estop", "the red button")
    latch = bench.path.with_suffix(".estop")
    assert latch.read_text() == f"the red button\t{ME}\n"
    bench.end()
    assert latch.exists() and not bench.path.exists()
    second = ControlBench(make_rig(bench.rig.kit), bench.path)
    assert of(m.Latched, second.run(0.5)) == [m.Latched("the red button", holders=((ME, "the red button"),))]
    before = second.register(GOAL)
    assert len(of(m.Refused, second.move(before + 100))) == 1
    assert second.register(GOAL) == before
    assert second.order("state")[0]["estop"] == "the red button"
    second.order("release")
    assert not latch.exists()
    second.end()


def can_move(bench: ControlBench) -> bool:
    """Whether a target of the present epoch reaches servo 6."""
    before = bench.register(GOAL)
    bench.move(before + 5, epoch=bench.engine._authority.epoch)
    return bench.register(GOAL) != before


def test_the_robot_is_free_when_all_who_have_pressed_have_released(
    bench: ControlBench, make_rig: Callable[..., Rig]
) -> None:
    bench.order("estop", "Ann at the desk", user="ann")
    answer, _ = bench.order("estop", "Bob", user="bob")
    assert answer["estop"] == "Ann at the desk and Bob"
    assert answer["holders"] == [{"user": "ann", "who": "Ann at the desk"}, {"user": "bob", "who": "Bob"}]
    # Who holds nothing changes nothing.
    answer, heard = bench.order("release", "Cid", user="cid")
    assert (answer["released"], answer["estop"], of(m.Latched, heard)) == (False, "Ann at the desk and Bob", [])
    # It is the user who counts, not the connection or the name of it.
    answer, heard = bench.order("release", "Ann at the door", user="ann")
    assert (answer["released"], answer["estop"]) == (True, "Bob")
    assert of(m.Latched, heard) == [m.Latched("Bob", "Ann at the door", (("bob", "Bob"),), ("Ann at the desk",))]
    assert not can_move(bench)
    assert bench.path.with_suffix(".estop").read_text() == "Bob\tbob\n"
    bench.order("estop", "Ann again", user="ann")
    bench.end()
    second = ControlBench(make_rig(bench.rig.kit), bench.path)
    second.run(0.5)
    assert second.order("state")[0]["estop"] == "Bob and Ann again"
    second.order("release", "Bob", user="bob")
    assert not can_move(second)
    second.order("release", "Ann", user="ann")
    assert can_move(second)
    assert not bench.path.with_suffix(".estop").exists()
    second.end()


@pytest.mark.parametrize("more", [{"others": ["Ann", "bob"]}, {"everyone": True}])
def test_the_stops_of_others_are_released_by_name_or_all_and_the_parent_hears_who_did(
    bench: ControlBench, more: Say
) -> None:
    bench.order("estop", "Ann", user="ann")
    bench.order("estop", "Bob", user="bob")
    answer, heard = bench.order("release", "the tester", **more)
    assert (answer["released"], answer["estop"]) == (True, "")
    assert of(m.Latched, heard) == [m.Latched("", "the tester", (), ("Ann", "Bob"))]
    assert can_move(bench)


def test_another_user_of_the_machine_is_who_the_system_says_and_releases_nobody_else(
    bench: ControlBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.order("estop", "Ann", user="ann")
    monkeypatch.setattr("urbihw.buses.control.user_at", lambda connection: 4711)
    assert bench.order("release", "Ann", user="ann")[0]["released"] is False
    for more in ({"others": ["Ann"]}, {"everyone": True}):
        answer, _ = bench.order("release", "Ann", **more)
        assert answer == {
            "ok": False,
            "refused": True,
            "error": "only root and the user of the daemon may release the emergency stops of others: use sudo",
        }
    answer, _ = bench.order("estop", "somebody", user="ann")
    assert answer["holders"][1] == {"user": "uid 4711", "who": "somebody"}
    assert bench.order("release", "somebody")[0]["estop"] == "Ann"


def test_a_latch_of_nobody_known_is_released_by_anybody(rig: Rig, tmp_path: Path) -> None:
    (tmp_path / "robot.estop").write_text("the red button\n")
    bench = ControlBench(rig, tmp_path / "robot.sock")
    bench.run(0.5)
    assert bench.order("state")[0]["estop"] == "the red button"
    assert bench.order("release")[0]["estop"] == ""
    bench.end()


def test_more_users_than_are_kept_share_a_latch(bench: ControlBench) -> None:
    authority = bench.engine._authority
    for number in range(MOST_HOLDERS + 2):
        authority.latch(f"user {number}", f"user {number}")
    for number in range(MOST_HOLDERS):
        authority.release(f"user {number}")
    assert len(authority.holders) == 1
    # It is free when all who share it have released it: nobody else, and one of them alone, does not free it.
    assert authority.release("user 3") == ()
    assert authority.release("user 64") == ()
    assert len(authority.holders) == 1
    assert authority.release("user 65") == ("user 64, then user 65",)
    assert not authority.holders


def test_the_latch_that_users_share_takes_a_release_of_all_when_nobody_knows_whose_it_is(
    bench: ControlBench, make_rig: Callable[..., Rig]
) -> None:
    authority = bench.engine._authority
    for number in range(MOST_HOLDERS + 1):
        authority.latch(f"user {number}", f"user {number}")
    authority.keep_latches()
    bench.end()
    second = ControlBench(make_rig(bench.rig.kit), bench.path)
    second.run(0.1)
    assert "user 64" not in second.engine._authority.release("user 64")
    assert second.engine._authority.latched
    assert second.engine._authority.release("", everyone=True)
    second.end()


@pytest.mark.parametrize("size", [5000, 100_000])
@pytest.mark.parametrize("first", ["do", "who"])
@pytest.mark.parametrize("verb", ["stop", "estop"])
def test_a_stop_is_executed_whatever_its_name_is(bench: ControlBench, verb: str, first: str, size: int) -> None:
    bench.move(900)
    words = {"do": verb, "who": "x" * size}
    line = json.dumps({name: words[name] for name in sorted(words, reverse=first == "who")}).encode()
    caller = bench.call()
    caller.send(line + b'\n{"do": "state"}\n')
    bench.run(0.3)
    assert bench.register(GOAL) == pytest.approx(bench.register("present_position"), abs=3)
    answer, state = caller.hear()
    assert (answer["ok"], answer["do"]) == (True, verb)
    assert state["estop"] == ("x" * 100 if verb == "estop" else "")


def test_a_long_line_that_only_speaks_of_a_stop_is_none(bench: ControlBench) -> None:
    caller = bench.call()
    caller.send(json.dumps({"do": "state", "who": 'x"do": "estop"' * 500}).encode() + b"\n")
    bench.run(0.1)
    assert [answer["ok"] for answer in caller.hear()] == [False] and caller.ended
    assert bench.order("state")[0]["estop"] == ""


def test_a_stop_while_the_link_is_down_is_owed_and_says_so(bench: ControlBench) -> None:
    bench.move(900)
    bench.rig.end.unplug()
    bench.run(0.1)
    answer, _ = bench.order("stop")
    assert answer["link"] is False
    assert bench.register(GOAL) == 900
    bench.rig.end.replug()
    bench.run(3.0)
    assert bench.register(GOAL) != 900


def test_a_subscriber_hears_what_is_measured_and_what_happens(bench: ControlBench) -> None:
    bench.tell(m.Watch(6, ("present_position",)))
    caller = bench.call()
    caller.say("subscribe")
    bench.run(0.2)
    bench.order("estop", "another")
    bench.run(1.0)
    answer, *events = caller.hear()
    assert answer["ok"] and answer["do"] == "subscribe"
    kinds = {event["event"] for event in events}
    assert kinds == {"Samples", "Stopped", "Latched", "Statistics"}
    samples = [event for event in events if event["event"] == "Samples"]
    assert len(samples) > 100
    assert samples[-1]["values"] == {"6": {"present_position": bench.register("present_position")}}


def test_a_subscriber_that_leaves_disturbs_nobody(bench: ControlBench) -> None:
    bench.tell(m.Watch(6, ("present_position",)))
    for _ in range(3):
        caller = bench.call()
        caller.say("subscribe")
        bench.run(0.1)
        caller.close()
        assert bench.run(0.3)
    assert bench.order("state")[0]["ok"]


def test_a_worker_without_a_control_socket_works_and_says_so(rig: Rig, tmp_path: Path) -> None:
    bench = ControlBench(rig, tmp_path / "nowhere" / "robot.sock")
    refused, *others = bench.run(0.6)
    assert isinstance(refused, m.Refused) and refused.device == "control socket"
    assert of(m.Found, others)
    bench.end()


# ---------------------------------------------------------------- by itself


class Desk:
    """A control socket whose orders are answered."""

    def __init__(self, path: Path) -> None:
        self.now = 0.0
        self.control = ControlSocket(path, lambda: self.now)
        self._clock = BusRealClock()

    def serve(self) -> list[tuple[str, str]]:
        """Answer all that has come: verbs, and who asked."""
        served = []
        while ready := self._clock.wait_readable(self.control.descriptors(), 0.0):
            served += self.serve_once(ready)
            self.now += REST_S
        return served

    def serve_once(self, ready: list[int] | None = None) -> list[tuple[str, str]]:
        """The same for one look at the socket."""
        served = []
        for order in self.control.poll(ready or self._clock.wait_readable(self.control.descriptors(), 0.0)):
            order.client.subscribed |= order.verb == "subscribe"
            order.answer({})
            served.append((order.verb, order.who))
        return served


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    made = Desk(tmp_path / "robot.sock")
    yield made
    made.control.close()
    assert not made.control.path.exists()


@pytest.fixture
def call(desk: Desk) -> Iterator[Callable[[], Caller]]:
    made: list[Caller] = []

    def start() -> Caller:
        made.append(Caller(desk.control.path))
        desk.serve()
        return made[-1]

    yield start
    for caller in made:
        caller.close()


def test_a_flood_of_questions_does_not_hold_a_stop_up(desk: Desk, call: Callable[[], Caller]) -> None:
    *flooders, stopper = [call() for _ in range(16)]
    for flooder in flooders:
        flooder.socket.sendall(b'{"do": "health"}\n' * 200)
    stopper.socket.sendall(b'{"do": "stop", "who": "hand"}\n')
    # One question of each client, and the stop before them; then the clients that have asked rest.
    first = desk.serve_once()
    assert first[0] == ("stop", "hand")
    assert len(first) == 16
    assert desk.serve_once() == []
    desk.now += REST_S
    assert len(desk.serve_once()) == 15


@pytest.mark.parametrize("umask", [0o000, 0o022, 0o077])
def test_only_user_and_group_may_connect_whatever_the_umask_is(tmp_path: Path, umask: int) -> None:
    before = os.umask(umask)
    try:
        control = ControlSocket(tmp_path / "robot.sock", time.monotonic)
    finally:
        after = os.umask(before)
    assert after == umask
    assert stat.S_IMODE(control.path.stat().st_mode) == 0o660
    control.close()


def test_a_socket_that_a_killed_worker_left_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "robot.sock"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as dead:
        dead.bind(str(path))
    desk = Desk(path)
    caller = Caller(path)
    caller.say("state")
    assert desk.serve() == [("state", "a test")]
    assert caller.hear() == [{"ok": True, "do": "state"}]
    caller.close()
    desk.control.close()
    desk.control.close()


def test_the_socket_of_the_next_worker_outlives_the_one_before(tmp_path: Path) -> None:
    path = tmp_path / "robot.sock"
    before, after = ControlSocket(path, time.monotonic), ControlSocket(path, time.monotonic)
    before.close()
    assert path.is_socket()
    after.close()
    assert not path.exists()


def test_a_path_that_cannot_be_is_told(tmp_path: Path) -> None:
    with pytest.raises(Unavailable, match="No such file"):
        ControlSocket(tmp_path / "nowhere" / "robot.sock", time.monotonic)
    with pytest.raises(Unavailable):
        ControlSocket(tmp_path / ("x" * 200), time.monotonic)


GARBAGE = [
    b"stop",
    b"{",
    b"[]",
    b"null",
    b'"stop"',
    b"{}",
    b'{"do": "dance"}',
    b'{"do": null}',
    b'{"do": ["stop"]}',
    b'{"do": {"stop": 1}}',
    b"\xff\xfe\x00",
    b"[" * 3000,
    b"9" * 4000,
    b'{"do": "\\ud800"}',
]


@pytest.mark.parametrize("line", GARBAGE, ids=lambda line: repr(line[:20]))
def test_garbage_is_answered_by_an_error_and_the_next_line_counts(
    desk: Desk, call: Callable[[], Caller], line: bytes
) -> None:
    caller = call()
    caller.send(line + b'\n\n  \n{"do": "stop"}\n')
    assert desk.serve() == [("stop", "control socket")]
    error, answer = caller.hear()
    assert error["ok"] is False and error["error"]
    assert answer == {"ok": True, "do": "stop"}


def test_who_asks_is_one_short_line(desk: Desk, call: Callable[[], Caller]) -> None:
    caller = call()
    caller.say("stop", "a\nb\t" + "x" * 500)
    caller.send(b'{"do": "stop", "who": {"a": [1]}}\n')
    caller.say("stop", "\x1b[2Jme\ud800")
    (_, first), (_, second), (_, third) = desk.serve()
    assert first == ("a b " + "x" * 500)[:100]
    assert second == "control socket"
    assert third == "?[2Jme?"


def test_who_must_be_a_text_and_a_stop_is_obeyed_all_the_same(desk: Desk, call: Callable[[], Caller]) -> None:
    caller = call()
    caller.send(b'{"do": "estop", "who": ["x"]}\n')
    assert desk.serve() == [("estop", "control socket")]
    assert [line["ok"] for line in caller.hear()] == [True]
    caller.send(b'{"do": "release", "who": ["x"]}\n')
    assert desk.serve() == []
    assert caller.hear() == [{"ok": False, "error": '"who" must be a text'}]


def test_a_line_without_end_is_refused_and_its_writer_let_go(desk: Desk, call: Callable[[], Caller]) -> None:
    caller, other = call(), call()
    caller.send(b"x" * 10_000)
    assert desk.serve() == []
    assert caller.hear() == [{"ok": False, "error": f"a line has {MAX_LINE_BYTES} bytes at most"}]
    assert caller.ended
    other.say("stop")
    assert desk.serve() == [("stop", "a test")]


def test_a_line_in_pieces_is_one_line(desk: Desk, call: Callable[[], Caller]) -> None:
    caller = call()
    for byte in b'{"do": "estop", "who": "me"}':
        caller.send(bytes((byte,)))
        assert desk.serve() == []
    caller.send(b"\n")
    assert desk.serve() == [("estop", "me")]


def test_of_too_many_clients_the_oldest_go_and_the_newest_is_heard(desk: Desk, call: Callable[[], Caller]) -> None:
    callers = [call() for _ in range(20)]
    for caller in callers[-MAX_CLIENTS:]:
        caller.say("state")
    assert len(desk.serve()) == MAX_CLIENTS
    heard = [caller.hear() for caller in callers]
    refusal = {"ok": False, "error": "16 clients at most: this one was the oldest"}
    assert heard[:4] == [[refusal]] * 4
    assert all(line["ok"] for lines in heard[4:] for line in lines)
    assert [caller.ended for caller in callers] == [True] * 4 + [False] * MAX_CLIENTS


def test_many_that_come_and_go_are_all_heard(desk: Desk) -> None:
    for number in range(100):
        caller = Caller(desk.control.path)
        caller.say("stop", str(number))
        assert desk.serve() == [("stop", str(number))]
        assert caller.hear()
        caller.close()
    desk.serve()
    assert len(desk.control.descriptors()) == LISTENERS


def test_a_subscriber_that_does_not_read_loses_the_oldest_and_is_told_how_many(
    desk: Desk, call: Callable[[], Caller]
) -> None:
    caller = call()
    caller.say("subscribe")
    desk.serve()
    count = 5000
    for number in range(count):
        desk.control.publish(m.Samples(number, {n: {"present_position": number} for n in range(18)}, {}))
    assert caller.hear()[0] == {"ok": True, "do": "subscribe"}
    heard: list[Say] = []
    for number in range(count, count + 2 * MAX_QUEUED_LINES):
        desk.control.publish(m.Samples(number, {}, {}))
        heard += caller.hear()
    assert heard[-1]["time"] == count + 2 * MAX_QUEUED_LINES - 1
    dropped = sum(line.get("dropped", 0) for line in heard)
    assert dropped > count - 2 * MAX_QUEUED_LINES
    times = [line["time"] for line in heard]
    assert times == sorted(times)


def test_what_waits_for_a_subscriber_is_bounded(desk: Desk, call: Callable[[], Caller]) -> None:
    caller, reader = call(), call()
    for each in (caller, reader):
        each.say("subscribe")
    desk.serve()
    reader.hear()
    seen = 0
    for number in range(3000):
        desk.control.publish(m.Samples(number, {6: {"text": "x" * 2000}}, {}))
        seen += len(reader.hear())
    assert seen == 3000
    (slow, _) = desk.control._clients
    assert len(slow._waiting) <= MAX_QUEUED_LINES


def test_who_asks_without_end_and_never_reads_is_let_go(desk: Desk, call: Callable[[], Caller]) -> None:
    caller = call()
    for _ in range(200):
        try:
            caller.send(b'{"do": "state"}\n' * 200)
        except (BlockingIOError, BrokenPipeError, ConnectionResetError):
            break
        desk.serve()
        if len(desk.control.descriptors()) == LISTENERS:
            break
    assert len(desk.control.descriptors()) == LISTENERS
