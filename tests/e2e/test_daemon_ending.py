"""A daemon that cannot end in order ends all the same, and its robot stands.  On the real clock."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

HERE = Path(__file__).parent
sys.path.append(str(HERE))

from faults_lab import ROOT, TIMEOUT_S, Client, Watcher, wait_for  # noqa: E402
from moving_robots import RIGS, Rig  # noqa: E402

pytestmark = pytest.mark.e2e

DEAF = (
    "import sys; from urbihw.kernel.process import KernelProcess; KernelProcess.stop = lambda self: None; "
    "from urbihw.cli.main import main; sys.exit(main())"
)
"""A daemon that never hears that it is to end in order, as if a program kept it from that."""
BY_NAME = {rig.name: rig for rig in RIGS}


@pytest.mark.parametrize("rig", [BY_NAME["Bioloid, a wheel"], BY_NAME["NXT"]], ids=lambda rig: rig.platform)
def test_a_daemon_that_does_not_end_in_order_stops_the_robot_and_ends(rig: Rig, tmp_path: Path) -> None:
    end, look = rig.make()
    port_file, log = tmp_path / "port", tmp_path / "log"
    with end, log.open("w") as written:
        end.start()
        (tmp_path / "config.toml").write_text(f'control = "{tmp_path / "control"}"\n')
        command = ("serve", "--platform", rig.platform, "--url", end.url, "--quiet", "--port", "0")
        files = ("--port-file", str(port_file), "--config", str(tmp_path / "config.toml"))
        daemon = subprocess.Popen((sys.executable, "-c", DEAF, *command, *files), cwd=ROOT, stderr=written)
        watcher = Watcher(end, look)
        client: Client | None = None
        try:
            wait_for(lambda: port_file.exists() and port_file.read_text().endswith("\n"), "a port")
            client = Client(int(port_file.read_text()))
            client.say(rig.prepare)
            client.say(f'waituntil({rig.until or "true"}); echo("ready");')
            client.wait("ready")
            client.say(rig.go)
            wait_for(lambda: watcher.speed() > rig.moving, f"motion, but: {client.heard}")
            daemon.send_signal(signal.SIGTERM)
            assert daemon.wait(TIMEOUT_S) == 0
            wait_for(lambda: watcher.speed() <= rig.rest, "the body to stand")
            time.sleep(0.5)
            assert watcher.speed() <= rig.rest
            assert not port_file.exists()
        finally:
            if client is not None:
                client.close()
            watcher.close()
            daemon.kill()
            daemon.wait()
    assert "ended at once" in log.read_text()
