"""The panel in a real Chromium: how long a click on E-STOP takes to the robot's body, and whether the page grows.

`python -m bench.panel --clicks 20` and `python -m bench.panel --minutes 5`.

The body is that of a simulated Bioloid in this process: its wheel is looked at every millisecond.  It has the inertia
of a real one, so two times are shown: when it begins to brake, and when it has less than a hundredth of its speed.  The
click is stamped by the browser, with the clock of the same machine.

Memory is what the page's JavaScript uses after its garbage is collected, with 60 slots at 50 Hz in plots; the rings of
the plots have their full size from the beginning.
"""

from __future__ import annotations

import statistics
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from panel_lab import Visitor, open_browser

from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.endpoint import PtyEndpoint

WHEEL: Final = "motor6.cwLimit = 0|; motor6.ccwLimit = 0|; motor6.load = 1|;"
TURN: Final = "motor6.speed = 2;"
TIMEOUT_S: Final = 20.0
LOOK_S: Final = 0.001
BRAKES: Final = 0.9
STANDS: Final = 0.01
"""Shares of the speed of the wheel below which it brakes, and stands."""
STAMP: Final = """document.addEventListener('click',
    event => { window.clickedAt = (performance.timeOrigin + event.timeStamp) / 1000; }, true)"""
ADD: Final = "l => import('/static/cards/plots.js').then(m => l.forEach(m.addSeries))"
COUNT: Final = "s => import('/static/cards/plots.js').then(m => m.plot.series.get(s)?.count ?? 0)"
RELEASE: Final = "import('/static/js/connection.js').then(m => m.connection.ask('release'))"


class Body:
    """A simulated Bioloid at a pseudo terminal, and the speed of its wheel, looked at again and again."""

    def __init__(self) -> None:
        self._kit = Bioloid(servos=(6, 7), sensors=(), baud=1_000_000)
        self._end = PtyEndpoint(self._kit)
        self._end.start()
        self.url = self._end.url
        self.seen: list[tuple[float, float]] = []
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def _look(self) -> float:
        self._kit.tick(self._end.clock())
        return abs(float(self._kit.servo(6).speed))

    def _watch(self) -> None:
        while not self._over.wait(LOOK_S):
            self.seen.append((time.time(), self._end.call(self._look)))

    def wait_turning(self) -> None:
        """Wait until the wheel turns."""
        end = time.monotonic() + TIMEOUT_S
        while not self.seen or self.seen[-1][1] < 5:
            if time.monotonic() > end:
                raise SystemExit("the wheel does not turn")
            time.sleep(0.01)

    def slower_than(self, share: float, since: float) -> float:
        """When the wheel has had less than a share of its speed for good, after a time; nan if it turns on."""
        most = max(speed for _, speed in self.seen)
        after = [(at, speed) for at, speed in self.seen if at >= since]
        fast = [index for index, (_, speed) in enumerate(after) if speed > share * most]
        first = fast[-1] + 1 if fast else 0
        return after[first][0] if first < len(after) else float("nan")

    def close(self) -> None:
        """End it."""
        self._over.set()
        self._thread.join()
        self._end.close()


@contextmanager
def a_body() -> Iterator[Body]:
    """A body while the block runs."""
    made = Body()
    try:
        yield made
    finally:
        made.close()


def measure_clicks(body: Body, say: Any, address: str, clicks: int) -> None:
    """Print the time from a click to a standing wheel, idle and while a program holds the interpreter.

    ``say(text)`` sends urbiscript by a connection of its own.
    """
    print(f"{'E-STOP, click to body':>24} {'brakes, ms':>11} {'worst':>7} {'stands, ms':>11} {'worst':>7}")
    with open_browser() as browser:
        visitor = Visitor(browser, address)
        visitor.page.evaluate(STAMP)
        visitor.page.wait_for_selector("#lamp-link.ok")
        say(WHEEL)
        for name, held in (("idle", ""), ("while loop|{} runs", "loop|{};")):
            took = [_click(visitor, body, say, held) for _ in range(clicks)]
            print(f"{name:>24} " + " ".join(
                f"{statistics.median(column) * 1e3:11.1f} {max(column) * 1e3:7.1f}"
                for column in zip(*took, strict=True)
            ))  # fmt: skip
        visitor.close()


def _click(visitor: Visitor, body: Body, say: Any, held: str) -> tuple[float, float]:
    """One stop: seconds from the click to a wheel that brakes, and to one that stands."""
    say(TURN)
    body.wait_turning()
    if held:
        say(held)
        time.sleep(0.3)
    body.seen.clear()
    visitor.page.click("#estop")
    time.sleep(0.5)
    clicked = float(visitor.page.evaluate("window.clickedAt"))
    took = body.slower_than(BRAKES, clicked) - clicked, body.slower_than(STANDS, clicked) - clicked
    if held:
        visitor.page.wait_for_selector("#lamp-server.ok", timeout=TIMEOUT_S * 1e3)
    visitor.page.evaluate(RELEASE)
    visitor.page.wait_for_selector("#held", state="detached")
    return took


def measure_growth(address: str, slots: list[str], minutes: float) -> None:
    """Print the memory of the page, minute by minute, with all slots in plots."""
    print(f"{'minute':>6} {'JavaScript, MB':>15} {'elements':>9} {'samples/s':>10}")
    with open_browser() as browser:
        visitor = Visitor(browser, address)
        page = visitor.open("plots")
        page.evaluate(ADD, slots)
        visitor.open("jobs")
        visitor.open("plots")
        tools = page.context.new_cdp_session(page)
        end = time.monotonic() + TIMEOUT_S
        while page.evaluate(COUNT, slots[-1]) < 100:
            if time.monotonic() > end:
                raise SystemExit("no samples came")
            time.sleep(0.1)
        began, count = time.monotonic(), page.evaluate(COUNT, slots[0])
        while True:
            tools.send("HeapProfiler.collectGarbage")
            used = tools.send("Runtime.getHeapUsage")["usedSize"] / 1e6
            took = time.monotonic() - began
            rate = (page.evaluate(COUNT, slots[0]) - count) / took if took > 1 else float("nan")
            elements = page.evaluate("document.querySelectorAll('*').length")
            print(f"{took / 60:6.1f} {used:15.2f} {elements:9} {rate:10.1f}", flush=True)
            if took >= minutes * 60:
                break
            time.sleep(min(60.0, max(0.1, minutes * 60 - took)))
        visitor.close()
