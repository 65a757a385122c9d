"""Reports of a worker that come late do not undo what was ordered since: a press, a release.

Judged by the body of a simulated servo, and by what the daemon tells.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from bioloid_lab import BAUD, Lab

from urbihw.buses import messages as m
from urbihw.buses.authority import MOST_HOLDERS
from urbihw.buses.latch_view import LatchView
from urbihw_fakes.bioloid import Bioloid as Kit


class Late:
    """A robot whose worker's reports wait until ``deliver``."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.lab = Lab.ready(Kit(servos=(6, 7), sensors=(), baud=BAUD))
        self.lab.run(0.2)
        self._waiting: list[Any] = []
        robot = self.lab.robot
        self._post: Callable[[Any], None] = robot._handle_message

        def hold(message: Any) -> None:
            if isinstance(message, m.Latched | m.Stopped):
                self._waiting.append(message)
            else:
                self._post(message)

        monkeypatch.setattr(robot, "_handle_message", hold)

    def deliver(self, number: int | None = None) -> None:
        """The next reports arrive, all or so many."""
        for _ in range(len(self._waiting) if number is None else number):
            self._post(self._waiting.pop(0))
        self.lab.run(0.02)


@pytest.fixture
def late(monkeypatch: pytest.MonkeyPatch) -> Late:
    return Late(monkeypatch)


def test_a_write_at_once_after_a_release_moves_the_robot(late: Late) -> None:
    lab = late.lab
    lab.say("bioloid.estop = true;", 0.1)
    lab.say("bioloid.estop = false;", 0.1)
    late.deliver(2)  # the stop, and who pressed
    assert lab.look("bioloid.estop") == "false"
    lab.say("motor6.val = 0.5;", 0.02)
    late.deliver()
    lab.run(1.0)
    assert "!!!" not in lab.heard()
    assert lab.number("motor6.val") == pytest.approx(0.5, abs=0.05)


def test_a_press_is_not_undone_by_the_report_of_an_earlier_release(late: Late) -> None:
    lab = late.lab
    for text in ("true", "false", "true"):
        lab.say(f"bioloid.estop = {text};", 0.1)
    while late._waiting:
        late.deliver(1)
        assert lab.look("bioloid.estop") == "true"
    before = lab.kit.servo(6).position
    lab.say("motor6.val = 0.5;", 1.0)
    assert lab.kit.servo(6).position == pytest.approx(before, abs=2)


def test_a_stop_of_somebody_else_holds_although_a_release_is_on_its_way(late: Late) -> None:
    lab = late.lab
    lab.say("bioloid.estop = true;", 0.1)
    assert lab.worker is not None
    lab.worker.send(m.EmergencyStop("Bob", "bob"))
    lab.run(0.1)
    lab.say("bioloid.estop = false;", 0.1)
    late.deliver()
    assert lab.look("bioloid.estopHolders") == '["Bob"]'


def test_a_release_of_somebody_else_is_confirmed_when_it_counts(late: Late, monkeypatch: pytest.MonkeyPatch) -> None:
    """So the control socket can answer then."""
    lab, sent = late.lab, list[Any]()
    send = lab.robot.guard._send

    def pass_on(message: Any) -> None:
        sent.append(message)
        send(message)

    monkeypatch.setattr(lab.robot.guard, "_send", pass_on)
    assert lab.worker is not None
    for order in (m.EmergencyStop("Bob", "bob"), m.Release("Bob", "bob")):
        lab.worker.send(order)
        lab.run(0.1)
    assert m.ReleaseKnown() not in sent
    late.deliver()
    assert sent.count(m.ReleaseKnown()) == 1
    assert lab.look("bioloid.estop") == "false"


def test_a_release_that_the_worker_has_dropped_did_not_happen(late: Late) -> None:
    """Somebody presses right behind it: the worker reads both at once, and the stop is newer."""
    lab = late.lab
    lab.say("bioloid.estop = true;", 0.1)
    late.deliver()
    assert lab.worker is not None
    lab.say("bioloid.estop = false;")
    lab.worker.send(m.EmergencyStop("Bob", "bob"))
    lab.run(0.1)
    late.deliver()
    holders = lab.look("bioloid.estopHolders")
    assert "Bob" in holders and "Lobby_1" in holders


def told(order: int, *holders: str, who: str = "", freed: tuple[str, ...] = ()) -> m.Latched:
    return m.Latched(" and ".join(holders), who, tuple((each.lower(), each) for each in holders), freed, order)


def test_orders_that_a_report_does_not_know_are_carried_out_on_it() -> None:
    view = LatchView()
    view.order(m.EmergencyStop("Ann", "ann", 1))
    view.order(m.Release("Ann", "ann", order=2))
    assert view.report(told(0, "Bob", who="Bob")) == {"bob"}
    assert view.holders == {"bob": "Bob"}
    assert view.report(told(1, "Bob", "Ann", who="Ann")) == frozenset()
    assert view.holders == {"bob": "Bob"}
    # The worker has the last word: it has dropped this release, since somebody pressed behind it.
    assert view.report(told(2, "Bob", "Ann", who="Bob")) == {"ann"}
    assert view.holders == {"bob": "Bob", "ann": "Ann"}
    view.order(m.Release("Ann", "ann", order=3))
    assert view.report(told(3, "Bob", who="Ann", freed=("Ann",))) == frozenset()
    assert view.report(told(3, "Bob", who="Bob")) == {"bob"}


def test_a_user_beside_those_with_a_latch_of_their_own_releases_the_shared_one() -> None:
    lab = Lab.ready()
    assert lab.worker is not None
    for number in range(MOST_HOLDERS):
        lab.worker.send(m.EmergencyStop(f"name {number}", f"user {number}"))
    lab.run(1.0)
    lab.say("bioloid.estop = true;", 0.1)
    assert lab.number("bioloid.estopHolders.size") == MOST_HOLDERS + 1
    assert "still holds" in lab.say("bioloid.estop = false;", 0.1)
    assert lab.number("bioloid.estopHolders.size") == MOST_HOLDERS
