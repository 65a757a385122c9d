"""The simulated CiA 402 drive: what it says on the bus, its states, its motor, its watch over the master."""

from __future__ import annotations

import pytest

from urbihw_fakes.can.node import CanFrame
from urbihw_fakes.cia402.dictionary import INCREMENTS
from urbihw_fakes.cia402.node import Drive


class Bus:
    """A drive with the number 5, and a master that speaks bytes."""

    def __init__(self) -> None:
        self.drive = Drive(5)
        self.now = 0.0
        self.heard: list[str] = []
        self.run(0.002)

    def run(self, seconds: float) -> list[str]:
        """Let time pass; what was sent in it."""
        sent: list[str] = []
        end = self.now + seconds
        while self.now < end - 1e-9:
            self.now = min(self.now + 0.1, end)
            sent += [str(frame) for _, frame in self.drive.tick(self.now)]
        self.heard += sent
        return sent

    def say(self, identifier: int, data: str) -> list[str]:
        """Send a frame; what is answered at once."""
        frame = CanFrame(identifier, bytes.fromhex(data))
        return [str(answer) for _, answer in self.drive.receive_frame(frame, self.now)]

    def write(self, index: int, sub: int, value: int, size: int) -> str:
        """Write an object; the answer."""
        head = bytes([0x2F - 4 * (size - 1)]) + index.to_bytes(2, "little") + bytes([sub])
        body = (value & (1 << 8 * size) - 1).to_bytes(size, "little")
        (answer,) = self.say(0x605, (head + body.ljust(4, b"\0")).hex())
        return answer

    def read(self, index: int, sub: int = 0) -> int:
        """Read an object of up to four bytes."""
        (answer,) = self.say(0x605, f"40{index.to_bytes(2, 'little').hex()}{sub:02x}00000000")
        data = bytes.fromhex(answer.partition("#")[2])
        size = 4 - (data[0] >> 2 & 3)
        return int.from_bytes(data[4 : 4 + size], "little", signed=True)

    def enable(self, mode: int) -> None:
        """Walk through the states."""
        self.write(0x6060, 0, mode, 1)
        for word in (6, 7, 15):
            self.write(0x6040, 0, word, 2)
        assert self.drive.machine.state == "operation enabled"


def test_it_boots_and_its_heartbeat_is_that_of_the_sheets() -> None:
    bus = Bus()
    assert bus.heard == ["705#00"]
    bus.write(0x1017, 0, 100, 2)
    assert bus.run(0.31) == ["705#7F"] * 3
    bus.say(0, "0105")
    assert bus.run(0.1) == ["705#05"]
    bus.say(0, "0205")
    assert bus.run(0.1) == ["705#04"]
    bus.say(0, "8105")
    assert "705#00" in bus.run(0.01)


def test_objects_are_read_and_refused_as_in_the_sheets() -> None:
    bus = Bus()
    assert bus.say(0x605, "40 00 10 00 00 00 00 00") == ["585#4300100092010200"]
    assert bus.say(0x605, "40 99 29 00 00 00 00 00")[0].endswith("00000206")
    assert bus.write(0x6041, 0, 0, 2).endswith("02000106")
    assert bus.read(0x6502) == 0x2D


def test_process_data_flow_in_operational_only() -> None:
    bus = Bus()
    bus.write(0x1A00, 0, 0, 1)
    bus.write(0x1A00, 1, 0x60410010, 4)
    bus.write(0x1A00, 2, 0x606C0020, 4)
    bus.write(0x1A00, 0, 2, 1)
    bus.write(0x1800, 5, 20, 2)
    bus.write(0x1800, 1, 0x185, 4)
    bus.write(0x1600, 1, 0x60400010, 4)
    bus.write(0x1600, 2, 0x60FF0020, 4)
    bus.write(0x1600, 0, 2, 1)
    bus.write(0x1400, 1, 0x205, 4)
    assert bus.run(0.1) == []
    bus.say(0x205, "06 00 00 00 00 00")
    assert bus.drive.machine.state == "switch on disabled"
    bus.say(0, "0105")
    assert set(bus.run(0.1)) == {"185#500200000000"}
    assert len(bus.run(0.1)) == 5
    bus.say(0x205, "06 00 00 00 00 00")
    assert bus.drive.machine.state == "ready to switch on"
    bus.say(0x205, "07 00")
    assert bus.drive.machine.state == "ready to switch on"


