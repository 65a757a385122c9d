"""A parent that does not read: samples are merged, and the newest value of each item is the one that is left."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from multiprocessing import Pipe
from multiprocessing.connection import Connection

import pytest

from urbihw.buses.mailbox import Joiner, Mailbox
from urbihw.buses.messages import FromWorker, LinkState, Samples

FILLER = LinkState(True, "x" * 30_000)


class Full:
    """A mailbox whose parent has stopped reading, the pipe being full of ``FILLER``."""

    def __init__(self) -> None:
        self.parent: Connection
        self.parent, theirs = Pipe()
        self.mailbox = Mailbox(theirs)
        while self.mailbox._writable():
            self.mailbox.post(FILLER)

    def read(self) -> list[FromWorker]:
        """What is in the pipe, behind the filling."""
        found = []
        while self.parent.poll():
            found.append(self.parent.recv())
        return [message for message in found if message != FILLER]


@pytest.fixture
def full() -> Iterator[Full]:
    made = Full()
    yield made
    made.parent.close()
    made.mailbox.close()


def test_of_merged_samples_the_newest_value_of_each_item_wins(full: Full) -> None:
    full.mailbox.post(Samples(1.0, {6: {"place": 100, "speed": 7}, 7: {"place": 40}}, {6: 1.0, 7: 1.0}))
    full.mailbox.post(Samples(2.0, {6: {"place": 200}}, {6: 2.0}))
    full.mailbox.post(Samples(3.0, {6: {"place": 300, "load": 9}, 8: {"place": 50}}, {6: 3.0, 8: 3.0}))
    assert full.read() == []
    assert full.mailbox.pop_dropped_count() == 2
    full.mailbox.post(LinkState(False, "behind the samples"))
    merged, state = full.read()
    assert isinstance(merged, Samples)
    assert merged.time == 3.0
    assert merged.values == {6: {"place": 300, "speed": 7, "load": 9}, 7: {"place": 40}, 8: {"place": 50}}
    assert merged.times == {6: 3.0, 7: 1.0, 8: 3.0}
    assert state == LinkState(False, "behind the samples")


def test_states_keep_their_order_and_are_never_merged(full: Full) -> None:
    states = [LinkState(up, str(number)) for number, up in enumerate((True, False, True))]
    for state in states:
        full.mailbox.post(state)
    assert full.read() == []
    full.mailbox.post(Samples(1.0, {6: {"place": 1}}, {6: 1.0}))
    assert full.read() == [*states, Samples(1.0, {6: {"place": 1}}, {6: 1.0})]


def test_pictures_and_sound_never_block_who_posts_them_and_the_newest_is_left() -> None:
    parent, theirs = Pipe()
    mailbox = Mailbox(theirs)
    for number in range(50):
        sound = {f"piece{number % 8}": (number, bytes(4000))}
        values: dict[str, dict[str, object]] = {
            "camera": {"image": bytes([number]) * 65_535},
            "micro": dict(sound),
        }
        mailbox.post(Samples(float(number), values, dict.fromkeys(values, float(number))))
    joiner, last = Joiner(), None
    while mailbox._samples is not None or mailbox._pieces or parent.poll():
        mailbox.flush()
        if isinstance(message := joiner.add(parent.recv()), Samples):
            last = message
    assert last is not None
    assert last.values["camera"]["image"][:1] == bytes([49])
    assert sorted(number for number, _ in last.values["micro"].values()) == [*range(42, 50)]
    parent.close()
    mailbox.close()


def test_a_message_larger_than_the_pipe_never_blocks_who_posts_it() -> None:
    parent, theirs = Pipe()
    mailbox, joiner = Mailbox(theirs), Joiner()
    image = bytes(range(256)) * 3600
    posting = threading.Thread(target=mailbox.post, args=(Samples(1.0, {"camera": {"image": image}}, {"camera": 1.0}),))
    posting.start()
    posting.join(5.0)
    assert not posting.is_alive(), "post has blocked"
    mailbox.post(LinkState(False, "behind the picture"))
    found: list[FromWorker] = []
    while len(found) < 2:
        mailbox.flush()
        assert parent.poll(5.0)
        whole = joiner.add(parent.recv())
        found += [] if whole is None else [whole]
    samples, state = found
    assert isinstance(samples, Samples) and samples.values["camera"]["image"] == image
    assert state == LinkState(False, "behind the picture")
    parent.close()
    mailbox.close()
