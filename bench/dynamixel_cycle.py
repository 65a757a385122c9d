"""How close the Dynamixel cycle comes to the wire: `python -m bench.dynamixel_cycle [--seconds 3]`.

One run against the fake kit on a pty, paced at 1 Mbps in a process of its own: 18 servos, one sync write and all of
them read, as often as it goes. Beside it, in the same run and on the same fake: rustypot, dynamixel-sdk, and a bare
os.write / select / os.read loop that decodes nothing, which shows what this machine and the fake allow at all.
100 % is the bytes of a cycle at 10 bits each and nothing else. Return delays are 0. The contenders take turns; "best"
is the turn with the best median cycle, "usual" the median turn.

"core" is the share of a core that a contender takes meanwhile; dynamixel-sdk spins while it waits.

Then: the rate of the worker beside that of dynamixel-sdk, and its share of a core beside the sdk's (budget: 95 % of
the rate at 10 % of the share); processor at 100 Hz; the same with all cores busy, with and without real-time
scheduling; the rate that the worker achieves where more is asked for than the wire gives, in simulated time (budget:
never less where more is asked, and within 2 % of the wire); the time of a scan, and what 1, 2 and 5 silent servos of 18
cost.
The fake spins (so that its own wake-up is not counted against the driver): on two cores one is its.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import select
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing import Pipe
from pathlib import Path

import dynamixel_sdk  # type: ignore[import-untyped]
import rustypot

from bench import ROOT
from bench.quick import add_quick
from urbihw import buses
from urbihw.buses import messages as m
from urbihw.buses.clock import BusSimClock
from urbihw.buses.driver import driver_of
from urbihw.buses.engine import Engine
from urbihw.buses.link import Context, Link
from urbihw.buses.mailbox import Mailbox
from urbihw.buses.pipe import PipeEnd
from urbihw.buses.servos import packet
from urbihw.buses.servos.bus import ServoBus
from urbihw.buses.servos.cycle import Cycle
from urbihw.buses.servos.scan import scan
from urbihw.buses.worker import Worker
from urbihw_fakes.bioloid import Bioloid

BAUD = 1_000_000
WINDOW = 0.5
"""Seconds of a turn."""
IDS = list(range(1, 19))
BYTE = 10 / BAUD
READ = {1: (36, 8), 2: (126, 10)}
ITEMS = {
    1: ("present_position", "present_speed", "present_load", "present_voltage", "present_temperature"),
    2: ("present_load", "present_velocity", "present_position"),
}
# As often as it goes: the next tick is always due.
FLAT_OUT = 100_000.0
# A cycle: takes a running number, tells whether all data came.
Loop = Callable[[int], bool]
Contender = Callable[[], contextlib.AbstractContextManager[Loop]]


@dataclass(frozen=True)
class Amounts:
    """How much is measured.

    Attributes:
        seconds: of each measurement without turns.
        turns: of each contender.
        window: seconds of a turn.
        paced: whether the fake answers at the speed of the wire, and spins meanwhile.
    """

    seconds: float
    turns: int = 10
    window: float = WINDOW
    paced: bool = True


class Fake:
    """The fake kit in its own process: AX-12 in protocol 1.0, XL430 in 2.0."""

    def __init__(self, protocol: int, paced: bool, spins: bool = True) -> None:
        pace = [*(["--pace"] if paced else []), *(["--spin"] if paced and spins else [])]
        options = ["--pty", "--until-eof", "--baud", str(BAUD), *pace]
        options += ["--x-series", "18"] if protocol == 2 else []
        self._process = subprocess.Popen(
            [sys.executable, "-m", "urbihw_fakes", "bioloid", *options],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=ROOT,
        )
        assert self._process.stdout is not None
        self.url = f"{self._process.stdout.readline().strip()}?baud={BAUD}"
        self.path = self.url.removeprefix("serial://").partition("?")[0]
        with buses.open_link(self.url) as link:
            bus = ServoBus(link, 1 if protocol == 1 else 2)
            for device in IDS:
                bus.write(device, 5 if protocol == 1 else 9, b"\x00")

    def take_real_time(self) -> None:
        """Answer in time beside busy processes, as servos do, if this user may do that."""
        with contextlib.suppress(OSError):
            os.sched_setscheduler(self._process.pid, os.SCHED_RR, os.sched_param(1))

    def say(self, line: str) -> None:
        """Type a line at the fake's console and wait for its answer."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()
        self._process.stdout.readline()

    def close(self) -> None:
        """End it."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.wait(10)
        self._process.stdout.close()


@contextlib.contextmanager
def fake(protocol: int, paced: bool = True, spins: bool = True) -> Iterator[Fake]:
    """A fake for the time of a `with`; without a pace it answers as soon as it can."""
    made = Fake(protocol, paced, spins)
    try:
        yield made
    finally:
        made.close()


class Rounds:
    """Rates of several contenders, measured in turns, so that a busy moment of the machine strikes all of them.

    Each turn is `window` seconds long; a contender's result is the turn with the best median cycle, and the median
    over all its turns. A cycle counts only if it brought the data of all servos; the share of those is kept too.
    """

    def __init__(self, contenders: dict[str, Contender], window: float) -> None:
        self._contenders = contenders
        self._window = window
        self._rates: dict[str, list[float]] = {name: [] for name in contenders}
        self._full: dict[str, list[bool]] = {name: [] for name in contenders}
        self._shares: dict[str, list[float]] = {name: [] for name in contenders}

    def run(self, turns: int) -> None:
        """Give everyone `turns` turns."""
        for _ in range(turns):
            for name, contender in self._contenders.items():
                with contender() as loop:
                    self._turn(name, loop)

    def _turn(self, name: str, loop: Loop) -> None:
        for count in range(10):
            loop(count)
        times = []
        count = 0
        begun, used = time.perf_counter(), time.process_time()
        end = begun + self._window
        while (start := time.perf_counter()) < end:
            full = loop(count)
            if full:
                times.append(time.perf_counter() - start)
            self._full[name].append(full)
            count += 1
        self._shares[name].append((time.process_time() - used) / (time.perf_counter() - begun))
        self._rates[name].append(1 / statistics.median(times) if times else 0.0)

    def best(self, name: str) -> float:
        """Cycles a second in the best turn."""
        return max(self._rates[name])

    def usual(self, name: str) -> float:
        """Cycles a second in the median turn."""
        return statistics.median(self._rates[name])

    def share(self, name: str) -> float:
        """Share of a core in the median turn, 0..1."""
        return statistics.median(self._shares[name])

    def full(self, name: str) -> float:
        """Percentage of cycles that brought everything."""
        return 100 * sum(self._full[name]) / len(self._full[name])


def rate_of(loop: Callable[[int], object], seconds: float) -> float:
    """Calls a second of `loop(n)`."""
    count = 0
    start = time.perf_counter()
    while time.perf_counter() - start < seconds:
        loop(count)
        count += 1
    return count / (time.perf_counter() - start)


def goal(protocol: int, count: int) -> bytes:
    """Four bytes to write: goal and speed in protocol 1.0, goal in 2.0; another one each time."""
    place = 500 + count % 20
    return place.to_bytes(2, "little") + b"\x64\x00" if protocol == 1 else place.to_bytes(4, "little")


def sync_write(protocol: int, count: int) -> bytes:
    """The sync write of one cycle."""
    return packet.sync_write_packet(protocol, 30 if protocol == 1 else 116, dict.fromkeys(IDS, goal(protocol, count)))


def wire_limit(protocol: int, fast: bool = False) -> float:
    """Cycles a second that the bytes alone allow."""
    address, size = READ[protocol]
    count = len(sync_write(protocol, 0))
    if protocol == 1:
        count += len(IDS) * (8 + 6 + size)
    else:
        answer = 8 + len(IDS) * (size + 4) if fast else len(IDS) * (11 + size)
        count += len(packet.sync_read_packet(address, size, IDS)) + answer
    return 1 / (count * BYTE)


@contextlib.contextmanager
def bare(kit: Fake, protocol: int) -> Iterator[Loop]:
    """Requests made beforehand, answers counted but not looked at."""
    address, size = READ[protocol]
    if protocol == 1:
        requests = [(packet.read_packet(1, device, address, size), 6 + size) for device in IDS]
    else:
        requests = [(packet.sync_read_packet(address, size, IDS), len(IDS) * (11 + size))]
    with buses.open(kit.url):
        fd = os.open(kit.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)

        def loop(count: int) -> bool:
            data = sync_write(protocol, count)
            for request, expected in requests:
                os.write(fd, data + request)
                data = b""
                while expected > 0:
                    if not select.select((fd,), (), (), 1.0)[0]:
                        return False
                    expected -= len(os.read(fd, 4096))
                if expected:
                    # More than asked for: late bytes of an earlier question.
                    return False
            return True

        try:
            yield loop
        finally:
            os.close(fd)


def cycle_of(link: Link, protocol: int, fast: bool, period: float) -> Cycle:
    """Our cycle over all servos, reading everything each tick."""
    bus = ServoBus(link, 1 if protocol == 1 else 2)
    devices = scan(bus, IDS).devices
    if len(devices) != len(IDS):
        raise SystemExit("the fake misses its times: this machine is too busy to measure anything")
    cycle = Cycle(bus, devices, period, fast)
    for device in IDS:
        cycle.watch(device, ITEMS[protocol], 0.0, link.clock.now())
    return cycle


def aim(cycle: Cycle, protocol: int, count: int) -> None:
    """New targets for all."""
    for device in IDS:
        cycle.set_target(device, "goal_position", 500 + count % 20)
        if protocol == 1:
            cycle.set_target(device, "moving_speed", 100 + count % 3)


@contextlib.contextmanager
def ours(kit: Fake, protocol: int, fast: bool = False) -> Iterator[Loop]:
    """Our cycle, with new targets for all each time."""
    with buses.open_link(kit.url) as link:
        cycle = cycle_of(link, protocol, fast, 1 / FLAT_OUT)

        def loop(count: int) -> bool:
            aim(cycle, protocol, count)
            return len(cycle.tick(link.clock.now()).values) == len(IDS)

        yield loop


@contextlib.contextmanager
def rusty(kit: Fake, protocol: int) -> Iterator[Loop]:
    """rustypot's cycle: raw data, as ours."""
    kind = rustypot.AxPyController if protocol == 1 else rustypot.Xl430PyController
    controller = kind(kit.path, BAUD, 0.1)
    address, size = READ[protocol]

    def loop(count: int) -> bool:
        data = list(goal(protocol, count))
        try:
            controller.sync_write_raw_data(IDS, 30 if protocol == 1 else 116, [data] * len(IDS))
            if protocol == 1:
                for device in IDS:
                    controller.read_raw_data(device, address, size)
            else:
                controller.sync_read_raw_data(IDS, address, size)
        except RuntimeError:
            return False
        return True

    try:
        yield loop
    finally:
        controller.close()


