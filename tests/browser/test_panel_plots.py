"""Plots and the console of the panel in a real browser: what they show is what the robot's body does."""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from panel_lab import Body, Scene, Visitor, browser, scenes, visit, wait_until

pytestmark = pytest.mark.e2e

Visit = Callable[..., Visitor]
__all__ = ["browser", "scenes", "visit"]  # fixtures
COUNT = "s => import('/static/cards/plots.js').then(m => m.plot.series.get(s)?.count ?? 0)"
SLOTS = [f"motor{number}.{slot}" for slot in ("val", "load", "speed", "temperature") for number in range(1, 16)]
ADD = "l => import('/static/cards/plots.js').then(m => l.forEach(m.addSeries))"


@pytest.fixture
def body(scenes: Callable[..., Scene]) -> Body:
    made = scenes("bioloid").body
    assert made is not None
    return made


@pytest.fixture
def panel(scenes: Callable[..., Scene], visit: Visit, body: Body) -> Iterator[Visitor]:
    """A browser of role full; servo 6 swings."""
    scene = scenes("bioloid")
    with scene.run("motor6.load = 1; motor6.speed = 5; motor6.val = 0 sin:1s ampli:0.5,"):
        wait_until(lambda: abs(body.position(6) - 512) > 20)
        yield visit(scene.pair("full", "anna"))


def span(visitor: Visitor) -> float:
    """The seconds that the first chart shows."""
    return float(visitor.page.locator(".chart").first.get_attribute("data-span") or "nan")


@pytest.mark.long
def test_a_slot_is_dragged_in_and_its_curve_is_saved_zoomed_and_paused(panel: Visitor, tmp_path: Path) -> None:
    page = panel.open("plots")
    page.select_option("#owner", "motor6")
    page.locator("#card-slots .tools input").fill("val")
    # Both in view: a page that scrolls under the mouse would drag another name.
    page.set_viewport_size({"width": 1280, "height": 1600})
    page.locator(".slots .slot-name[title^='motor6.val:']").drag_to(page.locator("#drop"))
    page.locator(".chips button", has_text="motor6.val").wait_for()
    wait_until(lambda: page.evaluate(COUNT, "motor6.val") > 150)
    assert 2.0 < span(panel) <= 10.1

    page.click("#pause")
    before, shown = page.evaluate(COUNT, "motor6.val"), span(panel)
    time.sleep(1.0)
    assert abs(span(panel) - shown) < 0.3
    assert page.evaluate(COUNT, "motor6.val") > before + 20, "a paused plot goes on recording"
    box = page.locator(".chart .u-over").first.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] * 0.6, box["y"] + 50)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] * 0.8, box["y"] + 60, steps=5)
    page.mouse.up()
    wait_until(lambda: 0 < span(panel) < 0.4 * shown)
    page.mouse.dblclick(box["x"] + box["width"] * 0.5, box["y"] + 50)
    wait_until(lambda: span(panel) > 0.9 * shown)
    page.click("#pause")
    wait_until(lambda: span(panel) > shown + 0.5 or span(panel) > 9.5)

    with page.expect_download() as saved:
        page.click("button:has-text('CSV')")
    saved.value.save_as(tmp_path / "plot.csv")
    with (tmp_path / "plot.csv").open() as file:
        head, *rows = list(csv.reader(file))
    assert head == ["time", "motor6.val [rad]"]
    times, values = zip(*((float(row[0]), float(row[1])) for row in rows if row[1]), strict=True)
    assert len(rows) > 150 and list(times) == sorted(times)
    # It swings by 0.5 rad around the middle, in a second.
    assert 0.3 < max(values) < 0.55 and -0.55 < min(values) < -0.3
    assert abs(sum(values) / len(values)) < 0.15


def test_a_value_of_the_worker_is_plotted_at_the_time_of_the_slots(panel: Visitor) -> None:
    page = panel.open("plots")
    page.evaluate(ADD, ["motor6.val", "@6.position"])
    wait_until(lambda: page.evaluate(COUNT, "@6.position") > 150)
    near = """() => import('/static/cards/plots.js').then(({ plot }) => {
        const [slot, device] = ["motor6.val", "@6.position"].map((name) => plot.series.get(name));
        const at = slot.count - 100, other = device.first(slot.times[at]);
        return [slot.times[at] - device.times[other], slot.values[at] - device.values[other]];
    })"""
    late, apart = page.evaluate(near)
    assert abs(late) < 0.2
    assert abs(apart) < 0.5, "it swings by 0.5 rad in a second, 3 rad/s at most"
    page.fill("[aria-label='Slot'], #slot, form input", "nothing.val")
    page.keyboard.press("Enter")
    page.wait_for_selector("#toasts:has-text('nothing.val: no slot with a number')")
    page.click("button:has-text('Clear')")


