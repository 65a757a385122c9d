"""When ``at`` fires and when it does not: stopped and frozen tags, emissions under way, conditions that fail."""

from __future__ import annotations

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.sched.clock import SimClock


def play(text: str) -> list[str]:
    """What a client reads that sends a program, without time stamps."""
    kernel = Kernel(SimClock())
    lobby = kernel.open_lobby()
    lobby.output.take_bytes()
    kernel.feed(lobby, f'var e = Event.new|; var t = Tag.new("t")|;\n{text}'.encode())
    kernel.scheduler.run_simulated(20.0)
    return [line.partition("] ")[2] for line in lobby.output.take_bytes().decode().splitlines()]


@pytest.mark.parametrize("how", ["t.stop", "t.block"])
def test_an_at_with_a_duration_does_not_fire_after_its_tag_was_stopped(how: str) -> None:
    said = play("""
        t: at (e? ~ 1s) echo("fired");
        at (e? ~ 1s) echo("the other");
        var emission = e.trigger|;
        sleep(0.5s); HOW; sleep(2s); echo("end");
    """.replace("HOW", how))
    assert said == ["*** the other", "*** end"]


def test_an_at_with_a_duration_does_not_fire_when_the_emission_is_over_before() -> None:
    said = play('at (e? ~ 1s) echo("fired") onleave echo("left"); var h = e.trigger|; sleep(0.9s); h.stop; sleep(2s);')
    assert said == []


def test_an_at_hears_an_emission_that_is_under_way() -> None:
    said = play('var h = e.trigger|; at (e?) echo("on") onleave echo("off"); sleep(1s); h.stop; sleep(1s);')
    assert said == ["*** on", "*** off"]


def test_an_at_under_a_frozen_tag_misses_what_happens() -> None:
    said = play('t: at (e?) echo("fired"); t.freeze; e!; t.unfreeze; sleep(1s); echo("now"); e!; sleep(1s);')
    assert said == ["*** now", "*** fired"]


def test_an_onleave_under_a_frozen_tag_does_not_run() -> None:
    said = play("""
        t: at (e?) echo("on") onleave echo("off");
        var h = e.trigger|; sleep(1s); t.freeze; h.stop; sleep(1s); t.unfreeze; sleep(1s); echo("end");
    """)
    assert said == ["*** on", "*** end"]


def test_a_statement_that_is_stopped_while_it_emits_ends_the_emission() -> None:
    said = play("""
        at (e?) echo("on") onleave echo("off");
        at sync (e?) sleep(10s);
        t: e.trigger, sleep(1s); t.stop; sleep(1s); echo("end");
    """)
    assert said == ["*** on", "*** off", "*** end"]


def test_a_condition_that_changes_what_it_reads_is_evaluated_again() -> None:
    said = play("""
        var x = 0|;
        at ({ var two = (x == 2) | if (x == 1) x = 2 | two }) echo("two");
        x = 1|; sleep(1s); echo("end");
    """)
    assert said == ["*** two", "*** end"]


def test_an_error_of_a_condition_does_not_reach_the_statement_that_writes() -> None:
    said = play('var x = 1|; at (x / 2 == 3) nil; { x = "text" | echo("after") }; sleep(1s); x = 6|; sleep(1s);')
    assert "*** after" in said
    assert any("lookup failed" in line for line in said)
