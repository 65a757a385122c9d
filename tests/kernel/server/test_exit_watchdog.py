"""A process that was told to end ends, whatever its programs do.  Real processes, in real time."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.e2e

TIMEOUT_S = 20.0
"""Much less than the programs would go on."""
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
    ("what", "number", "says", "code"),
    [
        ("waits", signal.SIGTERM, "before", 0),
        ("deep", signal.SIGTERM, "before", 0),
        ("allowed", signal.SIGTERM, "in order", 7),
        ("other", signal.SIGUSR1, "", 8),
    ],
)
def test_a_process_that_does_not_end_in_order_is_ended(
    what: str, number: signal.Signals, says: str, code: int
) -> None:
    process = subprocess.Popen((sys.executable, "-c", PROGRAM, what), stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        assert process.stdout.readline() == "ready\n"
        time.sleep(0.3)
        began = time.monotonic()
        process.send_signal(number)
        assert process.wait(TIMEOUT_S) == code
        assert time.monotonic() - began > 1.4
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
        end = time.monotonic() + TIMEOUT_S
        while not (port_file.exists() and os.path.getsize(port_file)):
            assert time.monotonic() < end
            time.sleep(0.01)
        time.sleep(1.5)
        server.send_signal(signal.SIGTERM)
        assert server.wait(TIMEOUT_S) in (0, 70)  # 70: what -e gave had an error by then
    finally:
        server.kill()
        server.wait()
