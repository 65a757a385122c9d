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


def test_the_picture_has_the_angles_of_the_body(scene: Scene, body: Body, visit: Visit) -> None:
    panel = visit(scene.pair("full", "anna"), figure=True)
    with scene.run("bioloid.on|; motor2.val = 0.9 & motor6.val = -0.7 & motor7.val = 0.4 & motor13.val = 0.5;"):
        wait_until(lambda: abs(body.position(2) - MIDDLE - 0.9 / STEP) < 4)
    time.sleep(0.7)
    travels = view(panel, "view.travels()")
    assert len(travels) == 18
    for number in (1, 2, 6, 7, 8, 13):
        truth = (body.position(number) - MIDDLE) * STEP - MOUNTED.get(number, 0.0)
        assert travels[f"motor{number}"] == pytest.approx(truth, abs=0.02), number


def test_a_dragged_hand_moves_its_servo_no_faster_than_the_speed(scene: Scene, body: Body, visit: Visit) -> None:
    panel = visit(scene.pair("drive", "ben"), figure=True)
    with scene.run("bioloid.on|; motor5.val = 0;"):
        wait_until(lambda: abs(body.position(5) - MIDDLE) < 4)
    time.sleep(0.5)
    began, before = time.monotonic(), body.position(5)
    drag(panel, "right_hand", "[0, -0.09, 0]", (70, 0))
    wait_until(lambda: abs(body.position(5) - before) > 20)
    asked = view(panel, "view.goals.get('motor5')")
    wait_until(lambda: abs((body.position(5) - MIDDLE) * STEP - asked) < 0.03)
    assert abs(asked) / (time.monotonic() - began) < 1.1  # role drive: 1 rad/s
    # The hand is where the mouse has left it: the same point of it, as far as the servo can go.
    assert all(abs(body.position(number) - MIDDLE) < 400 for number in (1, 3))


def test_a_joint_is_not_dragged_by_who_only_looks_nor_while_another_browser_drives(
    scene: Scene, body: Body, visit: Visit
) -> None:
    with scene.run("bioloid.on|; motor6.val = 0;"):
        wait_until(lambda: abs(body.position(6) - MIDDLE) < 4)
    looks = visit(scene.pair("view", "cleo"), figure=True)
    drag(looks, "left_hand", "[0, 0.09, 0]", (-60, 0))
    looks.close()
    driver = visit(scene.pair("full", "anna"))
    assert driver.ask("lease", take=True)["ok"]
    other = visit(scene.pair("drive", "ben"), figure=True)
    drag(other, "left_hand", "[0, 0.09, 0]", (-60, 0))
    other.page.wait_for_selector(".toast:has-text('Take over')")
    assert abs(body.position(6) - MIDDLE) < 6
    driver.ask("lease", take=False)


def test_a_click_on_a_joint_opens_its_card_beside_the_picture(scene: Scene, visit: Visit) -> None:
    panel = visit(scene.pair("full", "anna"), figure=True)
    x, y = view(panel, "view.pixelOf('right_hand', [0, -0.05, 0])")
    panel.page.locator("#figure").click(position={"x": x, "y": y})
    panel.page.wait_for_selector("#chosen [data-part=motor5] .power")
    assert axe_findings(panel, ("control",)) == []


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
