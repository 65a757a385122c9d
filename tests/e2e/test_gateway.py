"""The gateway beside a real daemon, judged by the body of the simulated robot."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import re
import signal
import socket
import struct
import subprocess
import sys
import time
import urllib.request
from collections.abc import AsyncIterator, Callable
from contextlib import ExitStack, asynccontextmanager, closing
from pathlib import Path
from typing import Any

import aiohttp
import pytest
from faults_lab import Watcher, wait_for
from moving_robots import RIGS, Rig

from test_serve import TIMEOUT_S, URBIHW, Daemon  # isort: skip
import starts

pytestmark = pytest.mark.e2e

FLOOD = Path(__file__).with_name("flooding_browsers.py")
WHEEL, P3DX, SPYKEE = (
    next(rig for rig in RIGS if rig.name == name) for name in ("Bioloid, a wheel", "Pioneer 3-DX", "Spykee")
)


class Tab:
    """A browser with the panel open."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self.socket = socket
        self._number = 0

    async def ask(self, do: str, **fields: Any) -> dict[str, Any]:
        """The answer to a request."""
        self._number += 1
        await self.socket.send_json({"id": self._number, "do": do, **fields})
        return await self.wait(lambda told: told.get("id") == self._number)

    async def wait(self, fits: Callable[[dict[str, Any]], object]) -> dict[str, Any]:
        """The next message that fits."""
        while True:
            message = await self.socket.receive(timeout=TIMEOUT_S)
            if message.type is aiohttp.WSMsgType.TEXT:
                told: dict[str, Any] = json.loads(message.data)
                if fits(told):
                    return told

    async def event(self, name: str, fits: Callable[[dict[str, Any]], object] = lambda told: True) -> dict[str, Any]:
        """The next event of a name that fits."""
        return await self.wait(lambda told: told.get("event") == name and fits(told))

    async def picture(self, seconds: float) -> tuple[dict[str, Any], bytes]:
        """The next picture: its header and its data.  Raises TimeoutError."""
        async with asyncio.timeout(seconds):
            while True:
                message = await self.socket.receive()
                if message.type is aiohttp.WSMsgType.BINARY:
                    size = struct.unpack_from("<I", message.data)[0]
                    return json.loads(message.data[4 : 4 + size]), message.data[4 + size :]

    async def run(self, text: str) -> None:
        """Run text in the console until it has said that it is over."""
        await self.ask("run", text=f'{text} echo("it is over");')
        await self.event("output", lambda told: "it is over" in told["text"])


class Scene:
    """A robot, its daemon, a gateway, and a browser of each role."""

    def __init__(self, folder: Path, rig: Rig) -> None:
        self._folder = folder
        self.end, look = rig.make()
        self._stack = ExitStack()
        self._stack.enter_context(self.end)
        self.end.start()
        self.watcher = Watcher(self.end, look)
        self.control = folder / "robot.sock"
        file = folder / "urbihw.toml"
        file.write_text(f'platform = "{rig.platform}"\nurl = "{self.end.url}"\ncontrol = "{self.control}"\n'
                        "quiet = true\nhold_limit = 0\ndead_man = 30\n")
        self._arguments = "--platform", rig.platform, "--config", str(file)
        self.daemon = Daemon(folder, *self._arguments)
        self.tabs: list[Tab] = []
        self.panel: subprocess.Popen[bytes]
        self.url = ""
        self.cookies: list[str] = []

    def restart(self) -> None:
        """Kill the daemon, and start it again on the same port."""
        port = str(self.daemon.port)
        self.daemon.close()
        (self._folder / "port").unlink()
        self.daemon = Daemon(self._folder, *self._arguments, "--port", port)

    def close(self) -> None:
        self.watcher.close()
        self.daemon.close()
        self._stack.close()


