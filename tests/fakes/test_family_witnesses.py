"""The fakes of the other servo families against drivers written by others, on a pty: rustypot and dynamixel-sdk.

Addresses here are typed from the data sheets, or are rustypot's own. The real clock is used here.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import dynamixel_sdk  # type: ignore[import-untyped]
import pytest
import rustypot
from patient_sdk import make_patient

from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.dynamixel.catalogue import make_servos
from urbihw_fakes.endpoint import PtyEndpoint

pytestmark = pytest.mark.e2e

WAIT = 60.0
BAUD = 1_000_000
CHAIN = "MX-28:1,MX-64:2,RX-28:3,XL-320:11,XM430-W350:12,PH54-200-S500-R:13,H54-200-S500-R:14,YM070-210-R099-RH:15"


@pytest.fixture
def chain(tmp_path: Path) -> Iterator[PtyEndpoint]:
    with PtyEndpoint(Bioloid(units=make_servos(CHAIN), baud=BAUD), str(tmp_path / "chain")) as endpoint:
        endpoint.start()
        yield endpoint


def wait_until(there: Callable[[], bool]) -> None:
    end = time.monotonic() + WAIT
    while not there():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_rustypot_moves_an_mx(chain: PtyEndpoint) -> None:
    driver = rustypot.MxPyController(chain.path, BAUD, 0.5)
    assert driver.ping(1) is True
    assert list(driver.read_raw_present_position(1)) == [2048]
    driver.write_torque_enable(1, True)
    driver.write_raw_goal_position(1, 2500)
    wait_until(lambda: list(driver.read_raw_present_position(1)) == [2500])
    assert driver.read_present_position(1) == pytest.approx([(2500 - 2048) * 2 * 3.14159265 / 4096], abs=2e-3)


def test_rustypot_moves_an_xl320(chain: PtyEndpoint) -> None:
    driver = rustypot.Xl320PyController(chain.path, BAUD, 0.5)
    assert driver.ping(11) is True
    driver.write_torque_enable(11, True)
    assert list(driver.read_model_number(11)) == [350]
    driver.write_goal_position(11, 700)
    wait_until(lambda: list(driver.read_present_position(11)) == [700])
    assert list(driver.read_control_mode(11)) == [2]


# Id, model number, addresses of torque enable, goal position and present position, a goal.
@pytest.mark.parametrize(
    ("servo", "model", "torque", "goal", "place", "target"),
    [(13, 2020, 512, 564, 580, 20_000), (14, 54024, 562, 596, 611, 20_000), (15, 4030, 512, 532, 552, 20_000)],
)
def test_dynamixel_sdk_moves_large_servos(
    chain: PtyEndpoint, servo: int, model: int, torque: int, goal: int, place: int, target: int
) -> None:
    port = make_patient(dynamixel_sdk.PortHandler(chain.path))
    assert port.openPort() and port.setBaudRate(BAUD)
    try:
        handler = dynamixel_sdk.PacketHandler(2.0)
        assert handler.ping(port, servo) == (model, 0, 0)
        assert handler.write1ByteTxRx(port, servo, torque, 1) == (0, 0)
        assert handler.write4ByteTxRx(port, servo, goal, target) == (0, 0)
        wait_until(lambda: handler.read4ByteTxRx(port, servo, place)[0] == target)
        # The EEPROM only without torque: access error, number 7.
        assert handler.write1ByteTxRx(port, servo, 7, 9) == (0, 7)
    finally:
        port.closePort()


def test_dynamixel_sdk_turns_an_mx_and_an_rx_as_wheels(chain: PtyEndpoint) -> None:
    port = make_patient(dynamixel_sdk.PortHandler(chain.path))
    assert port.openPort() and port.setBaudRate(BAUD)
    try:
        handler = dynamixel_sdk.PacketHandler(1.0)
        for servo, model in ((2, 310), (3, 28)):
            assert handler.ping(port, servo) == (model, 0, 0)
            assert handler.write2ByteTxRx(port, servo, 6, 0) == (0, 0)
            assert handler.write2ByteTxRx(port, servo, 8, 0) == (0, 0)
            assert handler.write1ByteTxRx(port, servo, 24, 1) == (0, 0)
            assert handler.write2ByteTxRx(port, servo, 32, 1024 + 300) == (0, 0)
            first = handler.read2ByteTxRx(port, servo, 36)[0]
            wait_until(lambda servo=servo, first=first: handler.read2ByteTxRx(port, servo, 36)[0] not in (first, 0))  # type: ignore[misc]
            assert handler.read2ByteTxRx(port, servo, 38)[0] == 1024 + 300
            assert handler.write2ByteTxRx(port, servo, 32, 0) == (0, 0)
            assert handler.read2ByteTxRx(port, servo, 38)[0] == 0
    finally:
        port.closePort()
