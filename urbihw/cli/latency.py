"""Measure how long the server, a remote UObject and the bus take to answer.

- telnet: a statement to its answer, on a connection of a client.
- remote: a change of a variable of a UObject in another process, to the change that it writes back.
- bus: a question of the bus worker to the answer of the device, as the worker sees it (robots of this machine only).

Nothing moves: the statements only read, the UObject is one of this command, and the bus is only listened to.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from urbihw.buses.trace import Chunk
from urbihw.cli.lobby_client import LobbyClient
from urbihw.cli.options import DEFAULT_PORT, CliRefused, whole
from urbihw.cli.reach import add_server, credentials, only_port, server
from urbihw.cli.tracing import WorkerTraffic, open_traffic, traffic_of
from urbihw.client.where import Where, is_loopback
from urbihw.exitcodes import EX_CONFIG, EX_OK, EX_UNAVAILABLE
from urbihw.started import as_typed

WHATS: Final = ("telnet", "remote", "bus")
ANSWER_TIMEOUT_S: Final = 5.0
"""Seconds for one answer."""
JOIN_TIMEOUT_S: Final = 10.0
"""Seconds for the process of the remote UObject to join the server."""
BUS_S: Final = 10.0
"""Seconds of listening to the bus at most."""
_ECHO: Final = Path(__file__).with_name("latency_echo.py")
_PROBE: Final = "urbihwLatencyProbe"
_STEPS: Final = (1.0, 2.0, 5.0)
_BAR: Final = 40


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw latency``."""
    parser.add_argument("what", nargs="*", metavar="WHAT", help=f"what to measure: {', '.join(WHATS)} (default: all)")
    add_server(parser)
    parser.set_defaults(port=None)  # Without a port it is that of the only daemon here.
    parser.add_argument("--count", type=whole(1, 1_000_000, "number of round trips"), default=500, metavar="N",
                        help="round trips of each (%(default)s)")
    parser.add_argument("--socket", type=Path, metavar="PATH", help="control socket of the robot, for the bus")
    parser.add_argument("--json", action="store_true", help="print the measurements as JSON, in seconds")


def run(options: argparse.Namespace) -> int:
    """Measure; the exit code is 69 if nothing could be measured."""
    unknown = [what for what in options.what if what not in WHATS]
    if unknown:
        print(f"urbihw: what is {unknown[0]!r}? Give {', '.join(WHATS)}", file=sys.stderr)
        return EX_CONFIG
    measured: dict[str, list[float]] = {}
    for what in options.what or WHATS:
        try:
            times = _MEASURE[what](options)
        except CliRefused as error:
            print(f"urbihw: {what}: {error}", file=sys.stderr)
            continue
        except KeyboardInterrupt:
            print()
            break
        measured[what] = times
        if not options.json:
            print("\n".join(histogram(what, times)), flush=True)
    if options.json:
        print(json.dumps({what: as_json(times) for what, times in measured.items()}, indent=2))
    return EX_OK if measured else EX_UNAVAILABLE


# ---------------------------------------------------------------- measuring


def telnet(options: argparse.Namespace) -> list[float]:
    """Measure statement and answer.  Raises CliRefused."""
    with LobbyClient(_server(options), credentials(options)) as link:
        link.read_banner()
        return [_round_trip(link) for _ in range(options.count)]


def remote(options: argparse.Namespace) -> list[float]:
    """Measure a variable of a UObject in another process, there and back.  Raises CliRefused."""
    where = _server(options)
    with LobbyClient(where, credentials(options)) as link, _echo_process(where, options):
        _wait_for_class(link)
        name = f"{_PROBE}{os.getpid()}"
        link.ask(f"var Global.{name} = uobjects.UrbihwLatency.new | 1")
        try:
            return [_change(link, name) for _ in range(options.count)]
        finally:
            link.ask(f'Global.removeLocalSlot("{name}") | 1')


def bus(options: argparse.Namespace) -> list[float]:
    """Measure question and answer on the bus, by what the worker sends and gets.  Raises CliRefused."""
    if options.socket is not None:
        traffic = open_traffic(options.socket)
    else:
        traffic = _bus_of(options)
    times: list[float] = []
    asked = math.nan
    with traffic:
        for item in traffic.chunks(time.monotonic() + BUS_S):
            if not isinstance(item, Chunk):
                continue
            if item.direction == ">":
                asked = item.time
            elif not math.isnan(asked):
                times.append(item.time - asked)
                asked = math.nan
            if len(times) >= options.count:
                break
    if not times:
        raise CliRefused("nothing is asked on this bus: is the robot there?")
    return times


