"""The unread input of a client: its era, and whether it tells that the client is there."""

from __future__ import annotations

from urbihw.kernel.sched.arrivals import UnreadInput


class Source:
    """A socket with so many bytes that have arrived."""

    def __init__(self) -> None:
        self.size = 0
        self.unread = UnreadInput(lambda: self.size)

    def read(self, era: int, caught_up: bool = True) -> tuple[int, bool]:
        """Read all that has arrived."""
        self.size = 0
        return self.unread.read(era, caught_up)


def test_what_is_unread_when_an_era_ends_belongs_to_it() -> None:
    source = Source()
    source.unread.end_era(1)
    assert source.read(2) == (2, True)
    source.size = 8
    source.unread.end_era(2)
    source.unread.end_era(3)
    assert source.read(4) == (2, True)
    assert source.read(4) == (4, True)


def test_what_is_on_its_way_while_reading_pauses_belongs_to_the_era_that_ends_then() -> None:
    source = Source()
    source.unread.pause()
    source.unread.end_era(1)
    source.unread.resume()
    assert source.read(2, caught_up=False) == (1, False)
    assert source.read(2, caught_up=False) == (1, False), "it may have waited in the client's machine"
    assert source.read(2) == (1, True), "all that it had sent has run"
    assert source.read(2) == (2, True)


def test_what_is_read_behind_a_pause_does_not_tell_that_the_client_is_there() -> None:
    source = Source()
    source.unread.pause()
    source.unread.resume()
    assert source.read(1, caught_up=False) == (1, False)
    assert source.read(1) == (1, True)
