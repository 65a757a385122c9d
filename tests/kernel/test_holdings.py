"""What the jobs of a connection hold is bounded, and is closed when the connection ends."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.errors import Raised
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.runtime.holdings import Holdings
from urbihw.kernel.sched.clock import SimClock

ADDRESS = "127.0.0.1", 40_000


class Thing:
    """Something to be closed; ``closed`` says how often it was."""

    def __init__(self, error: Exception | None = None) -> None:
        self.closed = 0
        self._error = error

    def close(self) -> None:
        self.closed += 1
        if self._error is not None:
            raise self._error


class Equal(Thing):
    """Equal to any other, as an object of the language may be."""

    def __eq__(self, other: object) -> bool:
        return True

    def __hash__(self) -> int:
        return 1


@contextmanager
def refused(message: str) -> Iterator[None]:
    """What is done here must be refused, and the error begins with a message."""
    with pytest.raises(Raised) as caught:
        yield
    assert caught.value.message.startswith(message)


@pytest.fixture
def kernel() -> Kernel:
    made = Kernel(SimClock())
    made.programs.quiet = True
    return made


def end(kernel: Kernel, lobby: Lobby) -> None:
    lobby.close()
    kernel.scheduler.run_simulated()


# ---------------------------------------------------------------- alone


def test_so_many_of_a_kind_and_no_more() -> None:
    holdings = Holdings()
    first, second = Equal(), Equal()
    holdings.register(first, "things", 2)
    holdings.register(first, "things", 2)
    holdings.register(second, "things", 2)
    with refused("too many things: this connection has 2; close one"):
        holdings.register(Thing(), "things", 2)
    holdings.register(Thing(), "others", 2)
    holdings.unregister(first)
    holdings.unregister(first)
    holdings.register(first, "things", 2)
    assert len(holdings.held()) == 3


def test_all_that_is_held_is_closed_once_whatever_fails(caplog: pytest.LogCaptureFixture) -> None:
    holdings = Holdings()
    things = [Thing(), Thing(ValueError("broken")), Thing()]
    for thing in things:
        holdings.register(thing, "things", 9)
    with caplog.at_level(logging.ERROR):
        holdings.close()
        holdings.close()
    assert [thing.closed for thing in things] == [1, 1, 1]
    assert [record.getMessage() for record in caplog.records] == ["error while closing what a connection held: broken"]
    with refused("the connection is closed: nothing can be opened"):
        holdings.register(Thing(), "things", 9)


def test_who_belongs_to_another_counts_with_him() -> None:
    maker = Holdings()
    made = Holdings(maker)
    thing = Thing()
    made.register(thing, "things", 1)
    with refused("too many things"):
        maker.register(Thing(), "things", 1)
    made.close()
    assert thing.closed == 1
    maker.register(Thing(), "things", 1)


# ---------------------------------------------------------------- of lobbies


def test_what_a_connection_holds_is_closed_behind_its_finally_clauses(kernel: Kernel) -> None:
    class Told(Thing):
        def close(self) -> None:
            super().close()
            assert kernel.world.global_.slots["said"] == 1.0

    lobby, thing = kernel.open_lobby(), Told()
    lobby.holdings.register(thing, "things", 1)
    kernel.run_text(lobby, "var Global.said = 0|; detach({ try { sleep(1h) } finally { Global.said = 1 } });", 1.0)
    end(kernel, lobby)
    assert thing.closed == 1


def test_a_connection_that_is_gone_opens_nothing_any_more(kernel: Kernel) -> None:
    lobby = kernel.open_lobby()
    tries = 'try { Server.new.listen("", 0) } catch (var e) { Global.told = e.message }'
    kernel.run_text(lobby, f'var Global.told = ""|; detach({{ try {{ sleep(1h) }} finally {{ {tries} }} }});', 1.0)
    end(kernel, lobby)
    assert str(kernel.world.text(kernel.world.global_.slots["told"])).startswith("the connection is closed")
    assert lobby.holdings.held() == []


def test_what_jobs_without_a_lobby_hold_stays(kernel: Kernel) -> None:
    thing = Thing()
    kernel.world.holdings.register(thing, "things", 1)
    end(kernel, kernel.open_lobby())
    assert thing.closed == 0


def test_a_lobby_that_was_created_holds_with_its_maker(kernel: Kernel) -> None:
    lobby = kernel.open_lobby()
    kernel.run_text(lobby, "var l = Lobby.create|;")
    made = next(one for one in kernel.programs.lobbies if one.maker is lobby)
    thing = Thing()
    made.holdings.register(thing, "things", 1)
    with refused("too many things"):
        lobby.holdings.check("things", 1)
    end(kernel, lobby)
    assert thing.closed == 1
    assert not made.connected


def test_a_client_that_a_program_makes_belongs_to_who_runs_the_program(kernel: Kernel) -> None:
    lobby, other, client, later = (kernel.open_lobby("127.0.0.1") for _ in range(4))
    ended = []
    client.on_quit = lambda: ended.append("client")
    lobby.holdings.register(Thing(), "sockets", 2, lambda: ADDRESS)
    other.holdings.register(Thing(), "sockets", 2, lambda: ("127.0.0.1", 40_001))
    kernel.scheduler.begin_era()
    client.find_maker(ADDRESS)
    later.find_maker(("127.0.0.2", 40_000))
    client.holdings.register(Thing(), "sockets", 2)
    assert (client.maker, later.maker) == (lobby, None)
    # It is as old as the program that has opened the Socket, not as the connection.
    assert (client.ordered, later.ordered) == (0, None)
    with refused("too many sockets"):
        client.holdings.register(Thing(), "sockets", 2)
    end(kernel, lobby)
    assert (ended, client.connected, other.connected) == (["client"], False, True)


def test_who_can_stop_nothing_any_more_moves_nothing_by_others(kernel: Kernel) -> None:
    lobby, client = kernel.open_lobby(), kernel.open_lobby("127.0.0.1")
    lobby.holdings.register(Thing(), "sockets", 1, lambda: ADDRESS)
    client.find_maker(ADDRESS)
    kernel.run_text(client, "var l = Lobby.create|;")
    gone: list[Lobby] = []
    kernel.world.client_gone.append(gone.append)
    lobby.revoke_command()
    assert len(gone) == 3
    assert client in gone
    assert not client.in_command


def test_the_lobbies_that_a_connection_makes_are_bounded(kernel: Kernel) -> None:
    lobby = kernel.open_lobby()
    lobby.feed(b"var made = []|; for (64) made << Lobby.create|; made[0].create; made.size; made[0].quit|;"
               b" sleep(1s); made << Lobby.create|; made.size;\n")  # fmt: skip
    kernel.scheduler.run_simulated()
    said = [line.partition("] ")[2] for line in lobby.output.take_bytes().decode().splitlines()]
    assert said[0].endswith("create: too many lobbies: this connection has 64; close one")
    assert said[1:] == ["64", "65"]
    end(kernel, lobby)
    assert not kernel.programs.lobbies
