"""The panel of bases in a real browser, judged by where they stand, what they light, and what their camera sees."""

from __future__ import annotations

import math
import re
import socket
import struct
import time
import wave
from collections.abc import Callable
from ctypes.util import find_library
from pathlib import Path

import pytest
from panel_lab import Scene, Visitor, axe_findings, browser, scenes, visit, wait_until

pytestmark = pytest.mark.e2e

PICTURE_TIMEOUT_S = 60.0
"""Until the first picture of a world: OpenGL without hardware starts slowly."""


def heard_until(connection: socket.socket, text: bytes) -> bytes:
    """What a connection says up to a text.  Raises TimeoutError."""
    heard = b""
    while text not in heard:
        heard += connection.recv(4096)
    return heard


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
    page.click("#card-base button:has-text('Motors: off')")
    page.wait_for_selector("#card-base button:has-text('Motors: on')")
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


PAD = """pad => {
  window.pad = {connected: true, axes: [0, 0], buttons: Array.from({length: 16}, () => ({pressed: false}))};
  navigator.getGamepads = () => [window.pad];
}"""


@pytest.mark.long
def test_a_gamepad_drives_while_a_shoulder_button_is_held_and_its_start_button_stops(
    scenes: Callable[..., Scene], visit: Visit
) -> None:
    scene = scenes("p3dx")
    body = scene.body
    assert body is not None
    with scene.run("P3dx.motorsLoad = 1;"):
        page = visit(scene.pair("drive", "bert")).page
        page.wait_for_selector("#pad")
        page.evaluate(PAD)
        began = body.place()
        page.evaluate("window.pad.axes = [0.9, 0]")  # to the right
        time.sleep(0.5)
        assert far(body.place(), began) < 0.02, "nothing is held"
        page.evaluate("window.pad.axes = [0, 1]; window.pad.buttons[5].pressed = true")  # backwards
        wait_until(lambda: far(body.place(), began) > 0.1)
        page.evaluate("window.pad.buttons[5].pressed = false")
        time.sleep(1.5)
        stood = body.place()
        time.sleep(0.4)
        assert far(body.place(), stood) < 0.02
        page.evaluate("window.pad.buttons[5].pressed = true")
        wait_until(lambda: far(body.place(), stood) > 0.05)
        page.evaluate("window.pad.buttons[9].pressed = true")
        page.wait_for_selector("#stop-line.ok")
        time.sleep(1.0)
        stood = body.place()
        time.sleep(0.5)
        assert far(body.place(), stood) < 0.02, "after a stop the held stick does not drive on"
        # A gamepad whose plug is pulled lets go.
        page.evaluate("window.pad.buttons.forEach(b => b.pressed = false)")
        time.sleep(0.3)
        page.evaluate("window.pad.buttons[5].pressed = true")
        wait_until(lambda: far(body.place(), stood) > 0.05)
        page.evaluate("window.pad.connected = false")
        time.sleep(1.5)
        stood = body.place()
        time.sleep(0.4)
        assert far(body.place(), stood) < 0.02


