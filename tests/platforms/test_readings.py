"""What the drivers tell of the health of their devices, in SI units; each count as its driver documents it."""

from __future__ import annotations

import math
from typing import Any

import pytest

from urbihw.buses.can.cia402 import FAULT, state_of
from urbihw.buses.can.drives import DrivesDriver
from urbihw.buses.can.emergencies import advised
from urbihw.buses.driver import Driver
from urbihw.buses.readings import Reading
from urbihw.platforms.nxt.driver import NxtDriver
from urbihw.platforms.p3dx.driver import ArcosDriver
from urbihw.platforms.segway.driver import RmpDriver
from urbihw.platforms.spykee.driver import SpykeeDriver
from urbihw_nao.driver import NaoDriver

FAULT_WORD = 0x0008
"""Status word of CiA 402 in the state FAULT."""


@pytest.mark.parametrize(
    ("driver", "device", "item", "raw", "quantity", "value", "unit"),
    [
        (NxtDriver, "brick", "millivolts", 7900, "voltage", 7.9, "V"),
        (ArcosDriver, "robot", "battery", 124, "voltage", 12.4, "V"),
        (SpykeeDriver, "power", "level", 80, "charge", 0.8, ""),
        (SpykeeDriver, "power", "level", -80, "charge", 0.8, ""),
        (NaoDriver, "HeadYaw", "angle", 0.5, "position", 0.5, "rad"),
        (NaoDriver, "HeadYaw", "temperature", 41, "temperature", 41, "degC"),
    ],
)
def test_a_reading(
    driver: type[Driver], device: str, item: str, raw: float, quantity: str, value: float, unit: str
) -> None:
    found = driver().reading(device, item, raw)
    assert found is not None
    assert (found.quantity, found.unit) == (quantity, unit)
    assert found.value == pytest.approx(value)
    assert math.isnan(found.low) and math.isnan(found.high)


def test_a_fault_of_a_drive_is_an_alarm() -> None:
    assert state_of(FAULT_WORD) == FAULT
    assert DrivesDriver().reading(5, "status", FAULT_WORD) == Reading("alarm", advised("fault", 5))
    assert DrivesDriver().reading(5, "status", 0x0027) == Reading("alarm", "")


def test_the_pressed_stop_button_of_a_pioneer_is_an_alarm() -> None:
    driver = ArcosDriver()
    pressed = "its STOP button is pressed: release it, then P3dx.body.load = 1"
    assert driver.reading("robot", "flags", 0x0021) == Reading("alarm", pressed)
    assert driver.reading("robot", "flags", 0x001F) == Reading("alarm", "")


def test_the_faults_of_an_rmp_are_an_alarm_and_its_voltage_has_a_lower_limit() -> None:
    driver = RmpDriver()
    assert driver.reading("base", "status1", 0x0180) == Reading("alarm", "")
    assert driver.reading("base", "status1", 0x0101) == Reading("alarm", "safety shutdown")
    found = driver.reading("base", "battery", 290)
    assert found is not None
    assert found[:4] == ("voltage", 72.5, "V", 66.0) and math.isnan(found.high)
    assert driver.reading("base", "mode", 2) is None


@pytest.mark.parametrize("raw", [True, "text", None, b"bytes", [1]])
def test_what_is_no_number_is_no_reading(raw: Any) -> None:
    assert NaoDriver().reading("HeadYaw", "angle", raw) is None
    assert NaoDriver().reading("HeadYaw", "unknown", 1.0) is None
