"""The fake brick on its USB bus: pyusb by itself, and nxt-python as an independent witness."""

from __future__ import annotations

import errno
import importlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import usb.backend.libusb1  # type: ignore[import-untyped]
import usb.core  # type: ignore[import-untyped]
import usb.util  # type: ignore[import-untyped]

from urbihw_fakes.endpoint import PtyEndpoint
from urbihw_fakes.nxt.inputs import Colour
from urbihw_fakes.nxt.stream import NxtDevice
from urbihw_fakes.nxt.tribot import TriBot
from urbihw_fakes.nxt.usb_backend import Bus, bus
from urbihw_fakes.nxt.usb_endpoint import UsbEndpoint

BATTERY = bytes.fromhex("00 0b")
MILLIVOLTS = bytes.fromhex("02 0b 00 d2 1e")


@pytest.fixture
def robot() -> TriBot:
    return TriBot(0.37)


@pytest.fixture
def end(robot: TriBot, tmp_path: Path) -> Iterator[UsbEndpoint]:
    with UsbEndpoint(NxtDevice(robot), str(tmp_path / "bus")) as endpoint:
        endpoint.start()
        yield endpoint


def find(backend: Bus) -> Any:
    return usb.core.find(idVendor=0x0694, idProduct=0x0002, backend=backend)


def refusal(what: Any, *arguments: Any) -> int:
    """The errno with which pyusb refuses."""
    with pytest.raises(usb.core.USBError) as caught:
        what(*arguments)
    return int(caught.value.errno)


def test_pyusb_finds_configures_and_asks(end: UsbEndpoint) -> None:
    device = find(bus(end.folder))
    device.set_configuration()
    out, back = device.get_active_configuration()[(0, 0)]
    assert (out.bEndpointAddress, back.bEndpointAddress) == (0x01, 0x82)
    assert out.write(BATTERY) == 2
    assert back.read(64).tobytes() == MILLIVOLTS
    assert usb.util.get_string(device, device.iSerialNumber) == "001653010203"
    assert refusal(back.read, 64, 1) == errno.ETIMEDOUT
    usb.util.dispose_resources(device)


def test_only_one_may_claim_it_and_then_the_next(end: UsbEndpoint) -> None:
    first, second = find(bus(end.folder)), find(bus(end.folder))
    usb.util.claim_interface(first, 0)
    assert refusal(usb.util.claim_interface, second, 0) == errno.EBUSY
    usb.util.dispose_resources(first)
    end.call(lambda: None)
    usb.util.claim_interface(second, 0)
    usb.util.dispose_resources(second)


def test_unplugged_and_back_under_the_same_url(end: UsbEndpoint) -> None:
    backend = bus(end.folder)
    device = find(backend)
    device.set_configuration()
    device.write(0x01, BATTERY)
    assert device.read(0x82, 64).tobytes() == MILLIVOLTS
    url = end.url
    end.unplug()
    assert refusal(device.write, 0x01, BATTERY) == errno.ENODEV
    assert refusal(device.read, 0x82, 64, 10) == errno.ENODEV
    assert find(backend) is None
    usb.util.dispose_resources(device)
    end.plug()
    assert end.url == url
    again = find(backend)
    again.set_configuration()
    again.write(0x01, BATTERY)
    assert again.read(0x82, 64).tobytes() == MILLIVOLTS
    usb.util.dispose_resources(again)


def test_a_bus_that_is_not_there_is_empty(tmp_path: Path) -> None:
    assert find(bus(str(tmp_path / "none"))) is None


def test_faults_reach_the_host_as_packets(end: UsbEndpoint) -> None:
    device = find(bus(end.folder))
    device.set_configuration()
    for word, wanted in (("checksum", MILLIVOLTS[:-1] + b"\xe1"), ("cut", MILLIVOLTS[:1])):
        end.call(lambda word=word: end.device.faults.start(word, times=1))  # type: ignore[misc]
        device.write(0x01, BATTERY)
        assert device.read(0x82, 64).tobytes() == wanted
    end.call(lambda: end.device.faults.start("silence", times=1))
    device.write(0x01, BATTERY)
    assert refusal(device.read, 0x82, 64, 20) == errno.ETIMEDOUT
    usb.util.dispose_resources(device)


