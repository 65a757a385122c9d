"""Every platform serves its simulated robot under the restrictions of the unit and of its own drop-in."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest
from sandbox_lab import reason_to_skip, settings, words

from urbihw import platforms
from urbihw.daemon.units import SHARE, drop_in, settings_text

pytestmark = [pytest.mark.e2e, pytest.mark.skipif(bool(reason_to_skip()), reason=reason_to_skip())]

TIMEOUT_S = 60.0
WITH_FAKE = [folder.name for folder in platforms.folders() if platforms.read(folder).fake]


def run(platform: str, folder: Path, *command: str) -> subprocess.Popen[str]:
    """Start a command in the sandbox of a platform; ``folder`` is that of the service."""
    rows = settings((SHARE / "urbihw@.service").read_text(), drop_in(platforms.find(platform)))
    environment = {
        "PATH": os.environ["PATH"], "HOME": str(folder), "XDG_CACHE_HOME": str(folder), "XDG_STATE_HOME": str(folder),
        "XDG_RUNTIME_DIR": str(folder), "PYTHONDONTWRITEBYTECODE": "1",
    }  # fmt: skip
    with tempfile.TemporaryFile() as filter_file:
        before = words(rows, folder, environment, filter_file)
        return subprocess.Popen((*before, *command), pass_fds=(filter_file.fileno(),), env=environment,
                                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def attempt(folder: Path, code: str, platform: str = "bioloid") -> str:
    """What a line of Python prints in the sandbox: the name of the error for what is not allowed."""
    told = f"try: {code}\nexcept OSError as error: print(error.strerror)\nelse: print('allowed')"
    output, _ = run(platform, folder, sys.executable, "-c", f"import ctypes, mmap, os, socket\n{told}").communicate()
    return output.strip()


def test_the_sandbox_forbids_what_the_unit_forbids(tmp_path: Path) -> None:
    assert attempt(tmp_path, "socket.socket(socket.AF_NETLINK, socket.SOCK_RAW)") != "allowed"
    assert attempt(tmp_path, "socket.socket(socket.AF_NETLINK, socket.SOCK_RAW)", "nxt") == "allowed"
    assert attempt(tmp_path, "os.nice(-1)") != "allowed"
    # The bus worker may ask; whether it gets real time is a matter of the bounds, which systemd alone sets.
    assert attempt(tmp_path, "os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))") == "allowed"
    assert attempt(tmp_path, "os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(6))") != "allowed"
    assert attempt(tmp_path, "mmap.mmap(-1, 4096, prot=7)") != "allowed"
    assert attempt(tmp_path, "open('/etc/hosts', 'a')") != "allowed"
    assert attempt(tmp_path, "open('/dev/kmsg')") != "allowed"
    assert attempt(tmp_path, f"open('{tmp_path}/own', 'w')") == "allowed"


@pytest.mark.parametrize("platform", WITH_FAKE)
def test_a_simulated_robot_is_served_in_the_sandbox(platform: str) -> None:
    manifest = platforms.find(platform)
    try:
        platforms.load(manifest)
    except Exception as error:  # an extra that is not installed
        pytest.skip(str(error))
    with tempfile.TemporaryDirectory(prefix="urbihw-", dir="/var/tmp") as name:
        folder = Path(name)
        port_file, config = folder / "port", folder / "robot.toml"
        text = settings_text(platform, "", 54000).replace("port = 54000", f'port = 0\nport_file = "{port_file}"')
        config.write_text(text)
        served = run(platform, folder, sys.executable, "-m", "urbihw.cli.main", "serve", "--config", str(config))
        try:
            deadline = time.monotonic() + TIMEOUT_S
            while not port_file.exists() and time.monotonic() < deadline and served.poll() is None:
                time.sleep(0.05)
            assert port_file.exists(), served.stdout and served.stdout.read()
            with socket.create_connection(("127.0.0.1", int(port_file.read_text())), TIMEOUT_S) as client:
                client.sendall(b"echo(6 * 7); shutdown;")
                heard = b"".join(iter(lambda: client.recv(4096), b""))
            assert b"*** 42" in heard
            output, _ = served.communicate(timeout=TIMEOUT_S)
            assert served.returncode == 0, output
            assert f": {platform}: " in output
            for sign in ("Traceback", "not permitted", "waiting for", "link lost"):
                assert sign not in output, output
        finally:
            if served.poll() is None:
                served.send_signal(signal.SIGKILL)
                served.communicate()
