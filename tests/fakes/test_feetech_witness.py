"""feetech-servo-sdk talks to the fake on a pty, and shows why our driver has a codec of its own.

Where the package is not installed these tests are skipped. The real clock is used here.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from patient_sdk import SLOWER, make_patient

from urbihw import buses
from urbihw.buses.servos.bus import ServoBus
from urbihw_fakes.endpoint import PtyEndpoint
from urbihw_fakes.feetech.bus import FeetechBus
from urbihw_fakes.feetech.servo import FeetechServo

sdk: Any = pytest.importorskip("scservo_sdk", reason="feetech-servo-sdk is not installed")

pytestmark = pytest.mark.e2e
POSITION = 56
LATE_S = 0.06 * SLOWER
"""Longer than the 35 ms that the SDK waits, by its own clock."""


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[PtyEndpoint]:
    servos = [FeetechServo("STS3215", number, position=1000 + number) for number in (1, 2, 3)]
    with PtyEndpoint(FeetechBus([*servos, FeetechServo("SCS0009", 7, position=300)]), str(tmp_path / "robot")) as end:
        end.start()
        yield end


@pytest.fixture
def port(robot: PtyEndpoint) -> Iterator[Any]:
    port = make_patient(sdk.PortHandler(robot.path))
    assert port.openPort() and port.setBaudRate(1_000_000)
    yield port
    port.closePort()
    sdk.PacketHandler(0)


def _bus(robot: PtyEndpoint) -> FeetechBus:
    assert isinstance(robot.device, FeetechBus)
    return robot.device


def test_the_sdk_drives_the_fake(port: Any, robot: PtyEndpoint) -> None:
    handler = sdk.PacketHandler(0)
    assert handler.ping(port, 1) == (777, 0, 0)
    assert handler.write1ByteTxRx(port, 1, 40, 1) == (0, 0)
    assert handler.write2ByteTxRx(port, 1, 42, 2048) == (0, 0)
    assert handler.read2ByteTxRx(port, 1, 42) == (2048, 0, 0)
    assert handler.read2ByteTxRx(port, 9, 42)[1] == sdk.COMM_RX_TIMEOUT


def test_the_sdk_reads_an_scs_servo(port: Any) -> None:
    handler = sdk.PacketHandler(1)
    assert handler.ping(port, 7) == (1284, 0, 0)
    assert handler.read2ByteTxRx(port, 7, POSITION) == (300, 0, 0)


# What it does wrong; each of these is a reason why it is not the default.


def test_defect_1_the_sdk_takes_a_late_answer_for_that_of_the_next_question(port: Any, robot: PtyEndpoint) -> None:
    handler = sdk.PacketHandler(0)
    robot.device.faults.start("late", 1, amount=LATE_S, times=1)
    assert handler.read2ByteTxRx(port, 1, POSITION)[1] == sdk.COMM_RX_TIMEOUT
    while port.ser.in_waiting < 8:  # ff ff 01 04 00 e9 03 0e
        time.sleep(0.01)
    # Register 42, the goal, is 1001 as well after power-on: another number makes the two distinguishable.
    _bus(robot).servo(1).registers.put("goal_position", 77)
    assert handler.read2ByteTxRx(port, 1, 42) == (1001, 0, 0), "the position, told as the goal"


def test_our_driver_does_not(robot: PtyEndpoint) -> None:
    _bus(robot).servo(1).registers.put("goal_position", 77)
    with buses.open_link(f"{robot.path}?baud=1000000") as link:
        bus = ServoBus(link, 1)
        robot.device.faults.start("late", 1, amount=0.12, times=1)
        bus.read(1, POSITION, 2)
        assert int.from_bytes(bus.read(1, 42, 2), "little") == 77


def test_defect_3_the_byte_order_of_the_sdk_is_one_for_the_whole_process(port: Any) -> None:
    little = sdk.PacketHandler(0)
    assert little.read2ByteTxRx(port, 1, POSITION) == (1001, 0, 0)
    sdk.PacketHandler(1)
    assert little.read2ByteTxRx(port, 1, POSITION) == (0xE903, 0, 0), "1001 with its bytes swapped"


def test_defect_5_a_group_read_of_the_sdk_tells_old_data_for_new(port: Any, robot: PtyEndpoint) -> None:
    handler = sdk.PacketHandler(0)
    group = sdk.GroupSyncRead(port, handler, POSITION, 2)
    for number in (1, 2, 3):
        assert group.addParam(number)
    assert group.txRxPacket() == 0
    _bus(robot).wait_for_predecessor = False
    robot.device.faults.start("silence", 2)
    _bus(robot).servo(3).motor.turn(500)
    assert group.txRxPacket() == sdk.COMM_RX_TIMEOUT
    assert group.isAvailable(3, POSITION, 2)
    assert group.getData(3, POSITION, 2) == 1003, "servo 3 is at 1503 and has answered"
