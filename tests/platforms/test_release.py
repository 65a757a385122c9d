"""What may move a robot after the release of an emergency stop: what is ordered then, and nothing that was before.

Judged by the body of a simulated servo.
"""

from __future__ import annotations

import pytest
from bioloid_lab import Lab

from urbihw.buses import messages as m
from urbihw.kernel.uobject import UObject, function
from urbihw.kernel.uremote.frames import SIZES, EmitRequest, ProgramText, Update, encode

PROGRAMS = {
    "loops that catch": "for (var i : 100) detach({ loop { try { motor6.val = 1 } catch {}; sleep(50ms) } });",
    "every": "detach({ every| (100ms) { try { motor6.val = 1 } catch {} } });",
    "at": "at (motor7.val > 0.3) motor6.val = 1;",
    "handler of an event that a loop emits": "var Global.e = Event.new|; at (e?) motor6.val = 1;"
    " detach({ loop { e!; sleep(100ms) } });",
    "rearm by itself": "detach({ every| (100ms) { try { bioloid.rearm; motor6.val = 1 } catch {} } });",
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
    lab = Lab.small(6, 7)
    lab.run(0.5)
    if when == "before":
        lab.say(PROGRAMS[name], 0.3)
    press(lab)
    if when == "while":
        lab.say(PROGRAMS[name], 0.3)
    release(lab)
    lab.kit.servo(7).position = 700.0  # a hand; the condition of ``at`` becomes true
    assert horn(lab, 2.0) < 1
    # They are told, also to who has not begun them, as in the panel.
    assert lab.heard().count("warning: bioloid: an emergency stop was released after this program had begun") == 1
    assert "programs of Lobby_1, begun before the emergency stop, want to move" in lab.look("robot.problems")
    # What is ordered now does, and so does the old program when that is wanted.
    lab.say("motor6.val = -1;", 1.5)
    assert lab.number("motor6.val") == pytest.approx(-1.0, abs=0.05)
    lab.kit.servo(7).position = 300.0
    assert horn(lab, 0.3) < 1
    lab.say("bioloid.rearm;")
    assert lab.look("robot.problems") == "[]"
    lab.kit.servo(7).position = 700.0
    assert horn(lab, 1.0) > 20


@pytest.mark.parametrize("typist", ["Lobby.create", "lobby"])
def test_what_a_program_types_is_as_old_as_that_program(typist: str) -> None:
    lab = Lab.small(6, 7)
    text = f'var L = {typist}|; every (99ms) {{ try {{ L.receive("motor6.val = (time*5).sin;\\n") }} catch {{}} }},'
    lab.say(text, 0.3)
    press(lab)
    release(lab)
    assert horn(lab, 1.0) < 1
    lab.say("bioloid.rearm;")
    assert horn(lab, 1.0) > 20


def test_who_releases_may_move_and_what_an_order_triggers_too() -> None:
    lab = Lab.small(6, 7)
    lab.say("var Global.e = Event.new|; at (e?(var goal)) motor6.val = goal;", 0.2)
    press(lab)
    lab.say("bioloid.estop = false; motor6.val = 1;", 1.5)
    assert lab.number("motor6.val") == pytest.approx(1.0, abs=0.05)
    lab.say("e!(-1);", 2.0)
    assert lab.number("motor6.val") == pytest.approx(-1.0, abs=0.05)


def test_a_servo_that_is_on_obeys_after_a_stop_has_taken_a_second_switching_on() -> None:
    lab = Lab.small(6, 7)
    lab.say("motor6.load = 1;", 0.3)
    lab.say("motor6.load = 1; robot.stop;", 0.3)
    lab.say("motor6.val = 0.5;", 1.5)
    assert lab.number("motor6.val") == pytest.approx(0.5, abs=0.05)
    lab.say("motor6.load = 0;", 0.3)
    lab.say("motor6.load = 1; robot.stop;", 0.3)
    lab.say("motor6.val = 1;", 1.5)
    assert lab.number("motor6.val") == pytest.approx(0.5, abs=0.05)
    assert lab.number("motor6.load") == 0


@pytest.mark.parametrize("when", ["before", "while"])
@pytest.mark.parametrize("waiting", [
    "at (!bioloid.estop) motor6.val = 1;",
    "at (bioloid.estop) {} onleave motor6.val = 1;",
    "whenever (!bioloid.estop) { motor6.val = 1 | sleep(100ms) };",
])  # fmt: skip
def test_the_release_itself_orders_nothing_of_those_who_wait_for_it(waiting: str, when: str) -> None:
    lab = Lab.small(6, 7)
    other = lab.kernel.open_lobby("127.0.0.1")
    lab.say("motor6.load = 1;", 0.3)
    if when == "before":
        lab.say("bioloid.estop = true;", 0.2)
        other.feed(waiting.encode())
    else:
        other.feed(waiting.encode())
        lab.run(1.0)
        lab.say("bioloid.estop = true;", 0.2)
    lab.run(0.3)
    here = lab.number("motor6.val")
    lab.say("bioloid.estop = false;", 1.5)
    assert lab.number("motor6.val") == pytest.approx(here, abs=0.02)


# ---------------------------------------------------------------- devices that are programs


class FarDevice:
    """A device in another process, ``far``, with the variable ``val`` and the event ``seen``."""

    def __init__(self, lab: Lab, binary: bool) -> None:
        self._lab = lab
        self._binary = binary
        self.lobby = lab.kernel.open_lobby("127.0.0.1")
        made = "class far{}|external object far|var far.val = 0|external var far.val from far|var far.seen = Event.new|"
        self.lobby.feed(made.encode() + b"external function (0) far.go from far|;")
        if binary:
            self.lobby.feed(b'binaryMode(1, "b")|;\n')
            lab.run(0)
            self.lobby.feed(SIZES)
        lab.run(0.02)

    def tell(self, value: float) -> None:
        """Report a value, and emit the event."""
        if self._binary:
            self._send(Update("far.val", value, 0), EmitRequest("far.seen", []))
        else:
            self.lobby.feed(f'far.getSlot("val").update_timed({value}, 0)|;far.seen!|;\n'.encode())
        self._lab.run(0.02)

    def run(self, text: str) -> None:
        """Run urbiscript at the server."""
        if self._binary:
            self._send(ProgramText(f"{text}|;"))
        else:
            self.lobby.feed(f"{text}|;\n".encode())
        self._lab.run(0.02)

    def _send(self, *frames: Update | EmitRequest | ProgramText) -> None:
        self.lobby.feed(b"".join(bytes(part) for frame in frames for part in encode(frame)))


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("called", [False, True])
def test_values_and_events_of_a_remote_device_are_no_orders(called: bool, binary: bool) -> None:
    lab = Lab.small(6, 7)
    lab.run(0.1)
    far = FarDevice(lab, binary)
    handlers = "at (uobjects.far.val > 1) motor6.val = 1; at (uobjects.far.seen?) motor6.val = 1;"
    lab.say(handlers + "loop { waituntil (uobjects.far.val > 1); try { motor6.val = 1 } catch {}; sleep(20ms) },", 0.2)
    press(lab)
    release(lab)
    if called:
        lab.say("uobjects.far.go(),", 0.1)
    far.tell(2.0)
    far.tell(0.0)
    far.tell(3.0)
    assert horn(lab, 0.3) < 1
    # What is set up now may be woken by it.
    lab.say("at (uobjects.far.val < 1) motor6.val = -1;", 0.2)
    far.tell(0.0)
    assert horn(lab, 0.5) > 20


@pytest.mark.parametrize("binary", [False, True])
def test_a_remote_program_that_moves_the_robot_waits_for_an_order(binary: bool) -> None:
    """It is one program, which began when it joined; a call of its functions is an order."""
    lab = Lab.small(6, 7)
    lab.run(0.1)
    far = FarDevice(lab, binary)
    far.run("motor6.val = 1")
    assert horn(lab, 0.5) > 20
    press(lab)
    release(lab)
    for _ in range(20):
        far.run("try { motor6.val = -1 } catch {}")
    assert horn(lab, 0.3) < 1
    # A call is one.
    lab.say("uobjects.far.go(),", 0.1)
    far.run("motor6.val = -1")
    assert horn(lab, 0.5) > 20


class Tracker(UObject):
    """A device in the server that moves the robot by itself, and when it is told to."""

    def init(self) -> None:
        self.set_timer(0.1, self.act)
        self.active, self.by_text = True, False

    def act(self) -> None:
        """Follow something."""
        if self.active and self.by_text:
            self.send("try { motor6.val = 1 } catch {};")
        elif self.active:
            self.var("motor6.val").set(1.0)

    @function
    def go(self) -> None:
        """Do it once."""
        self.var("motor6.val").set(-1.0)


@pytest.mark.parametrize("by_text", [False, True])
def test_a_device_in_the_server_moves_nothing_by_itself_after_a_release(by_text: bool) -> None:
    lab = Lab.small(6, 7)
    lab.kernel.host.register(Tracker)
    tracker = lab.kernel.host.create(Tracker, "tracker")
    tracker.by_text = by_text
    lab.run(1.0)
    assert lab.number("motor6.val") == pytest.approx(1.0, abs=0.05)
    tracker.active = False
    lab.say("motor6.val = 0;", 1.0)
    tracker.active = True
    press(lab)
    release(lab)
    assert horn(lab, 0.3) < 1
    tracker.active = False
    lab.say("tracker.go;")
    assert horn(lab, 0.5) > 20
