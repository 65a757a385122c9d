"""Programs with timers, tags, events, conditions, exceptions and jobs end with the objects they began with."""

from __future__ import annotations

import gc
import tracemalloc
from collections import Counter

import pytest

from urbihw.kernel import Kernel

pytestmark = pytest.mark.usefixtures("few_objects")

PROGRAM = """
function once()
{
  var e = Event.new; at (e?(var x)) { x }; e!(1);
  var t = Tag.new; t: every (100ms) { 1 },
  var y = 0; at (y > 2) { 1 } onleave { 2 }; y = 5; y = 0;
  sleep(250ms); t.stop;
  try { throw 1 } catch (var z) { z };
  var o = Object.new; var o.s = [1, 2]; o.s << 3;
  waituntil (y == 0); timeout (10ms) sleep(1s);
  { 1 & 2 }; "a" + "b";
  var m = Mutex.new; m: { 1 };
  detach({ sleep(1ms) })|; 42.uid
}|;
"""


def collect() -> None:
    """Take back all garbage: a kernel that is taken back ends its jobs, which are garbage only then."""
    for _ in range(3):
        gc.collect()


def alive() -> Counter[str]:
    """How many objects of each class there are."""
    collect()
    return Counter(type(thing).__name__ for thing in gc.get_objects())


def test_nothing_is_left_behind() -> None:
    kernel = Kernel(fast=True)
    lobby = kernel.open_lobby()
    assert kernel.run_text(lobby, PROGRAM) == ""
    kernel.run_text(lobby, "for (1200) once;")  # fills the bounded memories
    before = alive()
    kernel.run_text(lobby, "for (300) once;")
    after = alive()
    grown = {name: after[name] - before[name] for name in after if after[name] - before[name] > 30}
    assert grown == {}
    assert len(kernel.scheduler.jobs) == 1
    assert len(kernel.scheduler.timers) == 0


HOUR = """
var Global.ticks = 0|; var Global.level = 0|; var Global.alarm = Event.new|; var Global.work = Tag.new|;
var Global.seen = 0|; var Global.heard = 0|; var Global.kept = []|;
work: every (100ms) { ticks += 1 | level = (level + 1) % 10 },
work: at (level > 7) { seen += 1 } onleave { seen += 1 },
work: at (level == 3 ~ 50ms) { alarm!(ticks) },
work: at (alarm?(var t) if t % 2 == 1) { var s = "at " + t; kept << s | if (kept.size > 20) kept.clear },
work: whenever (level == 5) { sleep(50ms) },
work: every (1s) { timeout (300ms) { sleep(1s) } | try { throw "no" } catch (var e) { heard += 1 } },
work: every (7s) { var t = Tag.new; detach({ t: sleep(1h) })|; sleep(2s); t.stop },
work: every (5s) { { sleep(1s) & sleep(2s) } | waituntil (level == 1) | echo("alive") },
work: every (11s) { var o = Object.clone; var o.x = 1; at (o.x == 2) 1; o.x = 2; var y = 0; y = 5 time: 500ms },
"""


def test_an_hour_takes_no_memory() -> None:
    """Simulated: some 300 000 turns of jobs.  Memory is looked at when the bounded stores are full."""
    kernel = Kernel(fast=True)
    lobby = kernel.open_lobby()
    answers = kernel.run_text(lobby, HOUR, until=600)
    assert "alive" in answers
    assert "error" not in answers
    collect()
    before, objects = alive(), len(kernel.scheduler.jobs)
    tracemalloc.start()
    try:
        kernel.run_text(lobby, "", until=1200)
        collect()
        held, _ = tracemalloc.get_traced_memory()
        for minute in range(21, 61):
            kernel.run_text(lobby, "", until=minute * 60)
        collect()
        grown = tracemalloc.get_traced_memory()[0] - held
    finally:
        tracemalloc.stop()
    after = alive()
    more = {name: after[name] - before[name] for name in after if after[name] - before[name] > 60}
    assert more == {}
    assert grown < 200_000
    assert abs(len(kernel.scheduler.jobs) - objects) <= 3
    assert len(kernel.scheduler.timers) < 20
    assert kernel.run_text(lobby, "ticks;", until=3600.05).split()[-1] == "36001"
    kernel.run_text(lobby, "work.stop;", until=3700)
    assert len(kernel.scheduler.jobs) == 1
    assert len(kernel.scheduler.timers) == 0
