"""The wires of other robots than a Bioloid, recorded and played to their drivers: what these tell is what they told.

In simulated time: the driver and a simulated robot at the ends of a pipe, then the driver and the recording of it.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import pytest
from driver_rig import DriverRig

from urbihw.buses import messages as m
from urbihw.buses.can.drives import DrivesDriver
from urbihw.buses.can.port import CanPort
from urbihw.buses.driver import Driver
from urbihw.buses.servos.driver import ServoDriver
from urbihw.platforms.nxt.driver import NxtDriver
from urbihw.platforms.p3dx.driver import ArcosDriver
from urbihw.platforms.segway.driver import BASE, RmpDriver
from urbihw.recording.reading import Recording
from urbihw.recording.recording_file import RecordingFile
from urbihw.recording.records import RecordMaker
from urbihw.recording.wire import capture_lines
from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.can.device import CanDevice
from urbihw_fakes.can.records import Records
from urbihw_fakes.cia402.node import Drive
from urbihw_fakes.device import Device
from urbihw_fakes.nxt.stream import NxtDevice
from urbihw_fakes.nxt.tribot import TriBot
from urbihw_fakes.p3dx.kit import P3dx
from urbihw_fakes.p3dx.world import World
from urbihw_fakes.replay import Replay, read_capture
from urbihw_fakes.replay.node import ReplayNode
from urbihw_fakes.segway.rmp import SegwayRmp
from urbihw_fakes.so101 import So101

BAUD = 1_000_000


class ServoRig(DriverRig):
    driver_class: ClassVar[type[Driver]] = ServoDriver
    url = f"pipe://robot?baud={BAUD}"
    tick = 0.01


class BaseRig(DriverRig):
    driver_class: ClassVar[type[Driver]] = ArcosDriver
    url = "pipe://robot?baud=115200"
    tick = 0.01


class SegwayRig(DriverRig):
    driver_class: ClassVar[type[Driver]] = RmpDriver
    link_class: ClassVar[type[Any]] = CanPort
    url = "can://pipe/robot"


class DrivesRig(SegwayRig):
    driver_class: ClassVar[type[Driver]] = DrivesDriver
    tick = 0.01


class BrickRig(DriverRig):
    driver_class: ClassVar[type[Driver]] = NxtDriver
    url = "pipe://robot"
    tick = 0.01


class Wire(NamedTuple):
    """A platform, its driver's rig, its simulated robot, and what happens."""

    platform: str
    rig: type[DriverRig]
    device: Callable[[], Device]
    script: Callable[[DriverRig], None]
    settings: dict[str, Any]


def paced(kit: Bioloid | So101) -> Device:
    kit.pace(BAUD)
    return kit


def servos(numbers: range, items: tuple[str, ...], goal: int) -> Callable[[DriverRig], None]:
    def script(rig: DriverRig) -> None:
        rig.run(1.0)
        for number in numbers:
            rig.news += rig.driver.watch(m.Watch(number, items), rig.clock.now())
        rig.run(0.1)
        rig.news += rig.write({(numbers[2], "goal_position"): goal})
        rig.run(0.5)
        rig.news += rig.send_request("read", numbers[0], "torque_enable")
        rig.device.faults.start("silence", numbers[1]) if not isinstance(rig.device, Replay) else None
        rig.run(1.0)

    return script


def drive(rig: DriverRig) -> None:
    rig.run(0.3)
    rig.news += rig.send_request("write", "robot", "enable", 1)
    rig.run(0.5)
    rig.news += rig.write({("robot", "speed"): 200})
    rig.run(1.5)
    rig.driver.safe_stop()
    rig.run(0.5)


def turn(rig: DriverRig) -> None:
    for motor in "BC":
        rig.news += rig.driver.watch(m.Watch(motor, ("rotation",), 0.0), rig.clock.now())
    rig.news += rig.driver.watch(m.Watch(2, ("distance",), 0.05), rig.clock.now())
    rig.run(0.3)
    rig.news += rig.write({("B", "power"): 50})
    rig.run(0.8)
    rig.driver.safe_stop()
    rig.run(0.3)


def balance(rig: DriverRig) -> None:
    rig.news += rig.driver.watch(m.Watch(BASE, ()), rig.clock.now())
    rig.run(0.5)
    rig.news += rig.write({(BASE, "velocity"): 300})
    rig.run(1.0)
    rig.driver.safe_stop()
    rig.run(0.5)


