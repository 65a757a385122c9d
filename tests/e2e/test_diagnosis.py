"""``urbihw trace``, ``latency`` and ``doctor`` beside a daemon that serves a simulated robot, as real processes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
import starts

from urbihw.cli.tracing import open_traffic

TIMEOUT_S = 60.0


class Served:
    """A daemon with a simulated Bioloid, and commands beside it."""

    def __init__(self, folder: Path) -> None:
        self.environment = {**os.environ, "XDG_RUNTIME_DIR": str(folder)}
        self._port_file = folder / "port"
        words = ("serve", "--platform", "bioloid", "--fake", "--port", "0", "--port-file", str(self._port_file))
        self._daemon = starts.Forked(
            (sys.executable, "-m", "urbihw.cli.main", *words), env=self.environment, stderr=subprocess.DEVNULL
        )
        end = time.monotonic() + TIMEOUT_S
        while not self._port_file.exists() and time.monotonic() < end:
            time.sleep(0.05)
        self.port = int(self._port_file.read_text())
        (self.socket,) = (folder / "urbihw").glob("bioloid-*.sock")
        while not (about := self.about())["link"] and time.monotonic() < end:
            time.sleep(0.1)
        self.url = str(about["url"])

    def about(self) -> Mapping[str, Any]:
        """What the worker tells of its wire."""
        with open_traffic(self.socket) as traffic:
            return traffic.about

    def command(self, *words: str) -> subprocess.CompletedProcess[str]:
        return starts.run(
            (sys.executable, "-m", "urbihw.cli.main", *words), env=self.environment, capture_output=True, text=True,
            timeout=TIMEOUT_S,
        )  # fmt: skip

    def close(self) -> None:
        self._daemon.terminate()
        self._daemon.wait(TIMEOUT_S)


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("run")
    folder.chmod(0o700)
    made = Served(folder)
    yield made
    made.close()


def test_trace_shows_the_cycle_of_the_daemon(served: Served) -> None:
    done = served.command("trace", "--count", "60", "--seconds", "20", "--json")
    packets = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 0 and len(packets) == 60
    whole = [each for each in packets[2:] if not each["problem"]]
    assert {"read", "status"} <= {each["what"] for each in whole}
    assert all(each["check"] == "ok" for each in whole)
    assert any("present_position 512" in each["detail"] and "(as" not in each["detail"] for each in whole)


def test_latency_measures_all_three_and_leaves_nothing(served: Served) -> None:
    done = served.command("latency", "-H", "127.0.0.1", "-P", str(served.port), "--count", "20", "--json")
    told = json.loads(done.stdout)
    assert {what: each["count"] for what, each in told.items()} == {"telnet": 20, "remote": 20, "bus": 20}
    assert all(0 < each["p50"] <= each["worst"] for each in told.values())
    again = served.command("latency", "remote", "-H", "127.0.0.1", "-P", str(served.port), "--count", "3")
    assert again.returncode == 0, again.stderr


def test_doctor_asks_the_daemon(served: Served) -> None:
    told = json.loads(served.command("doctor", served.url, "--json").stdout)
    assert any("a daemon serves" in each["text"] for each in told["findings"])
    assert told["bus"]["bytes_a_cycle"] > 100 and len(told["bus"]["turnaround"]) == 19
