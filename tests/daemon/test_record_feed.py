"""What a daemon tells to recorders: settings, log and clients; never a secret."""

from __future__ import annotations

import asyncio
import json
import socket
import stat
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

from urbihw.daemon.config import Config
from urbihw.daemon.record_feed import MOST_CLIENTS, MOST_TEXT, MOST_UNREAD, RecordFeed, shown_settings
from urbihw.kernel.server.connection import LobbyConnection
from urbihw.recording import topics
from urbihw.recording.reading import RecordedMessage
from urbihw.recording.records import RecordMaker
from urbihw.recording.showing import line_of

ALICE = cast(LobbyConnection, SimpleNamespace(peer="10.0.0.7:5000 (alice)"))


def test_settings_have_no_secret() -> None:
    options = {"password": "hush", "user": "me"}
    config = Config(platform="spykee", url="spykee://10.0.0.9?password=hush", options=options)
    shown = shown_settings(config)
    assert "hush" not in json.dumps(shown, default=str)
    assert (shown["platform"], shown["url"], shown["options.user"]) == ("spykee", "spykee://10.0.0.9", "me")
    assert shown["options.password"] is None


async def read(path: Path, count: int) -> list[dict[str, Any]]:
    reader, writer = await asyncio.open_unix_connection(path, limit=1 << 22)
    lines = [json.loads(await asyncio.wait_for(reader.readline(), 5)) for _ in range(count)]
    writer.close()
    return lines


async def feed_with(folder: Path) -> RecordFeed:
    feed = RecordFeed(str(folder / "bioloid-1.sock"), {"rate": 100.0})
    await feed.start()
    return feed


def test_files_that_are_made_while_the_feed_starts_have_their_usual_modes(tmp_path: Path) -> None:
    async def other() -> None:
        (tmp_path / "other").mkdir()

    async def trial() -> None:
        feed = RecordFeed(str(tmp_path / "bioloid-1.sock"), {})
        await asyncio.gather(feed.start(), other())
        feed.close()

    asyncio.run(trial())
    (tmp_path / "another").mkdir()
    assert (tmp_path / "other").stat().st_mode == (tmp_path / "another").stat().st_mode


def test_a_feed_takes_the_place_of_one_that_was_killed(tmp_path: Path) -> None:
    async def trial() -> None:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as dead:
            dead.bind(str(tmp_path / "bioloid-1.feed"))
        feed = await feed_with(tmp_path)
        (settings,) = await read(tmp_path / "bioloid-1.feed", 1)
        assert settings["event"] == "Settings"
        feed.close()

    asyncio.run(trial())


def test_a_recorder_gets_settings_log_and_what_clients_say(tmp_path: Path) -> None:
    async def trial() -> list[dict[str, Any]]:
        feed = await feed_with(tmp_path)
        path = tmp_path / "bioloid-1.feed"
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        task = asyncio.create_task(read(path, 4))
        while not feed._clients:
            await asyncio.sleep(0.01)
        feed.add_log({"date": 1.5, "level": "warning", "text": "link lost", "fields": {"logger": "urbihw.robot"}})
        feed.overhear(ALICE, ">", b"token abc-DEF_123\r\nmotor6.val = 1;\n")
        feed.overhear(ALICE, "<", b"x" * 100_000)
        lines = await task
        feed.close()
        assert not path.exists()
        return lines

    settings, log, typed, answered = asyncio.run(trial())
    assert settings["settings"] == {"rate": 100.0}
    assert typed["text"] == "token ...\r\nmotor6.val = 1;\n"
    assert len(answered["text"]) == MOST_TEXT and answered["size"] == 100_000
    maker = RecordMaker()
    lines = (json.dumps(line).encode() for line in (settings, log, typed, answered))
    records = [record for line in lines for record in maker.records(line)]
    assert [record.topic for record in records] == [topics.SETTINGS, topics.LOG, topics.TYPED, topics.ANSWERED]
    shown = [line_of(RecordedMessage(*record)).split(None, 1)[1] for record in records[:3]]
    assert shown == [
        "settings   rate = 100.0",
        "log        link lost",
        r"typed      10.0.0.7:5000 (alice): token ...\r\nmotor6.val = 1;",
    ]
    assert json.loads(records[1].data)["level"] == 3 and json.loads(records[1].data)["timestamp"]["nsec"] == 500_000_000
    assert maker.beginning == records[:1]


def test_a_recorder_that_does_not_read_loses_lines_and_is_told_how_many(tmp_path: Path) -> None:
    async def trial() -> tuple[int, list[dict[str, Any]]]:
        feed = await feed_with(tmp_path)
        reader, writer = await asyncio.open_unix_connection(tmp_path / "bioloid-1.feed", limit=1 << 22)
        while not feed._clients:
            await asyncio.sleep(0.01)
        for _ in range(2000):
            feed.overhear(ALICE, "<", b"y" * MOST_TEXT)
        (client,) = feed._clients
        waiting = client.transport.get_write_buffer_size()
        lines = [json.loads(await reader.readline())]
        while len(lines) < 100:
            lines.append(json.loads(await asyncio.wait_for(reader.readline(), 5)))
        await asyncio.sleep(0.05)
        feed.overhear(ALICE, ">", b"z")
        while lines[-1].get("text") != "z":
            lines.append(json.loads(await asyncio.wait_for(reader.readline(), 5)))
        writer.close()
        feed.close()
        return waiting, lines

    waiting, lines = asyncio.run(trial())
    assert waiting < MOST_UNREAD + 2 * MOST_TEXT
    assert lines[-1]["dropped"] > 500 and len(lines) - 2 + lines[-1]["dropped"] == 2000


def test_recorders_are_few(tmp_path: Path) -> None:
    async def trial() -> int:
        feed = await feed_with(tmp_path)
        made = [await asyncio.open_unix_connection(tmp_path / "bioloid-1.feed") for _ in range(MOST_CLIENTS + 3)]
        ended = 0
        for reader, _ in made:
            ended += not await asyncio.wait_for(reader.readline(), 5)
        for _, writer in made:
            writer.close()
        feed.close()
        return ended

    assert asyncio.run(trial()) == 3
