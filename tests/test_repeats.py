"""Lines of a log that repeat are counted and told once a minute."""

from __future__ import annotations

import asyncio
import logging

import pytest

from urbihw.repeats import MAX_KINDS, LimitedLog

log = logging.getLogger("urbihw.test")


def lines(caplog: pytest.LogCaptureFixture) -> list[str]:
    """What was logged since the last call."""
    said = [record.getMessage() for record in caplog.records]
    caplog.clear()
    return said


def test_the_first_of_a_kind_is_told_and_the_others_are_counted(caplog: pytest.LogCaptureFixture) -> None:
    async def play() -> None:
        limited_log = LimitedLog(log, 0.02)
        for number in range(1000):
            limited_log.say("refused", f"client {number} refused")
        limited_log.say("lost", "client 7 lost")
        assert lines(caplog) == ["client 0 refused", "client 7 lost"]
        await asyncio.sleep(0.1)
        assert lines(caplog) == ["999 more like this in a minute: client 999 refused"]
        for number in range(4):
            limited_log.say("refused", "client %d refused", number, most=2)
        assert lines(caplog) == ["client 0 refused", "client 1 refused"]
        limited_log.close()
        assert lines(caplog) == ["2 more like this in a minute: client 3 refused"]

    asyncio.run(play())


def test_kinds_are_bounded(caplog: pytest.LogCaptureFixture) -> None:
    async def play() -> None:
        limited_log = LimitedLog(log)
        for number in range(1000):
            limited_log.say(number, f"text {number}")
        assert len(lines(caplog)) == MAX_KINDS + 1
        limited_log.close()
        assert lines(caplog) == [f"{999 - MAX_KINDS} more like this in a minute: text 999"]

    asyncio.run(play())
