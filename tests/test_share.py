"""The unit against what each platform declares, and against systemd where its tools are."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from urbihw import platforms
from urbihw.cli.main import main
from urbihw.daemon.units import PACKAGED_COMMAND, SHARE, drop_in, shared_files

PLATFORMS = [folder.name for folder in platforms.folders()]
MAX_EXPOSURE = 20
"""Exposure by ``systemd-analyze security``, in tenths."""

ANALYZE = shutil.which("systemd-analyze")
needs_systemd = pytest.mark.skipif(ANALYZE is None, reason="systemd-analyze is not installed")


def settings(text: str) -> list[str]:
    return [line for line in text.splitlines() if "=" in line and not line.startswith("#")]


def test_every_file_of_share_is_installed_or_a_sample() -> None:
    installed = {file.text for file in shared_files(PACKAGED_COMMAND)}
    left = {path.name for path in SHARE.iterdir() if path.read_text() not in installed}
    assert left == {"urbihw.toml", "Containerfile"}


def test_the_unit_restarts_reloads_and_stops_as_the_pages_say() -> None:
    rows = settings((SHARE / "urbihw@.service").read_text())
    for row in (
        "Type=notify", "WatchdogSec=30", "RestartPreventExitStatus=78", "KillMode=control-group", "User=urbihw",
        "ExecReload=/bin/sh -c 'kill -HUP $$MAINPID'", "RuntimeDirectoryPreserve=yes", "DevicePolicy=closed",
        "LoadCredential=urbihw.tokens", "LoadCredential=urbihw.certificate.pem", "MemoryMax=2G", "TasksMax=256",
    ):  # fmt: skip
        assert row in rows
    assert not any(row.startswith("DynamicUser") for row in rows)


@pytest.mark.parametrize("name", PLATFORMS)
def test_a_platform_declares_what_its_default_url_needs(name: str) -> None:
    manifest = platforms.find(name)
    rows = settings(drop_in(manifest))
    scheme = manifest.default_url.partition(":")[0]
    if manifest.default_url.startswith("/dev/tty"):
        assert f"DeviceAllow=char-{manifest.default_url.removeprefix('/dev/').rstrip('0123456789')} rw" in rows
    elif scheme == "can":
        assert "RestrictAddressFamilies=AF_CAN" in rows
    elif scheme == "usb":
        assert {"DeviceAllow=char-usb_device rw", "RestrictAddressFamilies=AF_NETLINK"} <= set(rows)
    else:  # by the network alone
        assert rows == []
    assert ("SupplementaryGroups=dialout" in rows) == any(row.startswith("DeviceAllow") for row in rows)


@needs_systemd
@pytest.mark.parametrize("name", PLATFORMS)
def test_systemd_understands_the_unit_and_rates_it_safe(name: str, tmp_path: Path) -> None:
    true = shutil.which("true")
    manifest = platforms.find(name)
    robot = ["--fake"] if manifest.fake else ["--url", manifest.default_url]
    words = ["install-service", "robot", "--platform", name, *robot, "--root", str(tmp_path), "--program", str(true)]
    assert main(words) == 0
    units = tmp_path / "etc" / "systemd" / "system"
    for unit in ("urbihw@robot.service", "urbihw@robot.socket"):
        done = subprocess.run((str(ANALYZE), "verify", "--man=no", str(units / unit)), capture_output=True, text=True,
                              check=False, env={"SYSTEMD_UNIT_PATH": f"{units}:"})
        if "Failed to initialize" in done.stderr:
            pytest.skip(done.stderr.strip())
        assert [row for row in done.stderr.splitlines() if "urbihw" in row] == []
    rated = subprocess.run((str(ANALYZE), "security", "--no-pager", "--offline=true", f"--root={tmp_path}",
                            f"--threshold={MAX_EXPOSURE}", "urbihw@robot.service"), capture_output=True, text=True,
                           check=False)
    if "unrecognized option" in rated.stderr:
        pytest.skip("this systemd-analyze cannot rate files")
    assert rated.returncode == 0, rated.stdout[-300:] + rated.stderr
    assert "exposure level" in rated.stdout