@asynccontextmanager
async def scene(folder: Path, rig: Rig, *roles: str, remote: bool = False) -> AsyncIterator[Scene]:
    """A scene while the block runs.  With ``remote`` the gateway does not reach the bus worker."""
    made = Scene(folder, rig)
    port_file = folder / "panel-port"
    environment = {**os.environ, "XDG_STATE_HOME": str(folder), "STATE_DIRECTORY": ""}
    control = () if remote else ("--control", str(made.control))
    panel = made.panel = starts.Forked(
        (*URBIHW, "panel", f"127.0.0.1:{made.daemon.port}", "--port", "0", "--port-file", str(port_file),
         *control), env=environment, stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        while not port_file.exists():
            assert panel.poll() is None, "the gateway has ended"
            await asyncio.sleep(0.02)
        port = int(port_file.read_text())
        made.url = f"http://127.0.0.1:{port}/ws"
        async with aiohttp.ClientSession() as http:
            for role in roles:
                pair = (sys.executable, *URBIHW[1:], "panel", "pair", "--port", str(port), "--role", role)
                url = starts.run(pair, env=environment, capture_output=True, text=True, check=True).stdout.strip()
                async with http.get(url, allow_redirects=False) as answer:
                    cookie = answer.headers["Set-Cookie"].partition(";")[0]
                made.cookies.append(cookie)
            for cookie in made.cookies:  # all at once: one that reads nothing while others pair is disconnected
                made.tabs.append(Tab(await http.ws_connect(made.url, headers={"Cookie": cookie})))
            for tab in made.tabs:
                await tab.event("tree")
            yield made
            for tab in made.tabs:
                await tab.socket.close()
    finally:
        panel.terminate()
        panel.wait(TIMEOUT_S)
        made.close()


def play(
    folder: Path, rig: Rig, roles: tuple[str, ...], test: Callable[[Scene], Any], *, remote: bool = False
) -> None:
    """Play a test in a scene."""

    async def run() -> None:
        async with scene(folder, rig, *roles, remote=remote) as made:
            await test(made)

    asyncio.run(run())


async def until(holds: Callable[[], bool], seconds: float, what: str) -> None:
    """Wait until something of the body holds."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, f"waited for {what}"
        await asyncio.sleep(0.01)


def test_a_browser_stops_a_moving_robot_and_sees_its_devices_beside_a_held_interpreter(tmp_path: Path) -> None:
    async def test(made: Scene) -> None:
        full, view = made.tabs
        assert (await view.ask("set", slot="motor6.val", value=1))["code"] == "role"
        assert (await full.ask("subscribe", slots=["motor6.val"], hz=20))["units"] == ["rad"]
        assert (await full.ask("call", slot="robot.stop", args=[]))["ok"]
        assert (await full.ask("set", slot="motor6.val", value=1))["ok"]
        await full.event("samples", lambda told: told["v"][0] > 0.9)
        assert "full (panel)" in str((await full.ask("get", slot="motor6.why")).get("value"))
        await full.run(f"{WHEEL.prepare} waituntil({WHEEL.until}); {WHEEL.go}")
        await until(lambda: made.watcher.speed() > WHEEL.moving, 5.0, "a turning wheel")
        await full.ask("run", text="loop|{};")
        await full.event("state", lambda told: told["silent"] > 0.5)
        assert made.watcher.speed() > WHEEL.moving, "it should still turn: the worker holds its goal"
        answer = await view.ask("estop")
        assert answer["confirmed"] and answer["estop"]
        await until(lambda: made.watcher.speed() < WHEEL.rest, 0.5, "a standing wheel")
        assert (await view.ask("values", hz=20))["ok"]
        first = await view.event("values")
        later = await view.event("values", lambda told: told["time"] > first["time"] + 0.5)
        assert abs(later["values"]["6"]["position"] - 1) < 0.1
        await full.event("state", lambda told: told["estop"] and told["worker"] and not told["daemon"])

    play(tmp_path, WHEEL, ("full", "view"), test)


@pytest.mark.long
def test_eight_browsers_that_flood_do_not_hold_up_a_stop(tmp_path: Path) -> None:
    async def test(made: Scene) -> None:
        full = made.tabs[0]
        await full.run(f"{WHEEL.prepare} waituntil({WHEEL.until});")
        flooding = subprocess.Popen((sys.executable, str(FLOOD), made.url, *made.cookies[1:]))
        try:
            for _ in range(3):
                end = time.monotonic() + 60
                while made.watcher.speed() < WHEEL.moving:
                    assert time.monotonic() < end, "the wheel does not turn"
                    # Again, since the dead man may have stopped it: eight browsers hold a busy machine up.
                    await full.run(WHEEL.go)
                    await asyncio.sleep(0.3)
                assert (await full.ask("stop"))["confirmed"]
                await until(lambda: made.watcher.speed() < WHEEL.rest, 1.0, "a standing wheel")
        finally:
            flooding.kill()
            flooding.wait()

    play(tmp_path, WHEEL, ("full", *["view"] * 8), test)


def test_a_subscription_tells_which_slots_cannot_be_read(tmp_path: Path) -> None:
    async def test(made: Scene) -> None:
        view = made.tabs[0]
        answer = await view.ask("subscribe", slots=["motor6.val", "motor6.nothing", "nothing.val"], hz=20)
        assert answer["errors"] == {"motor6.nothing": "lookup failed: nothing", "nothing.val": "lookup failed: nothing"}
        await view.event("samples", lambda told: told["v"][0] is not None)
        answer = await view.ask("subscribe", slots=["nothing.val"], hz=20)
        assert answer["code"] == "language" and answer["error"] == "nothing.val: lookup failed: nothing"
        assert (await view.ask("picture", slot="nothing.val"))["code"] == "language"

    play(tmp_path, WHEEL, ("view",), test)


@pytest.mark.long
def test_a_robot_of_another_machine_is_stopped_by_its_daemon_and_told_as_that(tmp_path: Path) -> None:
    async def test(made: Scene) -> None:
        full, view = made.tabs

        async def turn() -> None:
            await full.run(WHEEL.go)
            await until(lambda: made.watcher.speed() > WHEEL.moving, 5.0, "a turning wheel")

        state = await view.event("state", lambda told: told["daemon"] and told["link"])
        assert state["remote"] and not state["worker"]
        await full.run(f"{WHEEL.prepare} waituntil({WHEEL.until});")
        await turn()
        answer = await view.ask("stop")
        assert answer["confirmed"] and answer["by"] == "daemon" and answer["link"] is True and answer["estop"] == ""
        await until(lambda: made.watcher.speed() < WHEEL.rest, 1.0, "a standing wheel")
        await turn()
        answer = await view.ask("estop")
        assert answer["confirmed"] and answer["by"] == "daemon" and answer["estop"].startswith("view (panel)")
        await until(lambda: made.watcher.speed() < WHEEL.rest, 1.0, "a standing wheel")
        told = await full.event("state", lambda told: told["estop"].startswith("view (panel)"))
        assert told["holders"] == [answer["estop"]] and not told["holds"]
        assert (await view.ask("release"))["code"] == "role"
        refused = await full.ask("release")
        assert refused["code"] == "held" and answer["estop"] in refused["error"]
        await full.ask("run", text=WHEEL.go)
        await asyncio.sleep(0.5)
        assert made.watcher.speed() < WHEEL.rest
        answer = await full.ask("release", of=told["holders"])
        assert answer["confirmed"] and answer["estop"] == ""
        await turn()
        await full.ask("run", text="loop|{};")
        await full.event("state", lambda told: told["silent"] > 0.5)
        answer = await view.ask("estop")
        assert answer["code"] == "gone" and answer["error"].startswith("NOT CONFIRMED: the daemon has not answered")

    play(tmp_path, WHEEL, ("full", "view"), test, remote=True)


def test_a_base_stands_soon_after_the_last_order_and_when_the_browser_is_closed(tmp_path: Path) -> None:
    async def test(made: Scene) -> None:
        full, drive = made.tabs
        await full.run(f"{P3DX.prepare} waituntil({P3DX.until});")

        async def hold() -> float:
            """Hold the pad until the base drives; the time of the last order."""
            end = time.monotonic() + 10.0
            while made.watcher.speed() < P3DX.moving:
                assert time.monotonic() < end, "the base did not drive"
                answer = await drive.ask("drive", x=5, yaw=0)
                if answer.get("deferred") or answer.get("late"):  # a busy machine: as if the pad were released
                    await drive.ask("drive", x=0, yaw=0)
                last = time.monotonic()
                await asyncio.sleep(0.1)
            return last

        last = await hold()
        assert made.watcher.speed() < 0.31, "role drive is limited to 0.3 m/s"
        await until(lambda: made.watcher.speed() < 0.2, last + 0.3 + 1.0 - time.monotonic(), "a base that brakes")
        await until(lambda: made.watcher.speed() < P3DX.rest, 3.0, "a standing base")
        await hold()
        await drive.socket.close()
        await until(lambda: made.watcher.speed() < P3DX.rest, 3.0, "a standing base")

    play(tmp_path, P3DX, ("full", "drive"), test)


@pytest.mark.parametrize("take", [True, False])
def test_what_a_browser_has_moved_stops_when_it_does_not_drive_any_more(tmp_path: Path, take: bool) -> None:
    async def test(made: Scene) -> None:
        full, drive = made.tabs
        await full.run(f"{P3DX.prepare} waituntil({P3DX.until});")
        for do, fields in (
            ("set", {"slot": "robot.body.x.speed", "value": 0.3}), ("call", {"slot": "robot.go", "args": [20]})
        ):  # fmt: skip
            assert (await drive.ask(do, **fields))["ok"]
            await until(lambda: made.watcher.speed() > P3DX.moving, 10.0, "a driving base")
            assert (await (full if take else drive).ask("lease", take=take))["ok"]
            await until(lambda: made.watcher.speed() < P3DX.rest, 3.0, "a standing base")
            await asyncio.sleep(1.0)
            assert made.watcher.speed() < P3DX.rest, "the call goes on"
            await full.ask("lease", take=False)

    play(tmp_path, P3DX, ("full", "drive"), test)


def test_what_a_browser_moves_under_a_lease_stops_when_it_says_nothing(tmp_path: Path) -> None:
    async def test(made: Scene) -> None:
        full, drive = made.tabs
        await full.run(f"{P3DX.prepare} waituntil({P3DX.until});")
        assert (await drive.ask("lease", take=True, seconds=1.0))["ok"]
        end = time.monotonic() + 10.0
        while made.watcher.speed() < P3DX.moving:
            assert time.monotonic() < end, "the base did not drive"
            assert (await drive.ask("set", slot="robot.body.x.speed", value=0.3))["ok"]
            await asyncio.sleep(0.2)
        # Its connection stays, as that of one that is held; what others say does not count.
        end = time.monotonic() + 10.0
        while made.watcher.speed() > P3DX.rest:
            assert time.monotonic() < end, "the base drives on"
            await full.ask("get", slot="robot.body.x.speed")
            await asyncio.sleep(0.05)
        assert not drive.socket.closed

    play(tmp_path, P3DX, ("full", "drive"), test)


def test_orders_that_waited_for_a_gateway_that_hung_are_not_carried_out(tmp_path: Path) -> None:
    async def test(made: Scene) -> None:
        full, drive = made.tabs
        await full.run(f"{P3DX.prepare} waituntil({P3DX.until});")
        before = time.monotonic()
        assert (await drive.ask("drive", x=0, yaw=0, at=time.monotonic() - before))["ok"]
        made.panel.send_signal(signal.SIGSTOP)
        for number in range(10):
            await drive.socket.send_json(
                {"id": f"late {number}", "do": "drive", "x": 0.3, "yaw": 0, "at": time.monotonic() - before}
            )
        await asyncio.sleep(1.5)
        made.panel.send_signal(signal.SIGCONT)
        for number in range(10):
            answer = await drive.wait(lambda told, number=number: told.get("id") == f"late {number}")  # type: ignore[misc]
            assert answer["late"]
            assert made.watcher.speed() < P3DX.rest

    play(tmp_path, P3DX, ("full", "drive"), test)


def test_a_browser_gets_the_newest_picture_when_it_has_drawn_the_last_one(tmp_path: Path) -> None:
    async def test(made: Scene) -> None:
        view = made.tabs[0]
        sub = (await view.ask("picture", slot="camera.val", hz=20))["sub"]
        header, data = await view.picture(TIMEOUT_S)
        while not header["width"]:  # the robot has not sent one yet
            await view.socket.send_json({"do": "ack", "sub": sub})
            header, data = await view.picture(TIMEOUT_S)
        assert header["sub"] == sub and header["format"] == "jpeg" and header["width"] == 320
        assert data.startswith(b"\xff\xd8") and data.endswith(b"\xff\xd9")
        await asyncio.sleep(1.0)
        with pytest.raises(TimeoutError):
            await view.picture(0.1)
        await view.socket.send_json({"do": "ack", "sub": sub})
        newer, _ = await view.picture(TIMEOUT_S)
        assert newer["t"] > header["t"] + 0.5, "an old picture was kept for a browser that was busy"

    play(tmp_path, SPYKEE, ("view",), test)


def test_a_browser_goes_on_when_the_daemon_was_killed(tmp_path: Path) -> None:
    async def test(made: Scene) -> None:
        full = made.tabs[0]
        await full.ask("subscribe", slots=["motor6.val"], hz=20)
        await full.event("samples")
        await asyncio.to_thread(made.restart)
        await full.event("state", lambda told: not told["daemon"])
        await full.event("state", lambda told: told["daemon"] and told["worker"] and told["link"])
        async with asyncio.timeout(TIMEOUT_S):
            there = False
            while not there:  # a servo that the machine holds up for a moment is lost, and its movement ends
                assert (await full.ask("set", slot="motor6.val", value=1))["ok"]
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(5):
                        await full.event("samples", lambda told: told["v"][0] is not None and told["v"][0] > 0.9)
                        there = True

    play(tmp_path, WHEEL, ("full",), test)


def free_port() -> int:
    """A port that is not in use."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        number: int = listener.getsockname()[1]
        return number


def is_running(pid: int) -> bool:
    """Whether a process runs."""
    return Path(f"/proc/{pid}").exists() and ") Z " not in Path(f"/proc/{pid}/stat").read_text()


def test_the_panel_of_a_daemon_is_started_again_and_ends_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    file, port = tmp_path / "urbihw.toml", free_port()
    file.write_text(f"web = true\npanel_port = {port}\nfake = true\nquiet = true\n")

    def answers() -> bool:
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/healthz", timeout=5) as answer:
                return bool(answer.status == 200)
        except OSError:
            return False

    def panel() -> int:
        children = Path(f"/proc/{daemon.process.pid}/task").glob("*/children")
        found = [int(child) for each in children for child in each.read_text().split()]
        panels = [pid for pid in found if re.search(rb"\0panel\0", Path(f"/proc/{pid}/cmdline").read_bytes())]
        assert len(panels) == 1
        return panels[0]

    with closing(Daemon(tmp_path, "--config", str(file))) as daemon:
        wait_for(answers, "the panel")
        first = panel()
        os.kill(first, signal.SIGKILL)
        wait_for(lambda: not answers(), "the end of the panel")
        wait_for(answers, "another panel")
        second = panel()
        assert second != first and "it is started again in 1 s" in daemon.log()
        os.kill(second, signal.SIGSTOP)
        wait_for(lambda: not is_running(second), "the end of a panel that hangs")
        wait_for(answers, "a third panel")
        second = panel()
        assert "the panel has not answered for 4 s: it is killed" in daemon.log()
        daemon.process.terminate()
        assert daemon.process.wait(TIMEOUT_S) == 0
        assert not is_running(second), "the panel has outlived its daemon"
        third = Daemon(tmp_path, "--config", str(file), "--port", str(daemon.port))
        with closing(third):
            daemon = third
            wait_for(answers, "the panel of another daemon")
            last = panel()
            third.process.kill()
            wait_for(lambda: not is_running(last), "the end of the panel of a killed daemon")