def _server(options: argparse.Namespace) -> Where:
    """The server that the options name.  Raises CliRefused."""
    number = options.port or (only_port() if options.host is None else None) or DEFAULT_PORT
    return server(argparse.Namespace(**vars(options) | {"port": number}))


def _bus_of(options: argparse.Namespace) -> WorkerTraffic:
    """The traffic of the robot that the options name.  Raises CliRefused."""
    chosen = options.port is not None or options.port_file is not None
    where = _server(options)
    if options.host is not None and where.path is None and not is_loopback(where.host):
        raise CliRefused(f"a bus is measured on its own machine only: log in to {where.host}")
    traffic = traffic_of("", where.port if chosen else None)
    if traffic is None:
        which = f" on port {where.port}" if chosen else ""
        raise CliRefused(f"no daemon of this machine serves a robot{which}; start one ({as_typed('urbihw serve')})")
    return traffic


_MEASURE: Final = {"telnet": telnet, "remote": remote, "bus": bus}


def _round_trip(link: LobbyClient) -> float:
    began = time.perf_counter()
    link.send(b"1;\n")
    while (line := link.read(ANSWER_TIMEOUT_S)) is not None:
        if line.text == "1" and not line.channel:
            return time.perf_counter() - began
    raise CliRefused(f"{link.peer} did not answer within {ANSWER_TIMEOUT_S:g} s")


def _change(link: LobbyClient, name: str) -> float:
    """Write a variable of the remote UObject; return the seconds until it has written it back."""
    began = time.perf_counter()
    # Always the same text: a server compiles a new one first.
    link.ask(f"{name}.val = {name}.val + 1 | waituntil({name}.back == {name}.val) | 1", ANSWER_TIMEOUT_S)
    return time.perf_counter() - began


@contextmanager
def _echo_process(where: Where, options: argparse.Namespace) -> Iterator[None]:
    """Run the process of the remote UObject."""
    host = where.path if where.path is not None else where.host
    words = [sys.executable, "-m", "urbihw.cli.launch", "--remote", "--host", str(host), "--port", str(where.port)]
    if where.path is None:
        words.append("--tls" if where.tls else "--no-tls")
    if options.token_file is not None:
        words += ["--token-file", str(options.token_file)]
    process = subprocess.Popen(
        [*words, str(_ECHO)], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        yield
    finally:
        process.terminate()
        process.wait()


def _wait_for_class(link: LobbyClient) -> None:
    end = time.monotonic() + JOIN_TIMEOUT_S
    while link.ask("isdef(uobjects.UrbihwLatency)").shown != "true":
        if time.monotonic() > end:
            raise CliRefused("the process of the remote UObject did not join the server; may this client send devices?")
        time.sleep(0.02)


# ---------------------------------------------------------------- telling


def percentile(times: Sequence[float], share: float) -> float:
    """The value that this share (0..1) of the times does not exceed."""
    ordered = sorted(times)
    return ordered[min(max(math.ceil(share * len(ordered)) - 1, 0), len(ordered) - 1)]


def as_json(times: Sequence[float]) -> dict[str, Any]:
    """The measurement for programs, in seconds."""
    return {
        "count": len(times), "p50": percentile(times, 0.5), "p90": percentile(times, 0.9),
        "p99": percentile(times, 0.99), "worst": max(times), "times": list(times),
    }  # fmt: skip


def histogram(what: str, times: Sequence[float]) -> list[str]:
    """The measurement as text: the summary, and a bar for each class of times."""
    shown = ", ".join(
        f"{name} {1000 * value:.3f} ms"
        for name, value in (
            ("p50", percentile(times, 0.5)), ("p90", percentile(times, 0.9)), ("p99", percentile(times, 0.99)),
            ("worst", max(times)),
        )
    )  # fmt: skip
    counts: dict[int, int] = {}
    for value in times:
        index = _class_of(value)
        counts[index] = counts.get(index, 0) + 1
    most = max(counts.values())
    rows = [f"{what}: {len(times)} round trips: {shown}"]
    for index in range(min(counts), max(counts) + 1):
        count = counts.get(index, 0)
        low, high = (f"{1000 * _limit(number):g}" for number in (index, index + 1))
        rows.append(f"  {low:>7} .. {high:>5} ms  {'#' * math.ceil(_BAR * count / most):{_BAR}} {count}".rstrip())
    return rows


def _limit(index: int) -> float:
    """The lower limit of a class of times, in seconds: 1, 2, 5, 10, 20 ... us."""
    return round(1e-6 * 10.0 ** (index // 3) * _STEPS[index % 3], 12)


def _class_of(value: float) -> int:
    index = 0
    while _limit(index + 1) <= value:
        index += 1
    return index
