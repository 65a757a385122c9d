"""Every documented frame, put to the simulated RMP: what it understands, and what it says."""

from __future__ import annotations

import math

import pytest

from urbihw_fakes import captures
from urbihw_fakes.can.node import CanFrame
from urbihw_fakes.segway import frames as f
from urbihw_fakes.segway import monitor
from urbihw_fakes.segway.monitor import Reading
from urbihw_fakes.segway.rmp import SegwayRmp
from urbihw_fakes.segway.usb import UsbLink, packet

EXCHANGES = captures.read("segway")
MODEL = f.MODELS["200"]
SENT = [name for name, exchange in EXCHANGES.items() if exchange.sent]
SAID = [name for name, exchange in EXCHANGES.items() if exchange.received]


def can_frame(data: bytes) -> CanFrame:
    return CanFrame(int.from_bytes(data[:2], "big"), data[2:])


def degrees(counts: int) -> float:
    return math.radians(counts / 7.8)


# What the sheets say of the two logs, in SI units.
LOG = Reading(
    pitch=degrees(7),
    pitch_rate=degrees(2),
    roll=degrees(2),
    roll_rate=degrees(8),
    yaw_rate=-math.radians(4.103),
    frames=530,
    left_count=-16497,
    right_count=-28919,
    forward_count=18882,
    yaw_count=67997,
    left_torque=-0.0384,
    right_torque=0.0229,
    mode=f.TRACTOR,
    box_volts=6.3625,
    volts=76.0,
    build=2032,
)
TEST = Reading(
    pitch=-math.radians(0.897),
    pitch_rate=math.radians(1.923),
    roll=-math.radians(0.128),
    roll_rate=math.radians(1.154),
    left_speed=0.0361,
    right_speed=-0.0422,
    yaw_rate=math.radians(9.615),
    frames=6356,
    left_count=-506,
    right_count=79,
    forward_count=-999,
    yaw_count=-84,
    left_torque=-0.0064,
    right_torque=0.1527,
    mode=f.TRACTOR,
    box_volts=9.325,
    volts=78.0,
)

HEARD: dict[str, dict[str, int]] = {
    "velocity-plus-332-turn-0": {"_velocity": 332, "_turn": 0},
    "velocity-plus-332-turn-plus-78": {"_velocity": 332, "_turn": 78},
    "velocity-minus-166": {"_velocity": -166},
    "velocity-plus-1176-turn-minus-1024-limits": {"_velocity": 1176, "_turn": -1024},
    "maximum-velocity-scale-16-16": {"velocity_scale": 16},
    "maximum-velocity-scale-8-16": {"velocity_scale": 8},
    "maximum-acceleration-16-16": {"acceleration_scale": 16},
    "maximum-turn-16-16": {"turn_scale": 16},
    "gain-schedule-heavy": {"gain": 2},
    "current-limit-256-full": {"current_limit": 256},
    "current-limit-128-half": {"current_limit": 128},
    "balance-lockout-on": {"lockout": True},
    "balance-lockout-off": {"lockout": False},
    "mode-disabled": {"mode": 0},
    "mode-tractor": {"mode": 1},
    "mode-balance": {"mode": 2},
    "mode-power-down": {"powered": False},
    "heartbeat-stand-still": {"_velocity": 0, "_turn": 0},
    "shutdown": {"powered": False},
}
RESETS = {"right-wheel": "right", "left-wheel": "left", "yaw": "yaw", "fore-aft": "forward"}


@pytest.mark.parametrize("name", SENT)
def test_a_packet_of_the_host_holds_the_frame(name: str) -> None:
    bus, usb = EXCHANGES[name].sent
    link = UsbLink()
    assert link.decode(usb) == ([can_frame(bus)], b"")
    assert link.decode(bytes([*usb[:-1], usb[-1] ^ 1]) + usb)[0] == [can_frame(bus)]
    assert link.damaged > 0


@pytest.mark.parametrize("name", [name for name in SENT if not name.startswith("reset-")])
def test_a_command_does_what_it_says(name: str) -> None:
    base = SegwayRmp()
    other = {"velocity_scale": 3, "acceleration_scale": 3, "turn_scale": 3, "gain": 1, "current_limit": 7}
    for attribute, value in other.items():
        setattr(base, attribute, value)
    base.lockout = name != "mode-balance" and name != "balance-lockout-on"
    base.receive_frame(can_frame(EXCHANGES[name].sent[0]), 0.0)
    assert {attribute: getattr(base, attribute) for attribute in HEARD[name]} == HEARD[name]


@pytest.mark.parametrize("name", [name for name in SENT if name.startswith("reset-")])
def test_a_reset_is_of_what_it_says(name: str) -> None:
    base = SegwayRmp()
    base.preset_integrators(left=11, right=12, forward=13, yaw=14)
    base.receive_frame(can_frame(EXCHANGES[name].sent[0]), 0.0)
    reading = base.reading()
    kept = {kind for kind in RESETS.values() if getattr(reading, f"{kind}_count")}
    which = name.removeprefix("reset-").removesuffix("-integrator")
    assert kept == (set() if which == "all-integrators" else set(RESETS.values()) - {RESETS[which]})


@pytest.mark.parametrize("name", SAID)
def test_a_reading_looks_as_it_does_on_the_bus_and_in_a_packet(name: str) -> None:
    data, usb = EXCHANGES[name].received
    bus = can_frame(data)
    log = name.startswith("log-")
    frames = {frame.id: frame for frame in monitor.cycle(LOG if log else TEST, MODEL)}
    frames[f.BOX] = monitor.box_heartbeat(6.325)
    frames[f.SHUTDOWN] = monitor.box_alone(6.375)[0]
    # Slot 3 of the status words means nothing, and is 0 here.
    status = monitor.status(0x0080, 0)
    frames[f.STATUS] = CanFrame(status.id, status.data[:6] + bytes.fromhex("3E57"))
    assert str(frames[bus.id]) == str(bus)
    assert packet(bus) == usb


def test_every_exchange_is_looked_at() -> None:
    assert len(SENT) + len(SAID) == len(EXCHANGES) == 41
    assert {name for name in SENT if not name.startswith("reset-")} == set(HEARD)
