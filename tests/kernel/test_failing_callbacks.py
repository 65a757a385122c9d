"""An error in whatever the kernel calls back is reported once; all others go on, and nothing stays behind."""

from __future__ import annotations

import gc
import re
from collections import Counter

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.sched.signals import JobKilled

CALLBACKS = {
    # conditions and events
    "body of at": 'var x = 0; at (x > 1) throw "boom"; at (x > 1) echo("other"); x = 2;',
    "body of at on an event": 'var e = Event.new; at (e?) throw "boom"; at (e?) echo("other"); e!;',
    "body of at sync": 'var x = 0; at sync (x > 1) throw "boom"; at sync (x > 1) echo("other"); x = 2;',
    "body of at sync on an event": 'var e = Event.new; at sync (e?) throw "boom"; at sync (e?) echo("other"); e!;',
    "onleave of at sync":
        'var e = Event.new; at sync (e?) {} onleave throw "boom"; at sync (e?) {} onleave echo("other"); e!;',
    "body after a while": 'var x = 0; at (x > 1 ~ 1s) throw "boom"; at (x > 1 ~ 1s) echo("other"); x = 2; sleep(2s);',
    "onleave": 'var x = 2; at (x > 1) {} onleave throw "boom"; at (x > 1) {} onleave echo("other"); x = 0;',
    "onleave of an event":
        'var e = Event.new; at (e?) {} onleave throw "boom"; at (e?) {} onleave echo("other"); e!;',
    "onleave of what is stopped": 'var t = Tag.new; var x = 2; t: at (x > 1) {} onleave throw "boom"; t.stop;',
    "condition": 'var x = 0; at ({ if (x == 2) throw "boom" | x > 1 }) 1; at (x > 1) echo("other"); x = 2;',
    "condition at first": 'var x = 0; detach({ at ({ x | throw "boom" | true }) 1 })|; x = 1; x = 2;',
    "guard": 'var e = Event.new; at (e?(var v) if { throw "boom" | true }) 1; at (e?(var v)) echo("other"); e!(1);',
    "whenever": 'var x = 0; whenever (x > 1) throw "boom"; at (x > 1) echo("other"); x = 2;',
    "condition of whenever":
        'var x = 0; whenever ({ if (x == 2) throw "boom" | x > 1 }) 1; at (x > 1) echo("other"); x = 2;',
    "else of whenever": 'whenever (false) 1 else throw "boom";',
    "whenever on an event": 'var e = Event.new; whenever (e?) throw "boom"; at (e?) echo("other"); e!;',
    "condition of waituntil":
        'var x = 0; detach({ waituntil ({ if (x == 2) throw "boom" | x > 1 }) })|; '
        'sleep(1s);at (x > 1) echo("other"); x = 2;',
    "guard of waituntil":
        'var e = Event.new; detach({ waituntil (e?(var v) if { throw "boom" | true }) })|; '
        'sleep(1s);at (e?(var v)) echo("other"); e!(1);',
    "condition of stopif":
        'var x = 0; detach({ stopif ({ if (x == 2) throw "boom" | x > 1 }) sleep(1h) })|; '
        'sleep(1s);at (x > 1) echo("other"); x = 2;',
    "condition of freezeif":
        'var x = 0; detach({ freezeif ({ if (x == 2) throw "boom" | x > 1 }) sleep(1h) })|; '
        'sleep(1s);at (x > 1) echo("other"); x = 2;',
    "onSubscribe":
        'var e = Event.new; var e.onSubscribe = Event.new; '
        'at (e.onSubscribe?) throw "boom";at (e.onSubscribe?) echo("other"); at (e?) 1;',
    "changed":
        'var o = Object.new; var o.a = 1; at (o.a->changed?) throw "boom"; '
        'at (o.a->changed?) echo("other"); o.a = 3;',
    # tags
    "enter": 'var t = Tag.new; at (t.enter?) throw "boom"; at (t.enter?) echo("other"); t: 1;',
    "leave": 'var t = Tag.new; at (t.leave?) throw "boom"; at (t.leave?) echo("other"); t: 1;',
    "finally": 'detach({ try { 1 } finally { throw "boom" } })|;',
    "finally of what failed": 'detach({ try { throw 1 } finally { throw "boom" } })|;',
    "finally of what is stopped":
        'var t = Tag.new; detach({ t: try { sleep(1h) } finally { throw "boom" } })|; sleep(1s); t.stop;',
    "under a mutex": 'var m = Mutex.new; detach({ m: throw "boom" })|; m: echo("other");',
    "under a timeout": 'detach({ timeout (1h) throw "boom" })|;',
    # jobs and time
    "every": 'detach({ every (1s) throw "boom" })|; every (1s) { echo("other") | break };',
    "every|": 'detach({ every| (1s) throw "boom" })|; sleep(2s);',
    "job in the background": 'detach({ { throw "boom" }, sleep(1h) })|; sleep(1s);',
    "branch": 'detach({ throw "boom" & sleep(1h) })|; sleep(1s);',
    "turn of for&": 'detach({ for& (var i : [1, 2, 3]) { if (i == 2) throw "boom" | sleep(1h) } })|; sleep(1s);',
    "each&": "detach({ [1, 2, 3].'each&'(closure (i) { if (i == 2) throw \"boom\" | sleep(1h) }) })|; sleep(1s);",
    # what the library calls
    "asString": 'class A { function asString() { throw "boom" } }; detach({ echo(A) })|;',
    "asPrintable": 'class A { function asPrintable() { throw "boom" } }; detach({ echo([A]) })|;',
    "comparator": 'detach({ [3, 1, 2].sort(closure (a, b) { throw "boom" }) })|;',
    "'<' of what is sorted": "class A { function '<'(x) { throw \"boom\" } }; detach({ [A.new, A.new].sort() })|;",
    "'==' of what is looked for": "class A { function '=='(x) { throw \"boom\" } }; detach({ 1 in [A.new] })|;",
    "function of each": 'detach({ [3, 1, 2].each(closure (a) { throw "boom" }) })|;',
    "function of map": 'detach({ [3, 1, 2].map(closure (a) { throw "boom" }) })|;',
    "init": 'class A { function init() { throw "boom" } }; detach({ A.new })|;',
    "fallback": 'class A { function fallback { throw "boom" } }; detach({ A.foo })|;',
    "channel": "class C : Channel { function '<<'(x) { throw \"boom\" } }; detach({ C << 1 })|;",
    "pattern": "class A { function '=='(x) { throw \"boom\" } }; detach({ switch (1) { case A.new: 2 } })|;",
    "lazy argument": 'function lazy { call.evalArgAt(0) }; detach({ lazy({ throw "boom" }) })|;',
}  # fmt: skip


