"""What ``urbihw drive`` asks of the server: each order with the server's time at which it was made."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from urbihw.cli import drive


class Link:
    """A server whose clock is 1000 s ahead of ours; an answer takes ``way`` seconds."""

    peer, ended = "here", False

    def __init__(self, clock: SimpleNamespace) -> None:
        self._clock = clock
        self.way = 0.0
        self.made: list[float] = []
        self.place = 0.0

    def read_banner(self) -> None:
        """No banner."""

    def send(self, data: bytes) -> None:
        """The program."""

    def ask(self, expression: str, timeout: float) -> Any:
        """Answer as ``drive.u`` does."""
        told = self._clock.now + 1000
        self._clock.now += self.way
        if expression == "drive.check":
            return SimpleNamespace(shown=f'"{told}|0.2|0.5|base|\x1b[2J"')
        self.made.append(float(expression.rstrip(")").split(", ")[3]))
        return SimpleNamespace(shown=f'"false|false|{told}|0|0|{self.place}|0|0"')


@pytest.fixture
def base(monkeypatch: pytest.MonkeyPatch) -> tuple[drive.RemoteBase, Link, SimpleNamespace]:
    clock = SimpleNamespace(now=5.0)
    monkeypatch.setattr(drive, "time", SimpleNamespace(monotonic=lambda: clock.now))
    link: Any = Link(clock)
    return drive.RemoteBase(link), link, clock


def test_an_order_has_the_time_of_the_server(base: tuple[drive.RemoteBase, Link, SimpleNamespace]) -> None:
    it, link, clock = base
    assert (it.name, it.speeds) == (r"base|\x1b[2J", (0.2, 0.5))
    it.order(0.1, 0.0)
    clock.now += 3.0
    it.order(0.1, 0.0)
    assert link.made == [1005.0, 1008.0]


def test_a_slow_answer_makes_the_next_order_older_not_younger(
    base: tuple[drive.RemoteBase, Link, SimpleNamespace],
) -> None:
    it, link, clock = base
    link.way = 0.3
    it.order(0.1, 0.0)
    it.order(0.1, 0.0)
    assert link.made[1] == pytest.approx(1000 + clock.now - 0.3 - 0.3)


def test_it_stands_when_nothing_is_measured_any_more(base: tuple[drive.RemoteBase, Link, SimpleNamespace]) -> None:
    it, link, clock = base
    link.way = 0.1
    seen = []
    for link.place in (0.0, 0.3, 0.5, 0.6, 0.6, 0.6, 0.6, 0.6, 0.6, 0.6):
        it.order(0.0, 0.0)
        seen.append(it.stands)
    assert seen[1:5] == [False] * 4
    assert seen[-1]
