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
    assert line.startswith("urbihw: bus: no daemon of this machine")


@pytest.mark.parametrize(("port", "count"), [("54000", 2), ("54001", 1)])
def test_the_bus_is_that_of_the_server_on_a_port(
    port: str, count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    rows = [[8.0, ">", "01"], [8.001, "<", "02"], [9.0, ">", "01"], [9.001, "<", "02"]]
    paths = [tmp_path / "bioloid-54000.sock", tmp_path / "p3dx-54001.sock"]
    workers = [
        WorkerSocket(path, {"url": path.stem, "devices": []}, [{"event": "Traffic", "chunks": chunks}])
        for path, chunks in zip(paths, (rows, rows[:2]), strict=True)
    ]
    monkeypatch.setattr(tracing, "control_sockets", lambda: paths)
    try:
        assert main(["latency", "bus", "-P", port, "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["bus"]["count"] == count
        assert main(["latency", "bus", "-P", "54002"]) == 69
        assert "no daemon of this machine serves a robot on port 54002" in capsys.readouterr().err
        assert main(["latency", "bus"]) == 69
        assert "which robot? Give one of: --socket" in capsys.readouterr().err
    finally:
        for worker in workers:
            worker.close()


def test_the_bus_of_another_machine_cannot_be_measured_here(capsys: Capture) -> None:
    assert main(["latency", "bus", "-H", "robot.local"]) == 69
    told = "urbihw: bus: a bus is measured on its own machine only: log in to robot.local\n"
    assert capsys.readouterr().err == told
