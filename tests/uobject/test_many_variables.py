"""Thousands of variables made in one statement do not keep others waiting."""

from __future__ import annotations

from urbihw.kernel import Kernel
from urbihw.kernel.sched.clock import SimClock


class Working(SimClock):
    """A clock on which each look takes a millisecond."""

    def now(self) -> float:
        self.advance(0.001)
        return super().now()


def test_others_have_a_turn_while_variables_are_made() -> None:
    kernel = Kernel(Working(), fast=True)
    lobby = kernel.open_lobby("127.0.0.1")
    other = kernel.open_lobby("127.0.0.2")
    kernel.run_text(lobby, "var u = UObject.new|; var Global.made = 0|;")
    other.feed(b"sleep(1s); echo(Global.made);\n")
    kernel.run_text(lobby, 'sleep(500ms); for| (var i : 1000) { UVar.new(u, "v" + i) | Global.made += 1 };')
    (seen,) = other.output.take_bytes().decode().splitlines()
    assert 0 < float(seen.rpartition(" ")[2]) < 900
    assert kernel.run_text(lobby, "Global.made;").endswith(" 1000\n")
