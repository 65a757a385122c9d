"""More independent drivers talk to the fake on a pty: pypot and lerobot, which `make witnesses` installs.

They are not among the packages for the tests, because lerobot brings hundreds of megabytes; where they are not
installed these tests are skipped. The real clock is used here.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.dynamixel.ax12 import Ax12
from urbihw_fakes.dynamixel.axs1 import AxS1
from urbihw_fakes.dynamixel.xseries import XSeries
from urbihw_fakes.endpoint import PtyEndpoint

# Their own imports give warnings that are not ours.
pytestmark = [pytest.mark.e2e, pytest.mark.filterwarnings("default")]

REASON = "is not installed: make witnesses"
WAIT = 20.0


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[PtyEndpoint]:
    units = [Ax12(1), Ax12(2), AxS1(100), XSeries("XL330-M288", 11), XSeries("XL330-M288", 12)]
    with PtyEndpoint(Bioloid(units=units), str(tmp_path / "robot")) as endpoint:
        endpoint.start()
        yield endpoint


def test_pypot_moves_ax_servos(robot: PtyEndpoint) -> None:
    dynamixel: Any = pytest.importorskip("pypot.dynamixel", reason=f"pypot {REASON}")
    with dynamixel.DxlIO(robot.path, baudrate=1_000_000, timeout=WAIT / 10) as io:
        assert io.scan([1, 2]) == [1, 2]
        assert io.get_model([1, 2]) == ("AX-12", "AX-12")
        io.set_torque_limit({1: 100, 2: 100})
        io.set_moving_speed({1: 300, 2: 300})
        io.enable_torque([1, 2])
        io.set_goal_position({1: 40, 2: -40})
        end = time.monotonic() + WAIT
        while True:
            places = io.get_present_position([1, 2])
            if places == pytest.approx((40, -40), abs=2):
                break
            assert time.monotonic() < end, places
        assert io.get_present_temperature([1])[0] < 70
        io.set_wheel_mode([2])
        assert io.get_control_mode([2]) == ("wheel",)


def test_lerobot_moves_x_servos(robot: PtyEndpoint) -> None:
    motors: Any = pytest.importorskip("lerobot.motors", reason=f"lerobot {REASON}")
    dynamixel: Any = pytest.importorskip("lerobot.motors.dynamixel", reason=f"lerobot {REASON}")
    kind = motors.MotorNormMode.DEGREES
    bus = dynamixel.DynamixelMotorsBus(
        robot.path, {"one": motors.Motor(11, "xl330-m288", kind), "two": motors.Motor(12, "xl330-m288", kind)}
    )
    bus.connect()
    try:
        bus.disable_torque()
        bus.write("Operating_Mode", "one", 3)
        bus.enable_torque()
        bus.sync_write("Goal_Position", {"one": 2500, "two": 1500}, normalize=False)
        end = time.monotonic() + WAIT
        while True:
            places = bus.sync_read("Present_Position", normalize=False)
            if abs(places["one"] - 2500) < 20 and abs(places["two"] - 1500) < 20:
                break
            assert time.monotonic() < end, places
    finally:
        bus.disconnect()
