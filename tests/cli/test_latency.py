"""``urbihw latency``: the numbers, the text, and what is measured; real processes are in tests/e2e."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from kernel_socket import KernelSocket
from worker_socket import WorkerSocket

from urbihw.cli import latency, tracing
from urbihw.cli.main import main

Capture = pytest.CaptureFixture[str]


def test_percentiles() -> None:
    times = [float(number) for number in range(1, 101)]
    assert [latency.percentile(times, share) for share in (0.5, 0.9, 0.99)] == [50.0, 90.0, 99.0]
    assert latency.percentile([3.0], 0.5) == 3.0


def test_the_histogram_has_a_bar_for_each_class() -> None:
    assert latency.histogram("telnet", [0.00015] * 4 + [0.0006]) == [
        "telnet: 5 round trips: p50 0.150 ms, p90 0.600 ms, p99 0.600 ms, worst 0.600 ms",
        "      0.1 ..   0.2 ms  ######################################## 4",
        "      0.2 ..   0.5 ms                                           0",
        "      0.5 ..     1 ms  ##########                               1",
    ]
    assert latency.histogram("bus", [0.0])[1].startswith("    0.001 .. 0.002 ms")


def test_an_unknown_word_is_one_line(capsys: Capture) -> None:
    assert main(["latency", "moon"]) == 78
    assert capsys.readouterr().err == "urbihw: what is 'moon'? Give telnet, remote, bus\n"


def test_a_statement_and_its_answer(monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    server = KernelSocket()
    monkeypatch.setattr("urbihw.client.connect._plain", lambda where, timeout: server)
    assert main(["latency", "telnet", "-H", "127.0.0.1", "--no-tls", "--count", "5", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["telnet"]
    assert told["count"] == 5 and 0 < told["p50"] <= told["worst"]
    assert server.sent.count(b"1;\n") == 5


def test_the_bus_is_only_listened_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    path = tmp_path / "bioloid-54000.sock"
    chunks = [[1.0, ">", "01"], [1.0015, "<", "02"], [1.002, "<", "03"], [1.1, ">", "01"], [1.1025, "<", "02"]]
    worker = WorkerSocket(path, {"url": "/dev/ttyUSB7"}, [{"event": "Traffic", "chunks": chunks, "lost": 0}])
    monkeypatch.setattr(tracing, "control_sockets", lambda: [path])
    try:
        assert main(["latency", "bus", "--json"]) == 0
    finally:
        worker.close()
    assert [round(each, 6) for each in json.loads(capsys.readouterr().out)["bus"]["times"]] == [0.0015, 0.0025]
    assert worker.asked == ["trace"]


def test_without_a_daemon_there_is_one_line_each(monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    monkeypatch.setattr(tracing, "control_sockets", list)
    assert main(["latency", "bus"]) == 69
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("urbihw: bus: no daemon on this machine")
