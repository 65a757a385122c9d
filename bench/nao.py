"""Joints and camera of a Nao: `python -m bench.nao [--seconds 5]`.

Measured are, of the joints, the cycles a second in which all get a goal and are read, and what the worker's half
costs; of the camera: how many pictures come of those that were asked for, as JPEG of 320 x 240.

Each back end (ours, and libqi's where its package is) at each rate.  The simulated Nao is a process of its own, so the
share of the processor, by `time.process_time`, is that of the driver with the threads of libqi; a cycle is one
`setAngles` of 24 joints and one `getListData`, over loopback TCP.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import math
import subprocess
import sys
import time
from collections.abc import Callable, Iterator

from bench.quick import add_quick
from urbihw import buses
from urbihw.buses.messages import Configure, Found, Request, Samples, Targets
from urbihw_nao.camera_part import CAMERA, FILM
from urbihw_nao.driver import NaoDriver
from urbihw_nao.pictures import JPEG, CameraMode

RATES = (50.0, 100.0)
PICTURE_RATES = (10.0, 30.0)
TICKS = 50.0
"""A second, while pictures are counted."""
SCHEMES = ("qi", "libqi")
BUDGET = 0.25
"""Share of a processor at 100 cycles a second, at most, by our own back end."""


@contextlib.contextmanager
def simulated_robot() -> Iterator[tuple[str, Callable[[str], int]]]:
    """The address of a Nao in a process of its own, and what tells how often one of its methods was called."""
    command = [sys.executable, "-m", "urbihw_fakes", "nao", "--tcp", "0", "--until-eof"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None and process.stdout is not None
        source, sink = process.stdout, process.stdin

        def count_calls(method: str) -> int:
            sink.write(f"calls {method}\n")
            sink.flush()
            return int(source.readline())

        yield source.readline().strip().removeprefix("qi://"), count_calls
        sink.close()


def measure(scheme: str, rate: float, seconds: float) -> tuple[float, float, float]:
    """Cycles a second, joint goals a second, share of a processor."""
    with simulated_robot() as (address, count_calls), buses.open(f"{scheme}://{address}") as port:
        driver = NaoDriver()
        driver.configure(Configure(rate=rate))
        (found,) = (each for each in driver.attach(port) if isinstance(each, Found))
        names = [each.name for each in found.devices[0].joints if "Hand" not in each.name]
        names.remove("RHipYawPitch")
        driver.targets(Targets({(name, "stiffness"): 1.0 for name in names}))
        before, cycles = count_calls("setAngles"), 0
        begun, worked = time.monotonic(), time.process_time()
        while (now := time.monotonic()) < begun + seconds:
            driver.targets(Targets({(name, "angle"): 0.01 * math.sin(now) for name in names}))
            driver.tick(now, lambda: None)
            cycles += 1
            time.sleep(max(0.0, begun + cycles / rate - time.monotonic()))
        share = (time.process_time() - worked) / seconds
        calls = count_calls("setAngles") - before
        driver.detach()
    return cycles / seconds, calls * len(names) / seconds, share


def measure_camera(scheme: str, rate: float, seconds: float) -> tuple[float, float, float]:
    """Pictures a second that were sent and that came, share of a processor."""
    with simulated_robot() as (address, count_calls), buses.open(f"{scheme}://{address}") as port:
        driver = NaoDriver()
        driver.configure(Configure(rate=TICKS))
        driver.attach(port)
        driver.request(Request(1, FILM, CAMERA, value=CameraMode(0, 1, JPEG, 75, rate)))
        before, cycles, shown = count_calls("getImageRemote"), 0, 0
        begun, worked = time.monotonic(), time.process_time()
        while (now := time.monotonic()) < begun + seconds:
            news = driver.tick(now, lambda: None)
            shown += sum(isinstance(each, Samples) and CAMERA in each.values for each in news)
            cycles += 1
            time.sleep(max(0.0, begun + cycles / TICKS - time.monotonic()))
        share = (time.process_time() - worked) / seconds
        sent = count_calls("getImageRemote") - before
        driver.request(Request(2, FILM, CAMERA, value=None))
        driver.detach()
    return sent / seconds, shown / seconds, share


def main() -> None:
    """Print the figures of all back ends beside the budget of ours."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=5.0, help="of each measurement (%(default)s)")
    add_quick(parser, seconds=0.2)
    seconds = parser.parse_args().seconds
    for scheme in SCHEMES:
        if scheme == "libqi" and importlib.util.find_spec("qi") is None:
            print("nao, libqi: its package is not there")
            continue
        for rate in RATES:
            cycles, goals, share = measure(scheme, rate, seconds)
            budget = f" (budget {BUDGET * rate / 100:.0%})" if scheme == "qi" else ""
            print(
                f"nao, {scheme}: {cycles:.0f} cycles/s (asked {rate:.0f}), {goals:.0f} joint goals/s, "
                f"{share:.0%} of a processor{budget}"
            )
        for rate in PICTURE_RATES:
            sent, shown, share = measure_camera(scheme, rate, seconds)
            print(
                f"nao, {scheme}: {shown:.1f} pictures/s of {sent:.1f} sent (asked {rate:.0f}), "
                f"{share:.0%} of a processor, joints measured {TICKS:.0f} times a second beside it"
            )


if __name__ == "__main__":
    main()
