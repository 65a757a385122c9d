"""Text that a client sent before the release of an emergency stop, and that runs after it, moves nothing.

Judged by the body of a simulated servo.
"""

from __future__ import annotations

import pytest
from bioloid_lab import BAUD, Lab
from test_release import FarDevice, horn, press, release

from urbihw.kernel import Kernel
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.uobject.arming import Arming
from urbihw_fakes.bioloid import Bioloid as Kit

MOVE = "try { motor6.val = 1 } catch {};"
WAITING = {
    "behind a sleep": [f"sleep(1s); {MOVE}"],
    "sent one after the other": ["sleep(1s);", MOVE],
    "in the background": ["sleep(1s); try { motor6.val = 1 } catch {},"],
    "at the end of a long text": ["sleep(1s);" + "1 | 2 | 3;\n" * 2000 + MOVE],
    "evaluated": ['sleep(1s); eval("motor6.val = 1;");'],
    "an at": ["sleep(1s); at (true) motor6.val = 1;"],
    "a loop": ["sleep(1s); loop { try { motor6.val = 1 } catch {}; sleep(50ms) };"],
    "a release of its own": ["sleep(1s); bioloid.estop = false; motor6.val = 1;"],
    "rearm": ["sleep(1s); bioloid.rearm; motor6.val = 1;"],
    "the first half of a statement": ["motor6.val"],
}
"""What a client sends before the release; the last one is completed after it."""


def small_lab() -> Lab:
    """A robot of two servos."""
    return Lab.ready(Kit(servos=(6, 7), sensors=(), baud=BAUD))


@pytest.mark.parametrize("when", ["before", "while"])
@pytest.mark.parametrize("how", WAITING)
def test_text_that_waits_is_as_old_as_it_is(how: str, when: str) -> None:
    lab = small_lab()
    other = lab.kernel.open_lobby("127.0.0.1")
    lab.run(0.3)
    if when == "before":
        for text in WAITING[how]:
            lab.say(text, 0.02)
    press(lab)
    if when == "while":
        for text in WAITING[how]:
            lab.say(text, 0.02)
    release(lab)
    if how == "the first half of a statement":
        lab.say(" = 1;\n")
    assert horn(lab, 2.0) < 1
    # What is sent now moves it, from this connection and from others.
    other.feed(b"motor6.val = -1;")
    assert horn(lab, 1.0) > 20
    if how != "a loop":
        lab.say("motor6.val = 1;")
        assert horn(lab, 1.0) > 20


def test_text_behind_a_release_is_ordered_with_it() -> None:
    lab = small_lab()
    press(lab)
    lab.say("bioloid.estop = false;\n" + "1 | 2 | 3;\n" * 2000 + "motor6.val = 1;")
    assert horn(lab, 1.0) > 20


OWN_RELEASES = {
    "detached": "detach({ sleep(1s); bioloid.estop = true; sleep(1s); bioloid.estop = false });",
    "in the background": "sleep(1s) | bioloid.estop = true | sleep(1s) | bioloid.estop = false,",
    "at": "var Global.t = 0|; at (t == 1) bioloid.estop = true; at (t == 2) bioloid.estop = false;"
    " detach({ sleep(1s); Global.t = 1; sleep(1s); Global.t = 2 });",
}


@pytest.mark.parametrize("how", OWN_RELEASES)
def test_a_release_in_the_background_orders_no_text_that_was_sent_before(how: str) -> None:
    lab = small_lab()
    lab.say(OWN_RELEASES[how], 0.3)
    lab.say("sleep(3s); motor6.val = 1;", 0.1)
    lab.run(1.2)
    assert lab.look("bioloid.estop") == "true"
    assert horn(lab, 3.0) < 1
    assert lab.look("bioloid.estop") == "false"
    lab.say("motor6.val = 1;")
    assert horn(lab, 1.0) > 20


