"""Programs that harm the others: one that holds the interpreter, one that takes all memory.  In real time."""

from __future__ import annotations

import asyncio
import logging
import re
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import FrameType

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.boot import KernelHooks
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.sched.job import Job
from urbihw.kernel.sched.scheduler import Scheduler
from urbihw.kernel.server import watchdog
from urbihw.kernel.server.bounds import MIB, NONE, Bounds, bounds, machine_memory
from urbihw.kernel.server.loop import LoopDriver
from urbihw.kernel.server.memory import GROWTH_MARGIN, MemoryAccount, ResidentMemory
from urbihw.kernel.uobject import UObject, function

pytestmark = pytest.mark.e2e

TIMEOUT_S = 60.0
HOLD = 0.2
HELD = "held the interpreter for more than 0.2 s: give way with ';' or sleep"
KILLED = "is ended: it held the interpreter on"


class Talk:
    """Two connections of a kernel that is driven like a server's."""

    def __init__(self, limits: Bounds) -> None:
        self.kernel = Kernel()
        self.driver = LoopDriver(self.kernel.scheduler, limits)
        self.lobby = self.kernel.open_lobby("127.0.0.1")
        self.other = self.kernel.open_lobby("127.0.0.1")
        self.driver.drive()

    def close(self) -> None:
        self.driver.close()
        self.kernel.close()

    def say(self, text: str, lobby: Lobby) -> None:
        """Send something."""
        lobby.feed(text.encode())
        self.driver.drive()

    async def ask(self, text: str, lobby: Lobby | None = None) -> str:
        """Send something; the first line that comes back, without its time."""
        lobby = self.lobby if lobby is None else lobby
        self.say(text, lobby)
        return (await self.heard(lobby))[0]

    async def heard(self, lobby: Lobby, wanted: str = "") -> list[str]:
        """The lines that come, up to one that has ``wanted`` in it."""
        lines: list[str] = []
        end = time.monotonic() + TIMEOUT_S
        while time.monotonic() < end:
            lines += [line.partition("] ")[2] for line in lobby.output.take_bytes().decode().splitlines()]
            if any(wanted in line for line in lines):
                return lines
            await asyncio.sleep(0.002)
        raise AssertionError(f"no answer but {lines}")


def played(scene: Callable[[Talk], object], limits: Bounds) -> None:
    """Play a scene, and leave the process as it was."""
    former = signal.getsignal(watchdog.SIGNAL)

    async def run() -> None:
        talk = Talk(limits)
        try:
            await scene(talk)  # type: ignore[misc]
        finally:
            talk.close()

    asyncio.run(run())
    assert signal.getsignal(watchdog.SIGNAL) is former
    assert sys.gettrace() is None


