"""``at sync``: who emits waits for the handlers, as long as they are those of the same connection."""

from __future__ import annotations

from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby


def make_kernel() -> Kernel:
    """A kernel on a simulated clock that does not greet."""
    kernel = Kernel(fast=True)
    kernel.programs.quiet = True
    return kernel


def say(kernel: Kernel, lobby: Lobby, text: str, until: float = 0.0) -> list[str]:
    """What a lobby is answered, without time stamps."""
    return [line.partition("] ")[2] for line in kernel.run_text(lobby, text, until=until).splitlines()]


def test_the_programs_of_others_are_not_held_up() -> None:
    kernel = make_kernel()
    mine, other = kernel.open_lobby(), kernel.open_lobby()
    say(kernel, mine, "var Global.e = Event.new|; var Global.x = 0|;")
    say(kernel, mine, 'at sync (e?) { sleep(10s); echo("e") }; at sync (x > 0) { sleep(10s); echo("x") };')
    assert say(kernel, other, 'e! | Global.x = 1 | echo("on");') == ["*** on"]
    assert say(kernel, mine, 'e! | echo("after");', until=25) == ["*** e", "*** x", "*** e", "*** after"]


def test_what_is_no_job_goes_on() -> None:
    kernel = make_kernel()
    lobby = kernel.open_lobby()
    say(kernel, lobby, 'var Global.x = 0|; at sync (x > 0) { sleep(10s); echo("x") };')
    kernel.world.scheduler.call_at(1.0, lambda: kernel.world.update_slot(kernel.world.global_, "x", 1.0))
    assert say(kernel, lobby, 'sleep(2s); echo("on"); sleep(10s);', until=20) == ["*** on", "*** x"]


def test_who_waits_goes_on_when_the_tag_of_the_handler_is_stopped() -> None:
    kernel = make_kernel()
    lobby = kernel.open_lobby()
    say(kernel, lobby, "var Global.e = Event.new|; var Global.t = Tag.new|; t: at sync (e?) sleep(1h);")
    assert say(kernel, lobby, 'e! | echo("on"),', until=1) == []
    assert say(kernel, lobby, "t.stop;", until=2) == ["*** on"]


def test_the_connection_ends_while_a_job_waits() -> None:
    kernel = make_kernel()
    lobby = kernel.open_lobby()
    before = len(kernel.scheduler.jobs)
    say(kernel, lobby, "var Global.e = Event.new|; at sync (e?) sleep(1h) onleave sleep(1h); e!;")
    lobby.close()
    kernel.scheduler.run_simulated(10.0)
    assert len(kernel.scheduler.jobs) < before
