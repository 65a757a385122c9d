"""How long a scan takes: `python -m bench.scan`, beside pypot and LeRobot where they are installed.

The fake kit on a pty, paced at 1 Mbps, with 18 AX-12 at the factory's return delay, hears only the speed that the port
is set to. Measured are: all 254 ids at one speed in protocol 1.0, in 2.0 and in both; all speeds of a port with 18
servos, and of an empty one. pypot scans 254 ids at one speed; LeRobot searches all speeds it knows (Feetech and
Dynamixel X; on these servos it finds nothing, which takes it as long).

Known from quiet runs: pypot 11.9 s, LeRobot 21 s.
"""

from __future__ import annotations

import contextlib
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

from bench import ROOT
from urbihw.buses.servos.line import ServoLine
from urbihw.buses.servos.survey import BAUDS, survey

FULL = [f"AX-12:{number}" for number in range(1, 19)]
ALONE = ["AX-12:1"]


@contextlib.contextmanager
def fake(servos: list[str]) -> Iterator[str]:
    """A fake for the time of a `with`: the path of its port."""
    command = [sys.executable, "-m", "urbihw_fakes", "bioloid", "--pty", "--pace", "--follow-baud", "--until-eof"]
    process = subprocess.Popen(
        [*command, "--servos", ",".join(servos)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT
    )
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        yield process.stdout.readline().strip().removeprefix("serial://")
    finally:
        process.stdin.close()
        process.wait(10)
        process.stdout.close()


def seconds(scan: Callable[[], int]) -> tuple[float, int]:
    """Run a scan: its seconds, and how many it found."""
    begin = time.monotonic()
    found = scan()
    return time.monotonic() - begin, found


def ours(path: str, bauds: tuple[int, ...], protocols: tuple[int, ...]) -> int:
    """Scan with urbihw."""
    with ServoLine.open(path, bauds[0]) as line:
        return len(survey(line, bauds, protocols).servos)


def pypots(path: str) -> int:
    """Scan 254 ids at 1 Mbps with pypot."""
    from pypot.dynamixel import DxlIO  # type: ignore[import-not-found]

    with DxlIO(path, baudrate=1_000_000) as io:
        return len(io.scan())


def lerobots(path: str) -> int:
    """Search all speeds with LeRobot's Feetech bus."""
    from lerobot.motors.feetech import FeetechMotorsBus

    found: dict[int, Any] = FeetechMotorsBus.scan_port(path)
    return sum(len(ids) for ids in found.values())


def row(name: str, scan: Callable[[], int]) -> None:
    """Measure and print one row."""
    try:
        took, found = seconds(scan)
    except ImportError as error:
        print(f"{name:44} {error.name} is not installed")
        return
    except Exception as error:  # a peer may fail in any way; the other rows still count
        print(f"{name:44} failed: {type(error).__name__}: {error}")
        return
    print(f"{name:44} {took:6.2f} s, {found} found")


def main() -> None:
    """Print all rows."""
    with fake(FULL) as path:
        row("254 ids, 1 Mbps, protocol 1.0", lambda: ours(path, (1_000_000,), (1,)))
        row("253 ids, 1 Mbps, protocol 2.0", lambda: ours(path, (1_000_000,), (2,)))
        row("all ids, 1 Mbps, both protocols", lambda: ours(path, (1_000_000,), (1, 2)))
        row(f"{len(BAUDS)} speeds, 18 servos", lambda: ours(path, BAUDS, (1, 2)))
        row("pypot: 254 ids, 1 Mbps", lambda: pypots(path))
        row("lerobot: all its speeds", lambda: lerobots(path))
    with fake(ALONE) as path:
        row(f"{len(BAUDS)} speeds, one servo", lambda: ours(path, BAUDS, (1, 2)))


if __name__ == "__main__":
    main()