def test_an_own_folder_goes_with_the_endpoint() -> None:
    with UsbEndpoint(NxtDevice()) as endpoint:
        folder = Path(endpoint.folder)
        assert [path.name for path in folder.iterdir()] == ["001653010203"]
    assert not folder.exists()


# ---------------------------------------------------------------- nxt-python


@pytest.fixture(params=["usb", "pty"])
def brick(request: pytest.FixtureRequest, robot: TriBot, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """nxt-python's Brick, over USB and over the framing of Bluetooth."""
    locator = importlib.import_module("nxt.locator")
    if request.param == "pty":
        with PtyEndpoint(NxtDevice(robot)) as pty:
            pty.start()
            devfile = importlib.import_module("nxt.backend.devfile")
            made = next(iter(devfile.get_backend().find(filename=pty.path)))
            yield made
            made.close()
        return
    with UsbEndpoint(NxtDevice(robot)) as endpoint:
        endpoint.start()
        backend = bus(endpoint.folder)
        monkeypatch.setattr(usb.backend.libusb1, "get_backend", lambda find_library=None: backend)
        found = locator.find(backends=["usb"])
        yield found
        device = found._sock._dev
        found.close()
        usb.util.dispose_resources(device)


def test_nxt_python_reads_the_brick(brick: Any) -> None:
    assert brick.get_battery_level() == 7890
    assert brick.get_firmware_version() == ((1, 124), (1, 29))
    assert brick.get_device_info() == ("NXT", "00:16:53:01:02:03", (0, 0, 0, 0), 65536)
    assert brick.keep_alive() == 600000
    assert [name for name, _ in brick.find_files("*.*")] == ["Demo.rxe"]
    with brick.open_file("hello.txt", "w", 5) as file:
        file.write("hello")
    with brick.open_file("hello.txt", "r") as file:
        assert file.read() == "hello"


def test_nxt_python_names_the_brick(brick: Any) -> None:
    # Its telegram has 17 bytes, one less than the documented one.
    brick.set_brick_name("Alpha")
    assert brick.get_device_info()[0] == "Alpha"
    brick.set_brick_name("FourteenChars!")
    assert brick.get_device_info()[0] == "FourteenChars!"


def test_nxt_python_reads_the_sensors(brick: Any, robot: TriBot) -> None:
    generic, sensor = importlib.import_module("nxt.sensor.generic"), importlib.import_module("nxt.sensor")
    port = sensor.Port
    assert brick.get_sensor(port.S2, generic.Ultrasonic).get_distance() == 37
    touch = brick.get_sensor(port.S4, generic.Touch)
    assert touch.is_pressed() is False
    robot.pushed = True
    assert touch.is_pressed() is True
    assert brick.get_sensor(port.S1, generic.Sound).get_loudness() == pytest.approx(1023 * 0.08, abs=2)
    assert brick.get_sensor(port.S3, generic.Light).get_lightness() == pytest.approx(1023 * 0.45, abs=2)
    robot.brick.plug(0, Colour(3))
    colour = brick.get_sensor(port.S1, generic.Color)
    assert colour.get_color() == 3


def test_nxt_python_turns_a_motor(brick: Any) -> None:
    motor_module = importlib.import_module("nxt.motor")
    motor = brick.get_motor(motor_module.Port.B)
    motor.run(100)
    before = motor.get_tacho().tacho_count
    while motor.get_tacho().tacho_count < before + 20:
        pass
    motor.brake()
    assert motor.get_tacho().rotation_count >= 20
    motor.turn(50, 30, brake=True)
    motor.idle()