def test_the_motor_follows_a_speed_and_stops_on_halt() -> None:
    bus = Bus()
    bus.enable(3)
    bus.write(0x60FF, 0, INCREMENTS, 4)
    bus.run(1.0)
    assert bus.read(0x606C) == INCREMENTS
    bus.write(0x6040, 0, 0x010F, 2)
    bus.run(0.5)
    assert bus.read(0x606C) == 0
    assert bus.drive.machine.state == "operation enabled"


def test_the_motor_goes_to_a_position_when_told_that_it_is_new() -> None:
    bus = Bus()
    bus.enable(1)
    bus.write(0x607A, 0, 3 * INCREMENTS, 4)
    bus.run(1.0)
    assert bus.read(0x6064) == 0
    bus.write(0x6040, 0, 0x003F, 2)
    assert bus.read(0x6041) & 0x1000
    bus.run(3.0)
    assert bus.read(0x6064) == pytest.approx(3 * INCREMENTS, abs=2)
    assert bus.read(0x6041) & 0x0400
    bus.write(0x6040, 0, 0x002F, 2)
    assert not bus.read(0x6041) & 0x1000


def test_a_position_beyond_the_limits_is_cut() -> None:
    bus = Bus()
    bus.write(0x607D, 2, INCREMENTS, 4)
    bus.enable(1)
    bus.write(0x607A, 0, 3 * INCREMENTS, 4)
    bus.write(0x6040, 0, 0x003F, 2)
    bus.run(3.0)
    assert bus.read(0x6064) == pytest.approx(INCREMENTS, abs=2)
    assert bus.read(0x6041) & 0x0800


def test_a_quick_stop_brakes_and_ends_switched_off() -> None:
    bus = Bus()
    bus.enable(3)
    bus.write(0x60FF, 0, INCREMENTS, 4)
    bus.run(1.0)
    bus.write(0x6040, 0, 0x0002, 2)
    assert bus.read(0x6041) & 0x6F == 0x07
    bus.run(0.5)
    assert bus.read(0x606C) == 0
    assert bus.read(0x6041) & 0x4F == 0x40


def test_a_fault_is_told_and_wants_an_edge_to_be_reset() -> None:
    bus = Bus()
    bus.enable(3)
    bus.drive.fault()
    assert "085#1032010000000000" in bus.run(0.1)
    assert bus.read(0x6041) & 0x4F == 0x08
    assert (bus.read(0x603F), bus.read(0x1001)) == (0x3210, 1)
    for word in (0x0F, 0x00, 0x80):
        bus.write(0x6040, 0, word, 2)
    assert bus.read(0x6041) & 0x4F == 0x40
    assert bus.read(0x603F) == 0


@pytest.mark.parametrize(("action", "state"), [(1, "fault"), (2, "switch on disabled"), (3, "quick stop active")])
def test_a_master_that_dies_stops_the_drive(action: int, state: str) -> None:
    bus = Bus()
    bus.write(0x6007, 0, action, 2)
    bus.write(0x1016, 1, 127 << 16 | 300, 4)
    bus.enable(3)
    bus.write(0x60FF, 0, INCREMENTS, 4)
    for _ in range(10):
        bus.say(0x77F, "05")
        bus.run(0.2)
    assert bus.drive.machine.state == "operation enabled"
    bus.run(0.106)
    assert bus.drive.machine.state == state
    assert any(line.startswith("085#308110") for line in bus.heard)
    bus.run(1.5)
    assert bus.drive.machine.speed == 0.0


