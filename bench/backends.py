"""Our driver of the servo bus beside that of the maker: `python -m bench.backends [--turns 10]`.

One run against the fake kit of `bench.dynamixel_cycle`, a process of its own on a pty, paced at 1 Mbps: our cycle over
18 servos, one sync write and all of them read, as often as it goes ("own"); and the same by dynamixel-sdk without
urbihw ("bare"), as its examples do it. They take turns of half a second. Printed for each protocol, and once more with
one servo silent:

    cycles/s    median turn
    ms/cycle    processor time of this process, in ms; the fake has its own
    data        share of the answering servos whose data came, over all cycles
    stop        time in ms that a stop would have waited for the end of a transaction: 99th percentile, and longest

The fake spins: on two cores one is its.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import dynamixel_sdk  # type: ignore[import-untyped]

from bench.dynamixel_cycle import BAUD, FLAT_OUT, IDS, ITEMS, READ, WINDOW, Fake, aim, fake, goal
from bench.quick import add_quick
from urbihw import buses
from urbihw.buses.servos.bus import ServoBus
from urbihw.buses.servos.cycle import Cycle
from urbihw.buses.servos.scan import scan

BACK_ENDS: dict[str, type[ServoBus] | None] = {"own": ServoBus, "bare": None}
"""Name -> class of the bus, None for the package alone."""
CountingCycle = Callable[[int, Callable[[], bool]], int]
"""One cycle: takes its number and what to call between two transactions, and returns how many servos gave data."""
SILENT = 6
SETTLE = 0.3
"""Seconds in which a silent servo is noticed, and a link gets up to speed."""


@dataclass
class Result:
    """What one back end did.

    Attributes:
        rates: cycles a second of each turn.
        processor: seconds, over all cycles.
        cycles: their number.
        answers: servos whose data came, over all cycles.
        waits: seconds between two moments in which a stop would be noticed.
    """

    rates: list[float] = field(default_factory=list)
    processor: float = 0.0
    cycles: int = 0
    answers: int = 0
    waits: list[float] = field(default_factory=list)


def turn(kit: Fake, protocol: int, kind: type[ServoBus] | None, silent: bool, result: Result) -> None:
    """Let a back end run for `WINDOW` seconds."""

    def measure(cycle: CountingCycle) -> None:
        if silent:
            kit.say(f"silence {SILENT}")
        run(cycle, SETTLE, Result())
        run(cycle, WINDOW, result)
        if silent:
            kit.say(f"heal {SILENT}")

    if kind is None:
        measure_package(kit, protocol, measure)
        return
    with buses.open_link(kit.url) as link:
        bus = kind(link, 1 if protocol == 1 else 2)
        devices = scan(bus, IDS).devices
        if len(devices) != len(IDS):
            raise SystemExit("the fake misses its times: this machine is too busy to measure anything")
        cycle = Cycle(bus, devices, 1 / FLAT_OUT, fast=False)
        for device in IDS:
            cycle.watch(device, ITEMS[protocol], 0.0, link.clock.now())

        def one(count: int, urgent: Callable[[], bool]) -> int:
            aim(cycle, protocol, count)
            return len(cycle.tick(link.clock.now(), None, urgent).values)

        measure(one)


def measure_package(kit: Fake, protocol: int, measure: Callable[[CountingCycle], None]) -> None:
    """Measure dynamixel-sdk alone: its port, its group write, its reads or its group read."""
    port = dynamixel_sdk.PortHandler(kit.path)
    port.openPort()
    port.setBaudRate(BAUD)
    handler = dynamixel_sdk.PacketHandler(float(protocol))
    address, size = READ[protocol]
    writer = dynamixel_sdk.GroupSyncWrite(port, handler, 30 if protocol == 1 else 116, 4)
    reader = dynamixel_sdk.GroupSyncRead(port, handler, address, size)
    for device in IDS:
        writer.addParam(device, goal(protocol, 0))
        reader.addParam(device)

    def one(count: int, urgent: Callable[[], bool]) -> int:
        for device in IDS:
            writer.changeParam(device, goal(protocol, count))
        writer.txPacket()
        if protocol == 2:
            reader.txRxPacket()
            return sum(reader.isAvailable(device, address, size) for device in IDS)
        full = 0
        for device in IDS:
            full += handler.readTxRx(port, device, address, size)[1] == dynamixel_sdk.COMM_SUCCESS
            urgent()
        return full

    try:
        measure(one)
    finally:
        port.closePort()


def run(cycle: CountingCycle, seconds: float, result: Result) -> None:
    """Run a cycle flat out for some seconds."""
    last = time.perf_counter()

    def urgent() -> bool:
        nonlocal last
        now = time.perf_counter()
        result.waits.append(now - last)
        last = now
        return False

    begin, processor, cycles = time.perf_counter(), time.process_time(), 0
    while (last := time.perf_counter()) < begin + seconds:
        result.answers += cycle(cycles, urgent)
        urgent()
        cycles += 1
    result.rates.append(cycles / (time.perf_counter() - begin))
    result.processor += time.process_time() - processor
    result.cycles += cycles


def compare(protocol: int, turns: int, paced: bool) -> None:
    """Print the rows of one protocol."""
    with fake(protocol, paced) as kit:
        for silent in (False, True):
            results = {name: Result() for name in BACK_ENDS}
            for _ in range(turns):
                for name, kind in BACK_ENDS.items():
                    turn(kit, protocol, kind, silent, results[name])
            for name, result in results.items():
                waits = sorted(result.waits)
                data = result.answers / (result.cycles * (len(IDS) - silent))
                print(
                    f"{protocol}.0 {'1 silent' if silent else 'healthy':9} {name:4} "
                    f"{statistics.median(result.rates):8.1f} {1000 * result.processor / result.cycles:9.2f} "
                    f"{100 * data:7.1f} % {1000 * waits[len(waits) * 99 // 100]:8.2f} {1000 * waits[-1]:8.2f}",
                    flush=True,
                )


def main() -> None:
    """Run it."""
    options = argparse.ArgumentParser(prog="python -m bench.backends", description="The back ends of the servo bus.")
    options.add_argument("--turns", type=int, default=10, help="turns of half a second for each")
    add_quick(options, turns=1)
    wanted = options.parse_args()
    print(f"{'protocol':13} {'by':4} {'cycles/s':>8} {'ms/cycle':>9} {'data':>9} {'stop 99%':>8} {'longest':>8}")
    for protocol in (1, 2):
        compare(protocol, wanted.turns, not wanted.quick)


if __name__ == "__main__":
    main()
