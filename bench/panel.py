"""What browsers cost: `python -m bench.panel [--seconds 10 | --clicks 20 | --minutes 5]`.

A real daemon serves a simulated Bioloid, with the gateway beside it; 0, 1 and 10 WebSocket clients of this process
subscribe to 60 slots at 50 Hz each.  Measured are the processor shares of the interpreter, the bus worker and the
gateway (percent of one core), the rate of samples at each client, their delay, and the rate of the bus, which should
stay as it is.  The delay is counted from the fastest sample of the same client: clocks of two processes are compared.
With `--clicks` or `--minutes` a real Chromium is measured (`bench.panel_browser`).
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import os
import re
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import aiohttp

SLOTS = [f"motor{number}.{slot}" for slot in ("val", "load", "speed", "temperature") for number in range(1, 16)]
HZ = 50
TIMEOUT_S = 30.0
SETTLE_S = 2.0
TICKS = os.sysconf("SC_CLK_TCK")
URBIHW = (sys.executable, "-m", "urbihw.cli.main")


def processor_seconds(pid: int) -> float:
    """Processor time of a process so far."""
    words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / TICKS


def child_of(pid: int, word: str) -> int:
    """The child of a process whose command line contains a word."""
    for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        if word in Path(f"/proc/{child}/cmdline").read_text():
            return int(child)
    raise SystemExit(f"no child {word} of process {pid}")


def wait_for_port(file: Path, process: subprocess.Popen[str]) -> int:
    """The port that a server writes when it can be reached."""
    end = time.monotonic() + TIMEOUT_S
    while not file.exists():
        if process.poll() is not None or time.monotonic() > end:
            raise SystemExit("a server did not start")
        time.sleep(0.05)
    return int(file.read_text())


@contextlib.contextmanager
def served(folder: Path, robot: Sequence[str] = ("--fake",)) -> Iterator[tuple[int, int, int, str]]:
    """Serve a simulated Bioloid and its panel: process numbers of daemon and gateway, the port of the daemon, and the
    address to pair."""
    files = folder / "daemon", folder / "panel"
    environment = os.environ | {"XDG_STATE_HOME": str(folder), "XDG_RUNTIME_DIR": str(folder)}
    with contextlib.ExitStack() as stack:

        def start(*words: str) -> subprocess.Popen[str]:
            process = subprocess.Popen((*URBIHW, *words), env=environment, stderr=subprocess.PIPE, text=True)
            stack.callback(process.wait, TIMEOUT_S)
            stack.callback(process.terminate)
            return process

        daemon = start("serve", "--platform", "bioloid", *robot, "--port", "0", "--port-file", str(files[0]))
        port = wait_for_port(files[0], daemon)
        panel = start("panel", f":{port}", "--port", "0", "--port-file", str(files[1]))
        assert panel.stderr is not None
        line = next(line for line in panel.stderr if "/pair?" in line)
        found = re.search(r"http://\S+/pair\?c=[\w-]+", line)
        assert found is not None, line
        wait_for_port(files[1], panel)
        yield daemon.pid, panel.pid, port, found[0]


class Browser:
    """One WebSocket client."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._socket = socket
        self.delays: list[float] = []
        self.lost = 0

    async def run(self) -> None:
        """Subscribe, and record the samples until cancelled."""
        await self._socket.send_json({"id": 1, "do": "subscribe", "slots": SLOTS, "hz": HZ})
        async for message in self._socket:
            if message.type is not aiohttp.WSMsgType.TEXT:
                continue
            told: dict[str, Any] = message.json()
            if told.get("event") == "samples":
                self.delays.append(time.time() - told["t"])
                self.lost = told["lost"]
            elif told.get("ok") is False:
                raise SystemExit(told["error"])