@contextlib.contextmanager
def sdk(path: str, protocol: int) -> Iterator[Loop]:
    """dynamixel-sdk's cycle over the device of a fake; it spins while it waits."""
    port = dynamixel_sdk.PortHandler(path)
    port.openPort()
    port.setBaudRate(BAUD)
    handler = dynamixel_sdk.PacketHandler(float(protocol))
    address, size = READ[protocol]
    group_write = dynamixel_sdk.GroupSyncWrite(port, handler, 30 if protocol == 1 else 116, 4)
    group_read = dynamixel_sdk.GroupSyncRead(port, handler, address, size) if protocol == 2 else None
    for device in IDS:
        group_write.addParam(device, goal(protocol, 0))
        if group_read is not None:
            group_read.addParam(device)

    def loop(count: int) -> bool:
        for device in IDS:
            group_write.changeParam(device, goal(protocol, count))
        group_write.txPacket()
        if group_read is not None:
            return bool(group_read.txRxPacket() == dynamixel_sdk.COMM_SUCCESS)
        results = [handler.readTxRx(port, device, address, size)[1] for device in IDS]
        return all(result == dynamixel_sdk.COMM_SUCCESS for result in results)

    try:
        yield loop
    finally:
        port.closePort()


def worker_numbers(
    kit: Fake,
    protocol: int,
    rate: float,
    seconds: float,
    realtime: bool = False,
    begun: Callable[[int], object] = lambda pid: None,
) -> tuple[float, float]:
    """(full samples a second, processor share) of a worker whose parent sends new targets for each sample."""
    found = threading.Event()
    full = 0

    def post(message: m.FromWorker) -> None:
        nonlocal full
        if isinstance(message, m.Found) and len(message.devices) == len(IDS):
            found.set()
        elif isinstance(message, m.Samples):
            full += len(message.values) == len(IDS)
            values = {(device, "goal_position"): 500 + full % 20 for device in IDS}
            if protocol == 1:
                values |= {(device, "moving_speed"): 100 + full % 3 for device in IDS}
            worker.send(m.Targets(values))

    options = {"protocol": protocol, "ids": IDS, "fast_read": False}
    settings = m.Configure(rate=rate, dead_man=0, options=options, realtime=realtime)
    with Worker.start(kit.url, post=post, settings=settings) as worker:
        if not found.wait(30):
            raise SystemExit("the worker does not find all: this machine is too busy to measure anything")
        for device in IDS:
            worker.send(m.Watch(device, ITEMS[protocol]))
        for pid in worker_processes():
            begun(pid)
        time.sleep(1.0)
        before, begin, used = full, time.perf_counter(), child_seconds()
        time.sleep(seconds)
        elapsed = time.perf_counter() - begin
        return (full - before) / elapsed, (child_seconds() - used) / elapsed


