"""A process that was told to end ends, whatever its programs do.  Real processes, in real time."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

SECONDS = 10.0
PROGRAM = """
import signal, sys, time
from urbihw.kernel.server.exit_watchdog import ExitWatchdog, leave
what = sys.argv[1]
last = ExitWatchdog((signal.SIGTERM,), lambda: print("before", flush=True))
signal.signal(signal.SIGTERM, lambda number, frame: None)
last.install()
print("ready", flush=True)
if what == "deep":
    def f():
        try:
            f()
        except RecursionError:
            f()
    f()
if what == "allowed":
    signal.pause()
    last.extend_deadline(3)
    time.sleep(2)
    print("in order", flush=True)
    last.uninstall()
    last.uninstall()
    leave(7)
if what == "other":
    signal.signal(signal.SIGUSR1, lambda number, frame: None)
    signal.pause()
    time.sleep(2)
    leave(8)
while True:
    time.sleep(1)
"""


@pytest.mark.parametrize(
    ("what", "number", "says", "code", "at_most"),
    [
        ("waits", signal.SIGTERM, "before", 0, 2.5),
        ("deep", signal.SIGTERM, "before", 0, 2.5),
        ("allowed", signal.SIGTERM, "in order", 7, 3.0),
        ("other", signal.SIGUSR1, "", 8, 3.0),
    ],
)
def test_a_process_that_does_not_end_in_order_is_ended(
    what: str, number: signal.Signals, says: str, code: int, at_most: float
) -> None:
    process = subprocess.Popen((sys.executable, "-c", PROGRAM, what), stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        assert process.stdout.readline() == "ready\n"
        time.sleep(0.3)
        began = time.monotonic()
        process.send_signal(number)
        assert process.wait(SECONDS) == code
        assert 1.4 < time.monotonic() - began < at_most
        assert process.stdout.read().strip() == says
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


@pytest.mark.parametrize(
    "text",
    [
        "function f() { try { f() } catch { f() } }; f();",
        'var l = []|; for| (300000) l << ["x" * 1000]; var done = true;',
    ],
)
def test_a_server_ends_soon_after_sigterm(text: str, tmp_path: Path) -> None:
    port_file = tmp_path / "port"
    command = ("-m", "urbihw.cli.urbi", "--quiet", "--port", "0", "--port-file", str(port_file), "-e", text)
    server = subprocess.Popen((sys.executable, *command), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        end = time.monotonic() + SECONDS
        while not (port_file.exists() and os.path.getsize(port_file)):
            assert time.monotonic() < end
            time.sleep(0.01)
        time.sleep(1.5)
        began = time.monotonic()
        server.send_signal(signal.SIGTERM)
        assert server.wait(SECONDS) in (0, 70)  # 70: what -e gave had an error by then
        assert time.monotonic() - began < 2.0
    finally:
        server.kill()
        server.wait()
