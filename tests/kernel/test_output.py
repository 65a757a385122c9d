"""What waits for a client to read it is bounded: its own jobs wait, no others do."""

from __future__ import annotations

from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby

LIMIT = 4000


class Reader:
    """The client of a lobby, which takes ``room`` bytes and reads them when it is told to."""

    def __init__(self, kernel: Kernel) -> None:
        self.kernel = kernel
        self.lobby: Lobby = kernel.open_lobby("127.0.0.1", self.wanted, LIMIT)
        self.heard = b""
        self.waiting = b""
        self.given_up: list[int] = []
        self.most = 0
        self.lobby.output.unread = lambda: len(self.waiting)
        self.lobby.output.give_up = self.given_up.append
        kernel.scheduler.add_round_hook(self.flush)
        kernel.run()

    def wanted(self, lobby: Lobby) -> None:
        """There will be something."""

    def flush(self) -> None:
        """The end of a round."""
        self.waiting += self.lobby.output.take_bytes()
        self.most = max(self.most, len(self.waiting))
        self.lobby.output.update_unread()

    def read(self, size: int) -> None:
        """Read that much."""
        self.heard, self.waiting = self.heard + self.waiting[:size], self.waiting[size:]
        self.lobby.output.update_unread()
        self.kernel.run()

    def say(self, text: str) -> None:
        """Type something."""
        self.lobby.feed(text.encode())
        self.kernel.run()


def numbers(heard: bytes) -> list[str]:
    return [line.partition(b"*** ")[2].strip(b"x").decode() for line in heard.splitlines()]


def test_a_job_of_the_client_waits_and_all_of_it_comes_in_order() -> None:
    kernel = Kernel(fast=True)
    reader = Reader(kernel)
    reader.say('for| (var i: 500) echo("x" * 100 + i);')
    assert len(reader.waiting) < LIMIT
    assert kernel.run_text(kernel.open_lobby(), "1 + 1;").endswith("2\n")
    while reader.waiting:
        reader.read(777)
    assert numbers(reader.heard) == [str(number) for number in range(500)]
    assert reader.most <= LIMIT and not reader.given_up


def test_several_jobs_of_the_client_wait_in_turn() -> None:
    reader = Reader(Kernel(fast=True))
    reader.say("for& (var i: 20) for| (var j: 20) echo(\"x\" * 100 + (i * 20 + j));")
    while reader.waiting:
        reader.read(1000)
    heard = numbers(reader.heard)
    assert sorted(heard, key=int) == [str(number) for number in range(400)]
    assert reader.most <= LIMIT


def test_what_others_say_closes_it_when_the_limit_is_passed() -> None:
    kernel = Kernel(fast=True)
    reader, other = Reader(kernel), kernel.open_lobby()
    reader.say("var Global.deaf = lobby|;")
    kernel.run_text(other, 'for| (var i: 20) deaf.echo("x" * 100);')
    assert not reader.given_up
    assert kernel.run_text(other, 'for| (var i: 500) wall("x" * 100) | "done";').endswith('"done"\n')
    assert reader.given_up and reader.given_up[0] <= LIMIT
    assert len(reader.waiting) + len(reader.lobby.output.take_bytes()) <= LIMIT
    assert not reader.lobby.output.open


def test_a_lobby_made_by_the_client_waits_as_it_does_itself() -> None:
    reader = Reader(Kernel(fast=True))
    reader.say('var l = lobby.create| l.receive("for| (var i: 500) echo(\\"x\\" * 100 + i);");')
    assert len(reader.waiting) < LIMIT
    while reader.waiting:
        reader.read(1000)
    assert numbers(reader.heard)[-1] == "499" and not reader.given_up


def test_what_a_stopped_job_wanted_to_say_is_not_said() -> None:
    reader = Reader(Kernel(fast=True))
    reader.say('var t = Tag.new|; t: for| (var i: 500) echo("x" * 100 + i),')
    reader.say("t.stop|;")
    while reader.waiting:
        reader.read(1000)
    said = len(numbers(reader.heard))
    assert said < 30
    reader.say('echo("x");')
    assert len(numbers(reader.waiting)) == 1


def test_who_waits_for_room_is_ended_with_the_connection() -> None:
    kernel = Kernel(fast=True)
    reader, other = Reader(kernel), kernel.open_lobby()
    jobs = len(kernel.scheduler.jobs)
    reader.say('loop| echo("x" * 100),')
    reader.say('for| (var i: 1000) echo("y" * 100);')
    reader.lobby.close()
    kernel.run()
    assert len(kernel.scheduler.jobs) == jobs - 1
    assert kernel.run_text(other, "1 + 1;").endswith("2\n")


def test_without_a_server_nothing_is_bounded() -> None:
    kernel = Kernel(fast=True)
    lobby = kernel.open_lobby(limit=LIMIT)
    assert kernel.run_text(lobby, 'for| (var i: 500) echo("x" * 100);').count("\n") == 500
