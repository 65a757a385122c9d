"""What happens at sockets is handled on account of the lobby they belong to."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.stdlib.io_service import RETRY_DELAY_S, ServiceObject


class Lab:
    """A kernel, two lobbies and the service that needs no polling."""

    def __init__(self) -> None:
        self.kernel = Kernel(SimClock())
        self.kernel.programs.quiet = True
        self.one, self.other = self.kernel.open_lobby(), self.kernel.open_lobby()
        self.scheduler = self.kernel.scheduler
        service = self.kernel.world.classes["Socket"].service
        assert isinstance(service, ServiceObject)
        self.service = service
        self.done: list[tuple[str, Lobby | None]] = []

    def note(self, name: str) -> Callable[[], None]:
        """An action that notes who pays for it."""
        return lambda: self.done.append((name, self.scheduler.running().charged_context))

    def run(self, until: float | None = None) -> None:
        self.scheduler.run_simulated(until)


@pytest.fixture
def lab() -> Lab:
    return Lab()


def test_each_lobby_pays_for_its_own(lab: Lab) -> None:
    for owner in (lab.one, lab.other, None):
        lab.service.queue_event(owner, lab.note("a"))
    lab.run()
    assert lab.done == [("a", lab.one), ("a", lab.other), ("a", None)]


def test_nobody_waits_for_what_others_have_to_handle(lab: Lab) -> None:
    for number in range(100):
        lab.service.queue_event(lab.one, lab.note(str(number)))
    lab.service.queue_event(lab.other, lab.note("mine"))
    lab.run()
    assert lab.done.index(("mine", lab.other)) <= 2
    assert [name for name, owner in lab.done if owner is lab.one] == [str(number) for number in range(100)]


def test_what_fails_is_told_to_its_lobby_and_the_rest_is_handled(lab: Lab) -> None:
    def fail() -> None:
        raise OSError("broken")

    lab.service.queue_event(lab.one, fail)
    lab.service.queue_event(lab.one, lab.note("next"))
    lab.run()
    assert lab.done == [("next", lab.one)]
    assert "broken" in lab.one.output.take_bytes().decode()
    assert lab.other.output.take_bytes() == b""


def test_who_has_too_many_jobs_is_served_when_there_is_room_again(lab: Lab) -> None:
    lab.kernel.run_text(lab.one, "for| (10) detach({ sleep(1s) });", 0.5)
    lab.scheduler.shares.max_of_one = 5
    lab.service.queue_event(lab.one, lab.note("late"))
    lab.service.queue_event(lab.other, lab.note("soon"))
    lab.run(0.9)
    assert lab.done == [("soon", lab.other)]
    lab.run(1.0 + 2 * RETRY_DELAY_S)
    assert lab.done == [("soon", lab.other), ("late", lab.one)]


def test_who_polls_pays(lab: Lab) -> None:
    service = lab.service.clone()
    service.queue_event(lab.one, lab.note("polled"))
    lab.run()
    assert lab.done == []
    lab.scheduler.spawn(service.poll, context=lab.other)
    lab.run()
    assert lab.done == [("polled", lab.other)]