@pytest.mark.long
def test_sixty_slots_at_50_hz_arrive_whole_and_the_page_does_not_grow(panel: Visitor) -> None:
    """A short look; ``python -m bench.panel --minutes 5`` takes longer."""
    page = panel.open("plots")
    page.evaluate(ADD, SLOTS)
    panel.open("jobs")
    panel.open("plots")
    wait_until(lambda: page.locator(".chips li").count() == 60)
    # The charts show 10 s, which are 500 samples: from then on nothing is added.
    wait_until(lambda: page.evaluate(COUNT, SLOTS[-1]) > 600, 40)
    tools = page.context.new_cdp_session(page)

    def used() -> float:
        tools.send("HeapProfiler.collectGarbage")
        told = tools.send("Runtime.getHeapUsage")
        return float(told["usedSize"]) / 1e6

    nodes = "document.querySelectorAll('*').length"
    first, count, size = used(), page.evaluate(COUNT, SLOTS[0]), page.evaluate(nodes)
    began = time.monotonic()
    time.sleep(8.0)
    came, took = page.evaluate(COUNT, SLOTS[0]) - count, time.monotonic() - began
    assert came / took > 25, "a busy machine may leave some out"
    assert used() - first < 1.5, "MB; kept samples have their place from the beginning"
    assert abs(page.evaluate(nodes) - size) < 30
    page.click("button:has-text('Clear')")


@pytest.mark.long
def test_the_console_completes_by_tab_and_recalls_what_was_typed(panel: Visitor, body: Body) -> None:
    page = panel.open("console")
    page.fill("#input", "motor6.torqueLim")
    page.press("#input", "Tab")
    wait_until(lambda: page.input_value("#input") == "motor6.torqueLimit")
    page.fill("#input", "motor6.cw")
    page.press("#input", "Tab")
    page.wait_for_selector("#words button")
    words = page.locator("#words button").all_text_contents()
    assert "cwLimit" in words and all(word.startswith("cw") for word in words)
    page.locator("#words button", has_text="cwLimit").first.click()
    assert page.input_value("#input") == "motor6.cwLimit"
    for text in ("1 + 1;", "var tail = 7;", "tail * 6;"):
        page.fill("#input", text)
        page.press("#input", "Enter")
    page.wait_for_selector("#output .line.value:has-text('42')")
    # A name of this console, which other connections do not have.
    page.fill("#input", "tai")
    page.press("#input", "Tab")
    wait_until(lambda: page.input_value("#input") == "tail")
    page.fill("#input", "")
    for text in ("tail * 6;", "var tail = 7;", "1 + 1;"):
        page.press("#input", "ArrowUp")
        assert page.input_value("#input") == text
    page.press("#input", "ArrowDown")
    assert page.input_value("#input") == "var tail = 7;"
    page.reload()
    page.wait_for_selector("#input")
    page.press("#input", "ArrowUp")
    assert page.input_value("#input") == "tail * 6;"
    # Several lines are one text: the servo goes where the last line says.
    page.fill("#input", "motor6.val = 0.2;\nsleep(200ms);\nvar goal = 0.1;")
    page.press("#input", "Shift+Enter")
    page.locator("#input").press_sequentially("goal + 1;")
    page.press("#input", "Enter")
    page.wait_for_selector("#output .line.value:has-text('1.1')")


@pytest.mark.long
def test_names_with_markup_are_shown_as_text(panel: Visitor, scenes: Callable[..., Scene]) -> None:
    """Names and texts of programs reach the page in the console, the list of jobs, the log and the events."""
    page = panel.open("console")
    bad = "<img src=x onerror=window.hacked=1><script>window.hacked=1</script>"
    program = (
        f'echo("{bad}"); var Global.odd = Tag.new("{bad}")|; odd: every (1s) {{ 1 }}, '
        f'lobby.introduce("{bad}"); cerr << "{bad}"; logger.log("{bad}"); nothing["{bad}"];'
    )
    page.fill("#input", program)
    page.press("#input", "Enter")
    page.wait_for_selector("#output .line:has-text('<img')")
    page.wait_for_selector("#output .line.error")
    for name in ("jobs", "log", "devices", "plots"):
        panel.open(name)
        time.sleep(1.2 if name == "jobs" else 0.3)
    assert page.evaluate("window.hacked") is None
    assert page.locator("main img, main script").count() == 0
    assert not math.isnan(page.evaluate("performance.now()"))
    with scenes("bioloid").run("odd.stop;"):
        time.sleep(0.2)
