"""What an owner of each robot does first, at a desk and on a phone: move it, pull the plug and see it told, stop it."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable

import pytest
from panel_lab import Scene, Visitor, browser, scenes, visit, wait_until

pytestmark = pytest.mark.e2e

Visit = Callable[..., Visitor]
__all__ = ["browser", "scenes", "visit"]  # fixtures
DESK, PHONE = 1280, 390


def told(scene: Scene, line: str) -> str:
    """What the simulated robot tells of its body."""
    heard = b""
    with scene.run(f'echo("<" + fake.tell("{line}") + ">");') as connection:
        connection.settimeout(5)
        while b">" not in heard.partition(b"*** <")[2]:
            heard += connection.recv(4096)
    return heard.partition(b"*** <")[2].partition(b">")[0].decode()


def place(scene: Scene) -> float:
    """How far ahead of its start a base truly is: m; of an NXT the way of a wheel of 28 mm."""
    if scene.platform == "nxt":
        found = re.search(r"A power -?\d+ at (-?\d+)", told(scene, "state"))
        assert found is not None
        return math.radians(float(found[1])) * 0.028
    return float(re.findall(r"-?\d+\.\d+", told(scene, "where"))[0])


def pull_the_plug_and_stop(visitor: Visitor) -> None:
    """Unplug, see it told, plug, stop, hold and release."""
    page = visitor.page
    visitor.open("faults")
    page.click("#fault-unplug")
    page.wait_for_selector("#lamp-link.bad", state="attached")
    assert "no link" in (page.text_content("#health") or "")
    page.wait_for_selector("#stale:has-text('it may move')")
    page.click("#stop")
    page.wait_for_selector("#stop-line.bad:has-text('NOT CONFIRMED: there is no link')")
    page.click("#fault-plug")
    page.wait_for_selector("#lamp-link.ok", state="attached")
    page.wait_for_selector("#stop-line", state="detached")
    page.click("#stop")
    page.wait_for_selector("#stop-line.ok:has-text('Stopped after')")
    page.click("#estop")
    page.wait_for_selector("#held")
    visitor.ask("release")
    page.wait_for_selector("#stop-line:has-text('Released')")


@pytest.mark.long
def test_a_nao_wakes_up_by_a_button_and_gets_slack_by_a_second_click_only(
    scenes: Callable[..., Scene], visit: Visit
) -> None:
    scene = scenes("nao", simulated=True)
    visitor = visit(scene.pair("full", "dora"))
    page = visitor.page
    page.click("button:has-text('Wake up')")
    wait_until(lambda: "standing" in told(scene, "where"))
    page.fill("#motion-name", "wave")
    for selector in ("#record", "#all-off"):
        page.click(selector)
        page.wait_for_selector(f"{selector}.warning")
    time.sleep(1.0)
    assert "standing" in told(scene, "where")
    page.wait_for_selector("#record:not(.warning)")
    page.click("#record")
    page.click("#record")
    page.wait_for_selector("#end-record")
    page.click("#end-record")
    page.wait_for_selector("#end-record", state="detached")


@pytest.mark.parametrize("width", [DESK, pytest.param(PHONE, marks=pytest.mark.long)])
@pytest.mark.parametrize("platform", ["segway", "spykee", "nxt"])
def test_a_base_drives_while_a_key_is_held(
    scenes: Callable[..., Scene], visit: Visit, platform: str, width: int
) -> None:
    scene = scenes(platform, simulated=True)
    visitor = visit(scene.pair("full", f"anna{width}"), width=width, height=844)
    page = visitor.page

    def is_still() -> bool:
        return page.text_content("#moving") == "no"

    wait_until(is_still)
    before = place(scene)
    page.focus("#pad")
    page.keyboard.down("w")
    wait_until(lambda: abs(place(scene) - before) > 0.1)
    page.keyboard.up("w")
    wait_until(is_still)
    here = place(scene)
    pull_the_plug_and_stop(visitor)
    assert abs(place(scene) - here) < 0.02
    assert page.evaluate("document.documentElement.scrollWidth") <= width


@pytest.mark.long
def test_a_fallen_segway_says_so_and_why_it_does_not_drive(scenes: Callable[..., Scene], visit: Visit) -> None:
    scene = scenes("segway", simulated=True)
    visitor = visit(scene.pair("full", "bert"))
    page = visitor.page
    visitor.open("faults")
    for arguments, words in (("on", "emergency stop switch open"), ("off", "pitch angle limit")):
        page.fill("#fault-estop ~ input", arguments)
        page.click("#fault-estop")
        page.wait_for_selector(f"#health:has-text('{words}')")
    # It has fallen, as its motors were off.
    before = place(scene)
    visitor.open("control")
    page.focus("#pad")
    page.keyboard.down("w")
    page.wait_for_selector("#toasts:has-text('the base does not drive (mode disabled)')")
    page.keyboard.up("w")
    assert abs(place(scene) - before) < 0.02
    visitor.open("faults")
    page.click("#fault-lift")
    page.wait_for_selector("#health:not(:has-text('alarm'))")
    with scene.run('rmp.mode = "balance";'):
        wait_until(lambda: "motors on" in told(scene, "show"))


def test_tab_passes_a_slider_of_a_speed_and_an_arrow_key_drives_while_it_is_held(
    scenes: Callable[..., Scene], visit: Visit
) -> None:
    scene = scenes("segway", simulated=True)
    visitor = visit(scene.pair("full", "fred"))
    page = visitor.page
    slider = page.locator("#card-speeds input").first
    slider.wait_for()

    def speed() -> float:
        found = re.search(r"(-?\d+\.\d+) m/s", told(scene, "show"))
        assert found is not None
        return float(found[1])

    with scene.run("rmp.forwardSpeed = 0.3;"):
        wait_until(lambda: speed() > 0.25)
        slider.focus()
        for key in ("Tab", "Shift+Tab", "Shift+Tab", "Tab"):
            page.keyboard.press(key)
        page.wait_for_timeout(500)
        assert speed() > 0.25
        assert "no one" in (page.text_content("#driver") or "")
    wait_until(lambda: abs(speed()) < 0.02)
    slider.focus()
    for _ in range(40):
        page.keyboard.down("ArrowRight")
    wait_until(lambda: speed() > 0.1)
    page.keyboard.up("ArrowRight")
    wait_until(lambda: abs(speed()) < 0.02)
    for _ in range(40):
        page.keyboard.down("ArrowRight")
    wait_until(lambda: speed() > 0.1)
    page.locator("#pad").focus()
    wait_until(lambda: abs(speed()) < 0.02)
    page.keyboard.up("ArrowRight")


def test_nothing_covers_the_bar_when_the_page_is_scrolled(scenes: Callable[..., Scene], visit: Visit) -> None:
    visitor = visit(scenes("segway", simulated=True).pair("full", "dora"), width=PHONE, height=844)
    page = visitor.page
    page.wait_for_selector("#pad .front")
    for step in range(0, 400, 20):
        page.evaluate(f"window.scrollTo(0, {step})")
        assert page.evaluate("""() => {
            const bar = document.getElementById("bar");
            const { left, top, right, bottom } = bar.getBoundingClientRect();
            for (let x = left + 5; x < right; x += 20)
              for (let y = Math.max(0, top) + 5; y < bottom; y += 10)
                if (!bar.contains(document.elementFromPoint(x, y))) return false;
            return true;
        }"""), step


@pytest.mark.long
def test_a_finger_that_scrolls_over_a_slider_moves_nothing(scenes: Callable[..., Scene], visit: Visit) -> None:
    scene = scenes("so101", simulated=True)
    visitor = visit(scene.pair("full", "emil"), width=PHONE, height=600, finger=True)
    page = visitor.page
    touch = page.context.new_cdp_session(page)
    track = page.locator("#card-joints li", has_text="shoulder_lift").first.locator(".track")
    track.scroll_into_view_if_needed()

    def swipe(right: float, down: float) -> None:
        box = track.bounding_box()
        assert box is not None
        x, y = box["x"] + 0.7 * box["width"], box["y"] + box["height"] / 2
        touch.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
        for step in range(1, 9):
            at = {"x": x + right * step / 8, "y": y + down * step / 8}
            touch.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": [at]})
            page.wait_for_timeout(30)
        touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})

    before = told(scene, "state")
    top = page.evaluate("scrollY")
    swipe(0, -150)
    wait_until(lambda: page.evaluate("scrollY") != top)
    page.wait_for_timeout(1000)
    assert told(scene, "state") == before
    track.scroll_into_view_if_needed()
    swipe(40, 0)
    wait_until(lambda: told(scene, "state") != before)


@pytest.mark.long
@pytest.mark.parametrize(("width", "goal"), [pytest.param(DESK, 0.5, marks=pytest.mark.long), (PHONE, 0.2)])
@pytest.mark.parametrize(
    ("platform", "joint", "word"), [("nao", "HeadYaw", "joints"), ("so101", "wrist_roll", "state")]
)
def test_a_slider_moves_a_joint(
    scenes: Callable[..., Scene], visit: Visit, platform: str, joint: str, word: str, width: int, goal: float
) -> None:
    scene = scenes(platform, simulated=True)
    visitor = visit(scene.pair("full", f"anna{width}"), width=width, height=844)
    page = visitor.page
    row = page.locator(f"[data-part$={joint}]")
    power = row.locator(".power:not([aria-pressed=mixed])")
    if power.get_attribute("aria-pressed") == "false":
        power.click()
    row.locator(".power[aria-pressed=true]").wait_for()
    before = told(scene, word)
    moved = "(e, v) => { e.value = v; e.dispatchEvent(new Event('input', {bubbles: true})); }"
    row.locator(".track input").evaluate(moved, goal)
    wait_until(lambda: told(scene, word) != before)
    wait_until(lambda: abs(float((row.locator(".live").first.text_content() or "x")[:-1]) - math.degrees(goal)) < 3)
    pull_the_plug_and_stop(visitor)
    assert page.evaluate("document.documentElement.scrollWidth") <= width


@pytest.mark.long
def test_a_spykee_on_its_dock_says_so_goes_nowhere_and_leaves_it(scenes: Callable[..., Scene], visit: Visit) -> None:
    scene = scenes("spykee", simulated=True)
    visitor = visit(scene.pair("full", "dora"))
    page = visitor.page
    page.wait_for_selector("#on-dock:has-text('no')")
    page.click("button:has-text('Go to the dock')")
    page.wait_for_selector("#on-dock:has-text('yes')", timeout=30_000)
    page.focus("#pad")
    page.keyboard.down("w")
    page.wait_for_selector(".toast:has-text('the robot is on its dock')")
    page.keyboard.up("w")
    assert page.text_content("#moving") == "no"
    page.click("button:has-text('Leave the dock')")
    page.wait_for_selector("#on-dock:has-text('no')")
