"""The robot drawn in the panel, compared with the body; a dragged joint moves the body, under role and lease."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable
from typing import Any

import pytest
from panel_lab import ROOT, Body, Scene, Visitor, axe_findings, browser, scenes, visit, wait_until

pytestmark = pytest.mark.e2e

MIDDLE, STEP = 511.5, math.radians(300 / 1023)
MOUNTED = {7: -math.pi / 4, 8: math.pi / 4}
"""The servos of the hips are mounted at 45 degrees (the kit)."""
STATIC = ROOT / "urbihw" / "web" / "static"
Visit = Callable[..., Visitor]
__all__ = ["browser", "scenes", "visit"]  # fixtures


@pytest.fixture
def scene(scenes: Callable[..., Scene]) -> Scene:
    return scenes("bioloid")


@pytest.fixture
def body(scene: Scene) -> Body:
    assert scene.body is not None
    return scene.body


def view(visitor: Visitor, asked: str) -> Any:
    """What the picture tells: an expression of ``view``, the object that draws."""
    visitor.page.wait_for_selector("#figure.ready")
    return visitor.page.evaluate(f"(view => {asked})(document.getElementById('figure').figureView)")


def drag(visitor: Visitor, link: str, place: str, by: tuple[float, float]) -> None:
    """Drag a point of a link across the picture, pixels, as a hand does."""
    x, y = view(visitor, f"view.pixelOf('{link}', {place})")
    box = visitor.page.locator("#figure").bounding_box()
    assert box is not None
    mouse = visitor.page.mouse
    mouse.move(box["x"] + x, box["y"] + y)
    mouse.down()
    for step in range(1, 11):
        mouse.move(box["x"] + x + by[0] * step / 10, box["y"] + y + by[1] * step / 10)
        time.sleep(0.02)
    mouse.up()


def has_come(body: Body, number: int) -> tuple[float, float]:
    """When a servo that moves has come to its end (``time.monotonic``), and where that is: rad."""
    at, since = body.position(number), time.monotonic()
    while time.monotonic() < since + 1.0:
        time.sleep(0.02)
        if abs(body.position(number) - at) > 1:
            at, since = body.position(number), time.monotonic()
    return since, (at - MIDDLE) * STEP


def test_the_picture_is_as_the_body_and_a_dragged_hand_moves_it(scene: Scene, body: Body, visit: Visit) -> None:
    # One page for all of it: drawing takes seconds of a processor without a graphics card.
    panel = visit(scene.pair("drive", "ben"), figure=True)
    with scene.run("bioloid.on|; motor5.val = 0; motor2.val = 0.9 & motor6.val = -0.7 & motor7.val = 0.4;"):
        wait_until(lambda: abs(body.position(2) - MIDDLE - 0.9 / STEP) < 4)

    def is_as_body(number: int) -> bool:
        truth = (body.position(number) - MIDDLE) * STEP - MOUNTED.get(number, 0.0)
        return abs(float(view(panel, f"view.travels()['motor{number}']")) - truth) < 0.02

    assert len(view(panel, "view.travels()")) == 18
    for number in (1, 2, 5, 6, 7, 8):
        wait_until(lambda number=number: is_as_body(number))
    with scene.run("motor2.val = 0 & motor6.val = 0 & motor7.val = 0;"):
        wait_until(lambda: abs(body.position(2) - MIDDLE) < 4 and abs(body.position(6) - MIDDLE) < 4)

    # Role drive: 1 rad/s.
    began, before = time.monotonic(), body.position(5)
    drag(panel, "right_hand", "[0, -0.09, 0]", (70, 0))
    wait_until(lambda: abs(body.position(5) - before) > 20)
    ended, end = has_come(body, 5)
    assert abs(end - (before - MIDDLE) * STEP) / (ended - began) < 1.1
    # The hand is where the mouse has left it, and no other joint has moved.
    assert end == pytest.approx(view(panel, "view.goals.get('motor5')"), abs=0.03)
    assert all(abs(body.position(number) - MIDDLE) < 400 for number in (1, 3))

    # A click on a joint opens its card beside the picture.
    x, y = view(panel, "view.pixelOf('right_hand', [0, -0.05, 0])")
    panel.page.locator("#figure").click(position={"x": x, "y": y})
    panel.page.wait_for_selector("#chosen [data-part=motor5] .power")
    assert axe_findings(panel, ("control",)) == []

    # No drag while another browser drives.
    driver = visit(scene.pair("full", "anna"))
    assert driver.ask("lease", take=True)["ok"]
    here = body.position(6)
    drag(panel, "left_hand", "[0, 0.09, 0]", (-60, 0))
    panel.page.wait_for_selector(".toast:has-text('Take over')")
    assert abs(body.position(6) - here) < 6
    driver.ask("lease", take=False)

    # The page of who only looks asks for nothing: here the gateway would obey.
    panel.page.evaluate("import('/static/js/store.js').then(m => { m.store.hello.role = 'view'; })")
    drag(panel, "left_hand", "[0, 0.09, 0]", (-60, 0))
    time.sleep(0.5)
    assert abs(body.position(6) - here) < 6


def test_a_base_goes_to_a_click_and_not_to_where_a_look_around_ends(scenes: Callable[..., Scene], visit: Visit) -> None:
    # Small: an empty room is drawn quickly.
    panel = visit(scenes("segway", simulated=True).pair("full", "anna"), figure=True, width=500, height=600)
    view(panel, "view.pose")
    panel.page.evaluate("""import('/static/js/connection.js').then(({ connection }) => {
      const { ask } = connection;
      window.asked = [];
      connection.ask = async (verb, fields) => {
        if (verb !== "go") return ask.call(connection, verb, fields);
        window.asked.push(fields);
        return { ok: true };
      };
    })""")
    panel.page.click("#figure-go")
    box = panel.page.locator("#figure").bounding_box()
    assert box is not None
    x, y = box["x"] + 0.5 * box["width"], box["y"] + 0.8 * box["height"]
    mouse = panel.page.mouse
    mouse.move(x, y)
    mouse.down()
    mouse.move(x + 60, y, steps=4)
    mouse.up()
    time.sleep(0.2)
    assert panel.page.evaluate("window.asked") == []
    # It still wants a place, and a hand that trembles means one.
    mouse.down()
    mouse.move(x + 62, y + 1)
    mouse.up()
    panel.page.wait_for_selector("#figure-go[aria-pressed=false]")
    (asked,) = panel.page.evaluate("window.asked")
    assert math.isfinite(asked["x"]) and math.isfinite(asked["y"])


def test_a_scene_that_fails_is_drawn_flat_and_says_why(scene: Scene, visit: Visit) -> None:
    panel = visit(scene.pair("view", "cleo"))
    failing = 'export class FigureScene { constructor() { throw new Error("out of contexts"); } }'
    panel.page.route("**/figure/scene.js", lambda route: route.fulfill(body=failing, content_type="text/javascript"))
    panel.page.click("#figure-hide")
    panel.page.wait_for_selector(".toast:has-text('out of contexts')")
    panel.page.wait_for_selector("svg#figure polygon")
    assert panel.page.locator("#figure").count() == 1


def test_without_webgl_there_is_a_drawing_and_three_js_is_never_loaded(scene: Scene, visit: Visit) -> None:
    panel = visit(scene.pair("view", "cleo"), figure=True, without_webgl=True)
    panel.page.wait_for_selector("svg#figure polygon")
    assert panel.page.locator("svg#figure polygon").count() > 20
    loaded = panel.page.evaluate("performance.getEntriesByType('resource').map(entry => new URL(entry.name).pathname)")
    assert not any("three" in path for path in loaded)
    panel.page.locator("svg#figure polygon").nth(6).click()
    panel.page.wait_for_selector("#chosen .joint")


def test_the_page_without_the_picture_is_light() -> None:
    files = [path for path in STATIC.rglob("*") if path.suffix in (".js", ".css", ".html") and "three" not in path.name]
    assert sum(path.stat().st_size for path in files) < 400_000
    # Only the scene imports it, and the scene is imported when it is shown.
    importing = [path.name for path in files if re.search(r"^import .*|^} from .*three\.js", path.read_text(), re.M)
                 and "vendor/three.js" in path.read_text()]  # fmt: skip
    assert importing == ["scene.js"]
    assert 'import("../figure/scene.js")' in (STATIC / "cards" / "figure.js").read_text()