@pytest.mark.parametrize(
    "text",
    [
        "bioloid.estop = false, motor6.val = 1;",
        "{ bioloid.estop = false & sleep(0.1s) }; motor6.val = 1;",
        "bioloid.estop = true; sleep(0.3s); bioloid.estop = false; motor6.val = 1;",
    ],
)
def test_text_behind_the_statement_that_releases_is_ordered_with_it(text: str) -> None:
    lab = small_lab()
    press(lab)
    lab.say(text)
    assert horn(lab, 1.5) > 20


def test_text_that_waits_does_not_release_the_stop_of_another_press() -> None:
    """Not even that of the same person, who has pressed beside the interpreter."""
    lab = small_lab()
    lab.say("sleep(1s); bioloid.estop = false;", 0.1)
    press(lab)
    lab.run(2.0)
    assert lab.look("bioloid.estop") == "true"
    assert "this was begun before the emergency stop" in lab.heard()
    lab.say("bioloid.estop = false;")
    assert lab.look("bioloid.estop") == "false"


def test_a_program_begun_before_the_stop_does_not_release_it() -> None:
    lab = small_lab()
    lab.say("detach({ every| (100ms) { try { bioloid.estop = false; motor6.val = 1 } catch {} } });", 0.3)
    lab.say("motor6.val = 0;", 0.5)
    press(lab)
    assert horn(lab, 1.0) < 1
    assert lab.look("bioloid.estop") == "true"


def test_a_program_may_release_what_it_has_pressed() -> None:
    lab = small_lab()
    lab.say("var Global.bumper = false|; at (bumper) bioloid.estop = true onleave bioloid.estop = false;", 0.3)
    lab.say("Global.bumper = true;", 0.3)
    assert lab.look("bioloid.estop") == "true"
    lab.say("Global.bumper = false;", 0.3)
    assert lab.look("bioloid.estop") == "false"


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("called", [False, True])
def test_what_a_remote_has_sent_before_waits_in_vain(called: bool, binary: bool) -> None:
    """A call of one of its functions is an order, but not of what it had sent before."""
    lab = small_lab()
    lab.run(0.1)
    far = FarDevice(lab, binary)
    far.run("sleep(1s)")
    far.run("try { motor6.val = 1 } catch {}")
    press(lab)
    release(lab)
    if called:
        lab.say("uobjects.far.go(),", 0.1)
    assert horn(lab, 2.0) < 1
    if called:
        far.run("motor6.val = -1")
        assert horn(lab, 1.0) > 20


def test_programs_that_have_ended_do_not_want_to_move() -> None:
    lab = small_lab()
    lab.say("var Global.t = Tag.new|; t: loop { try { motor6.val = 1 } catch {}; sleep(1s) },", 0.1)
    lab.say("sleep(1s); motor6.val = 1;", 0.1)
    press(lab)
    release(lab)
    lab.run(20.0)
    assert "programs of Lobby_1" in lab.look("robot.problems")
    lab.say("t.stop;")
    lab.run(25.0)
    assert lab.look("robot.problems") == "[]"


def test_presses_of_clients_that_have_gone_do_not_pile_up() -> None:
    kernel = Kernel(SimClock())
    arming = Arming(kernel.world, "robot")
    for _ in range(20):
        lobby = kernel.open_lobby()
        arming.press("anna", lobby)
        lobby.close()
        assert len(arming._presses) <= 2


def test_what_was_begun_before_the_press_of_a_client_that_has_gone_does_not_release_it() -> None:
    lab = small_lab()
    lab.say("sleep(2s); bioloid.estop = false;", 0.1)
    for _ in range(3):
        other = lab.kernel.open_lobby()
        lab.kernel.feed(other, b"bioloid.estop = true;")
        lab.run(0.1)
        other.close()
    lab.run(3.0)
    assert lab.look("bioloid.estop") == "true"
    lab.say("bioloid.estop = false;")
    assert lab.look("bioloid.estop") == "false"
