"""Independent drivers, written by others, talk to the fake on a pty: dynamixel-sdk and rustypot.

And `python -m urbihw_fakes` as a process of its own. The real clock is used here.
"""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import dynamixel_sdk  # type: ignore[import-untyped]
import pytest
import rustypot
from patient_sdk import make_patient

from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.dynamixel.ax12 import Ax12
from urbihw_fakes.dynamixel.xseries import XSeries
from urbihw_fakes.endpoint import PtyEndpoint

pytestmark = pytest.mark.e2e

ROOT = Path(__file__).parents[2]
WAIT = 60.0


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[PtyEndpoint]:
    units = [*(Ax12(number) for number in (1, 2)), *(XSeries("XL330-M288", number) for number in (11, 12, 13))]
    with PtyEndpoint(Bioloid(units=units), str(tmp_path / "robot")) as endpoint:
        endpoint.start()
        yield endpoint


@pytest.fixture
def port(robot: PtyEndpoint) -> Iterator[Any]:
    port = make_patient(dynamixel_sdk.PortHandler(robot.path))
    assert port.openPort() and port.setBaudRate(1_000_000)
    yield port
    port.closePort()


def test_dynamixel_sdk_protocol_1(port: Any) -> None:
    handler = dynamixel_sdk.PacketHandler(1.0)
    assert handler.ping(port, 1) == (12, 0, 0)
    assert handler.read2ByteTxRx(port, 2, 36) == (512, 0, 0)
    assert handler.write1ByteTxRx(port, 2, 25, 1) == (0, 0)
    assert handler.read1ByteTxRx(port, 2, 25) == (1, 0, 0)
    # A value out of range: error bit 3.
    assert handler.write1ByteTxRx(port, 2, 25, 2) == (0, 8)


@pytest.mark.long
def test_dynamixel_sdk_protocol_2(port: Any, robot: PtyEndpoint) -> None:
    handler = dynamixel_sdk.PacketHandler(2.0)
    assert handler.ping(port, 11) == (1200, 0, 0)
    found, result = handler.broadcastPing(port)
    assert result == 0 and sorted(found) == [11, 12, 13]
    assert handler.write1ByteTxRx(port, 12, 65, 1) == (0, 0)
    assert handler.write1ByteTxRx(port, 12, 0, 1) == (0, 7)
    assert handler.reboot(port, 12) == (0, 0)
    assert handler.read1ByteTxRx(port, 12, 65) == (0, 0, 0)


@pytest.mark.parametrize("fast", [False, True])
def test_dynamixel_sdk_sync_read(port: Any, robot: PtyEndpoint, fast: bool) -> None:
    assert isinstance(robot.device, Bioloid)
    # -1 in present current and FD behind it: the pattern that has to be stuffed.
    robot.device[12].pin_register("present_current", -1)
    robot.device[12].pin_register("present_velocity", 0xFD)
    group = dynamixel_sdk.GroupSyncRead(port, dynamixel_sdk.PacketHandler(2.0), 126, 10)
    for number in (11, 12, 13):
        group.addParam(number)
    assert (group.fastSyncRead() if fast else group.txRxPacket()) == 0
    assert [group.getData(number, 132, 4) for number in (11, 12, 13)] == [2048] * 3
    assert (group.getData(12, 126, 2), group.getData(12, 128, 4)) == (0xFFFF, 0xFD)


def test_dynamixel_sdk_bulk_read(port: Any) -> None:
    group = dynamixel_sdk.GroupBulkRead(port, dynamixel_sdk.PacketHandler(2.0))
    group.addParam(11, 144, 2)
    group.addParam(13, 146, 1)
    assert group.txRxPacket() == 0
    assert (group.getData(11, 144, 2), group.getData(13, 146, 1)) == (50, 30)


def test_rustypot_reads_and_writes_an_ax(robot: PtyEndpoint) -> None:
    driver = rustypot.AxPyController(robot.path, 1_000_000, 0.5)
    assert driver.ping(1) is True
    raw = driver.read_raw_present_position(1)
    assert list(raw) == [512]


def test_rustypot_sync_reads_x_servos(robot: PtyEndpoint) -> None:
    driver = rustypot.Xl330PyController(robot.path, 1_000_000, 0.5)
    assert driver.ping(12) is True
    assert list(driver.sync_read_raw_present_position([11, 12, 13])) == [2048, 2048, 2048]
    driver.sync_write_raw_goal_position([11, 12], [1000, 3000])
    assert list(driver.sync_read_raw_goal_position([11, 12, 13])) == [1000, 3000, 2048]


def _start(*arguments: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "urbihw_fakes", "bioloid", *arguments]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=ROOT)


def _line(process: subprocess.Popen[bytes]) -> str:
    assert process.stdout is not None
    assert select.select([process.stdout], [], [], WAIT)[0], "nothing printed"
    return process.stdout.readline().decode().strip()


def _type(process: subprocess.Popen[bytes], line: str) -> str:
    assert process.stdin is not None
    process.stdin.write(line.encode() + b"\n")
    process.stdin.flush()
    return _line(process)


def test_a_process_on_a_pty_obeys_its_console_and_ends_with_its_input(tmp_path: Path) -> None:
    path = str(tmp_path / "robot")
    with _start("--pty", path, "--until-eof") as process:
        assert _line(process) == f"serial://{path}"
        assert _type(process, "unplug") == "ok"
        assert not os.path.lexists(path)
        assert _type(process, "plug") == "ok"
        port = make_patient(dynamixel_sdk.PortHandler(path))
        assert port.openPort()
        assert dynamixel_sdk.PacketHandler(1.0).ping(port, 18) == (12, 0, 0)
        port.closePort()
        assert process.stdin is not None
        process.stdin.close()
        assert process.wait(WAIT) == 0
    assert not os.path.lexists(path)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_process_on_tcp_outlives_its_input_and_ends_at_a_signal(number: signal.Signals) -> None:
    with _start("--tcp", "0", "--x-series", "3", "--pace") as process:
        assert _line(process).startswith("socket://127.0.0.1:")
        assert _type(process, "state 3").startswith("model=1060 ")
        assert process.stdin is not None
        process.stdin.close()
        process.send_signal(number)
        assert process.wait(WAIT) == 0


def test_a_process_that_cannot_start_says_why(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    for arguments in (("--pty", str(tmp_path / "taken")), ("--tcp", "0", "--baud", "4321000")):
        with _start(*arguments) as process:
            _, errors = process.communicate(timeout=WAIT)
            assert process.returncode == 78
            assert errors.startswith(b"fakes: ")
