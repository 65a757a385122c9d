"""The panel of a servo chain in a real browser, judged by where the servos are."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from panel_lab import Body, Scene, Visitor, axe_findings, browser, scenes, visit, wait_until

pytestmark = pytest.mark.e2e

MIDDLE = 512
Visit = Callable[..., Visitor]
__all__ = ["browser", "scenes", "visit"]  # fixtures


@pytest.fixture
def scene(scenes: Callable[..., Scene]) -> Scene:
    return scenes("bioloid")


@pytest.fixture
def body(scene: Scene) -> Body:
    assert scene.body is not None
    return scene.body


@pytest.fixture
def panel(scene: Scene, visit: Visit) -> Iterator[Visitor]:
    """A browser of role full, and servo 6 on in the middle; at its end everything is released and ends."""
    body = scene.body
    assert body is not None
    with scene.run("motor6.load = 1; motor6.speed = 5; motor6.val = 0;"):
        wait_until(lambda: abs(body.position(6) - MIDDLE) < 4)
    visitor = visit(scene.pair("full", "anna"))
    yield visitor
    visitor.ask("release")


def slider(visitor: Visitor, motor: str) -> Any:
    """The slider of a joint."""
    return visitor.page.locator(f"[data-part={motor}] .track input")


def set_goal(visitor: Visitor, motor: str, value: float) -> None:
    """Move a slider as a hand does: the value, and the event of it."""
    moved = "(e, v) => { e.value = v; e.dispatchEvent(new Event('input', {bubbles: true})); }"
    slider(visitor, motor).evaluate(moved, value)


def shown(visitor: Visitor, motor: str) -> float:
    """The angle that a row shows, degrees; nan for none."""
    text = visitor.page.locator(f"[data-part={motor}] .live").first.text_content() or ""
    return float(text[:-1]) if text.endswith("°") else math.nan


def test_a_slider_moves_the_servo_no_faster_than_the_speed_and_a_double_click_centres(
    panel: Visitor, body: Body
) -> None:
    panel.page.locator("[data-part=motor6] .power[aria-pressed=true]").click()
    wait_until(lambda: "torque_enable=0" in body.say("state 6"))
    panel.page.locator("[data-part=motor6] .power[aria-pressed=false]").click()
    wait_until(lambda: "torque_enable=1" in body.say("state 6"))
    began = time.monotonic()
    set_goal(panel, "motor6", 0.8)
    wait_until(lambda: abs(body.position(6) - (MIDDLE + 156)) < 8)
    assert time.monotonic() - began > 0.6  # 0.8 rad at 1 rad/s; without the limit a tenth of it
    wait_until(lambda: shown(panel, "motor6") > 43)
    slider(panel, "motor6").dblclick()
    wait_until(lambda: abs(body.position(6) - MIDDLE) < 8)


def test_the_space_bar_holds_the_robot_until_the_button_was_held_for_a_second(panel: Visitor, body: Body) -> None:
    panel.page.locator("h1").click()
    panel.page.keyboard.press("Space")
    panel.page.wait_for_selector("#held")
    panel.page.wait_for_selector("#stop-line.ok")
    before = body.position(6)
    set_goal(panel, "motor6", 0.8)
    panel.page.wait_for_selector(".toast")
    button = panel.page.locator("#release")
    button.click()  # too short
    assert panel.page.locator("#held").is_visible()
    assert abs(body.position(6) - before) < 4
    button.hover()
    panel.page.mouse.down()
    panel.page.wait_for_selector("#held", state="detached")
    panel.page.mouse.up()
    panel.page.wait_for_selector("#stop-line:has-text('Released')")


def test_the_emergency_stop_reaches_the_body_at_once_while_a_program_holds_the_interpreter(
    panel: Visitor, scene: Scene, body: Body
) -> None:
    panel.ask("set", slot="motor6.speed", value=0.6)
    with scene.run("motor6.val = 2.4;"):
        wait_until(lambda: body.position(6) > MIDDLE + 20)
        with scene.run("loop|{};"):
            time.sleep(0.3)
            before = body.position(6)
            panel.page.evaluate("document.getElementById('estop').click()")
            panel.page.wait_for_selector("#stop-line.ok")
            stopped = body.position(6)
            time.sleep(0.3)
            after = body.position(6)
    assert before > MIDDLE + 20
    assert after - stopped <= 2  # it stands
    # 0.6 rad/s are 117 counts in a second.  Alone on a machine it is less than 50 ms; here other tests run beside.
    assert (after - before) / 117 < 0.35, (before, stopped, after)


def test_the_interpreter_is_told_as_held_and_the_devices_go_on(panel: Visitor, scene: Scene) -> None:
    page = panel.open("plots")
    page.fill("#plot-slot", "@6.position")
    page.click("text=Add")
    with scene.held_daemon():
        page.wait_for_selector("#stale:has-text('interpreter')")
        count = "import('/static/cards/plots.js').then(m => m.plot.series.get('@6.position').count)"
        first = page.evaluate(count)
        time.sleep(0.4)
        assert page.evaluate(count) > first + 5
    page.wait_for_selector("#stale", state="detached")


def test_a_pose_is_kept_and_a_joint_goes_there(panel: Visitor, body: Body) -> None:
    set_goal(panel, "motor6", 0.5)
    wait_until(lambda: abs(body.position(6) - (MIDDLE + 98)) < 8)
    panel.page.fill("#motion-name", "bow")
    panel.page.click("#save-pose")
    row = panel.page.locator("#card-motions li", has_text="bow")
    row.wait_for()
    slider(panel, "motor6").dblclick()
    wait_until(lambda: abs(body.position(6) - MIDDLE) < 8)
    row.locator("button").click()
    wait_until(lambda: abs(body.position(6) - (MIDDLE + 98)) < 8)


def test_the_console_runs_under_a_tag_that_a_click_stops(panel: Visitor, body: Body) -> None:
    page = panel.open("console")
    page.fill("#input", "1 + 41")
    page.press("#input", "Enter")
    page.wait_for_selector("#output .line.value:has-text('42')")
    page.fill("#input", "nothing.anywhere;")
    page.press("#input", "Enter")
    page.wait_for_selector("#output .line.error:has-text('lookup failed')")
    page.fill("#tag", "swing")
    page.fill("#input", "motor6.val = 0 sin:1s ampli:0.5")
    page.click("#run")
    wait_until(lambda: abs(body.position(6) - MIDDLE) > 50)
    page.click("#stop-swing")
    time.sleep(0.5)
    where = body.position(6)
    time.sleep(0.5)
    assert abs(body.position(6) - where) < 4
    page.press("#input", "ArrowUp")
    assert page.input_value("#input") == "motor6.val = 0 sin:1s ampli:0.5"


def test_jobs_and_tags_of_others_are_shown_and_events_as_they_happen(panel: Visitor, scene: Scene, body: Body) -> None:
    page = panel.open("jobs")
    with scene.run("var waver = Tag.new(\"waver\")|; waver: every (1s) {1},"):
        page.wait_for_selector("[data-tag=waver]")
        body.say("silence 3")
        page.wait_for_selector("#card-events :text('lost')")
        body.say("heal")
        page.wait_for_selector("#card-events :text('back')")


def test_a_lost_servo_is_told_among_the_devices_with_advice(panel: Visitor, body: Body) -> None:
    page = panel.open("devices")
    page.wait_for_selector("[data-device='3']")
    body.say("silence 3")
    page.wait_for_selector("[data-device='3'].lost")
    page.wait_for_selector("#advice li")
    body.say("heal")
    page.wait_for_selector("[data-device='3']:not(.lost)")


@pytest.mark.long
def test_of_two_browsers_one_drives_until_the_other_takes_over(
    panel: Visitor, scene: Scene, visit: Visit, body: Body
) -> None:
    panel.page.click("#driver button:has-text('Drive')")
    panel.page.wait_for_selector("#driver:has-text('you')")
    other = visit(scene.pair("drive", "bert"))
    set_goal(other, "motor6", 0.8)
    other.page.click(".toast button:has-text('Take over')")
    panel.page.wait_for_selector("#driver:has-text('bert')")
    assert abs(body.position(6) - MIDDLE) < 8
    set_goal(other, "motor6", 0.3)
    wait_until(lambda: abs(body.position(6) - (MIDDLE + 59)) < 8)
    assert not other.page.locator("#tab-console").count()


def test_role_view_sees_and_stops_but_cannot_move(panel: Visitor, scene: Scene, visit: Visit, body: Body) -> None:
    viewer = visit(scene.pair("view", "carl"))
    assert slider(viewer, "motor6").is_disabled()
    assert viewer.ask("set", slot="motor6.val", value=0.5) == "role"
    set_goal(panel, "motor6", 2.0)
    wait_until(lambda: body.position(6) > MIDDLE + 30)
    viewer.page.keyboard.press("Escape")
    viewer.page.wait_for_selector("#stop-line.ok")
    time.sleep(0.3)
    where = body.position(6)
    time.sleep(0.3)
    assert abs(body.position(6) - where) < 4
    assert where < MIDDLE + 350


def test_a_browser_comes_back_by_itself_and_says_meanwhile_that_nothing_is_confirmed(
    scene: Scene, visit: Visit
) -> None:
    visitor = visit(scene.pair("full", "dora"))
    page = visitor.page
    scene.stop_gateway()
    page.wait_for_selector("#stale")
    page.wait_for_selector("body.cut #lamp-link.bad:has-text('unknown')", state="attached")
    page.click("#stop")
    page.wait_for_selector("#stop-line.bad:has-text('NOT CONFIRMED')")
    scene.start_gateway()
    page.wait_for_selector("#stale", state="detached")
    wait_until(lambda: shown(visitor, "motor1") > -90)
    # That the server was away is the one thing the browser may complain of.
    visitor.errors[:] = [error for error in visitor.errors if "WebSocket connection" not in error]


@pytest.mark.long
@pytest.mark.parametrize(
    ("dark", "width"),
    [
        (False, 1280), (True, 390),
        pytest.param(True, 1280, marks=pytest.mark.long), pytest.param(False, 390, marks=pytest.mark.long),
    ],  # fmt: skip
)
def test_axe_finds_nothing_serious(scene: Scene, visit: Visit, dark: bool, width: int) -> None:
    visitor = visit(scene.pair("full", "eva"), dark=dark, width=width)
    assert axe_findings(visitor, ("control", "plots", "console", "jobs", "devices", "log")) == []


@pytest.mark.long
def test_on_a_phone_nothing_is_wider_than_the_screen_and_stop_is_in_view(scene: Scene, visit: Visit) -> None:
    visitor = visit(scene.pair("full", "finn"), width=390, height=800)
    for name in ("control", "plots", "console", "jobs", "devices", "log"):
        page = visitor.open(name)
        assert page.evaluate("document.documentElement.scrollWidth") <= 390, name
        page.evaluate("window.scrollTo(0, document.body.scrollHeight)")
        box = page.locator("#stop").bounding_box()
        assert box is not None
        assert box["y"] >= 0 and box["y"] + box["height"] < 200 and box["width"] >= 120 and box["height"] >= 48


def test_the_page_speaks_words_of_people_and_keeps_still(panel: Visitor) -> None:
    page = panel.page
    page.wait_for_selector("[data-part=motor6] .head:has-text('left hand motor6')")
    page.wait_for_selector("#doing:text-matches('standing|stopped: ')")  # a stop of the test before is told for 20 s
    page.fill("#motion-name", "wave")
    panel.open("plots")
    page.wait_for_selector(".chips:has-text('motor1.val')")  # the most telling slots are drawn already, in degrees
    page.wait_for_selector(".chart")
    panel.open("control")
    assert page.input_value("#motion-name") == "wave"
    place = page.locator("#tab-control").bounding_box()
    page.click("#estop")
    page.wait_for_selector("#held #release")
    page.wait_for_selector("#doing:has-text('held by an emergency stop')")
    assert page.locator("#tab-control").bounding_box() == place


def test_who_only_looks_sees_no_handles(scene: Scene, visit: Visit) -> None:
    page = visit(scene.pair("view", "cleo")).page
    page.wait_for_selector("[data-part=motor6] .measured", state="attached")
    handles = "[...document.querySelectorAll('main input, main button')].filter(e => e.offsetParent)"
    assert page.evaluate(f"{handles}.map(e => e.textContent)") == ["Show", "Copy pose"]
