"""``/metrics``: the text, and the server with clients that should not be served.  The worker is a socket of the
test."""

from __future__ import annotations

import contextlib
import json
import re
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from health_sample import HEALTHY

from urbihw.daemon import control_client, metrics
from urbihw.daemon.metrics import MetricsServer, parse_address
from urbihw.daemon.metrics_text import render

pytestmark = pytest.mark.e2e

SAMPLE = re.compile(r'urbihw_[a-z_]+\{([a-z]+="([^"\\\n]|\\.)*",?)+\} -?[0-9.e+-]+')
"""A line of the text format."""


def value(text: str, start: str) -> float:
    (line,) = [line for line in text.splitlines() if line.startswith(start)]
    return float(line.rpartition(" ")[2])


# ---------------------------------------------------------------- the text


def test_the_text_has_base_units_and_counters_end_in_total() -> None:
    text = render("bio", HEALTHY)
    assert value(text, 'urbihw_device_temperature_celsius{robot="bio",device="6",name="",model="AX-12A"}') == 41
    assert value(text, "urbihw_device_voltage_volts{") == 11.1
    assert value(text, 'urbihw_bus_errors_total{robot="bio",kind="timeouts"}') == 900
    assert value(text, 'urbihw_bus_late_ticks_total{robot="bio"}') == 3
    assert value(text, 'urbihw_health{robot="bio"}') == 0
    assert "# TYPE urbihw_bus_errors_total counter\n" in text
    assert "# TYPE urbihw_device_up gauge\n" in text


def test_each_line_is_of_the_format_and_each_family_is_described_once() -> None:
    text = render("bio", HEALTHY)
    assert text.endswith("\n")
    families = [line.split()[2] for line in text.splitlines() if line.startswith("# TYPE")]
    assert len(families) == len(set(families))
    for line in text.splitlines():
        assert line.startswith(("# HELP urbihw_", "# TYPE urbihw_")) or SAMPLE.fullmatch(line), line


def test_a_name_of_a_device_forges_no_line() -> None:
    told = json.loads(json.dumps(HEALTHY))
    told["devices"][0]["model"] = 'A"} 1\nurbihw_up{x="\\'
    assert all(line.startswith("# ") or SAMPLE.fullmatch(line) for line in render("bio", told).splitlines())


def test_a_worker_that_is_silent_is_down() -> None:
    assert render("bio", None).splitlines()[-1] == 'urbihw_up{robot="bio"} 0'


@pytest.mark.parametrize("text", ["", "9100", "0.0.0.0:9100", "192.168.1.5:9100", "localhost:9100", "127.0.0.1:0",
                                  "127.0.0.1:99999", "[::]:9100", "1.2.3:1", "127.0.0.1"])  # fmt: skip
def test_only_an_address_of_this_machine_is_taken(text: str) -> None:
    with pytest.raises(ValueError, match="."):
        parse_address(text)
    assert parse_address("127.0.0.1:9100") == ("127.0.0.1", 9100)
    assert parse_address("[::1]:9100") == ("::1", 9100)


# ---------------------------------------------------------------- the server


class WorkerSocket:
    """A control socket that answers each question, or is silent."""

    def __init__(self, path: Path) -> None:
        self.answer: dict[str, Any] | None = HEALTHY
        self.asked = 0
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._listener.bind(str(path))
        self._listener.listen()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                connection, _ = self._listener.accept()
                with connection:
                    assert json.loads(connection.recv(4096)) == {"do": "health"}
                    self.asked += 1
                    if self.answer is None:
                        connection.recv(1)  # until the other side gives up
                    else:
                        connection.sendall(json.dumps(self.answer).encode() + b"\n")

    def close(self) -> None:
        self._listener.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._listener.close()


