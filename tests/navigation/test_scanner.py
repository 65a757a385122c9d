"""A SICK laser as urbiscript sees it, with a worker that says what the test wants."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from typing import Any

import pytest

from urbihw.buses import messages as m
from urbihw.buses.errors import BadUrl
from urbihw.kernel import Kernel
from urbihw.kernel.sched.clock import SimClock
from urbihw.navigation.lasers.device import LineLaser, Mount
from urbihw.navigation.lasers.driver import LaserInfo


class Worker:
    """What was started for the laser."""

    def __init__(self, url: str, post: Callable[[m.FromWorker], None]) -> None:
        self.url, self.post = url, post
        self.stopped = False

    def stop(self) -> None:
        self.stopped = True


class Rig:
    """A kernel with a laser in it."""

    def __init__(self) -> None:
        self.kernel = Kernel(SimClock())
        self.lobby = self.kernel.open_lobby()
        self.workers: list[Worker] = []
        self.laser = self.kernel.host.create(LineLaser, "laser", Mount("pipe://laser"), self._start, 0.0)
        self.laser.log = logging.getLogger("laser")
        self.say('at (laser.lost?(var why)) echo("lost: " + why); at (laser.back?) echo("back");')

    def _start(self, url: str, *, post: Callable[[m.FromWorker], None], **rest: Any) -> Worker:
        if url == "no://where":
            raise BadUrl("there is no bus no://")
        self.workers.append(Worker(url, post))
        return self.workers[-1]

    def say(self, text: str) -> list[str]:
        """What is answered."""
        answer = self.kernel.run_text(self.lobby, text, self.kernel.scheduler.clock.now() + 0.1)
        return [line.partition("] ")[2] for line in answer.splitlines()]

    def hear(self, *messages: m.FromWorker) -> list[str]:
        """What is said when the last worker posts some messages."""
        for message in messages:
            self.workers[-1].post(message)
        return self.say("")

    def scan(self, *ranges: float) -> m.Samples:
        """A scan at the present time."""
        now = self.kernel.scheduler.clock.now()
        return m.Samples(now, {"laser": {"ranges": ranges, "farthest": 8.182, "dirty": False}}, {"laser": now})


@pytest.fixture
def rig() -> Rig:
    return Rig()


def test_a_scan_is_shown_from_the_left(rig: Rig) -> None:
    assert rig.say("laser.load = 1|; laser.state; laser.load;") == ['"connecting"', "0"]
    rig.hear(m.Found((LaserInfo(math.pi, math.pi / 2),)), rig.scan(1.0, 2.0, math.inf))
    assert rig.say("laser.state; laser.val; laser.load; laser.resolution;") == ['"on"', "[inf, 2, 1]", "1", "1.5708"]
    assert [r for r, _ in rig.laser.echoes()] == [1.0, 2.0]
    assert rig.laser.nearest() == 1.0


def test_an_old_scan_tells_nothing_of_what_is_ahead(rig: Rig) -> None:
    rig.say("laser.load = 1|;")
    rig.hear(rig.scan(1.0))
    rig.say("sleep(2);")
    rig.kernel.run_text(rig.lobby, "", rig.kernel.scheduler.clock.now() + 2)
    assert (rig.laser.nearest(), rig.laser.fresh_echoes()) == (math.inf, [])
    assert rig.laser.echoes() != []


def test_a_laser_that_is_lost_and_back(rig: Rig) -> None:
    rig.say("laser.load = 1|;")
    rig.hear(rig.scan(1.0))
    assert rig.hear(m.LinkState(False, "unplugged")) == ["*** lost: unplugged"]
    assert rig.say("laser.state; laser.load;") == ['"lost"', "0"]
    assert rig.hear(rig.scan(1.0)) == ["*** back"]


def test_a_worker_that_has_ended_leaves_the_laser_off_until_it_is_switched_on_again(rig: Rig) -> None:
    rig.say("laser.load = 1|;")
    rig.hear(rig.scan(1.0))
    assert rig.hear(m.Ended("it crashed too often")) == ["*** lost: it crashed too often"]
    assert rig.say("laser.state; laser.load; laser.load = 1|; laser.state;") == ['"off"', "0", '"connecting"']
    assert len(rig.workers) == 2


def test_what_a_worker_says_after_it_was_let_go_does_not_count(rig: Rig) -> None:
    rig.say("laser.load = 1|; laser.load = 0|;")
    assert rig.hear(rig.scan(1.0)) == []
    assert rig.say("laser.state; laser.val;") == ['"off"', "[]"]


def test_a_url_that_leads_nowhere_is_said_to_the_writer(rig: Rig) -> None:
    rig.laser.mount = Mount("no://where")
    (line,) = rig.say("laser.load = 1|;")
    assert line.endswith("there is no bus no://")
    assert rig.say("laser.state;") == ['"off"']
