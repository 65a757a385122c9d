"""``urbihw trace``: captures, the traffic of a daemon, a port that is only listened to."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from worker_socket import WorkerSocket

import urbihw_fakes
from urbihw import buses
from urbihw.buses.capture import CaptureHead
from urbihw.buses.clock import BusSimClock
from urbihw.buses.link import Context, Link
from urbihw.buses.pipe import PipeEnd
from urbihw.buses.servos import packet
from urbihw.buses.servos import trace as trace_servos
from urbihw.buses.trace import Chunk, TracedPacket
from urbihw.cli import trace, tracing
from urbihw.cli.main import main

CAPTURES = Path(urbihw_fakes.__file__).parent / "captures"
READ, ANSWER = "ffff0104022402d2", "ffff0104000002f8"
Capture = pytest.CaptureFixture[str]


@pytest.fixture
def worker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[WorkerSocket]:
    """A worker of a Bioloid on /dev/ttyUSB7, on whose wire a servo is read."""
    path = tmp_path / "bioloid-54000.sock"
    events: list[dict[str, Any]] = [
        {"event": "Traffic", "chunks": [[8.0, ">", READ], [8.0012, "<", ANSWER]], "lost": 0},
        {"event": "Samples"},
        {"event": "Traffic", "chunks": [[9.0, ">", READ]], "lost": 3},
    ]
    devices = [{"id": 1, "model": 12, "protocol": 1}]
    made = WorkerSocket(path, {"url": "/dev/ttyUSB7", "devices": devices, "baud": 1_000_000, "link": True}, events)
    monkeypatch.setattr(tracing, "control_sockets", lambda: [path])
    yield made
    made.close()


def test_a_capture_is_decoded_line_by_line(capsys: Capture) -> None:
    assert main(["trace", str(CAPTURES / "dynamixel.hex"), "--platform", "bioloid", "--count", "3"]) == 0
    told = capsys.readouterr()
    assert told.out.splitlines() == [
        "-- [p1-ping]",
        "   0.000000    +0.000 ms  >    1  ping          checksum ok",
        "   0.000000    +0.000 ms  <    1  status        checksum ok",
        "-- [p1-read-temperature]",
        "   0.000000    +0.000 ms  >    1  read          present_temperature @43:1 (as AX-12)  checksum ok",
    ]
    assert told.err == "3 packets in 0.000 s, 0 damaged, 0 requests without an answer\n"


def test_a_daemon_is_found_by_the_url_and_knows_the_models(worker: WorkerSocket, capsys: Capture) -> None:
    assert main(["trace", "/dev/ttyUSB7?baud=1000000", "--bytes"]) == 0
    told = capsys.readouterr()
    assert told.out.splitlines() == [
        "   0.000000    +0.000 ms  >    1  read          present_position @36:2  checksum ok  "
        "[FF FF 01 04 02 24 02 D2]",
        "   0.001200    +1.200 ms  <    1  status        present_position 512 (0.002559 rad)  checksum ok  "
        "[FF FF 01 04 00 00 02 F8]",
        "-- 3 pieces of the traffic were lost",
        "-- nothing for 1.00 s",
        "   1.000000  +998.800 ms  >    1  read          present_position @36:2  checksum ok  "
        "[FF FF 01 04 02 24 02 D2]",
        "   1.000000    +0.000 ms  <    1  no answer     !! no answer",
    ]
    assert told.err == "4 packets in 1.000 s, 0 damaged, 1 requests without an answer\n"
    assert worker.asked == ["trace"]


def test_what_is_saved_is_decoded_again(worker: WorkerSocket, tmp_path: Path, capsys: Capture) -> None:
    file = tmp_path / "wire.txt"
    assert main(["trace", "--save", str(file), "--json"]) == 0
    assert file.stat().st_mode & 0o777 == 0o600
    first = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert main(["trace", str(file), "--json"]) == 0
    again = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    kinds = [each["what"] for each in first if "what" in each]
    assert kinds == ["read", "status", "read", "no answer"]
    assert [each["what"] for each in again if "what" in each] == kinds
    # The model comes from the file, too: a servo whose model is assumed has "(as AX-12)".
    assert [each["detail"] for each in again if "what" in each] == [each["detail"] for each in first if "what" in each]
    assert main(["trace", str(file), "--platform", "chain"]) == 0
    capsys.readouterr()
    assert main(["trace", str(file), "--platform", "nxt"]) == 78
    told = f"urbihw: {file} is the traffic of a bioloid, not of a nxt: leave --platform out\n"
    assert capsys.readouterr() == ("", told)
    assert main(["trace", str(file), "--save", str(file)]) == 78
    assert "name another file" in capsys.readouterr().err and file.stat().st_size


def test_the_platform_of_a_daemon_is_known(worker: WorkerSocket, capsys: Capture) -> None:
    assert main(["trace", "--platform", "nxt"]) == 78
    assert "is the traffic of a bioloid, not of a nxt" in capsys.readouterr().err


def test_a_guessed_platform_may_be_corrected(tmp_path: Path, capsys: Capture) -> None:
    file = tmp_path / "wire.txt"
    file.write_text(CaptureHead("chain", guessed=True).line() + "\n0.1  > FF FF 01 02 01 FB\n")
    for words in ([], ["--platform", "so101"]):
        assert main(["trace", str(file), *words]) == 0
        assert "ping" in capsys.readouterr().out


@pytest.mark.parametrize(
    "head",
    [
        "{", "[]", '{"platform": 5, "devices": [], "guessed": false}', '{"platform": "chain", "devices": [5]}',
        "[" * 99999, '{"platform": "chain", "devices": [5], "guessed": false}',
    ],
)  # fmt: skip
def test_a_damaged_head_is_one_line(head: str, tmp_path: Path, capsys: Capture) -> None:
    file = tmp_path / "wire.txt"
    file.write_text(f"# urbihw trace: {head}\n")
    assert main(["trace", str(file)]) == 66
    assert capsys.readouterr().err == "urbihw: line 1 begins as that of a capture, and is damaged: remove it\n"


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        (("/dev/ttyUSB9",), 69, "/dev/ttyUSB9"),
        (("spykee://10.0.0.1", "--platform", "spykee"), 78, "no daemon serves spykee://10.0.0.1"),
        (("--socket", "/nowhere.sock"), 69, "is the daemon running?"),
        ((), 69, "no daemon answers"),
        (("/nowhere/wire.txt",), 66, "no such file or port: /nowhere/wire.txt"),
        (("wire.txt",), 66, "no such file or port: wire.txt"),
        ((str(CAPTURES / "nxt.hex"),), 78, "Give --platform, one of: bioloid, chain"),
        ((str(CAPTURES / "nxt.hex"), "--platform", "nix"), 78, "no platform 'nix'"),
        ((str(CAPTURES / "__init__.py"), "--platform", "nxt"), 66, "is no line of a capture"),
    ],
)
def test_what_cannot_be_shown_is_one_line(
    words: tuple[str, ...], code: int, told: str, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tracing, "control_sockets", list)
    assert main(["trace", *words]) == code
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("urbihw: ") and told in line


def test_listening_writes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    clock, written = BusSimClock(1.0), []
    end = PipeEnd(lambda data, at: written.append(data))
    context = Context(clock, {"robot": end})

    def opened(url: str) -> Link:
        link = buses.port_for(url, context)
        link.open()
        end.send(bytes.fromhex(READ), 1.5)
        end.send(bytes.fromhex(ANSWER), 2.5)
        assert isinstance(link, Link)
        return link

    monkeypatch.setattr(buses, "open", opened)
    heard = list(trace.listen("pipe://robot?baud=1000000", 4.0))
    assert [(each.direction, each.data.hex()) for each in heard] == [("<", READ), ("<", ANSWER)]
    assert written == []


def test_nothing_that_a_robot_sends_controls_the_terminal() -> None:
    stream = io.StringIO()
    printer = trace.Printer(stream, False, False, 0)
    printer.show([TracedPacket(0.0, "<", "", "log", "\x1b[2Jhello\n")])
    assert stream.getvalue() == "   0.000000    +0.000 ms  <       log           ?[2Jhello\n"


def test_the_page_shows_the_form_of_a_line() -> None:
    stream = io.StringIO()
    decoder = trace_servos.dynamixel([{"id": 6, "model": 12, "protocol": 1}])
    request, answer = packet.read_packet(1, 6, 36, 2), packet.encode_1(6, 0, b"\x00\x02")
    printer = trace.Printer(stream, False, False, 0)
    printer.show(decoder.feed(Chunk(5.0, ">", request)) + decoder.feed(Chunk(5.000412, "<", answer)))
    page = (Path(__file__).resolve().parents[2] / "docs" / "diagnosis.md").read_text("utf-8")
    assert all(f"    {line}\n" in page for line in stream.getvalue().splitlines())


@pytest.mark.parametrize(
    ("about", "event"),
    [
        ({"devices": 5}, {}),
        ({"devices": ["x"]}, {}),
        ({"devices": {"id": 1}}, {}),
        ({}, {"lost": []}),
        ({}, {"lost": None}),
        ({}, {"chunks": 5}),
        ({}, {"chunks": [5]}),
        ({}, {"chunks": [[None, "<", "ff"]]}),
        ({}, {"chunks": [[float("nan"), "<", "ff"]]}),
        ({}, {"chunks": [[10**400, "<", "ff"]]}),
        ({}, {"chunks": [[1.0, "<", "no hex"]]}),
    ],
)
def test_an_answer_without_sense_is_one_line(
    about: dict[str, Any], event: dict[str, Any], tmp_path: Path, capsys: Capture
) -> None:
    path = tmp_path / "bioloid-54000.sock"
    worker = WorkerSocket(path, {"url": "/dev/ttyUSB7", **about}, [{"event": "Traffic", **event}])
    try:
        assert main(["trace", "--socket", str(path)]) == 69
    finally:
        worker.close()
    (line,) = capsys.readouterr().err.splitlines()
    assert line == f"urbihw: {path}: this daemon's answer has no sense; is it of the same version?"


def test_devices_with_odd_ids_are_passed_over() -> None:
    decoder = trace_servos.dynamixel([{"id": [], "model": 12, "protocol": 1}, {"id": 1, "model": "x", "protocol": {}}])
    assert "(as AX-12)" in decoder.feed(Chunk(0.0, ">", bytes.fromhex(READ)))[0].detail


def test_a_file_without_line_ends_is_refused(tmp_path: Path, capsys: Capture) -> None:
    path = tmp_path / "long"
    with open(path, "wb") as file:
        file.truncate(1 << 26)
    assert main(["trace", str(path), "--platform", "chain"]) == 66
    assert "line 1 is longer than 1048576 characters" in capsys.readouterr().err


@pytest.mark.parametrize("line", [b"[" * 100_000, b"hello", b'{"event": "Traffic", "lost": ' + b"9" * 5000 + b"}"])
@pytest.mark.parametrize("command", [["trace"], ["latency", "bus"]])
def test_a_line_that_is_no_json_is_told(command: list[str], line: bytes, tmp_path: Path, capsys: Capture) -> None:
    path = tmp_path / "bioloid-54000.sock"
    worker = WorkerSocket(path, {"url": "/dev/ttyUSB7"}, [line])
    try:
        assert main([*command, "--socket", str(path)]) == 69
    finally:
        worker.close()
    (told,) = capsys.readouterr().err.splitlines()
    assert f"{path}: this daemon's answer has no sense" in told