def worker_processes() -> list[int]:
    """The worker processes among our children: one."""
    children = Path(f"/proc/self/task/{os.getpid()}/children").read_text(encoding="ascii").split()
    lines = {int(each): Path(f"/proc/{each}/cmdline").read_text(encoding="utf-8") for each in children}
    return [each for each, line in lines.items() if "urbihw.buses.child" in line]


def child_seconds() -> float:
    """Processor time so far of the one worker process among our children."""
    total = 0.0
    for child in worker_processes():
        fields = Path(f"/proc/{child}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
        total += (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return total


def throughput(protocol: int, amounts: Amounts) -> None:
    """Print the table of rates of one protocol."""
    limit = wire_limit(protocol)
    size = READ[protocol][1]
    print(f"\nprotocol {protocol}.0: sync write of 4 bytes, {size} bytes read, of each of 18 servos, 1 Mbps")
    columns = f"{'best':>8} {'of wire':>9} {'usual':>9} {'of wire':>9} {'all data':>10} {'core':>7}"
    print(f"  {'cycles a second':26}{columns}")
    print(f"  {'wire limit':26}{limit:8.1f}   100.0 %")
    with fake(protocol, amounts.paced) as kit:
        contenders: dict[str, Contender] = {
            "bare loop, no decoding": lambda: bare(kit, protocol),
            "urbihw cycle": lambda: ours(kit, protocol),
            "rustypot": lambda: rusty(kit, protocol),
            "dynamixel-sdk": lambda: sdk(kit.path, protocol),
        }
        limits = dict.fromkeys(contenders, limit)
        if protocol == 2:
            contenders["urbihw, fast sync read"] = lambda: ours(kit, 2, True)
            limits["urbihw, fast sync read"] = wire_limit(2, True)
        rounds = Rounds(contenders, amounts.window)
        rounds.run(amounts.turns)
        for name, of in limits.items():
            best, usual = rounds.best(name), rounds.usual(name)
            shares = f"{100 * best / of:7.1f} % {usual:9.1f} {100 * usual / of:7.1f} % {rounds.full(name):8.1f} %"
            shares += f"{100 * rounds.share(name):6.0f} %"
            print(f"  {name:26}{best:8.1f} {shares}", flush=True)
        rate, share = worker_numbers(kit, protocol, FLAT_OUT, amounts.seconds)
        print(f"  {'worker process, mean':26}{rate:8.1f} {100 * rate / limit:7.1f} %", flush=True)
        of_rate = 100 * rate / (rounds.usual("dynamixel-sdk") or 1)
        of_share = 100 * share / rounds.share("dynamixel-sdk")
        beside = f"{of_rate:.0f} % of its usual rate, {of_share:.0f} % of its share of a core"
        print(f"  worker beside dynamixel-sdk: {beside}", flush=True)
        rate, share = worker_numbers(kit, protocol, 100.0, amounts.seconds)
        print(f"  worker at 100 Hz: {rate:.1f} Hz, {100 * share:.1f} % of a core", flush=True)


def busy_cores(amounts: Amounts) -> None:
    """Print the rate beside a busy process on each core, with and without real-time scheduling of the worker."""
    spin = (sys.executable, "-c", "while True: pass")
    with fake(1, amounts.paced, spins=False) as kit, contextlib.ExitStack() as stack:
        kit.take_real_time()
        for _ in range(os.cpu_count() or 1):
            stack.callback(subprocess.Popen(spin).kill)
        for realtime in (False, True):
            rate, share = worker_numbers(kit, 1, 100.0, amounts.seconds, realtime)
            how = "in real time, if allowed" if realtime else "as any program"
            print(f"  every core busy, worker {how}: {rate:.1f} Hz of 100, {100 * share:.1f} % of a core", flush=True)


def simulated_rate(asked: float) -> float:
    """Samples a second of a worker that reads 18 servos with the return delay of the factory, in simulated time."""
    kit, clock = Bioloid(baud=BAUD), BusSimClock()
    kit.pace(BAUD)

    def receive(data: bytes, at: float) -> None:
        kit.tick(at)
        for answer in kit.feed(data, at):
            end.send(answer.data, answer.at)

    end = PipeEnd(receive)
    mine, theirs = Pipe()
    settings = m.Configure(rate=asked, dead_man=0, options={"protocol": 1, "ids": IDS})
    context = Context(clock, {"robot": end})
    engine = Engine(f"pipe://robot?baud={BAUD}", driver_of("servos"), Mailbox(theirs), m.Begin(settings), context)
    engine.step()
    for device in IDS:
        mine.send(m.Watch(device, ITEMS[1]))
    engine.step()
    begun, count = clock.now(), 0
    while clock.now() < begun + 2.0:
        engine.step()
        while mine.poll():
            count += isinstance(mine.recv(), m.Samples)
    return count / (clock.now() - begun)


def asked_and_achieved() -> None:
    """Print the achieved rate for some that were asked for."""
    limit = 1 / (18 * ((8 + 14) * BYTE + 0.0005))
    print(f"\nas shipped (return delay 0.5 ms), protocol 1.0, in simulated time; the wire gives {limit:.1f} Hz")
    for asked in (25, 50, 75, 80, 100, 150, 200):
        achieved = simulated_rate(asked)
        print(f"  {asked:4} Hz asked: {achieved:6.1f} Hz, {100 * achieved / min(asked, limit):5.1f} %", flush=True)


def scans(protocol: int, amounts: Amounts) -> None:
    """Print how long looking for all ids takes."""
    with fake(protocol, amounts.paced) as kit, buses.open_link(kit.url) as link:
        times = []
        for _ in range(3):
            start = time.perf_counter()
            found = scan(ServoBus(link, 1 if protocol == 1 else 2))
            times.append(time.perf_counter() - start)
        print(f"scan of all ids, protocol {protocol}.0: {min(times):.3f} s, {len(found.devices)} devices")


def silent(protocol: int, amounts: Amounts) -> None:
    """Print what silent servos cost the others, at full speed, each beside a healthy run right before it."""
    with fake(protocol, amounts.paced) as kit, buses.open_link(kit.url) as link:
        for dead in ((6,), (6, 13), (1, 6, 7, 13, 18)):
            cycle = cycle_of(link, protocol, False, 1 / FLAT_OUT)
            healthy, _ = living_rate(link, cycle, protocol, 18, amounts.seconds)
            for device in dead:
                kit.say(f"silence {device}")
            rate, complete = living_rate(link, cycle, protocol, 18 - len(dead), amounts.seconds)
            for device in dead:
                kit.say(f"heal {device}")
            share = 100 * rate / healthy
            print(
                f"  {len(dead)} silent: {rate:6.1f} Hz of {healthy:.1f} healthy ({share:5.1f} %), "
                f"all data of the living {complete:5.1f} %",
                flush=True,
            )


def living_rate(link: Link, cycle: Cycle, protocol: int, living: int, seconds: float) -> tuple[float, float]:
    """Return ticks a second, and the percentage of them that brought the data of all `living`."""
    full: list[bool] = []

    def loop(count: int) -> None:
        aim(cycle, protocol, count)
        full.append(len(cycle.tick(link.clock.now()).values) == living)

    return rate_of(loop, seconds), 100 * sum(full) / len(full)


def main() -> None:
    """Run everything and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=3.0, help="of each measurement (%(default)s)")
    add_quick(parser, seconds=0.1)
    wanted = parser.parse_args()
    amounts = Amounts(wanted.seconds, 1, 0.05, False) if wanted.quick else Amounts(wanted.seconds)
    for protocol in (1, 2):
        throughput(protocol, amounts)
    print()
    busy_cores(amounts)
    asked_and_achieved()
    print()
    for protocol in (1, 2):
        scans(protocol, amounts)
    for protocol in (1, 2):
        print(f"\nsilent servos, protocol {protocol}.0")
        silent(protocol, amounts)


if __name__ == "__main__":
    main()
