"""Telegrams a second to an NXT over USB: `python -m bench.nxt [--seconds 2]`.

A simulated brick in a process of its own, on a simulated USB bus, so this measures the hosts and not libusb.  In
the same run, on the same brick, taking turns: this driver's requests, nxt-python's, and pyusb alone, which decodes
nothing.  "at once" is a brick that answers immediately; "1 ms" one that answers once in each pass of its main loop, as
the real one does.

Then the whole worker at 100 Hz as the TriBot uses it: how often each device is read, ticks that came too late, and the
processor that it takes.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import usb.backend.libusb1  # type: ignore[import-untyped]
import usb.util  # type: ignore[import-untyped]

from bench import ROOT
from bench.quick import add_quick
from urbihw import buses
from urbihw.buses import messages as m
from urbihw.buses.link import Url
from urbihw.buses.worker import Worker
from urbihw.platforms.nxt import protocol as p
from urbihw.platforms.nxt.exchange import NxtExchange

TURNS = 10
FAMILY = "urbihw.platforms.nxt.driver:NxtDriver"
PASSES = {"at once": ["--instant"], "1 ms": []}

Loop = Callable[[int], None]
Contender = Callable[[str], contextlib.AbstractContextManager[Loop]]


@contextlib.contextmanager
def fake(*options: str) -> Iterator[str]:
    """A brick in a process of its own; its url."""
    process = subprocess.Popen(
        (sys.executable, "-m", "urbihw_fakes", "nxt", "--usb", "--until-eof", *options),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    )
    assert process.stdin is not None and process.stdout is not None
    try:
        yield process.stdout.readline().strip()
    finally:
        process.stdin.close()
        process.wait(10)
        process.stdout.close()


@contextlib.contextmanager
def ours(url: str) -> Iterator[Loop]:
    """This driver: asked and decoded."""
    with buses.open_link(url) as link:
        exchange = NxtExchange(link)

        def loop(count: int) -> None:
            p.parse_output_state(exchange.request(p.output_state(count % 3)))

        yield loop


@contextlib.contextmanager
def nxt_python(url: str) -> Iterator[Loop]:
    """nxt-python: asked and decoded."""
    backend = backend_of(url)
    original = usb.backend.libusb1.get_backend
    usb.backend.libusb1.get_backend = lambda find_library=None: backend
    try:
        brick = importlib.import_module("nxt.locator").find(backends=["usb"])
    finally:
        usb.backend.libusb1.get_backend = original
    ports = list(importlib.import_module("nxt.motor").Port)

    def loop(count: int) -> None:
        brick.get_output_state(ports[count % 3])

    yield loop
    device = brick._sock._dev
    brick.close()
    usb.util.dispose_resources(device)


@contextlib.contextmanager
def pyusb(url: str) -> Iterator[Loop]:
    """pyusb alone: the same bytes, nothing decoded."""
    core = importlib.import_module("usb.core")
    device = core.find(idVendor=0x0694, idProduct=0x0002, backend=backend_of(url))
    device.set_configuration()
    out, back = device.get_active_configuration()[(0, 0)]

    def loop(count: int) -> None:
        out.write(p.output_state(count % 3))
        back.read(64)

    yield loop
    usb.util.dispose_resources(device)


CONTENDERS: dict[str, Contender] = {"urbihw": ours, "nxt-python": nxt_python, "pyusb alone": pyusb}


def backend_of(url: str) -> Any:
    """The simulated bus that a url names."""
    options = Url.parse(url).options
    module_name, _, name = options["backend"].partition(":")
    return getattr(importlib.import_module(module_name), name)(options["at"])


def throughput(label: str, options: list[str], seconds: float) -> None:
    """Print requests a second of all contenders."""
    rates: dict[str, list[float]] = {name: [] for name in CONTENDERS}
    costs: dict[str, list[float]] = {name: [] for name in CONTENDERS}
    with fake(*options) as url:
        for _ in range(TURNS):
            for name, contender in CONTENDERS.items():
                with contender(url) as loop:
                    rate, cost = rate_of(loop, seconds / TURNS)
                rates[name].append(rate)
                costs[name].append(cost)
    print(f"requests a second, brick that answers {label}: best turn, usual turn; processor for one, usual turn")
    peer = statistics.median(rates["nxt-python"])
    for name, turns in rates.items():
        usual = statistics.median(turns)
        cost = statistics.median(costs[name]) * 1e6
        share = usual / peer
        print(f"  {name:12} {max(turns):8.0f} {usual:8.0f}   {share:5.2f} of nxt-python; {cost:5.0f} us", flush=True)


def rate_of(loop: Loop, seconds: float) -> tuple[float, float]:
    """How often a loop goes round in a second, and the seconds of processor that a round takes."""
    start, spent = time.perf_counter(), time.process_time()
    count = 0
    while time.perf_counter() - start < seconds:
        loop(count)
        count += 1
    return count / (time.perf_counter() - start), (time.process_time() - spent) / count


def worker(seconds: float) -> None:
    """Print what the worker of a TriBot does at 100 Hz."""
    counts: dict[Any, int] = {}
    late: list[int] = []
    up = threading.Event()

    def post(message: m.FromWorker) -> None:
        if isinstance(message, m.LinkState) and message.up:
            up.set()
        elif isinstance(message, m.Samples):
            for device in message.values:
                counts[device] = counts.get(device, 0) + 1
        elif isinstance(message, m.Statistics):
            late.append(message.late)

    with fake() as url, Worker.start(url, post=post, process=False, family=FAMILY) as running:
        assert up.wait(10), "no brick"
        for motor in p.OUTPUTS:
            running.send(m.Watch(motor, ("rotation",), 0.0))
        for port, (kind, mode) in ((1, (8, 0x80)), (2, (11, 0)), (3, (5, 0x80)), (4, (1, 0x20))):
            running.send(m.Targets({(port, "mode"): (kind, mode)}))
            running.send(m.Watch(port, ("distance",) if port == 2 else ("raw",), 0.05 if port == 2 else 0.02))
        time.sleep(1.0)
        counts.clear()
        late.clear()
        start, spent = time.perf_counter(), time.process_time()
        power = 0
        while time.perf_counter() - start < seconds:
            power = power % 100 + 1
            running.send(m.Targets({("A", "power"): power, ("C", "power"): power}))
            time.sleep(0.02)
        elapsed, spent = time.perf_counter() - start, time.process_time() - spent
    print("worker at 100 Hz, 1 ms a telegram, two motors told something 50 times a second")
    rates = ", ".join(f"{device} {count / elapsed:.0f}" for device, count in sorted(counts.items(), key=str))
    print(f"  readings a second: {rates}")
    print(f"  late ticks: {sum(late)}; processor: {100 * spent / elapsed:.1f} % of a core")


def main() -> None:
    """Run everything and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=2.0, help="of each measurement (%(default)s)")
    add_quick(parser, seconds=0.1)
    seconds = parser.parse_args().seconds
    for label, options in PASSES.items():
        throughput(label, options, seconds)
    worker(seconds)


if __name__ == "__main__":
    main()