def test_role_drive_goes_no_faster_than_its_limit(scenes: Callable[..., Scene], visit: Visit) -> None:
    scene = scenes("p3dx")
    body = scene.body
    assert body is not None
    with scene.run("P3dx.motorsLoad = 1;"):
        visitor = visit(scene.pair("drive", "bert"))
        end = time.monotonic() + 4.0
        places = []
        while time.monotonic() < end:
            told = visitor.ask("drive", x=-5, yaw=0)
            if isinstance(told, dict) and (told["deferred"] or told["late"]):
                visitor.ask("drive", x=0, yaw=0)
            places.append((time.monotonic(), body.place()))
            time.sleep(0.05)
        (first, began), (last, ended) = places[len(places) // 2], places[-1]
        way = math.dist(began, ended)
        assert 0.05 < way / (last - first) < 0.36
        visitor.ask("drive", x=0, yaw=0)


@pytest.mark.long
def test_a_loaded_map_is_drawn_with_its_walls_and_a_click_drives_along_a_path(
    scenes: Callable[..., Scene], visit: Visit, tmp_path: Path
) -> None:
    scene = scenes("p3dx")
    body = scene.body
    assert body is not None
    body.say("reset")
    assert body.say(f"map {tmp_path / 'room.map'}").startswith("ok")
    page = visit(scene.pair("full", "anna")).page
    walls = "document.getElementById('map').dataset.walls"
    wait_until(lambda: page.evaluate(walls) == "0")
    program = f'P3dx.motorsLoad = 1|; robot.planner.mapFileName = "{tmp_path / "room.map"}"|;'
    with scene.run(program):
        wait_until(lambda: int(page.evaluate(walls)) > 3)
        # In the colour of walls, there are pixels in the picture.
        assert page.evaluate(
            """() => {
              const canvas = document.getElementById('map');
              const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
              let dark = 0;
              for (let at = 0; at < data.length; at += 4) {
                if (data[at + 3] && data[at] < 120 && data[at + 2] < 140) dark++;
              }
              return dark;
            }"""
        ) > 100
        before = body.place()
        page.click("#click-to-go")
        box = page.locator("#map").bounding_box()
        assert box is not None
        page.mouse.click(box["x"] + box["width"] / 2 + 50, box["y"] + box["height"] / 2)
        wait_until(lambda: far(body.place(), before) > 0.2, 20)
        page.keyboard.press("Escape")
        page.wait_for_selector("#stop-line.ok")
        with scene.run('robot.planner.mapFileName = "";'):
            wait_until(lambda: page.evaluate(walls) == "0")


@pytest.mark.long
def test_a_sound_file_is_played_by_the_loudspeaker(
    scenes: Callable[..., Scene], visit: Visit, tmp_path: Path
) -> None:
    scene = scenes("spykee", simulated=True)
    visitor = visit(scene.pair("full", "anna"))
    page = visitor.page
    file = tmp_path / "tone.wav"
    with wave.open(str(file), "wb") as made:
        made.setnchannels(2)
        made.setsampwidth(2)
        made.setframerate(22050)
        made.writeframes(b"".join(
            struct.pack("<hh", *[round(12000 * math.sin(0.125 * index))] * 2) for index in range(55125)
        ))  # fmt: skip
    page.wait_for_selector("#lamp-link.ok", state="attached")

    def played() -> float:
        """Seconds that its loudspeaker has played, by the console of the simulated robot."""
        found = re.search(r"loudspeaker ([0-9.]+) s", visitor.ask("fake", tell="played")["answer"])
        assert found is not None
        return float(found[1])

    before = played()
    page.set_input_files("#card-sound input[type=file]", file)
    wait_until(lambda: 2.3 < played() - before < 3.5, 20)
    page.wait_for_selector("#card-sound :text('2.5 s sent')")
    text = tmp_path / "no.wav"
    text.write_text("this is no sound")
    page.set_input_files("#card-sound input[type=file]", text)
    page.wait_for_selector("#card-sound :text('no sound that this browser can read')")


@pytest.mark.long
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
        heard_until(connection, b"*** lit")
    visitor.open("faults")
    page.click("#fault-unplug")
    page.wait_for_selector("#lamp-link.bad", state="attached")
    page.click("#fault-plug")
    page.wait_for_selector("#lamp-link.ok", state="attached")
    assert axe_findings(visitor, ("control", "faults")) == []


@pytest.mark.long
@pytest.mark.parametrize(
    ("platform", "cards"),
    [
        ("nxt", ("base", "map", "joints", "distances", "sensors")),
        pytest.param("segway", ("base", "map", "speeds", "sensors"), marks=pytest.mark.long),
        ("nao", ("base", "camera-camera", "joints", "motions", "lights", "sound", "sensors")),
        pytest.param("so101", ("joints", "motions"), marks=pytest.mark.long),
        pytest.param("cia402", ("joints",), marks=pytest.mark.long),
    ],
)
def test_each_platform_has_its_cards_and_values_without_a_line_of_its_own(
    scenes: Callable[..., Scene], visit: Visit, platform: str, cards: tuple[str, ...]
) -> None:
    visitor = visit(scenes(platform, simulated=True).pair("view", "anna"), width=390, height=800)
    page = visitor.page
    for card in cards:
        page.wait_for_selector(f"#card-{card}", state="attached")
    wait_until(lambda: any(text not in ("", "–") for text in page.locator("main .live").all_text_contents()))
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert axe_findings(visitor, ("control",)) == []


@pytest.mark.long
def test_the_world_of_a_simulated_robot_is_shown_and_what_moves_in_it(
    scenes: Callable[..., Scene], visit: Visit
) -> None:
    pytest.importorskip("mujoco", reason="simulated worlds need the extra mujoco")
    if find_library("EGL") is None:
        pytest.skip("no EGL here, with which pictures are drawn")
    visitor = visit(scenes("webots", simulated=True).pair("full", "anna"))
    page = visitor.page
    page.wait_for_selector("#card-camera-worldView canvas[data-frames]", timeout=PICTURE_TIMEOUT_S * 1e3)
    canvas = "document.querySelector('#card-camera-worldView canvas')"
    before = page.evaluate(f"{canvas}.toDataURL()")
    assert len(before) > 2000  # more than one colour
    visitor.ask("run", text="wander.start;")
    wait_until(lambda: page.evaluate(f"{canvas}.toDataURL()") != before)


@pytest.mark.long
def test_a_slider_in_degrees_goes_at_the_speed_that_is_shown_and_follows_a_motor_that_turns_on(
    scenes: Callable[..., Scene], visit: Visit
) -> None:
    scene = scenes("nxt", simulated=True)
    page = visit(scene.pair("full", "anna")).page
    claw = page.locator("[data-part=claw] input")
    claw.evaluate("e => { e.value = 60; e.dispatchEvent(new Event('input', {bubbles: true})); }")
    with scene.run('waituntil(claw.val > 50); echo("there");') as connection:
        connection.settimeout(4)  # 1 rad/s; at 1 deg/s it takes a minute
        heard_until(connection, b"*** there")
    assert abs(float(claw.input_value()) - 60) < 4  # the goal, not the set-point on its way
    with scene.run('wheelL.speed = 300; sleep(2s); wheelL.speed = 0; echo("turned");') as connection:
        connection.settimeout(5)
        heard_until(connection, b"*** turned")
    wheel = page.locator("[data-part=wheelL] input")
    wait_until(lambda: float(wheel.get_attribute("min") or 0) > 100)
    assert page.locator("#card-joints button:has-text('All on')").count() == 0
