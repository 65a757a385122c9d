"""A simulated robot, a daemon, a gateway and a browser, each a process of its own; and their fixtures.

The robot is judged by its own console, which says where its body is, not by what the panel shows.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import pytest
import starts

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

ROOT: Final = Path(__file__).resolve().parents[2]
CHROMIUM: Final = next(filter(None, map(shutil.which, ("chromium-headless-shell", "chromium", "chromium-browser"))), "")
"""The browser; the first one has no windows and takes a third less of the processor."""
TIMEOUT_S: Final = 30.0
PAGE_MS: Final = 15_000
_ADDRESS: Final = re.compile(r"https?://\S+/pair\?c=\S+")


@contextlib.contextmanager
def open_browser() -> Iterator[Browser]:
    """Debian's Chromium.  Skips the tests where it or playwright is missing."""
    playwright = pytest.importorskip("playwright.sync_api", reason="no playwright: pip install 'urbihw[browser]'")
    if not CHROMIUM:
        pytest.skip("chromium is not installed: apt install chromium-headless-shell")
    with playwright.sync_playwright() as running:
        browser = running.chromium.launch(executable_path=CHROMIUM)
        try:
            yield browser
        finally:
            browser.close()


class Body:
    """The simulated robot and its console."""

    def __init__(self, platform: str) -> None:
        self._process = starts.Forked(
            [sys.executable, "-m", "urbihw_fakes", platform, "--tcp", "0", "--until-eof"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT / "fakes",
        )  # fmt: skip
        assert self._process.stdout is not None
        self.url = self._process.stdout.readline().strip()

    def say(self, words: str) -> str:
        """Type a line at its console; the first line of the answer."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(words + "\n")
        self._process.stdin.flush()
        return str(self._process.stdout.readline())

    def position(self, number: int) -> int:
        """Where the horn of a servo is, in its own counts: 512 is the middle, a count is 0.29 degrees."""
        match = re.search(r"present_position=(\d+)", self.say(f"state {number}"))
        assert match
        return int(match[1])

    def place(self) -> tuple[float, float]:
        """Where a base truly stands, m."""
        told = self.say("where")
        numbers = re.findall(r"-?\d+\.?\d*", told)
        assert len(numbers) >= 2, told
        return float(numbers[0]), float(numbers[1])

    def close(self) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.close()
        self._process.wait(TIMEOUT_S)
        self._process.stdout.close()


class Scene:
    """A robot that is served, and a gateway; ``body`` is None where the daemon itself simulates the robot."""

    def __init__(self, platform: str, folder: Path, *, body: Body | None) -> None:
        self.platform = platform
        self.body = body
        self._folder = folder
        self._environment = {
            **os.environ, "XDG_STATE_HOME": str(folder), "XDG_RUNTIME_DIR": str(folder), "HOME": str(folder),
            "PYTHONUNBUFFERED": "1",
        }  # fmt: skip
        # A world of the platform webots is a simulation by itself.
        self._fake = ["--fake"] if body is None and platform != "webots" else []
        robot = self._fake if body is None else ["--url", body.url]
        self._log = (folder / "daemon.log").open("w+")
        self._processes: list[subprocess.Popen[str]] = []
        try:
            self._serving = "serve", "--platform", platform, *robot, "--port-file", str(folder / "port")
            self.port = 0
            self.start_daemon()
            self.gateway_port = 0
            self.start_gateway()
        except BaseException:
            self.close()
            raise

    def _start(self, *arguments: str) -> subprocess.Popen[str]:
        process = starts.Forked(
            [sys.executable, "-m", "urbihw.cli.main", *arguments], stdin=subprocess.DEVNULL,
            stdout=self._log, stderr=self._log, cwd=self._folder, text=True,
            env=self._environment,
        )  # fmt: skip
        self._processes.append(process)
        return process

    def _wait_for_port(self, path: Path) -> int:
        end = time.monotonic() + TIMEOUT_S
        while not (path.exists() and path.read_text().endswith("\n")):
            assert time.monotonic() < end, (self._folder / "daemon.log").read_text()
            time.sleep(0.02)
        return int(path.read_text())

    def start_daemon(self) -> None:
        """Start the daemon, at the port it had before if there was one."""
        (self._folder / "port").unlink(missing_ok=True)
        self._daemon = self._start(*self._serving, "--port", str(self.port))
        self.port = self._wait_for_port(self._folder / "port")

    def kill_daemon(self) -> None:
        """Kill the daemon, which leaves everything as it is."""
        self._daemon.kill()
        self._daemon.wait(TIMEOUT_S)
        self._processes.remove(self._daemon)

    def start_gateway(self) -> None:
        """Start the gateway, at the port it had before if there was one."""
        (self._folder / "gateway").unlink(missing_ok=True)
        self._gateway = self._start(
            "panel", f":{self.port}", "--port", str(self.gateway_port), "--port-file", str(self._folder / "gateway"),
            "--platform", self.platform, *self._fake,
        )  # fmt: skip
        self.gateway_port = self._wait_for_port(self._folder / "gateway")

    def stop_gateway(self) -> None:
        """End the gateway."""
        self._gateway.terminate()
        assert self._gateway.wait(TIMEOUT_S) is not None
        self._processes.remove(self._gateway)

    def pair(self, role: str, name: str) -> str:
        """The address that pairs a browser of a role."""
        done = starts.run(
            [sys.executable, "-m", "urbihw.cli.main", "panel", "pair", "--port", str(self.gateway_port), "--role", role,
             "--name", name],
            capture_output=True, text=True, timeout=TIMEOUT_S, env=self._environment, cwd=self._folder,
        )  # fmt: skip
        found = _ADDRESS.search(done.stdout + done.stderr)
        assert found is not None, done.stdout + done.stderr
        return found[0]

    def run(self, text: str) -> socket.socket:
        """Send urbiscript from a connection of its own, which the caller closes."""
        connection = socket.create_connection(("127.0.0.1", self.port), TIMEOUT_S)
        connection.sendall(text.encode() + b"\n")
        return connection

    @contextlib.contextmanager
    def held_daemon(self) -> Iterator[None]:
        """The daemon stands still, and its worker goes on."""
        self._daemon.send_signal(signal.SIGSTOP)
        try:
            yield
        finally:
            self._daemon.send_signal(signal.SIGCONT)

    def log(self) -> str:
        """What daemon and gateway have said."""
        return (self._folder / "daemon.log").read_text()

    def close(self) -> None:
        for process in reversed(self._processes):
            process.terminate()
        for process in self._processes:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(10)
            if process.poll() is None:
                process.kill()
                process.wait(10)
        self._log.close()
        if self.body is not None:
            self.body.close()


class Visitor:
    """A browser of its own cookies at the panel; ``errors`` are those of its console."""

    def __init__(
        self, browser: Browser, address: str, *, width: int = 1280, height: int = 900, dark: bool = False,
        finger: bool = False, figure: bool = False, without_webgl: bool = False,
    ) -> None:  # fmt: skip
        """``figure``: with the robot drawn, which costs a processor without a graphics card seconds."""
        self._context = browser.new_context(
            viewport={"width": width, "height": height}, color_scheme="dark" if dark else "light",
            has_touch=finger, is_mobile=finger,
        )  # fmt: skip
        if not figure:
            self._context.add_init_script("localStorage.setItem('urbihw.figure.hidden', '1');")
        if without_webgl:
            self._context.add_init_script("HTMLCanvasElement.prototype.getContext = () => null;")
        self.page: Page = self._context.new_page()
        self.page.set_default_timeout(PAGE_MS)
        self.errors: list[str] = []
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("console", lambda message: self.errors.append(message.text) if message.type == "error" else None)
        self.page.goto(address)
        self.page.wait_for_selector(".card")

    def open(self, name: str) -> Page:
        """Show a page of the panel."""
        self.page.click(f"#tab-{name}")
        self.page.wait_for_selector(f"main.{name} .card")
        return self.page

    def ask(self, verb: str, **fields: object) -> Any:
        """The answer to a request that the page sends, or the code of its error."""
        asked = "([v, f]) => import('/static/js/connection.js').then(m => m.connection.ask(v, f)).catch(e => e.code)"
        return self.page.evaluate(asked, [verb, fields])

    def close(self) -> None:
        self._context.close()


def axe_findings(visitor: Visitor, pages: Iterable[str]) -> list[str]:
    """What axe-core finds serious or critical on pages of the panel.  Skips the test where it is missing."""
    axe = pytest.importorskip("axe_playwright_python", reason="no axe-core: pip install 'urbihw[browser]'")
    source = next(Path(axe.__file__).parent.glob("**/axe.min.js")).read_text("utf-8")
    visitor.page.evaluate(source)
    found = []
    for name in pages:
        visitor.open(name)
        told = json.loads(visitor.page.evaluate("axe.run().then(told => JSON.stringify(told.violations))"))
        found += [
            f"{name}: {rule['id']}: {rule['nodes'][0]['html'][:160]}"
            for rule in told if rule["impact"] in ("serious", "critical")
        ]  # fmt: skip
    return found


def wait_until(condition: object, seconds: float = 30.0) -> None:
    """Look at a body again and again until it is as expected."""
    assert callable(condition)
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.02)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with open_browser() as made:
        yield made


@pytest.fixture(scope="module")
def scenes(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Scene]]:
    """The scene of a platform, started when it is first asked for."""
    made: dict[str, Scene] = {}

    def scene(platform: str, *, simulated: bool = False) -> Scene:
        if platform not in made:
            folder: Path = tmp_path_factory.mktemp(platform)
            made[platform] = Scene(platform, folder, body=None if simulated else Body(platform))
        return made[platform]

    yield scene
    for each in made.values():
        each.close()


@pytest.fixture
def visit(browser: Browser) -> Iterator[Callable[..., Visitor]]:
    """Open the panel; at the end no browser may have had an error."""
    visitors: list[Visitor] = []

    def open_panel(address: str, **options: object) -> Visitor:
        visitors.append(Visitor(browser, address, **options))  # type: ignore[arg-type]
        return visitors[-1]

    yield open_panel
    errors = [error for visitor in visitors for error in visitor.errors]
    for visitor in visitors:
        visitor.close()
    assert errors == []