class Talk:
    """A connection and its neighbour."""

    def __init__(self) -> None:
        self.kernel = Kernel(fast=True)
        self.lobby = self.kernel.open_lobby("127.0.0.1")
        self.other = self.kernel.open_lobby("127.0.0.1")

    def say(self, text: str, lobby: Lobby | None = None) -> list[str]:
        """Send something and let two hours pass; what comes back, without time stamps and call stacks."""
        until = self.kernel.clock.now() + 7200
        lines = self.kernel.run_text(lobby or self.lobby, text, until).splitlines()
        return [re.sub(r"^\[\d+", "[", line) for line in lines if "called from" not in line]

    def census(self) -> Counter[str]:
        """What a callback might leave behind."""
        gc.collect()
        kinds = (
            "Job", "Carrier", "ConditionWatch", "Subscription", "AtExpression", "Edge", "TagEntry", "Waiter",
            "Emission",
        )  # fmt: skip
        found = Counter(type(thing).__name__ for thing in gc.get_objects() if type(thing).__name__ in kinds)
        found.update(jobs=len(self.kernel.scheduler.jobs), timers=len(self.kernel.scheduler.timers))
        return found


@pytest.fixture(scope="module")
def talk(few_objects: None) -> Talk:
    """All tests talk to one kernel."""
    return Talk()


@pytest.mark.parametrize("kind", CALLBACKS)
def test_an_error_in_a_callback_is_told_once_and_hurts_nobody(talk: Talk, kind: str) -> None:
    program = CALLBACKS[kind]
    text = "{ " + program + ' echo("on") };'
    expected = ["[:error] !!! boom", "[] *** on", *["[] *** other"] * ("other" in program)]
    for _ in range(3):
        assert sorted(talk.say(text)) == sorted(expected)
    before = talk.census()
    for _ in range(5):
        talk.say(text)
    assert talk.census() == before
    assert talk.say("40 + 2;") == ["[] 42"]
    assert talk.say("6 * 7;", talk.other) == ["[] 42"]


def test_an_error_at_a_disconnection_is_told_once_and_hurts_nobody(talk: Talk) -> None:
    program = 'at (Lobby.onDisconnect?) throw "boom"; at (Lobby.onDisconnect?) echo("other");'
    assert talk.say("var t = Tag.new|; t: {" + program + " sleep(1000h) },") == []

    def leave() -> None:
        leaver = talk.kernel.open_lobby("127.0.0.1")
        talk.say("1;", leaver)
        leaver.close()
        assert sorted(talk.say("")) == ["[:error] !!! boom", "[] *** other"]

    leave()
    before = talk.census()
    for _ in range(3):
        leave()
    assert talk.census() == before
    talk.say("t.stop;")


def test_a_signal_in_a_notification_loses_no_other() -> None:
    kernel = Kernel(SimClock())
    done: list[str] = []

    def hold() -> None:
        done.append("held")
        raise JobKilled

    for action in (hold, lambda: done.append("second"), hold, lambda: done.append("last")):
        kernel.world.call_soon(action)
    kernel.run()
    assert done == ["held", "second", "held", "last"]
