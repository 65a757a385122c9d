"""Who may do what in a real browser: roles, pages of other sites, and a daemon that went away.  Judged by the body."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from panel_lab import Body, Scene, Visitor, browser, scenes, visit, wait_until

pytestmark = pytest.mark.e2e

MIDDLE = 512
COUNTS_PER_RAD = 195.4
Visit = Callable[..., Visitor]
__all__ = ["browser", "scenes", "visit"]  # fixtures
# Opens the gateway's WebSocket from a page of another site, and tells what became of it.
FOREIGN = """url => new Promise(told => {
  const socket = new WebSocket(url);
  socket.onopen = () => told("open");
  socket.onclose = () => told("closed");
})"""
READ = "url => fetch(url, {credentials: 'include'}).then(a => a.text()).catch(() => 'refused')"
BLIND = """url => fetch(url, {mode: 'no-cors', credentials: 'include', method: 'POST', body: 'x'})
  .then(a => a.type).catch(() => 'refused')"""


@pytest.fixture
def scene(scenes: Callable[..., Scene]) -> Scene:
    return scenes("bioloid")


@pytest.fixture
def body(scene: Scene) -> Body:
    """The body, with servo 6 on in the middle."""
    assert scene.body is not None
    made = scene.body
    with scene.run("motor6.load = 1; motor6.speed = 5; motor6.val = 0;"):
        wait_until(lambda: abs(made.position(6) - MIDDLE) < 4)
    return made


class Page(BaseHTTPRequestHandler):
    """An empty page of another site."""

    def do_GET(self) -> None:
        """Any address."""
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b'<!doctype html><link rel="icon" href="data:,"><title>another site</title>')

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing."""


@pytest.fixture
def other_site() -> Iterator[int]:
    """The port of another site on this machine."""
    with ThreadingHTTPServer(("127.0.0.1", 0), Page) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server.server_address[1]
        server.shutdown()


def stands(body: Body, seconds: float = 0.6) -> bool:
    """Whether no servo moves for some seconds."""
    before = [body.position(number) for number in (5, 6, 7)]
    time.sleep(seconds)
    return all(abs(body.position(number) - at) < 3 for number, at in zip((5, 6, 7), before, strict=True))


def test_no_request_of_role_view_moves_anything(scene: Scene, visit: Visit, body: Body) -> None:
    viewer = visit(scene.pair("view", "carl"))
    # It is shown what the joint is, and nothing by which it could be moved.
    viewer.page.wait_for_selector("[data-part=motor6] .live")
    slider = viewer.page.locator("[data-part=motor6] .track input")
    slider.wait_for(state="hidden")
    assert slider.is_disabled()
    before = body.say("state 6")
    for verb, fields in (
        ("set", {"slot": "motor6.val", "value": 1}), ("set", {"slot": "motor6.val", "value": 1, "speed": 1}),
        ("set", {"slot": "motor6.load", "value": 0}), ("set", {"slot": "robot.joint[6].val", "value": 1}),
        ("call", {"slot": "robot.stop", "args": []}), ("call", {"slot": "bioloid.rescan", "args": []}),
        ("sound", {"slot": "motor6.val", "keywords": "raw 1 16000 16 1", "data": ""}),
        ("drive", {"x": 1, "yaw": 1}), ("go", {"x": 1, "y": 1}), ("run", {"text": "motor6.val = 1;"}),
        ("tag", {"tag": "t", "action": "stop"}), ("release", {}), ("lease", {"take": True}),
        ("fake", {"tell": "push 6 100"}), ("complete", {"text": "motor6."}), ("events", {"slots": ["motor6.val"]}),
    ):  # fmt: skip
        assert viewer.ask(verb, **fields) == "role", verb
    # What it may ask for reads, and calls no function.
    for slot in ("bioloid.stop", "System.shutdown", "motor6.val"):
        viewer.ask("get", slot=slot)
        viewer.ask("subscribe", slots=[slot], hz=20)
    assert stands(body)
    assert "torque_enable=1" in body.say("state 6")
    assert before.partition("goal_position")[2][:8] == body.say("state 6").partition("goal_position")[2][:8]
    # A slider that somebody has brought back does not move it, either.
    slider.evaluate("e => { e.disabled = false; e.value = 1; e.dispatchEvent(new Event('input', {bubbles: true})); }")
    viewer.page.wait_for_selector(".toast")
    assert stands(body)


