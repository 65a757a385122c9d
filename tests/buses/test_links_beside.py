"""A wait for input looks at the descriptors of the worker, too: a stop is seen without another call of the system."""

from __future__ import annotations

import contextlib
import os
import select
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from multiprocessing import Pipe
from typing import Any

import pytest

from urbihw import buses
from urbihw.buses import messages as m
from urbihw.buses.driver import driver_of
from urbihw.buses.engine import Engine
from urbihw.buses.link import Context, Link
from urbihw.buses.mailbox import Mailbox
from urbihw_fakes.bioloid import Bioloid

from .conftest import Rig
from .test_links import PEERS, Peer, soon
from .test_worker import Bench


@pytest.fixture(params=["serial", "socket"])
def peer(request: pytest.FixtureRequest) -> Iterator[Peer]:
    with ExitStack() as stack:
        yield PEERS[request.param](stack)


@pytest.fixture
def link(peer: Peer) -> Iterator[Link]:
    with buses.open_link(peer.url, peer.context) as opened:
        yield opened


@pytest.fixture
def beside(link: Link) -> Iterator[int]:
    """The end to write to; the other one is looked at."""
    read, write = os.pipe()
    link.beside = (read,)
    yield write
    for each in (read, write):
        os.close(each)


@pytest.mark.usefixtures("beside")
def test_a_wait_with_nothing_beside_is_quiet(peer: Peer, link: Link) -> None:
    peer.send(b"x")
    assert link.read(1, soon(link)) == b"x"
    assert link.is_quiet
    link.is_quiet = False
    assert link.read(1, link.clock.now()) == b""
    assert link.is_quiet


def test_what_is_there_beside_does_not_end_the_wait_and_is_noted(peer: Peer, link: Link, beside: int) -> None:
    os.write(beside, b"stop")
    later = threading.Timer(0.05, lambda: peer.send(b"x"))
    later.start()
    assert link.read(1, soon(link)) == b"x"
    later.join()
    assert not link.is_quiet
    assert link.read(1, link.clock.now()) == b""
    assert not link.is_quiet


def test_a_descriptor_that_was_closed_meanwhile_is_no_lost_link(peer: Peer, link: Link) -> None:
    link.is_quiet = False
    link.beside = (987,)
    peer.send(b"x")
    assert link.read(1, soon(link)) == b"x"
    assert not link.is_quiet


def test_a_port_that_does_not_look_is_never_quiet(rig: Rig) -> None:
    rig.link.beside = (0,)
    rig.link.read(1, rig.clock.now() + 0.1)
    assert not rig.link.is_quiet


def stopped(engine: Engine) -> bool:
    """What the engine says to its driver between two questions."""
    return engine._is_tick_urgent()


def test_the_worker_asks_only_where_the_port_has_not_looked(rig: Rig) -> None:
    bench = Bench(rig)
    bench.run(0.6)
    port = bench.engine._link.port
    assert port is not None
    assert port.beside
    bench.tell(m.Stop(7, "enough"))
    port.is_quiet = True
    assert not stopped(bench.engine)
    # That was true of one wait only.
    assert stopped(bench.engine)
    bench.close()


class Calls:
    """The calls of the system that this thread makes for the wire and for its parent."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.made: list[str] = []
        self._thread = threading.get_ident()
        for module, name in ((select, "select"), (os, "read"), (os, "write")):
            patch.setattr(module, name, self._counted(name, getattr(module, name)))

    def _counted(self, name: str, call: Any) -> Any:
        def counted(*arguments: Any) -> Any:
            if threading.get_ident() == self._thread:
                self.made.append(name)
            return call(*arguments)

        return counted


def serve(kit: Bioloid, wire: int) -> None:
    """Answer at once what comes on a wire, until it is closed."""
    with contextlib.suppress(OSError):
        while data := os.read(wire, 4096):
            now = time.monotonic()
            kit.tick(now)
            os.write(wire, b"".join(answer.data for answer in kit.feed(data, now)))


@pytest.mark.e2e
def test_an_answer_costs_three_calls(monkeypatch: pytest.MonkeyPatch) -> None:
    """A write, one wait, one read; the rest of a tick is a handful of them."""
    servos = 10
    wire, host = os.openpty()
    robot = threading.Thread(target=serve, args=(Bioloid(servos=tuple(range(1, servos + 1)), sensors=()), wire))
    robot.start()
    mine, theirs = Pipe()
    settings = m.Configure(rate=100, dead_man=0, options={"protocol": 1, "ids": list(range(1, servos + 1))})
    engine = Engine(os.ttyname(host), driver_of("servos"), Mailbox(theirs), m.Begin(settings), Context())
    try:
        for _ in range(3):
            engine.step()
        for number in range(1, servos + 1):
            mine.send(m.Watch(number, ("present_position",)))
        for _ in range(3):
            engine.step()
        calls, counts = Calls(monkeypatch), []
        for _ in range(10):
            calls.made.clear()
            engine.step()
            counts.append((len(calls.made), calls.made.count("write"), calls.made.count("select")))
        made, questions, waits = min(counts)
        assert questions >= servos
        assert waits <= servos + 8
        assert made <= 3 * servos + 20
    finally:
        monkeypatch.undo()
        engine._link.end()
        os.close(host)
        robot.join(5)
        os.close(wire)
