"""A daemon that is recorded in real time: the commands, what is left of what is killed, and its wire played again."""

from __future__ import annotations

import json
import signal
import subprocess
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
import starts
from test_serve import URBIHW, Daemon, until

from urbihw.recording import topics
from urbihw.recording.reading import Recording


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Runtime and state folders of this test alone."""
    for name, inner in (("XDG_RUNTIME_DIR", "run"), ("XDG_STATE_HOME", "state")):
        (tmp_path / inner).mkdir(mode=0o700)
        monkeypatch.setenv(name, str(tmp_path / inner))
    return tmp_path


@pytest.fixture
def daemon(folder: Path) -> Iterator[Daemon]:
    settings = folder / "robot.toml"
    settings.write_text("flight = 60.0\n")
    made = Daemon(folder, "--fake", "--config", str(settings))
    yield made
    made.close()


def command(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run((*URBIHW, *words), capture_output=True, text=True, timeout=60, check=False)


def test_record_look_kill_and_play_again(daemon: Daemon, folder: Path) -> None:
    flights = folder / "state" / "urbihw" / "recordings" / "bioloid"
    until(lambda: any((folder / "run" / "urbihw").glob("*.flight")), log=daemon.log)
    with starts.Forked((*URBIHW, "record", "--name", "lesson", "--folder", str(folder)), stdout=subprocess.DEVNULL,
                       stderr=subprocess.DEVNULL) as recorder:
        part = folder / "lesson.mcap.part"
        until(lambda: part.exists() and part.stat().st_size > 2000, log=daemon.log)
        client = daemon.client()
        client.ask("motor6.val = 0.5; sleep(1.2s); motor6.val;", 10)
        assert "recorded already" in command("record", "--name", "other").stderr
        until(lambda: any(Recording(part).messages((topics.APPLIED,))), log=daemon.log)
        recorder.send_signal(signal.SIGKILL)
    assert "applied" in command("show", str(part), "--device", "6").stdout
    typed = [message.content()["text"] for message in Recording(part).messages((topics.TYPED,))]
    assert any("motor6.val = 0.5" in text for text in typed)

    report = folder / "report.zip"
    assert command("report", "-o", str(report)).returncode == 0 and report.stat().st_mode & 0o777 == 0o600
    with zipfile.ZipFile(report) as archive:
        assert {*archive.namelist()} == {"about.txt", "doctor.txt", "health.json", "recording.mcap"}
        assert "ok    Python" in archive.read("doctor.txt").decode()
        assert len(json.loads(archive.read("health.json"))["devices"]) == 19
        archive.extract("recording.mcap", folder)
    assert any(Recording(folder / "recording.mcap").messages((topics.APPLIED,)))
    assert command("report", "-o", str(report)).returncode == 78  # nothing is overwritten

    # The daemon dies without a word: the flight recorder writes what it has.
    daemon.process.kill()
    until(lambda: any(flights.glob("flight-*-crash.mcap")), log=daemon.log)
    (crash,) = flights.glob("flight-*-crash.mcap")
    assert any(Recording(crash).messages((topics.APPLIED,))) and crash.stat().st_mode & 0o777 == 0o600

    # What was recorded is a robot again.
    with starts.Forked((*URBIHW, "replay", str(part), "--pty", str(folder / "robot")), stdout=subprocess.PIPE,
                       stderr=subprocess.DEVNULL, text=True) as replay:
        assert replay.stdout is not None and str(folder / "robot") in replay.stdout.readline()
        (folder / "again").mkdir()
        again = Daemon(folder / "again", "--url", str(folder / "robot"))
        try:
            assert "18 servos, 1 sensor" in again.log()
        finally:
            again.close()
            replay.send_signal(signal.SIGTERM)
        assert "requests that the recording has nothing like" in replay.stdout.read()
