"""A program with timers, tags, events, conditions, exceptions and jobs ends with the objects it began with."""

from __future__ import annotations

import gc
from collections import Counter

from urbihw.kernel import Kernel

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


def alive() -> Counter[str]:
    """How many objects of each class there are."""
    gc.collect()
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
