"""What was set up under a tag is over when the tag is stopped: nothing of it fires later."""

from __future__ import annotations

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.sched.clock import SimClock


@pytest.mark.parametrize("how", ["t.stop", "t.block"])
def test_an_at_with_a_duration_does_not_fire_after_its_tag_was_stopped(how: str) -> None:
    kernel = Kernel(SimClock())
    lobby = kernel.open_lobby()
    lobby.output.take_bytes()
    kernel.feed(lobby, b"""
        var e = Event.new|; var t = Tag.new("t")|;
        t: at (e? ~ 1s) echo("fired");
        at (e? ~ 1s) echo("the other");
        var emission = e.trigger|;
        sleep(0.5s); %s; sleep(2s); echo("end");
    """ % how.encode())  # fmt: skip
    kernel.scheduler.run_simulated(5.0)
    said = [line.partition(b"] ")[2] for line in lobby.output.take_bytes().splitlines()]
    assert said == [b"*** the other", b"*** end"]
