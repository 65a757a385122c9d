"""The verb "trace" of the control socket: what the worker writes and reads, for who asks, and no cost otherwise."""

from __future__ import annotations

from typing import Any

from urbihw.buses import messages as m
from urbihw.buses.can.frame import CanFrame
from urbihw.buses.can.port import CanPort
from urbihw.buses.clock import BusSimClock
from urbihw.buses.link import Context, Url
from urbihw.buses.servos import trace
from urbihw.buses.trace import Chunk
from urbihw.buses.traffic import (
    MOST_BYTES,
    MOST_CHUNKS,
    MOST_OPENING_BYTES,
    MOST_OPENING_ROWS,
    OPENING_ROWS,
    OPENING_S,
    TrafficLog,
)
from urbihw.buses.turnaround import BusMeter

from .conftest import Rig
from .test_control import ControlBench, bench

__all__ = ["bench"]


def traffic(said: list[dict[str, Any]]) -> list[tuple[str, bytes]]:
    """The chunks of all events."""
    return [
        (direction, bytes.fromhex(text))
        for event in said
        if event.get("event") == "Traffic"
        for _, direction, text in event["chunks"]
    ]


def test_a_tracer_gets_what_is_on_the_wire_and_the_devices(bench: ControlBench) -> None:
    caller = bench.call()
    caller.say("trace")
    bench.run(0.05)
    bench.rig.sent()
    caller.hear()
    bench.tell(m.Targets({(6, "goal_position"): 600}))
    bench.run(0.05)
    written = [data.hex(" ").upper() for direction, data in traffic(caller.hear()) if direction == ">"]
    assert written == bench.rig.sent()
    assert bench.register("goal_position") == 600


def test_the_answer_tells_how_to_decode(bench: ControlBench) -> None:
    answer, _ = bench.order("trace")
    assert answer["url"] == "pipe://robot"
    assert answer["baud"] == 1_000_000
    assert {"id": 6, "model": 12, "protocol": 1}.items() <= answer["devices"][5].items()


def test_nobody_listens_nothing_is_collected(bench: ControlBench) -> None:
    bench.run(OPENING_S)
    link = bench.engine._link.port
    assert link is not None and link.observer is None
    caller = bench.call()
    caller.say("trace")
    bench.run(0.05)
    assert link.observer is not None
    caller.close()
    bench.run(0.05)
    assert link.observer is None


def test_the_first_seconds_of_a_link_are_kept_for_who_records_later(bench: ControlBench) -> None:
    sent = bench.rig.sent()
    bench.run(OPENING_S + 1.0)
    caller = bench.call()
    caller.say("record")
    bench.run(0.2)
    first, *said = caller.hear()
    assert first["do"] == "record" and first["settings"]["rate"] == 100.0
    opening = [event for event in said if event.get("opening")]
    written = [data.hex(" ").upper() for direction, data in traffic(opening) if direction == ">"]
    assert len(sent) > 250 and written[: len(sent)] == sent
    assert len(opening) > 2 and all(len(event["chunks"]) <= OPENING_ROWS for event in opening)


def test_the_first_seconds_are_bounded(rig: Rig) -> None:
    log = TrafficLog("pipe://robot", rig.clock)
    log.begin(rig.link)
    for _ in range(5):
        rig.link.observer("<", b"x" * (MOST_OPENING_BYTES // 2))  # type: ignore[misc]
    rows = [row for event in log.opening() for row in event["chunks"]]
    assert [len(row[2]) // 2 for row in rows] == [MOST_OPENING_BYTES // 2] * 2
    log.begin(rig.link)
    for _ in range(MOST_OPENING_ROWS + 5):
        rig.link.observer("<", b"x")  # type: ignore[misc]
    assert sum(len(event["chunks"]) for event in log.opening()) == MOST_OPENING_ROWS


def test_what_the_first_seconds_have_no_room_for_is_counted_and_nothing_behind_it_is_kept(rig: Rig) -> None:
    log = TrafficLog("pipe://robot", rig.clock)
    log.begin(rig.link)
    for size in (10, MOST_OPENING_BYTES, 10, 10):
        rig.link.observer("<", b"x" * size)  # type: ignore[misc]
    # A gap in the middle would let a replay go wrong where nobody looks for it.
    (kept, lost) = log.opening()
    assert ([len(row[2]) // 2 for row in kept["chunks"]], kept["lost"]) == ([10], 0)
    assert (lost["chunks"], lost["lost"], lost["opening"]) == ([], 3, True)
    log.begin(rig.link)
    assert list(log.opening()) == []


def test_what_waits_is_bounded_and_the_loss_is_told(rig: Rig) -> None:
    log = TrafficLog("pipe://robot", rig.clock)
    log.observe(rig.link, True)
    observer = rig.link.observer
    assert observer is not None
    for _ in range(MOST_CHUNKS + 7):
        observer("<", b"x")
    event = log.take()
    assert event is not None and (len(event["chunks"]), event["lost"]) == (MOST_CHUNKS, 7)
    for _ in range(3):
        observer("<", b"x" * MOST_BYTES)
    event = log.take()
    assert event is not None and (len(event["chunks"]), event["lost"]) == (1, 2)
    assert log.take() is None


def test_frames_of_a_can_bus_are_shown_with_their_identifier() -> None:
    port = CanPort(Url.parse("can://pipe/robot"), Context(BusSimClock(0.0)))
    seen: list[tuple[str, bytes]] = []
    port.observer = lambda direction, data: seen.append((direction, data))
    port._show("<", [])
    port._show("<", [CanFrame(0x413, b"\x01\x02")])
    assert seen == [("<", b"\x04\x13\x01\x02")]


# ---------------------------------------------------------------- measuring


def test_turnaround_is_the_answer_time_without_the_wire() -> None:
    """10 us a byte: the request of 8 bytes ends at 80 us, the answer of 8 bytes takes 80 us, so 500 us are left."""
    request, answer = bytes.fromhex("FF FF 01 04 02 24 02 D2"), bytes.fromhex("FF FF 01 04 00 00 02 F8")
    meter = BusMeter(trace.dynamixel(()), 1e-5)
    meter.add_all([Chunk(1.0, ">", request), Chunk(1.00066, "<", answer), Chunk(1.001, ">", request)])
    assert {device: round(seconds, 7) for device, seconds in meter.turnarounds().items()} == {"1": 0.0005}
    assert (meter.written, meter.read, meter.damaged, dict(meter.silent)) == (16, 8, 0, {"1": 1})
    assert round(meter.busy, 3) == 0.24


def test_the_turnaround_of_a_factory_servo_is_its_return_delay(rig: Rig) -> None:
    """The factory value of an AX-12 is 250, 0.5 ms."""
    rig.kit.servo(3).registers.put("return_delay", 250)
    chunks: list[Chunk] = []
    rig.link.observer = lambda direction, data: chunks.append(
        Chunk(rig.clock.now(), ">" if direction == ">" else "<", data)
    )
    bus = rig.bus()
    for number in (3, 4):
        for _ in range(3):
            bus.read(number, 36, 2)
    meter = BusMeter(trace.dynamixel(()), rig.link.byte_time)
    meter.add_all(chunks)
    found = meter.turnarounds()
    assert abs(found["3"] - 0.0005) < 5e-5 and found["4"] < 5e-5