def test_role_drive_moves_joints_no_faster_than_its_limit(scene: Scene, visit: Visit, body: Body) -> None:
    driver = visit(scene.pair("drive", "bert"))
    assert driver.ask("set", slot="motor6.load", value=0) == "role"
    assert driver.ask("set", slot="motor6.torqueLimit", value=0) == "role"
    began = time.monotonic()
    assert driver.ask("set", slot="motor6.val", value=1.2, speed=50)["ok"]
    wait_until(lambda: abs(body.position(6) - (MIDDLE + 1.2 * COUNTS_PER_RAD)) < 8)
    assert time.monotonic() - began > 1.0, "1.2 rad at 1 rad/s"
    # A speed that was set before does not matter: the goal is a movement at the limit.
    driver.ask("set", slot="motor6.speed", value=100)
    began = time.monotonic()
    assert driver.ask("set", slot="motor6.val", value=0)["ok"]
    wait_until(lambda: abs(body.position(6) - MIDDLE) < 8)
    assert time.monotonic() - began > 1.0


@pytest.mark.long
@pytest.mark.parametrize("host", ["127.0.0.1", "localhost"])
def test_a_page_of_another_site_does_not_reach_the_robot(
    scene: Scene, visit: Visit, body: Body, other_site: int, host: str
) -> None:
    visitor = visit(scene.pair("full", "anna"))
    page = visitor.page
    page.wait_for_selector("#lamp-server.ok", state="attached")
    # The same browser, with its cookie, which is that of the host and not of the port.
    page.goto(f"http://{host}:{other_site}/")
    for name in ("127.0.0.1", "localhost"):
        gateway = f"{name}:{scene.gateway_port}"
        assert page.evaluate(FOREIGN, f"ws://{gateway}/ws") == "closed"
        assert page.evaluate(READ, f"http://{gateway}/") == "refused"
        assert page.evaluate(BLIND, f"http://{gateway}/pair?c=1") == "refused"
    frame = page.evaluate(
        """url => new Promise(told => {
          const frame = document.createElement("iframe");
          frame.onload = () => { try { told(frame.contentDocument.title); } catch { told("hidden"); } };
          frame.src = url;
          document.body.append(frame);
        })""",
        f"http://{host}:{scene.gateway_port}/",
    )
    assert frame == "hidden"
    assert stands(body, 0.2)
    visitor.errors.clear()  # the browser tells of each refusal
    page.goto(f"http://127.0.0.1:{scene.gateway_port}/")
    page.wait_for_selector("#lamp-server.ok", state="attached")


@pytest.mark.long
def test_two_browsers_see_the_same_and_each_may_stop(scene: Scene, visit: Visit, body: Body) -> None:
    first, second = visit(scene.pair("full", "anna")), visit(scene.pair("view", "carl"))
    assert first.ask("set", slot="motor6.val", value=0.5)["ok"]
    for visitor in (first, second):
        visitor.page.wait_for_selector("[data-part=motor6] .live:text-matches('^2[89]\\\\.')")
        visitor.page.wait_for_selector("#driver :text('anna')")
    assert first.ask("set", slot="motor6.val", value=-2, speed=0.5)["ok"]
    wait_until(lambda: body.position(6) < MIDDLE + 80)
    second.page.click("#estop")
    second.page.wait_for_selector("#stop-line.ok")
    assert stands(body)
    for visitor in (first, second):
        visitor.page.wait_for_selector("#held:has-text('carl')")
    assert second.page.locator("#release").count() == 0
    # It is carl's: anna is shown that first, and it holds until she has asked for it by name.
    assert first.page.locator("#release").count() == 0
    assert first.ask("release") == "held"
    first.page.click("#override:has-text('carl')")
    first.page.hover("#release:has-text('carl')")
    first.page.mouse.down()
    for visitor in (first, second):
        visitor.page.wait_for_selector("#held", state="detached")
    first.page.mouse.up()


def test_the_panel_goes_on_with_the_next_daemon(scene: Scene, visit: Visit, body: Body) -> None:
    visitor = visit(scene.pair("full", "anna"))
    page = visitor.page
    live = page.locator("[data-part=motor6] .live").first
    wait_until(lambda: live.text_content() not in ("", "–"))
    scene.kill_daemon()
    page.wait_for_selector("#lamp-server.bad", state="attached")
    page.wait_for_selector("#stale:has-text('old')")
    scene.start_daemon()
    page.wait_for_selector("#lamp-server.ok", state="attached", timeout=30_000)
    page.wait_for_selector("#lamp-link.ok", state="attached", timeout=30_000)
    page.wait_for_selector("#stale", state="detached")
    visitor.open("console")
    page.fill("#input", "motor6.load = 1|; motor6.val = 0.5; 40 + 2;")
    page.press("#input", "Enter")
    page.wait_for_selector("#output .line.value:has-text('42')")
    wait_until(lambda: abs(body.position(6) - (MIDDLE + 98)) < 8)
    visitor.open("control")
    page.wait_for_selector("[data-part=motor6] .live:text-matches('^2[89]\\\\.')")
