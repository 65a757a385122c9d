"""Where compiled code gives way to other jobs, and which tag a stop belongs to."""

from __future__ import annotations

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.sched.clock import SimClock


def play(text: str) -> str:
    """The words that a program says, in one line."""
    kernel = Kernel(SimClock())
    lobby = kernel.open_lobby()
    lobby.output.take_bytes()
    kernel.feed(lobby, text.encode())
    kernel.scheduler.run_simulated(9.0)
    lines = lobby.output.take_bytes().decode().splitlines()
    return " ".join(line.partition("] ")[2].removeprefix("*** ") for line in lines)


@pytest.mark.parametrize(("each", "said"), (
    ('echo("%s1"); echo("%s2")', "a1 b1 a2 b2"),
    ('echo("%s1") | echo("%s2")', "a1 a2 b1 b2"),
    ('var %s = 0 | while (%s < 2) { %s += 1 | echo("%s" + %s) }', "a1 b1 a2 b2"),
    ('var %s = 0 | while| (%s < 2) { %s += 1 | echo("%s" + %s) }', "a1 a2 b1 b2"),
    ('for (var %s : [1, 2]) echo("%s" + %s)', "a1 b1 a2 b2"),
    ('for| (var %s : [1, 2]) echo("%s" + %s)', "a1 a2 b1 b2"),
))  # fmt: skip
def test_two_branches_take_turns_at_each_semicolon(each: str, said: str) -> None:
    branches = " & ".join(f"{{ {each.replace('%s', name)} }}" for name in "ab")
    assert play(f"{branches};") == said


def test_a_stop_of_the_outer_tag_is_not_taken_by_the_inner_one() -> None:
    said = play("""
        var a = Tag.new("a")|; var b = Tag.new("b")|;
        { a: { b: { a.stop | echo("inside") } | echo("between") } | echo("behind") };
        { a: { b: { b.stop | echo("inside") } | echo("between") } | echo("behind") };
    """)
    assert said == "behind between behind"


def test_the_jobs_of_a_closed_connection_end_at_once() -> None:
    kernel = Kernel(SimClock())
    lobby, other = kernel.open_lobby(), kernel.open_lobby()
    kernel.feed(lobby, b"var Global.count = 0|; loop { Global.count += 1 | sleep(100ms) },")
    kernel.scheduler.run_simulated(1.05)
    lobby.close()
    kernel.scheduler.run_simulated(1.95)
    other.output.take_bytes()
    kernel.feed(other, b"Global.count;")
    kernel.scheduler.run_simulated(1.96)
    assert other.output.take_bytes().endswith(b"] 11\n")
