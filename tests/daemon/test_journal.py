"""Entries of the journal: read at a datagram socket of the test, by the documented form of the native protocol."""

from __future__ import annotations

import logging
import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from urbihw.daemon.journal import JournalHandler, journal_handler, message_id
from urbihw.platforms.devicelog import LOST, DeviceLog


def parse(entry: bytes) -> list[tuple[str, str]]:
    """The fields of an entry ("Native Journal Protocol")."""
    fields = []
    while entry:
        line, _, entry = entry.partition(b"\n")
        key, equals, value = line.partition(b"=")
        if not equals:
            size = int.from_bytes(entry[:8], "little")
            value, entry = entry[8 : 8 + size], entry[8 + size + 1 :]
        fields.append((key.decode(), value.decode()))
    return fields


class Journal:
    """The socket of a journal, and a logger that writes to it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(str(path))
        self.socket.setblocking(False)
        self.handler = JournalHandler(path)
        self.log = logging.Logger("urbihw.bioloid")
        self.log.addHandler(self.handler)

    def entry(self) -> list[tuple[str, str]]:
        return parse(self.socket.recv(1 << 18))

    def close(self) -> None:
        self.handler.close()
        self.socket.close()


@pytest.fixture
def journal(tmp_path: Path) -> Iterator[Journal]:
    made = Journal(tmp_path / "socket")
    yield made
    made.close()


def test_an_entry_has_message_priority_and_place(journal: Journal) -> None:
    journal.log.warning("motor %d: %s", 6, "hot")
    entry = dict(journal.entry())
    assert (entry["MESSAGE"], entry["PRIORITY"], entry["SYSLOG_IDENTIFIER"]) == ("motor 6: hot", "4", "urbihw")
    assert entry["CODE_FILE"] == __file__
    assert "EVENT" not in entry and "MESSAGE_ID" not in entry


@pytest.mark.parametrize(
    ("level", "priority"), [("debug", "7"), ("info", "6"), ("warning", "4"), ("error", "3"), ("critical", "2")]
)
def test_levels_are_those_of_syslog(journal: Journal, level: str, priority: str) -> None:
    getattr(journal.log, level)("text")
    assert dict(journal.entry())["PRIORITY"] == priority


def test_an_event_of_devices_has_a_field_for_each_and_an_id(journal: Journal) -> None:
    log = DeviceLog(journal.log, lambda: 0.0, lambda seconds, action: lambda: None)
    log.log_event(LOST, "motor 6", "no answer")
    log.log_event(LOST, "motor 7", "no answer")
    log.close()
    entry = journal.entry()
    assert [value for key, value in entry if key == "DEVICE"] == ["motor 6", "motor 7"]
    fields = dict(entry)
    assert (fields["ROBOT"], fields["EVENT"], fields["MESSAGE_ID"]) == ("bioloid", "lost", message_id("lost"))
    assert fields["MESSAGE"] == "2 devices are lost: motor 6-7 (no answer)"


def test_a_value_with_line_ends_forges_no_field(journal: Journal) -> None:
    journal.log.error("first\nPRIORITY=0\nEVENT=estop")
    entry = journal.entry()
    assert entry[0] == ("MESSAGE", "first\nPRIORITY=0\nEVENT=estop")
    assert [value for key, value in entry if key == "PRIORITY"] == ["3"]


def test_a_huge_message_is_cut(journal: Journal) -> None:
    journal.log.error("x" * 1_000_000)
    assert len(dict(journal.entry())["MESSAGE"]) == 32 * 1024


def test_a_journal_that_does_not_read_blocks_nobody_and_learns_what_it_missed(journal: Journal) -> None:
    for _ in range(2000):
        journal.log.info("%s", "x" * 1000)
    read = 0
    while True:
        try:
            journal.socket.recv(1 << 18)
        except BlockingIOError:
            break
        read += 1
    journal.log.info("later")
    assert int(dict(journal.entry())["DROPPED"]) == 2000 - read
    journal.log.info("still later")
    assert "DROPPED" not in dict(journal.entry())


def test_only_the_stream_of_the_journal_is_replaced(tmp_path: Path, journal: Journal) -> None:
    with (tmp_path / "stream").open("w") as stream:
        about = os.fstat(stream.fileno())
        mine = {"JOURNAL_STREAM": f"{about.st_dev}:{about.st_ino}"}
        handler = journal_handler(mine, stream.fileno(), journal.path)
        assert handler is not None
        handler.close()
        assert journal_handler(mine, stream.fileno(), tmp_path / "none") is None
        for other in ({}, {"JOURNAL_STREAM": ""}, {"JOURNAL_STREAM": f"{about.st_dev}:{about.st_ino + 1}"}):
            assert journal_handler(other, stream.fileno(), journal.path) is None