def turn_drive(rig: DriverRig) -> None:
    rig.run(1.0)
    rig.news += rig.driver.watch(m.Watch(5, ("position", "velocity")), rig.clock.now())
    rig.news += rig.send_request("write", 5, "mode", 3)
    rig.run(2.0)


X_ITEMS = ("present_position", "present_velocity")
WIRES = {
    "Dynamixel 2.0": Wire("chain", ServoRig, lambda: paced(Bioloid.x_series(6, baud=BAUD)),
                          servos(range(1, 7), X_ITEMS, 2300), {"options": {"protocol": 2}}),
    "Feetech": Wire("so101", ServoRig, lambda: paced(So101(calibrated=True)),
                    servos(range(1, 7), ("present_position", "present_load"), 2200),
                    {}),
    "ARCOS": Wire("p3dx", BaseRig, lambda: P3dx(World(), slip=0).robot, drive, {}),
    "CAN": Wire("segway", SegwayRig, lambda: CanDevice(SegwayRmp(), Records()), balance, {}),
    "CANopen": Wire("cia402", DrivesRig, lambda: CanDevice(Drive(5), Records()), turn_drive, {}),
    "NXT": Wire("nxt", BrickRig, lambda: NxtDevice(TriBot()), turn, {}),
}  # fmt: skip


def run_recorded(wire: Wire) -> tuple[DriverRig, list[bytes]]:
    rig = wire.rig(wire.device(), **wire.settings)
    chunks: list[tuple[float, str, str]] = []
    rig.link.observer = lambda way, data: chunks.append((round(rig.clock.now(), 6), way, data.hex()))
    rig.attach()
    wire.script(rig)
    return rig, [json.dumps({"event": "Traffic", "chunks": [chunk], "lost": 0}).encode() for chunk in chunks]


def capture(wire: Wire, lines: list[bytes], path: Path) -> list[str]:
    maker, file = RecordMaker(), RecordingFile(path, 0, {"platform": wire.platform})
    for line in lines:
        for record in maker.records(line):
            file.add(record)
    return list(capture_lines(Recording(file.close())))


def run_replayed(wire: Wire, lines: list[str]) -> tuple[DriverRig, Replay]:
    recorded = read_capture(lines)
    assert recorded.is_can == issubclass(wire.rig, SegwayRig)
    device = Replay(recorded, strict=True)
    robot = CanDevice(ReplayNode(device), Records()) if recorded.is_can else device
    rig = wire.rig(robot, **wire.settings)

    def receive(data: bytes, at: float) -> None:
        # Recorded delays begin when the host wrote, and contain the time on the wire.
        for answer in robot.feed(data, rig.clock.now()):
            rig.end.send(answer.data, answer.at)

    rig.end.on_receive = receive
    rig.attach()
    wire.script(rig)
    return rig, device


def plain(news: list[Any]) -> list[tuple[str, Any]]:
    """What a driver told, with its times in 10 us."""

    def rounded(value: Any) -> Any:
        if is_dataclass(value) and not isinstance(value, type):
            value = asdict(value)
        if isinstance(value, dict):
            return {str(key): rounded(inner) for key, inner in value.items()}
        if isinstance(value, list | tuple):
            return [rounded(inner) for inner in value]
        return pytest.approx(value, abs=1e-5) if isinstance(value, float) else value

    return [(type(each).__name__, rounded(each)) for each in news]


def exact(news: list[Any]) -> list[tuple[str, Any]]:
    return [(type(each).__name__, json.loads(json.dumps(asdict(each), default=str))) for each in news]


@pytest.mark.parametrize("name", WIRES)
def test_the_driver_tells_what_it_told(name: str, tmp_path: Path) -> None:
    wire = WIRES[name]
    recorded, lines = run_recorded(wire)
    replayed, device = run_replayed(wire, capture(wire, lines, tmp_path / "a.mcap"))
    assert device.compared() == "as recorded; 0 requests have not come"
    samples = [each for each in recorded.news if isinstance(each, m.Samples)]
    assert len(samples) > 20 and len(lines) > 50
    assert exact(replayed.news) == plain(recorded.news)
