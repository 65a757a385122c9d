"""Music of a Spykee: files are sent whole and played, streams without an end go on until they are stopped."""

from __future__ import annotations

import http.server
import itertools
import logging
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from spykee_lab import Lab

from urbihw.platforms.spykee import music
from urbihw.platforms.spykee.bulk import CHUNK_BYTES
from urbihw.platforms.spykee.mp3 import chunks_of
from urbihw.platforms.spykee.music import PIECE_BYTES, READ_BYTES, MusicReader

TIMEOUT_S = 10.0
STATION = "http://station/"


class Station:
    """A radio station: the k-th byte that it sends is k modulo 251.

    Attributes:
        sent: bytes so far.
        off: it sends nothing more, and the connection ends.
        breaks: the connection breaks instead.
    """

    def __init__(self) -> None:
        self.sent = 0
        self.off = self.breaks = False
        self.closed = threading.Event()

    def read1(self, size: int) -> bytes:
        if self.breaks:
            raise TimeoutError("timed out")
        if self.off:
            return b""
        data = course(self.sent, size)
        self.sent += size
        return data

    def close(self) -> None:
        self.closed.set()


def course(start: int, size: int) -> bytes:
    """Bytes that a station sends."""
    period = bytes(range(251))
    first = start % 251
    return (period * (size // 251 + 2))[first : first + size]


@pytest.fixture
def station(monkeypatch: pytest.MonkeyPatch) -> Station:
    made = Station()
    real = music.open_source
    monkeypatch.setattr(music, "open_source", lambda name: (made, None) if name == STATION else real(name))
    return made


def settle(lab: Lab) -> None:
    """Wait for threads that know nothing of simulated time: those of calls, and readers that have enough."""
    for thread in threading.enumerate():
        if thread.name == "urbihw-uobject":
            thread.join(TIMEOUT_S)
    reader = lab.robot.mp3._reader
    if reader is not None:
        full = reader._capacity
        with reader._changed:
            assert reader._changed.wait_for(lambda: reader._ended or len(reader._buffer) >= full, TIMEOUT_S)


def wait(lab: Lab, done: Callable[[], object], seconds: float = 10.0) -> None:
    """Let time pass until something holds; threads are as fast as they need to be."""
    end = lab.clock.now() + seconds
    while not done():
        assert lab.clock.now() < end, "it did not happen in time"
        settle(lab)
        lab.step()


def heard_music(lab: Lab) -> bytes:
    return b"".join(lab.device.music)


# ---------------------------------------------------------------- one file


@pytest.mark.parametrize("size", [1, CHUNK_BYTES, 3 * CHUNK_BYTES, 3 * CHUNK_BYTES + 5])
def test_music_is_sent_whole_and_played(tmp_path: Path, size: int) -> None:
    lab = Lab.ready()
    (tmp_path / "a.mp3").write_bytes(course(0, size))
    lab.say('at (mp3.ended?) echo("over");', 0.1)
    lab.say(f'mp3.play("{tmp_path}/a.mp3");', 0)
    wait(lab, lambda: lab.device.music)
    assert lab.device.music == [course(0, size)]
    lab.run(0.1)
    assert "over" in lab.heard() + lab.say("", 2.0)
    assert lab.look("[mp3.playing, mp3.sent]") == "[false, 1]"


def test_music_can_be_stopped(tmp_path: Path) -> None:
    lab = Lab.ready()
    (tmp_path / "a.mp3").write_bytes(bytes(200_000))
    lab.say('at (mp3.ended?) echo("over");', 0.1)
    lab.say(f'mp3.play("{tmp_path}/a.mp3");', 0)
    wait(lab, lambda: lab.look("mp3.playing") == "true")
    assert "over" not in lab.say("mp3.stop;", 0.1)
    assert lab.device.music_ends is None
    assert lab.look("mp3.playing") == "false"


def test_other_music_takes_the_place_of_what_plays(tmp_path: Path) -> None:
    lab = Lab.ready()
    for name in "ab":
        (tmp_path / name).write_bytes(name.encode() * 100_000)
    lab.say(f'mp3.play("{tmp_path}/a");', 0)
    wait(lab, lambda: lab.look("mp3.playing") == "true")
    lab.say(f'mp3.play("{tmp_path}/b");', 0)
    wait(lab, lambda: len(lab.device.music) == 2)
    assert lab.device.music == [b"a" * 100_000, b"b" * 100_000]
    assert lab.device.cut_music == 0  # the first was stopped before its file was replaced
    assert "there is no file" in lab.say('mp3.play("/none.mp3");', 0) + _later(lab)
    assert lab.look("mp3.playing") == "true"


def _later(lab: Lab) -> str:
    settle(lab)
    lab.run(0.1)
    return lab.heard()


def test_a_stop_ends_a_call_that_is_still_reading(station: Station, monkeypatch: pytest.MonkeyPatch) -> None:
    lab = Lab.ready()
    go = threading.Event()
    opened = music.open_source

    def wait_and_open(name: str) -> Any:
        assert go.wait(TIMEOUT_S)
        return opened(name)

    monkeypatch.setattr(music, "open_source", wait_and_open)
    lab.say(f'mp3.play("{STATION}"),', 0.1)
    lab.say("mp3.stop;", 0.1)
    go.set()
    settle(lab)
    lab.run(3.0)
    assert station.closed.wait(TIMEOUT_S)
    assert lab.device.music == []
    assert lab.look("mp3.playing") == "false"


def test_driving_goes_on_while_music_is_sent(tmp_path: Path) -> None:
    lab = Lab.ready()
    (tmp_path / "a.mp3").write_bytes(bytes(1_000_000))
    lab.say("trackL.val = 60;", 0.5)
    lab.say(f'mp3.play("{tmp_path}/a.mp3");', 0)
    wait(lab, lambda: lab.number("mp3.sent") > 0.1 and lab.number("mp3.sent") < 1)
    lab.say("robot.stop;", 0.04)
    assert lab.device.body.wanted == [0.0, 0.0]
    wait(lab, lambda: lab.look("mp3.playing") == "true")


def test_the_last_chunk_is_known_by_the_size() -> None:
    assert [flags for flags, _ in chunks_of(bytes(CHUNK_BYTES))] == [3]
    assert [flags for flags, _ in chunks_of(bytes(2 * CHUNK_BYTES))] == [1, 2]
    assert [flags for flags, _ in chunks_of(bytes(2 * CHUNK_BYTES + 1))] == [1, 0, 2]


def test_what_cannot_be_read_is_an_error_of_the_call(tmp_path: Path) -> None:
    (tmp_path / "empty").touch()
    for stream, words in (
        (f"{tmp_path}/none.mp3", "there is no file"), (f"{tmp_path}/empty", "is empty"), ("", "there is no file ''"),
        (str(tmp_path), "there is no file"),
        ("http://127.0.0.1:9/x.mp3", "cannot read http://127.0.0.1:9/x.mp3: "), ("http://[", "cannot read"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=words):
            MusicReader(stream).open()


# ---------------------------------------------------------------- without an end


def test_a_station_plays_on_in_bounded_memory_until_it_is_stopped(station: Station) -> None:
    lab = Lab.ready()
    lab.say(f'mp3.play("{STATION}");', 0)
    settle(lab)
    wait(lab, lambda: lab.look("mp3.playing") == "true")
    seconds = 100
    wait(lab, lambda: len(heard_music(lab)) > seconds * 16_000, 1.3 * seconds)
    assert heard_music(lab) == course(0, len(heard_music(lab)))
    assert max(map(len, lab.device.music)) <= PIECE_BYTES
    assert station.sent - len(heard_music(lab)) <= 2 * PIECE_BYTES + READ_BYTES
    assert lab.device.cut_music == 0
    assert lab.look("[mp3.sent, mp3.playing]") in ("[nan, true]", "[nan, false]")
    lab.say("mp3.stop;", 0.1)
    assert station.closed.wait(TIMEOUT_S)
    count = len(lab.device.music)
    lab.run(60)
    assert (len(lab.device.music), lab.device.music_ends) == (count, None)


def test_a_station_that_goes_off_ends_when_all_was_played(station: Station, caplog: pytest.LogCaptureFixture) -> None:
    lab = Lab.ready()
    lab.say('at (mp3.ended?) echo("over");', 0.1)
    lab.say(f'mp3.play("{STATION}");', 0)
    settle(lab)
    wait(lab, lambda: lab.look("mp3.playing") == "true")
    station.off = True
    wait(lab, lambda: "over" in lab.heard(), 200)
    assert heard_music(lab) == course(0, station.sent)
    assert [record.message for record in caplog.records if record.levelno >= logging.WARNING] == []


def test_a_station_that_breaks_off_is_told_in_one_line(station: Station, caplog: pytest.LogCaptureFixture) -> None:
    lab = Lab.ready()
    lab.say(f'mp3.play("{STATION}");', 0)
    settle(lab)
    station.breaks = True
    with caplog.at_level(logging.WARNING):
        wait(lab, lambda: caplog.records, 200)
    (line,) = [record.message for record in caplog.records]
    assert line.endswith(f"mp3: {STATION} broke off after {station.sent} bytes: timed out")
    assert heard_music(lab) == course(0, station.sent)


def test_a_lost_link_ends_a_station(station: Station) -> None:
    lab = Lab.ready()
    lab.say(f'mp3.play("{STATION}");', 0)
    settle(lab)
    wait(lab, lambda: lab.look("mp3.playing") == "true")
    lab.unplug()
    lab.run(1.0)
    assert station.closed.wait(TIMEOUT_S)
    assert lab.look("mp3.playing") == "false"


def test_a_long_file_is_played_in_pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(music, "WHOLE_BYTES", PIECE_BYTES)
    lab = Lab.ready()
    size = 2 * PIECE_BYTES + 1000
    (tmp_path / "a.mp3").write_bytes(course(0, size))
    lab.say(f'mp3.play("{tmp_path}/a.mp3");', 0)
    settle(lab)
    wait(lab, lambda: len(heard_music(lab)) == size and lab.device.music_ends is None, 200)
    assert heard_music(lab) == course(0, size)
    assert len(lab.device.music) >= 3
    lab.run(0.1)
    assert lab.look("[mp3.playing, mp3.sent]") == "[false, 1]"


# ---------------------------------------------------------------- http


@pytest.fixture
def radio() -> Iterator[str]:
    """An http server on this machine: ``/song`` has 9003 bytes, ``/short`` fewer than it says, ``/radio`` no end."""

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            if self.path == "/short":
                self.send_header("Content-Length", "20000")
            self.end_headers()
            if self.path != "/radio":
                self.wfile.write(b"ID3" + bytes(9000))
                return
            try:
                for start in itertools.count(0, 4096):
                    self.wfile.write(course(start, 4096))
            except ConnectionError:
                pass

        def log_message(self, *arguments: Any) -> None: ...

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()
        thread.join()


def test_music_of_an_http_address(radio: str) -> None:
    lab = Lab.ready()
    lab.say(f'mp3.play("{radio}/song");', 0)
    wait(lab, lambda: lab.device.music)
    assert lab.device.music == [b"ID3" + bytes(9000)]


def test_a_song_that_comes_in_part_is_an_error_of_the_call(radio: str) -> None:
    with pytest.raises(ValueError, match="/short broke off after 9003 of 20000 bytes"):
        MusicReader(f"{radio}/short").open()


def test_a_stream_of_an_http_address_goes_on(radio: str) -> None:
    lab = Lab.ready()
    lab.say(f'mp3.play("{radio}/radio");', 0)
    settle(lab)
    wait(lab, lambda: len(heard_music(lab)) > 2 * PIECE_BYTES, 200)
    assert heard_music(lab) == course(0, len(heard_music(lab)))
    lab.say("mp3.stop;", 0.1)
    for thread in threading.enumerate():
        if thread.name == "urbihw-music":
            thread.join(TIMEOUT_S)
    assert all(thread.name != "urbihw-music" for thread in threading.enumerate())
