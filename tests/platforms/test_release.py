"""What may move a robot after the release of an emergency stop: what is ordered then, and nothing that was before.

Judged by the body of a simulated servo.
"""

from __future__ import annotations

import pytest
from bioloid_lab import Lab

from urbihw.buses import messages as m

PROGRAMS = {
    "loops that catch": "for (var i : 20) detach({ loop { try { motor6.val = 1 } catch {}; sleep(50ms) } });",
    "every": "detach({ every| (100ms) { try { motor6.val = 1 } catch {} } });",
    "at": "at (motor7.val > 0.3) motor6.val = 1;",
    "handler of an event that a loop emits": "var Global.e = Event.new|; at (e?) motor6.val = 1;"
    " detach({ loop { e!; sleep(100ms) } });",
}


def horn(lab: Lab, seconds: float) -> float:
    """How far servo 6 turns in this time: degrees."""
    servo, places = lab.kit.servo(6), []
    for _ in range(round(seconds / lab.tick)):
        lab.run(lab.tick)
        places.append(servo.position)
    return (max(places) - min(places)) * 300 / 1024


def press(lab: Lab, who: str = "a red button") -> None:
    """Somebody presses a button beside the interpreter."""
    assert lab.worker is not None
    lab.worker.send(m.EmergencyStop(who))
    lab.run(0.3)
    assert lab.look("bioloid.estop") == "true"


def release(lab: Lab) -> None:
    """Somebody releases it there."""
    assert lab.worker is not None
    lab.worker.send(m.Release("a red button"))
    lab.run(0.1)
    assert lab.look("bioloid.estop") == "false"


@pytest.mark.parametrize("when", ["before", "while"])
@pytest.mark.parametrize("name", PROGRAMS)
def test_what_began_before_the_release_moves_nothing_until_it_is_armed_again(name: str, when: str) -> None:
    lab = Lab.ready()
    lab.run(0.5)
    if when == "before":
        lab.say(PROGRAMS[name], 0.3)
    press(lab)
    if when == "while":
        lab.say(PROGRAMS[name], 0.3)
    release(lab)
    lab.kit.servo(7).position = 700.0  # a hand; the condition of ``at`` becomes true
    assert horn(lab, 2.0) < 1
    # What is ordered now does, and so does the old program when that is wanted.
    lab.say("motor6.val = -1;", 1.5)
    assert lab.number("motor6.val") == pytest.approx(-1.0, abs=0.05)
    lab.kit.servo(7).position = 300.0
    assert horn(lab, 0.3) < 1
    lab.say("bioloid.rearm;")
    lab.kit.servo(7).position = 700.0
    assert horn(lab, 1.0) > 20


def test_who_releases_may_move_and_what_an_order_triggers_too() -> None:
    lab = Lab.ready()
    lab.say("var Global.e = Event.new|; at (e?(var goal)) motor6.val = goal;", 0.2)
    press(lab)
    lab.say("bioloid.estop = false; motor6.val = 1;", 1.5)
    assert lab.number("motor6.val") == pytest.approx(1.0, abs=0.05)
    lab.say("e!(-1);", 2.0)
    assert lab.number("motor6.val") == pytest.approx(-1.0, abs=0.05)
