"""More independent drivers talk to the fake on a pty: pypot and lerobot, which `make witnesses` installs.

They are not among the packages for the tests, because lerobot brings hundreds of megabytes; where they are not
installed these tests are skipped. The real clock is used here.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from urbihw import buses
from urbihw.buses.servos.bus import ServoBus
from urbihw.buses.servos.calibration import JointCalibration, load, save
from urbihw.buses.servos.eeprom import write_register
from urbihw.buses.servos.scan import scan
from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.dynamixel.ax12 import Ax12
from urbihw_fakes.dynamixel.axs1 import AxS1
from urbihw_fakes.dynamixel.xseries import XSeries
from urbihw_fakes.endpoint import PtyEndpoint
from urbihw_fakes.so101 import JOINTS, So101

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


# An SO-101 arm, read and calibrated by LeRobot and by us.


@pytest.fixture
def arm(tmp_path: Path) -> Iterator[PtyEndpoint]:
    with PtyEndpoint(So101(), str(tmp_path / "arm")) as endpoint:
        endpoint.start()
        yield endpoint


def _lerobot_bus(arm: PtyEndpoint, calibration: Any = None) -> Any:
    motors: Any = pytest.importorskip("lerobot.motors", reason=f"lerobot {REASON}")
    feetech: Any = pytest.importorskip("lerobot.motors.feetech", reason=f"lerobot {REASON}")
    joints = {name: motors.Motor(joint.id, "sts3215", motors.MotorNormMode.DEGREES) for name, joint in JOINTS.items()}
    bus = feetech.FeetechMotorsBus(arm.path, joints, calibration)
    bus.connect()
    return bus


def _our_rows(arm: PtyEndpoint, *names: str) -> dict[str, tuple[int, ...]]:
    """What our driver reads from each joint."""
    found = {}
    with buses.open_link(f"{arm.path}?baud=1000000") as link:
        bus = ServoBus(link, "auto")
        devices = {device.id: device for device in scan(bus, range(1, 7)).devices}
        for joint, about in JOINTS.items():
            table = devices[about.id].table
            assert table is not None
            items = [table.item(name) for name in names]
            found[joint] = tuple(item.unpack(bus.read(about.id, item.address, item.size)) for item in items)
    return found


def _our_calibration(arm: PtyEndpoint) -> dict[str, JointCalibration]:
    rows = _our_rows(arm, "id", "homing_offset", "min_position_limit", "max_position_limit")
    return {joint: JointCalibration(row[0], 0, *row[1:]) for joint, row in rows.items()}


def test_lerobot_calibrates_the_arm_and_our_driver_reads_the_same(arm: PtyEndpoint, tmp_path: Path) -> None:
    bus = _lerobot_bus(arm)
    try:
        bus.disable_torque()
        for joint in JOINTS:
            bus.write("Operating_Mode", joint, 0)
        bus.set_half_turn_homings()
        made = bus.read_calibration()
        for joint, row in made.items():
            about = JOINTS[joint]
            if about.low is not None and about.high is not None:
                row.range_min, row.range_max = 2047 + about.low, 2047 + about.high
        bus.write_calibration(made)
        places = bus.sync_read("Present_Position", normalize=False)
        assert places == dict.fromkeys(JOINTS, 2047)
    finally:
        bus.disconnect(disable_torque=False)
    theirs = {name: asdict(row) for name, row in made.items()}
    assert {name: asdict(row) for name, row in _our_calibration(arm).items()} == theirs
    assert {name: row[0] for name, row in _our_rows(arm, "present_position").items()} == places
    # Its file is the one that we read: LeRobot writes it with draccus, which writes JSON.
    draccus: Any = pytest.importorskip("draccus", reason=f"lerobot {REASON}")
    with open(tmp_path / "arm.json", "w") as file, draccus.config_type("json"):
        draccus.dump(made, file, indent=4)
    assert {name: asdict(row) for name, row in load(tmp_path / "arm.json").items()} == theirs


def test_lerobot_understands_a_calibration_of_ours(arm: PtyEndpoint, tmp_path: Path) -> None:
    made = {
        name: JointCalibration(joint.id, 0, joint.middle - 2048, 1000 + joint.id, 3000 + joint.id)
        for name, joint in JOINTS.items()
    }
    with buses.open_link(f"{arm.path}?baud=1000000") as link:
        bus = ServoBus(link, "auto")
        for device in scan(bus, range(1, 7)).devices:
            row = next(row for row in made.values() if row.id == device.id)
            for name, raw in (
                ("homing_offset", row.homing_offset),
                ("min_position_limit", row.range_min),
                ("max_position_limit", row.range_max),
            ):
                assert device.table is not None
                write_register(bus, device, device.table.item(name), raw)
    save(tmp_path / "arm.json", made)
    motors: Any = pytest.importorskip("lerobot.motors", reason=f"lerobot {REASON}")
    draccus: Any = pytest.importorskip("draccus", reason=f"lerobot {REASON}")
    with open(tmp_path / "arm.json") as file, draccus.config_type("json"):
        theirs = draccus.load(dict[str, motors.MotorCalibration], file)
    bus = _lerobot_bus(arm, theirs)
    try:
        assert bus.is_calibrated
        assert bus.sync_read("Present_Position", normalize=False) == dict.fromkeys(JOINTS, 2048)
    finally:
        bus.disconnect(disable_torque=False)
    assert json.loads((tmp_path / "arm.json").read_text()) == {name: asdict(row) for name, row in theirs.items()}


def test_lerobot_moves_the_arm(arm: PtyEndpoint) -> None:
    bus = _lerobot_bus(arm)
    try:
        bus.enable_torque()
        bus.sync_write("Goal_Position", {"shoulder_pan": 2300, "elbow_flex": 2000}, normalize=False)
        end = time.monotonic() + WAIT
        while True:
            places = bus.sync_read("Present_Position", normalize=False)
            if abs(places["shoulder_pan"] - 2300) < 5 and abs(places["elbow_flex"] - 2000) < 5:
                break
            assert time.monotonic() < end, places
    finally:
        bus.disconnect()
    assert isinstance(arm.device, So101)
    assert [unit.registers.get("torque") for unit in arm.device] == [0] * 6