async def ask(socket: aiohttp.ClientWebSocketResponse, slot: str) -> Any:
    """The value of a slot."""
    await socket.send_json({"id": 9, "do": "get", "slot": slot})
    while True:
        told = await socket.receive_json(timeout=TIMEOUT_S)
        if told.get("id") == 9:
            return told.get("value")


async def measure(pids: list[int], url: str, seconds: float) -> None:
    """Print a row for each number of clients."""
    print(f"{'clients':>7} {'daemon':>8} {'worker':>8} {'gateway':>8} {'samples/s':>10} {'lost':>5} "
          f"{'delay, ms':>10} {'99 %':>6} {'bus, Hz':>8} {'late':>5}")
    address = url.partition("/pair")[0]
    async with aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as session:
        async with session.get(url) as answer:
            answer.raise_for_status()
        for count in (0, 1, 10):
            async with contextlib.AsyncExitStack() as stack:

                async def connect(stack: contextlib.AsyncExitStack = stack) -> aiohttp.ClientWebSocketResponse:
                    opened = session.ws_connect(f"{address}/ws", headers={"Origin": address})
                    return await stack.enter_async_context(opened)

                browsers = [Browser(await connect()) for _ in range(count)]
                tasks = [asyncio.create_task(browser.run()) for browser in browsers]
                await asyncio.sleep(SETTLE_S)
                for browser in browsers:
                    browser.delays.clear()
                before, began = [processor_seconds(pid) for pid in pids], time.monotonic()
                await asyncio.sleep(seconds)
                took = time.monotonic() - began
                shares = [(processor_seconds(pid) - at) / took for pid, at in zip(pids, before, strict=True)]
                # Only now: a connection that is not read is closed.
                asker = await connect()
                rate, told = await ask(asker, "bioloid.rate"), await ask(asker, "bioloid.statistics")
                for task in tasks:
                    task.cancel()
                print(f"{count:7} " + " ".join(f"{share:8.1%}" for share in shares) + row(browsers, took)
                      + f" {rate:8.1f} {told['late']:5.0f}")  # fmt: skip


def row(browsers: list[Browser], took: float) -> str:
    """Samples per second and client, lost ones, and the delay in ms."""
    delays = sorted(each - min(browser.delays) for browser in browsers for each in browser.delays)
    if not delays:
        return f" {'-':>10} {'-':>5} {'-':>10} {'-':>6}"
    lost = sum(browser.lost for browser in browsers)
    return (f" {len(delays) / took / len(browsers):10.1f} {lost:5} {statistics.median(delays) * 1e3:10.2f} "
            f"{delays[int(len(delays) * 0.99)] * 1e3:6.1f}")


def measure_stop(clicks: int) -> None:
    """Print how long a click on E-STOP takes to the body."""
    from bench.panel_browser import a_body, measure_clicks

    with contextlib.ExitStack() as stack:
        name, body = stack.enter_context(tempfile.TemporaryDirectory()), stack.enter_context(a_body())
        _, _, port, url = stack.enter_context(served(Path(name), ("--url", body.url)))

        def say(text: str) -> None:
            connection = stack.enter_context(socket.create_connection(("127.0.0.1", port), TIMEOUT_S))
            connection.sendall(text.encode() + b"\n")

        measure_clicks(body, say, url, clicks)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=10.0, help="of each row (%(default)s)")
    parser.add_argument("--clicks", type=int, help="clicks on E-STOP in a browser, instead")
    parser.add_argument("--minutes", type=float, help="of 60 plots in a browser, instead")
    options = parser.parse_args()
    if options.clicks:
        measure_stop(options.clicks)
        return
    with tempfile.TemporaryDirectory() as name, served(Path(name)) as (daemon, panel, _, url):
        if options.minutes:
            from bench.panel_browser import measure_growth

            measure_growth(url, SLOTS, options.minutes)
            return
        pids = [daemon, child_of(daemon, "urbihw.buses.child"), panel]
        asyncio.run(measure(pids, url, options.seconds))


if __name__ == "__main__":
    main()
