"""One emergency stop for each person who has pressed it, as programs see it: the robot is free when all have released.

Judged by the body of a simulated servo.
"""

from __future__ import annotations

import os
from typing import Any

import pytest
from bioloid_lab import Lab

from urbihw.buses import messages as m
from urbihw.control_address import local_user

ANN, BOB = "10.0.0.5", "10.0.0.6"


class Place:
    """A robot, and the connections of people."""

    def __init__(self) -> None:
        self.lab = Lab.small(6)
        self.lab.run(0.1)

    def client(self, peer: str | None = None, user: str = "", label: str = "") -> Any:
        """A connection of somebody."""
        lobby = self.lab.kernel.open_lobby(peer)
        lobby.user, lobby.label = user, label
        return lobby

    def say(self, lobby: Any, text: str, seconds: float = 0.05) -> str:
        """The answer to a statement, without the time stamp."""
        lobby.feed(text.encode())
        self.lab.run(seconds)
        return str(lobby.output.take_bytes().decode()).partition("] ")[2].strip()

    def press(self, user: str, who: str) -> None:
        """Somebody presses beside the interpreter."""
        assert self.lab.worker is not None
        self.lab.worker.send(m.EmergencyStop(who, user))
        self.lab.run(0.05)

    @property
    def holders(self) -> str:
        """Who holds the robot, for programs."""
        return self.lab.look("bioloid.estopHolders")

    def turns(self, lobby: Any) -> bool:
        """Whether a new order turns servo 6."""
        servo = self.lab.kit.servo(6)
        before = servo.position
        self.say(lobby, f"motor6.val = {-0.5 if before > 511 else 0.5};", 0.3)
        return abs(float(servo.position - before)) > 10


@pytest.fixture
def place() -> Place:
    return Place()


def test_the_robot_is_free_when_all_have_released(place: Place) -> None:
    ann, bob = place.client(ANN), place.client(BOB)
    place.say(ann, "bioloid.estop = true;")
    place.say(bob, "bioloid.estop = true;")
    assert ANN in place.holders and BOB in place.holders
    told = place.say(ann, "bioloid.estop = false;")
    assert "still holds" in told and BOB in told
    assert place.lab.look("bioloid.estop") == "true"
    assert ANN not in place.holders
    refusal = place.say(ann, "motor6.val = 1;")
    assert "is held by an emergency stop" in refusal and BOB in refusal
    assert not place.turns(ann)
    place.say(bob, "bioloid.estop = false;")
    assert (place.lab.look("bioloid.estop"), place.holders) == ("false", "[]")
    assert place.turns(ann)


def test_who_holds_nothing_is_told_who_does_and_may_release_it_by_name(
    place: Place, caplog: pytest.LogCaptureFixture
) -> None:
    ann, bob = place.client(ANN), place.client(BOB)
    place.say(ann, "bioloid.estop = true;")
    refusal = place.say(bob, "bioloid.estop = false;")
    assert ANN in refusal and 'bioloid.releaseOf("NAME")' in refusal
    assert not place.turns(bob)
    assert "Cid does not hold bioloid" in place.say(bob, 'bioloid.releaseOf("Cid");')
    place.say(bob, "bioloid.releaseOf(bioloid.estopHolders[0]);")
    assert place.lab.look("bioloid.estop") == "false"
    assert place.turns(bob)
    (line,) = [each.message for each in caplog.records if each.message.startswith("emergency stop of")]
    assert ANN in line.split("released by")[0] and BOB in line.split("released by")[1]


@pytest.mark.parametrize(("first", "second"), [
    ({"peer": ANN}, {"peer": ANN}),
    ({"peer": ANN, "user": "ann"}, {"peer": BOB, "user": "ann"}),
    ({"peer": "127.0.0.1"}, {"peer": "::1"}),
    ({"peer": "127.0.0.1", "label": "ann (panel)"}, {"peer": "127.0.0.1", "label": "ann (panel)"}),
])
def test_a_person_who_comes_back_by_another_connection_may_release(
    place: Place, first: dict[str, str], second: dict[str, str]
) -> None:
    place.say(place.client(**first), "bioloid.estop = true;")
    place.say(place.client(**second), "bioloid.estop = false;")
    assert place.lab.look("bioloid.estop") == "false"


def test_a_client_of_this_machine_is_the_user_of_the_daemon_at_the_shell(place: Place) -> None:
    me = place.client("127.0.0.1")
    place.press(local_user(os.getuid()), "me@pts/0")
    place.press("ann (panel)", "ann (panel)")
    assert place.holders == '["me@pts/0", "ann (panel)"]'
    place.say(me, "bioloid.estop = false;")
    assert place.holders == '["ann (panel)"]'
    place.say(place.client("127.0.0.1", label="ann (panel)"), "bioloid.estop = false;")
    assert place.lab.look("bioloid.estop") == "false"


def test_a_program_of_the_robot_holds_for_itself(place: Place) -> None:
    """The robot's own button."""
    place.lab.kernel.host.run("var Global.button = Event.new|; at (button?) bioloid.estop = true;", "button.u")
    place.lab.run(0.05)
    place.lab.kernel.host.run("button!", "press.u")
    place.lab.run(0.05)
    assert "robot" in place.holders
    assert "robot" in place.say(place.client(ANN), "bioloid.estop = false;")
    assert not place.turns(place.client(ANN))


def test_one_who_presses_and_releases_in_one_statement_is_free(place: Place) -> None:
    me = place.client(ANN)
    assert place.say(me, "bioloid.estop = true | bioloid.estop = false;") == "false"
    assert place.turns(me)


def test_a_release_that_a_new_press_overtakes_frees_only_its_own(place: Place) -> None:
    me = place.client(ANN)
    place.say(me, "bioloid.estop = true;")
    assert place.lab.worker is not None
    place.lab.worker.send(m.EmergencyStop("Bob", "bob"))
    place.say(me, "bioloid.estop = false;")
    assert place.holders == '["Bob"]'
    assert not place.turns(me)