def test_nonsense_changes_nothing() -> None:
    bus = Bus()
    for identifier in (0, 0x205, 0x605, 0x705, 0x7FF):
        for data in ("", "01", "ff" * 8, "00" * 8):
            bus.say(identifier, data)
    assert bus.drive.machine.state == "switch on disabled"
    assert bus.read(0x1000) == 0x20192


def test_without_power_it_is_silent_and_forgets() -> None:
    bus = Bus()
    bus.enable(3)
    bus.drive.power_off(bus.now)
    assert bus.say(0x605, "40 00 10 00 00 00 00 00") == []
    assert bus.run(0.2) == []
    assert bus.drive.due() is None
    bus.drive.power_on(bus.now)
    assert bus.run(0.1) == ["705#00"]
    assert bus.drive.machine.state == "switch on disabled"


def test_a_mode_that_it_does_not_have_is_refused() -> None:
    bus = Bus()
    assert bus.write(0x6060, 0, 99, 1) == "585#8060600030000906"
    assert bus.write(0x6098, 0, 99, 1).endswith("30000906")
    assert bus.write(0x6060, 0, 3, 1) == "585#6060600000000000"
    assert bus.read(0x6061) == 3


def test_in_stopped_it_answers_no_sdo_and_sends_no_emergency() -> None:
    bus = Bus()
    bus.write(0x1017, 0, 100, 2)
    bus.say(0, "0205")
    assert bus.say(0x605, "40 00 10 00 00 00 00 00") == []
    bus.drive.fault()
    assert set(bus.run(0.5)) == {"705#04"}
    bus.say(0, "8005")
    assert bus.read(0x1000) == 0x20192


@pytest.mark.parametrize(("command", "mode"), [("8105", 0), ("8205", 3), ("8100", 0)])
def test_a_reset_takes_the_settings_back_and_the_heartbeat_ends(command: str, mode: int) -> None:
    bus = Bus()
    bus.write(0x1017, 0, 100, 2)
    bus.write(0x1016, 1, 127 << 16 | 300, 4)
    bus.write(0x6060, 0, 3, 1)
    assert bus.run(0.31) == ["705#7F"] * 3
    bus.say(0, command)
    assert bus.run(2.0) == ["705#00"]
    assert (bus.read(0x1017), bus.read(0x1016, 1), bus.read(0x6061)) == (0, 0, mode)


def test_homing_finds_the_switch() -> None:
    bus = Bus()
    bus.write(0x6098, 0, 17, 1)
    bus.enable(6)
    bus.write(0x6040, 0, 0x001F, 2)
    bus.run(1.0)
    assert not bus.read(0x6041) & 0x1400
    bus.run(6.0)
    assert bus.read(0x6041) & 0x1400 == 0x1400
    assert bus.read(0x6064) == pytest.approx(0, abs=INCREMENTS / 20)
    assert bus.read(0x606C) == 0
    assert bus.drive.machine.switches == pytest.approx((0, 6 * INCREMENTS), abs=INCREMENTS / 20)


def test_the_present_place_can_be_home() -> None:
    bus = Bus()
    bus.enable(3)
    bus.write(0x60FF, 0, INCREMENTS, 4)
    bus.run(1.0)
    bus.write(0x60FF, 0, 0, 4)
    bus.run(1.0)
    bus.write(0x6098, 0, 37, 1)
    bus.write(0x607C, 0, 100, 4)
    bus.write(0x6060, 0, 6, 1)
    bus.write(0x6040, 0, 0x001F, 2)
    assert bus.read(0x6064) == 100
    assert bus.read(0x6041) & 0x1400 == 0x1400


def test_a_torque_turns_the_motor_and_is_measured() -> None:
    bus = Bus()
    bus.enable(4)
    bus.write(0x6071, 0, 100, 2)
    bus.run(5.0)
    assert bus.read(0x606C) == pytest.approx(2 * INCREMENTS, rel=0.05)
    assert bus.read(0x6077) == pytest.approx(100, abs=5)
    bus.write(0x6040, 0, 0x010F, 2)
    bus.run(0.5)
    assert bus.read(0x606C) == 0
