"""The simulated lasers, seen by programs of others; each test runs where its package is installed.

The packages are hokuyolx and rplidar-roboticia (both MIT).
"""

from __future__ import annotations

import math
from typing import Any

import pytest

from urbihw_fakes.endpoint import PtyEndpoint, TcpEndpoint
from urbihw_fakes.p3dx.kit import P3dx as Kit

AHEAD = 3.0 - 0.021
"""m from the laser to the wall ahead, at the start in ``World.room``."""


def carried(model: str) -> Any:
    """A laser on a robot at its start."""
    return Kit(laser=model).laser


def test_rplidar_roboticia_reads_the_rplidar(monkeypatch: pytest.MonkeyPatch) -> None:
    # A pseudo terminal has no modem lines.
    monkeypatch.setattr("serial.Serial._update_dtr_state", lambda self: None)
    rplidar = pytest.importorskip("rplidar", reason="rplidar-roboticia is not installed")
    device = carried("rplidar")
    with PtyEndpoint(device) as end:
        end.start()
        laser = rplidar.RPLidar(end.path)
        assert laser.get_info()["firmware"] == (1, 29)
        assert laser.get_health() == ("Good", 0)
        scans = laser.iter_scans(min_len=100)
        next(scans)
        ahead = [millimetres for _, degrees, millimetres in next(scans) if degrees < 3 or degrees > 357]
        assert ahead and all(value / 1000 == pytest.approx(AHEAD, abs=0.02) for value in ahead)
        laser.stop()
        laser.disconnect()
    assert not device.scanning


def test_hokuyolx_reads_the_urg() -> None:
    hokuyolx = pytest.importorskip("hokuyolx", reason="hokuyolx is not installed")
    with TcpEndpoint(carried("urg")) as end:
        end.start()
        laser = hokuyolx.HokuyoLX(activate=False, info=True, addr=("127.0.0.1", end.port))
        assert laser.sensor_parameters()["AFRT"] == 384 and laser.version()["SERI"] == "H0000001"
        for distances, *_ in laser.iter_dist(scans=2):
            # It counts from the first step, to the right; the front is step 384.
            ahead = distances[384 - 44]
            assert ahead / 1000 == pytest.approx(AHEAD, abs=0.02)
        assert math.isfinite(float(ahead))
        laser.close()
