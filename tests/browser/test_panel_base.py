"""The panel of bases in a real browser, judged by where they stand, what they light, and what their camera sees."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest
from panel_lab import Scene, Visitor, browser, scenes, visit, wait_until

pytestmark = pytest.mark.e2e

Visit = Callable[..., Visitor]
__all__ = ["browser", "scenes", "visit"]  # fixtures


def far(a: tuple[float, float], b: tuple[float, float]) -> float:
    return max(abs(a[0] - b[0]), abs(a[1] - b[1]))


def test_a_pioneer_drives_while_a_key_or_the_pad_is_held_and_to_a_click_on_the_map(
    scenes: Callable[..., Scene], visit: Visit
) -> None:
    scene = scenes("p3dx")
    body = scene.body
    assert body is not None
    page = visit(scene.pair("full", "anna")).page
    page.click("#card-base button:has-text('Motors off')")
    page.wait_for_selector("#card-base button:has-text('Motors on')")
    page.focus("#pad")
    began = body.place()
    page.keyboard.down("w")
    wait_until(lambda: far(body.place(), began) > 0.1)
    page.keyboard.up("w")
    time.sleep(1.5)
    stands = body.place()
    time.sleep(0.4)
    assert far(body.place(), stands) < 0.02

    box = page.locator("#pad").bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y + 60, steps=4)
    wait_until(lambda: far(body.place(), stands) > 0.05)
    # A page that is left lets go.
    page.evaluate("window.dispatchEvent(new Event('blur'))")
    time.sleep(1.5)
    stands = body.place()
    time.sleep(0.4)
    assert far(body.place(), stands) < 0.02
    page.mouse.up()

    assert page.locator("#card-distances dd .live").first.text_content() not in ("", "–")
    page.click("#click-to-go")
    box = page.locator("#map").bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + box["width"] / 2 + 40, box["y"] + box["height"] / 2)
    wait_until(lambda: far(body.place(), stands) > 0.2)
    page.keyboard.press("Escape")
    page.wait_for_selector("#stop-line.ok")


def test_a_spykee_shows_its_picture_lights_its_lamp_and_has_a_page_of_faults(
    scenes: Callable[..., Scene], visit: Visit
) -> None:
    scene = scenes("spykee", simulated=True)
    visitor = visit(scene.pair("full", "anna"))
    page = visitor.page
    picture = page.locator(".picture")
    wait_until(lambda: int(picture.get_attribute("data-frames") or 0) > 5)
    assert picture.evaluate("e => e.getContext('2d').getImageData(e.width / 2, e.height / 2, 1, 1).data[3]") == 255
    lamp = page.locator("[data-part=ledL] input")
    lamp.evaluate("e => { e.value = 1; e.dispatchEvent(new Event('input', {bubbles: true})); }")
    with scene.run("waituntil(ledL.val == 1); echo(\"lit\");") as connection:
        connection.settimeout(5)
        heard = b""
        while b"lit" not in heard:
            heard += connection.recv(4096)
    visitor.open("faults")
    page.click("#fault-unplug")
    page.wait_for_selector("#lamp-link.bad")
    page.click("#fault-plug")
    page.wait_for_selector("#lamp-link.ok")


@pytest.mark.parametrize(
    ("platform", "cards"),
    [
        ("nxt", ("base", "map", "joints", "distances", "sensors")),
        ("segway", ("base", "map", "speeds", "sensors")),
        ("nao", ("base", "camera-camera", "joints", "motions", "lights", "sound", "sensors")),
        ("so101", ("joints", "motions")),
        ("cia402", ("joints",)),
    ],
)
def test_each_platform_has_its_cards_and_values_without_a_line_of_its_own(
    scenes: Callable[..., Scene], visit: Visit, platform: str, cards: tuple[str, ...]
) -> None:
    page = visit(scenes(platform, simulated=True).pair("view", "anna")).page
    for card in cards:
        page.wait_for_selector(f"#card-{card}", state="attached")
    wait_until(lambda: any(text not in ("", "–") for text in page.locator("main .live").all_text_contents()))