@pytest.fixture(autouse=True)
def hurry(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    monkeypatch.setattr(watchdog, "GRACE_SHARE", 1.0)
    caplog.set_level(logging.WARNING)


def logged(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [record.getMessage() for record in caplog.records if record.name == "urbihw.kernel"]


HOLDING = {
    "loop": ("loop| {};", "1.1-8"),
    "loop that calls": ('while| (true) { "a" + "b" };', ""),
    "for": ("for| (1e12) {};", ""),
    "calls": ("function fib(n) { if (n < 2) n else fib(n - 1) + fib(n - 2) }|; fib(60);", ""),
    "sorting": ("while| (true) { [3, 1, 2].sort(closure (a, b) { a < b }) };", ""),
    "in a branch": ("{ while| (true) 1 } & sleep(1s);", ""),
    "under a tag": ("var t = Tag.new|; t: while| (true) 1;", ""),
    "background": ("loop| {},", ""),
    "handler": ("var e = Event.new|; at (e?) loop| {}; e!;", ""),
    "condition": ("at ({ loop| {}; true }) 1;", ""),
    "printing": ("class A { function asString() { loop| {} } }|; A.new;", ""),
    "getter": ("var x = Object.new|; function x.y() { loop| {} }|; x.y;", ""),
    "eval": ('eval("loop| {};");', ""),
}


@pytest.mark.parametrize("kind", HOLDING)
def test_a_job_that_holds_the_interpreter_gets_an_error_with_its_place(
    kind: str, caplog: pytest.LogCaptureFixture
) -> None:
    text, place = HOLDING[kind]

    async def scene(talk: Talk) -> None:
        talk.say(text, talk.lobby)
        lines = await talk.heard(talk.lobby, HELD)
        (line,) = [line for line in lines if HELD in line]
        assert re.fullmatch(r"!!! (\S+ )?\d+\.\d+(-\d+(\.\d+)?)?: (\w+: )?" + re.escape(HELD), line)
        assert line.startswith(f"!!! {place}")
        assert await talk.ask("6 * 7;", talk.other) == "42"
        assert await talk.ask("40 + 2;") == "42"
        assert not any(KILLED in message for message in logged(caplog))

    played(scene, Bounds(hold_limit=HOLD))
    named = [message for message in logged(caplog) if "holds the interpreter" in message]
    assert len(named) == 1 and re.match(r"job \S+ holds the interpreter for more than 0.2 s at ", named[0])


@pytest.mark.parametrize("text", ["loop| {};", "loop| {},"])
def test_many_that_hold_at_once_hold_for_less_and_less(text: str) -> None:
    """The loop hears all of them at once, and a neighbour last, who has been quiet for as long as they."""
    many = 12

    async def scene(talk: Talk) -> None:
        crowd = [talk.kernel.open_lobby("127.0.0.1") for _ in range(many)]
        neighbour = talk.kernel.open_lobby("127.0.0.1")
        talk.driver.drive()
        loop = asyncio.get_running_loop()
        for lobby in crowd:
            loop.call_soon(talk.say, text, lobby)
        loop.call_soon(talk.say, "6 * 7;", neighbour)
        begun = time.process_time()
        await asyncio.sleep(0)
        # All are read after the first hold.
        assert neighbour.received and time.process_time() - begun < 2 * HOLD
        assert (await talk.heard(neighbour))[0] == "42"
        assert time.process_time() - begun < many / 2 * HOLD
        limits = {line for lobby in crowd for line in await talk.heard(lobby, "held the interpreter")}
        assert any("more than 0.2 s" in line for line in limits) and any("more than 0.03 s" in line for line in limits)

    played(scene, Bounds(hold_limit=HOLD))


def test_others_that_hold_take_nothing_from_a_client_that_stays_below_the_limit(
    caplog: pytest.LogCaptureFixture
) -> None:
    async def scene(talk: Talk) -> None:
        crowd = [talk.kernel.open_lobby("127.0.0.1") for _ in range(5)]
        assert await talk.ask("function work() { for| (var i : 1500000) { i + 1 } | 7 }|; 1;") == "1"
        begun = time.process_time()
        assert await talk.ask("work;") == "7"
        assert time.process_time() - begun > watchdog.SHORTEST_HOLD_S
        for lobby in crowd:
            talk.say("loop| {};", lobby)
            await talk.heard(lobby, "held the interpreter")
        for _ in range(watchdog.MAX_HOLDS):
            assert await talk.ask("work;") == "7"

    played(scene, Bounds(hold_limit=HOLD))


def test_the_error_can_be_caught_as_exception_scheduling() -> None:
    async def scene(talk: Talk) -> None:
        text = "try { loop| {} } catch (var e if e.isA(Exception.Scheduling)) { e.message };"
        assert await talk.ask(text) == f'"{HELD}"'

    played(scene, Bounds(hold_limit=HOLD))


STUBBORN = {
    "foreground": "loop| { try { loop| {} } catch {} };",
    "background": "loop| { try { loop| {} } catch {} },",
    "after the error": "try { loop| {} } catch { loop| {} },",
    "finally": "try { loop| {} } finally { loop| {} },",
    "the text of its error": "{ var o = Object.clone | function o.asString() { loop| { try { loop| {} } catch {} } } | "
                             "throw o },",
}


@pytest.mark.parametrize("kind", STUBBORN)
def test_a_job_that_holds_on_is_ended_and_its_connection_is_told(kind: str, caplog: pytest.LogCaptureFixture) -> None:
    async def scene(talk: Talk) -> None:
        talk.say(STUBBORN[kind], talk.lobby)
        await talk.heard(talk.lobby, KILLED)
        assert await talk.ask("6 * 7;", talk.other) == "42"
        assert await talk.ask("40 + 2;") == "42"
        assert talk.kernel.scheduler.shares.of(talk.lobby) == 1

    played(scene, Bounds(hold_limit=HOLD))
    assert len([message for message in logged(caplog) if "holds the interpreter" in message]) == 1


class SlowHooks(KernelHooks):
    """Frames are looked at for so long that the next signal comes; counts how many handlers are at it at a time."""

    def __init__(self) -> None:
        self.present = self.most = 0

    def is_program(self, frame: FrameType) -> bool:
        self.present += 1
        self.most = max(self.most, self.present)
        if self.present < 5:
            time.sleep(0.002)
        self.present -= 1
        return super().is_program(frame)


def test_signals_that_come_faster_than_they_are_handled_do_not_pile_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else the stack is used up: a machine with too much to do would lose the server."""
    monkeypatch.setattr(watchdog, "SIGNAL_RETRY_S", 0.0)
    monkeypatch.setattr(watchdog, "MAX_RUN_S", 0.001)
    hooks = SlowHooks()

    async def scene(talk: Talk) -> None:
        talk.kernel.scheduler.hooks = hooks
        talk.say("function f(n) { if (n > 20) { loop| {} } else f(n + 1) }|; f(0);", talk.lobby)
        await talk.heard(talk.lobby, HELD)
        assert await talk.ask("6 * 7;", talk.other) == "42"

    played(scene, Bounds(hold_limit=HOLD))
    assert hooks.most == 1


class Idler(UObject):
    """Something that takes time without using the processor, as any program does on a machine with much to do."""

    @function
    def idle(self) -> None:
        """Wait."""
        time.sleep(HOLD / 10)


def test_a_job_that_waits_for_the_processor_is_not_blamed() -> None:
    async def scene(talk: Talk) -> None:
        talk.kernel.host.register(Idler)
        assert await talk.ask("{ var i = Idler.new | for| (20) i.idle } | 7;") == "7"

    played(scene, Bounds(hold_limit=HOLD))


def test_who_gives_way_now_and_then_is_left_alone(caplog: pytest.LogCaptureFixture) -> None:
    async def scene(talk: Talk) -> None:
        talk.say("var n = 0|; loop { n += 1; 1 },", talk.lobby)
        await asyncio.sleep(4 * HOLD)
        assert await talk.ask("n > 10;") == "true"

    played(scene, Bounds(hold_limit=HOLD))
    assert logged(caplog) == []


def test_a_crowd_that_keeps_the_interpreter_busy_is_left_alone(caplog: pytest.LogCaptureFixture) -> None:
    """A round of many jobs takes longer than the limit, but none of them does."""
    async def scene(talk: Talk) -> None:
        talk.say("for& (300) { for (20) { for| (300) 1 } }; 1;", talk.lobby)
        assert (await talk.heard(talk.lobby, "1"))[-1] == "1"

    played(scene, Bounds(hold_limit=HOLD))
    assert logged(caplog) == []


def test_without_a_limit_it_is_only_named(caplog: pytest.LogCaptureFixture) -> None:
    async def scene(talk: Talk) -> None:
        assert await talk.ask("var began = time|; while| (time < began + 1.5) {}; 7;") == "7"

    played(scene, NONE)
    (message,) = logged(caplog)
    assert message.startswith("job shell_2 holds the interpreter for more than a second at ")


def test_bounds_of_a_server() -> None:
    assert bounds(1.0, 1, 5) == Bounds(1.0, MIB, 5)
    assert bounds(memory_limit=10**9).memory_limit == machine_memory() // 2
    assert bounds(memory_limit=0).memory_limit == 0


# ---------------------------------------------------------------- memory

GREEDY = {
    "foreground": 'var l = []|; loop| l << "x" * 1000;',
    "background": 'var l = []|; loop| l << "x" * 1000,',
    "that gives way": 'var l = []|; loop { for| (1000) l << "x" * 1000 },',
    "now and then": 'var l = []|; every| (2ms) for| (1000) l << "x" * 1000,',
    "large pieces": 'var l = []|; loop| l << "x" * 5000000;',
    "branches": 'var l = []|; loop { { for| (1000) l << "x" * 1000 } & sleep(0) },',
}


@pytest.mark.parametrize("kind", GREEDY)
def test_who_takes_all_memory_gets_an_error_and_its_neighbour_does_not(
    kind: str, caplog: pytest.LogCaptureFixture
) -> None:
    limit = _present() + 100 * MIB

    async def scene(talk: Talk) -> None:
        talk.say("var n = 0|; every (1ms) { n += 1 | [1, 2, 3].size | \"x\" * 1000 }, ", talk.other)
        talk.say(GREEDY[kind], talk.lobby)
        lines = await talk.heard(talk.lobby, "memory exhausted")
        # A crowd of short jobs is ended at once: the one that took most is over by then.
        wanted = r"!!! (\d+\.\d+(-\d+(\.\d+)?)?: )?memory exhausted" + (".*" if kind == "branches" else "")
        assert any(re.fullmatch(wanted, line) for line in lines)
        assert _present() < limit + 3 * GROWTH_MARGIN
        assert await talk.ask("40 + 2;") == "42"
        assert await talk.ask("n > 0;", talk.other) == "true"

    played(scene, Bounds(memory_limit=limit))
    assert any(message.startswith("memory exhausted: ") for message in logged(caplog))


def test_who_takes_on_is_ended(caplog: pytest.LogCaptureFixture) -> None:
    limit = _present() + 100 * MIB

    async def scene(talk: Talk) -> None:
        talk.say("var n = 0|; every (1ms) n += 1,", talk.other)
        talk.say('var l = []|; loop| { try { loop| l << "x" * 1000 } catch {} },', talk.lobby)
        await talk.heard(talk.lobby, "memory exhausted: all that this connection was running is ended")
        assert await talk.ask("40 + 2;") == "42"
        assert talk.kernel.scheduler.shares.of(talk.lobby) == 1
        assert _present() < limit + 3 * GROWTH_MARGIN
        assert await talk.ask("n > 0;", talk.other) == "true"
        assert talk.kernel.scheduler.shares.of(talk.other) > 1

    played(scene, Bounds(memory_limit=limit))


STEPS = {
    "large strings": 'var l = []|; loop { l << "x" * 30000000 | sleep(20ms) },',
    "one at a stroke": 'var l = []|; for| (6) l << "x" * 50000000; sleep(1h),',
    "lists": "var l = []|; loop { l << [1] * 4000000 | sleep(20ms) },",
    "from a file": 'var l = []|; loop { l << File.new("@FILE@").content },',
}


@pytest.mark.parametrize("kind", STEPS)
def test_the_jobs_of_a_neighbour_live_on_when_somebody_takes_memory_in_few_steps(
    kind: str, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    limit = _present() + 200 * MIB
    with (tmp_path / "large").open("wb") as file:
        file.truncate(30 * MIB)

    async def scene(talk: Talk) -> None:
        talk.say("var Global.level = 0|; var n = 0|; var m = 0|; at (Global.level > 1) m += 1; "
                 "every (10ms) { n += 1 | Global.level = n % 4 | [1, 2, 3].map(function (x) { x * x }) },", talk.other)
        await asyncio.sleep(0.1)
        talk.say(STEPS[kind].replace("@FILE@", str(tmp_path / "large")), talk.lobby)
        await talk.heard(talk.lobby, "memory exhausted")
        await asyncio.sleep(1.5)
        assert await talk.ask("40 + 2;", talk.other) == "42"
        # Both jobs go on.
        before = float(await talk.ask("n;", talk.other)), float(await talk.ask("m;", talk.other))
        assert await talk.ask(f"waituntil(n > {before[0]}) | waituntil(m > {before[1]}) | 7;", talk.other) == "7"

    played(scene, Bounds(memory_limit=limit))


def _present() -> int:
    resident = ResidentMemory()
    try:
        return resident()
    finally:
        resident.close()


class Account:
    """The account of a process whose size is made up: 1000 MiB are the limit."""

    def __init__(self) -> None:
        self.scheduler = Scheduler(SimClock())
        self.size = 500 * MIB
        self.time = 1.0
        self.memory = MemoryAccount(self.scheduler, 1000 * MIB, lambda: self.size, lambda: self.time)
        self.greedy = self.job("greedy")
        self.modest = self.job("modest")

    def job(self, context: str) -> Job:
        made = self.scheduler.spawn(lambda: self.scheduler.suspend(None), context, context)
        self.scheduler.run()
        return made

    def turn(self, job: Job, grows: int) -> None:
        """A turn of a job in which the process grows by so many MiB."""
        self.size += grows * MIB
        self.memory.charge_turn(job)


def near() -> Account:
    """An account near the limit."""
    account = Account()
    account.size = 800 * MIB
    assert not account.memory.is_over_limit()
    return account


def test_who_grew_the_process_most_is_blamed() -> None:
    account = near()
    account.turn(account.greedy, 150)
    account.turn(account.modest, 60)
    assert isinstance(account.greedy.pending, MemoryError)
    assert account.modest.pending is None


def test_who_is_found_running_while_there_is_plenty_is_charged_for_a_while(monkeypatch: pytest.MonkeyPatch) -> None:
    account = Account()
    account.size = 600 * MIB
    monkeypatch.setattr(account.scheduler, "current", account.modest)
    account.memory.is_over_limit()
    for _ in range(4):
        account.time += 2
        account.memory.is_over_limit()
    account.size = 1200 * MIB
    monkeypatch.setattr(account.scheduler, "current", account.greedy)
    account.memory.is_over_limit()
    monkeypatch.setattr(account.scheduler, "current", None)
    account.turn(account.modest, 20)
    assert isinstance(account.greedy.pending, MemoryError)
    assert account.modest.pending is None


def test_growth_between_two_turns_is_nobodys() -> None:
    account = near()
    for _ in range(20):
        account.size += 15 * MIB
        account.memory.begin()
        account.turn(account.modest, 0)
    assert account.modest.pending is None


def test_nobody_is_blamed_who_did_not_grow_it() -> None:
    account = Account()
    account.size = 1200 * MIB
    account.memory.is_over_limit()
    account.turn(account.modest, 0)
    account.turn(account.modest, 1)
    assert account.modest.pending is None


def test_each_turn_is_looked_at_only_near_the_limit() -> None:
    account = Account()
    assert (account.memory.is_over_limit(), account.memory.near) == (False, False)
    account.size = 800 * MIB
    assert (account.memory.is_over_limit(), account.memory.near) == (False, True)
    account.turn(account.modest, -400)
    assert not account.memory.near


def test_a_job_in_its_turn_is_not_to_be_left_for_what_another_took() -> None:
    account = near()
    account.turn(account.greedy, 150)
    account.size += 60 * MIB
    assert not account.memory.must_end(account.modest)
    account.turn(account.modest, 0)
    assert isinstance(account.greedy.pending, MemoryError)


def test_what_cannot_be_had_back_is_let_be() -> None:
    account = near()
    account.turn(account.greedy, 300)
    assert isinstance(account.greedy.pending, MemoryError)
    for _ in range(3):
        account.time += 2
        account.turn(account.modest, 1)
    assert account.modest.pending is None
    account.turn(account.modest, 20)
    assert account.modest.pending is None
    account.turn(account.modest, 20)
    assert isinstance(account.modest.pending, MemoryError)


LONG = {
    "closest": '"1999".closest(100000.map(function (var i) { i.asString }));',
    "difference": "([1] * 1e5) - ([2] * 1e5);",
    "subset": "1e5.seq.subset(1e5.seq);",
    "has": '{ var l = 1e5.seq | l.has(-1) | loop| l.has(-1) };',
    "printing what is shared": "{ var l = [1] | for| (60) l = [l, l] | l };",
    "printing tuples": "{ var l = (1, 2) | for| (60) l = (l, l) | l };",
    "printing dictionaries": '{ var l = ["a" => 1] | for| (60) l = ["a" => l, "b" => l] | l };',
    "comparing what is shared": "{ var l = [1] | var m = [1] | for| (60) { l = [l, l] | m = [m, m] } | l == m };",
    "text of what is shared": "{ var l = [1] | for| (60) l = [l, l] | l.asString.size };",
}


@pytest.mark.parametrize("kind", LONG)
def test_long_work_of_the_library_gives_way(kind: str) -> None:
    async def scene(talk: Talk) -> None:
        talk.say(LONG[kind], talk.lobby)
        await asyncio.sleep(HOLD / 2)
        for _ in range(5):
            assert await talk.ask("6 * 7;", talk.other) == "42"
            await asyncio.sleep(HOLD / 2)
        assert all(HELD not in line for line in talk.lobby.output.take_bytes().decode().splitlines())

    played(scene, Bounds(hold_limit=HOLD))


def test_a_recursion_that_is_caught_is_left_too() -> None:
    async def scene(talk: Talk) -> None:
        talk.say("function f() { try { f() } catch { f() } }|; f();", talk.lobby)
        await talk.heard(talk.lobby, "held the interpreter")
        assert await talk.ask("6 * 7;", talk.other) == "42"
        assert await talk.ask("40 + 2;") == "42"

    played(scene, Bounds(hold_limit=HOLD))


def test_who_reads_a_stream_that_never_ends_holds_nothing() -> None:
    async def scene(talk: Talk) -> None:
        typed = 'var Global.p = Process.new("yes", [])|; p.run; sleep(500ms); p.stdout.asList.size > 0;'
        talk.say(typed, talk.lobby)
        await asyncio.sleep(0.5 + 2 * HOLD)
        assert await talk.ask("6 * 7;", talk.other) == "42"
        talk.say("p.kill;", talk.other)
        assert talk.lobby.output.take_bytes() == b"", "nobody was told that it held the interpreter"
        await asyncio.sleep(0.1)

    played(scene, Bounds(hold_limit=HOLD))


WITHOUT_PLACE = {
    "slots": 'var o = Object.new|; for| (var i : 1e9) o.setSlot("s" + i, i);',
    "prototypes": "var o = Object.new|; for| (1e9) o.addProto(Object.new);",
    "detached": "for| (var i : 1e9) detach({ i });",
}


@pytest.mark.parametrize("kind", WITHOUT_PLACE)
def test_the_place_is_told_wherever_a_job_is_broken_into(kind: str, caplog: pytest.LogCaptureFixture) -> None:
    """CPython writes jumps of its own, which stand on no line."""
    async def scene(talk: Talk) -> None:
        talk.say(WITHOUT_PLACE[kind], talk.lobby)
        lines = await talk.heard(talk.lobby, "!!!")
        assert not any("internal error" in line for line in lines)
        assert await talk.ask("6 * 7;", talk.other) == "42"

    played(scene, Bounds(hold_limit=HOLD))
    assert not any("bug" in message for message in logged(caplog))


def test_who_is_ended_for_holding_on_is_told_once() -> None:
    async def scene(talk: Talk) -> None:
        talk.say(STUBBORN["foreground"], talk.lobby)
        lines = await talk.heard(talk.lobby, KILLED)
        talk.say("6 * 7;", talk.lobby)
        lines += await talk.heard(talk.lobby, "42")
        assert len([line for line in lines if line.startswith("!!!")]) == 1

    played(scene, Bounds(hold_limit=HOLD))


def test_who_holds_the_interpreter_again_and_again_keeps_nothing_that_could() -> None:
    async def scene(talk: Talk) -> None:
        talk.say("var Global.e = Event.new|; var Global.n = 0|; at (Global.e?) { n += 1 | loop| {} };", talk.lobby)
        talk.say("every (100ms) { Global.e! },", talk.other)
        await talk.heard(talk.lobby, "all that this connection runs is ended: it held the interpreter 3 times")
        before = await talk.ask("Global.n;", talk.other)
        await asyncio.sleep(0.5)
        assert await talk.ask("Global.n;", talk.other) == before
        assert await talk.ask("40 + 2;") == "42"

    played(scene, Bounds(hold_limit=HOLD))