class Site:
    """The server, and the worker that it asks."""

    def __init__(self, folder: Path) -> None:
        self.worker = WorkerSocket(folder / "bioloid-54000.sock")
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        self.server = MetricsServer(("127.0.0.1", port))
        self.server.start(folder / "bioloid-54000.sock")

    def connect(self) -> socket.socket:
        return socket.create_connection(("127.0.0.1", self.server.port), 30)

    def ask(self, request: bytes) -> str:
        """All that is answered until the connection ends."""
        heard = b""
        with self.connect() as client:
            client.sendall(request)
            with contextlib.suppress(ConnectionResetError):
                while data := client.recv(65536):
                    heard += data
        return heard.decode()

    def get(self, path: str = "/metrics", host: str = "127.0.0.1", method: str = "GET") -> str:
        return self.ask(f"{method} {path} HTTP/1.1\r\nHost: {host}\r\n\r\n".encode())

    def close(self) -> None:
        self.server.close()
        self.worker.close()


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    made = Site(tmp_path)
    yield made
    made.close()


def test_a_scrape(site: Site) -> None:
    head, _, body = site.get(host=f"localhost:{site.server.port}").partition("\r\n\r\n")
    assert head.startswith("HTTP/1.1 200 OK\r\nContent-Type: text/plain; version=0.0.4; charset=utf-8\r\n")
    assert f"Content-Length: {len(body.encode())}\r\n" in head
    assert 'urbihw_up{robot="bioloid-54000"} 1' in body
    assert "access-control" not in head.lower()


@pytest.mark.parametrize(
    ("request_", "status"),
    [
        (b"POST /metrics HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n", "405"),
        (b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n", "404"),
        (b"GET /metrics HTTP/1.1\r\nHost: evil.example\r\n\r\n", "403"),
        (b"GET /metrics HTTP/1.1\r\nHost: 127.0.0.1.evil.example\r\n\r\n", "403"),
        (b"GET /metrics HTTP/1.1\r\nHost: 127.0.0.1\r\nHost: evil.example\r\n\r\n", "403"),
        (b"GET /metrics HTTP/1.1\r\n\r\n", "403"),
        (b"hello\r\n\r\n", "400"),
    ],
)
def test_what_is_refused(site: Site, request_: bytes, status: str) -> None:
    assert site.ask(request_).startswith(f"HTTP/1.1 {status} ")
    assert site.worker.asked == 0


def test_a_request_without_end_is_cut(site: Site) -> None:
    assert site.ask(b"GET /metrics HTTP/1.1\r\nX: " + b"x" * 50_000) == ""


def test_slow_clients_are_cut_and_keep_nobody_waiting(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(metrics, "DEADLINE_S", 0.5)
    with contextlib.ExitStack() as stack:
        slow = [stack.enter_context(site.connect()) for _ in range(metrics.MAX_CLIENTS - 1)]
        for client in slow:
            client.sendall(b"GET /met")
        assert "200 OK" in site.get()
        assert all(client.recv(100) == b"" for client in slow)


def test_idle_clients_shut_nobody_out(site: Site) -> None:
    with contextlib.ExitStack() as stack:
        idle = [stack.enter_context(site.connect()) for _ in range(metrics.MAX_CLIENTS)]
        for client in idle:
            client.sendall(b"GET")
        for _ in range(3):
            assert "200 OK" in site.get()
        with contextlib.suppress(ConnectionResetError):
            assert idle[0].recv(100) == b"", "the oldest gives its place"
        idle[-1].sendall(b" /metrics HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        assert b"200 OK" in idle[-1].recv(100)


def test_more_requests_than_places_are_turned_away(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(control_client, "ANSWER_TIMEOUT_S", 30.0)
    monkeypatch.setattr(metrics, "DEADLINE_S", 30.0)
    site.worker.answer = None
    with contextlib.ExitStack() as stack:
        for _ in range(metrics.MAX_CLIENTS):
            stack.enter_context(site.connect()).sendall(b"GET /metrics HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        end = time.monotonic() + 10
        while (site.server._clients < metrics.MAX_CLIENTS or site.server._waiting) and time.monotonic() < end:
            time.sleep(0.01)
        assert site.get() == ""


def test_a_worker_that_hangs_is_told_as_down(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(control_client, "ANSWER_TIMEOUT_S", 0.1)
    site.worker.answer = None
    assert 'urbihw_up{robot="bioloid-54000"} 0' in site.get()


def test_the_worker_is_asked_once_for_requests_that_come_together(
    site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(metrics, "KEPT_S", 60.0)
    for _ in range(5):
        site.get()
    assert site.worker.asked == 1
