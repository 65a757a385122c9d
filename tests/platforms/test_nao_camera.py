"""The camera of a Nao: each slot of the manual, proven by what is in the pictures and what the robot was asked."""

from __future__ import annotations

import io
import math
from dataclasses import replace
from typing import Any

import pytest
from nao_lab import Lab, stand

from urbihw.buses.errors import BadValue
from urbihw.cli.pictures import PictureFile as ShownPicture
from urbihw.client.lines import Binary
from urbihw.extras import install_command
from urbihw.kernel.uobject import UImage
from urbihw.platforms.streamed import LINGER_S
from urbihw_nao import camera, pictures
from urbihw_nao.camera_part import PICTURE_TIMEOUT_S, RETRY_S
from urbihw_nao.pictures import CameraMode, read_picture
from urbihw_nao_fakes.device import Nao
from urbihw_nao_fakes.video import HALF_ANGLE, HEIGHTS, TILTS

COLOURS = {"red": (200, 30, 30), "green": (30, 160, 30), "blue": (30, 30, 200), "yellow": (210, 200, 30)}
WALLS = {"red": (0.0, 3.0), "green": (math.pi / 2, 2.5), "blue": (math.pi, 3.0), "yellow": (-math.pi / 2, 2.5)}
"""The direction in which a wall lies, and how far from the middle of the room, as the fake says."""
WALL_HEIGHT = 1.2


def picture(lab: Lab, seconds: float = 1.0) -> UImage:
    """The newest picture."""
    lab.look("camera.val")
    lab.run(seconds)
    image = lab.robot.camera.val.sensed
    assert isinstance(image, UImage)
    return image


def filming(text: str = "", **options: Any) -> Lab:
    """A lab whose camera is on."""
    lab = Lab.ready(**options)
    stand(lab.device.body)
    lab.run(0.3)
    assert lab.say(f"camera.load = 1; {text}").endswith("1" if not text else "")
    return lab


def rows_of(image: UImage) -> list[list[tuple[int, ...]]]:
    """The pixels of an RGB picture."""
    data = bytes(image.data)
    pixels = [tuple(data[at : at + 3]) for at in range(0, len(data), 3)]
    return [pixels[at : at + image.width] for at in range(0, len(pixels), image.width)]


def pose_of(image: UImage, height: float) -> dict[str, float]:
    """What an RGB picture tells of the pose of a camera at this height, in m and rad.

    A wall d away, whose direction is a, lies as deep as d / (cos a + u / f sin a) in column u, so the distance between
    its edges is a straight line in the picture; where the level of the camera lies between them is the pitch.
    """
    rows, focal = rows_of(image), image.width / 2 / math.tan(HALF_ANGLE)
    found: dict[str, list[tuple[float, float, float]]] = {}
    for column in range(2, image.width - 2, 2):
        for name, colour in COLOURS.items():
            seen = [row for row in range(image.height) if rows[row][column] == colour]
            if seen and seen[0] > 0 and seen[-1] < image.height - 1:
                aside = image.width / 2 - 0.5 - column
                found.setdefault(name, []).append((aside, float(seen[-1] + 1 - seen[0]), float(seen[0])))
    pose: dict[str, float] = {}
    for name, edge in sorted(found.items(), key=lambda row: len(row[1])):
        if len(edge) < 10:
            continue
        n = len(edge)
        mu, mh = sum(row[0] for row in edge) / n, sum(row[1] for row in edge) / n
        slope = sum((u - mu) * (h - mh) for u, h, _ in edge) / sum((u - mu) ** 2 for u, _, _ in edge)
        middle = (mh - slope * mu) / focal
        distance, direction = WALL_HEIGHT / math.hypot(middle, slope), math.atan2(slope, middle)
        where, far = WALLS[name]
        pose["heading"] = math.remainder(where - direction, math.tau)
        axis, sign = {"red": ("x", 1), "green": ("y", 1), "blue": ("x", -1), "yellow": ("y", -1)}[name]
        pose[axis] = sign * (far - distance)
        level = [top + high * (WALL_HEIGHT - height) / WALL_HEIGHT for _, high, top in edge]
        pose["pitch"] = math.atan((image.height / 2 - sum(level) / n) / focal)
    return pose


# ---------------------------------------------------------------- on and off


def test_it_is_off_by_default_and_nothing_is_asked_of_the_robot() -> None:
    lab = Lab.ready()
    assert lab.look("[camera.load, camera.rate, camera.threaded, camera.on]") == "[0, 4, 1, false]"
    assert picture(lab).data == b""
    assert (lab.device.video.subscribers, lab.others) == ({}, {})


def test_it_is_on_while_somebody_reads() -> None:
    lab = filming()
    assert picture(lab).keywords == "jpeg 320 240"
    assert len(lab.device.video.subscribers) == 1
    lab.run(LINGER_S + 0.5)
    assert (lab.look("camera.on"), lab.device.video.subscribers, lab.others) == ("false", {}, {})
    sent = lab.device.video.sent
    lab.run(1.0)
    assert lab.device.video.sent == sent


def test_it_is_on_while_somebody_follows_and_load_ends_it() -> None:
    lab = filming()
    lab.say("at (camera.val->changed?) 1,", 2 * LINGER_S)
    assert lab.look("camera.on") == "true"
    lab.say("camera.load = 0;", 0.1)
    assert (lab.look("camera.on"), lab.device.video.subscribers, lab.others) == ("false", {}, {})
    lab.say("camera.load = 1;", 1.0)
    assert lab.look("camera.on") == "true"


# ---------------------------------------------------------------- what is in the pictures


@pytest.mark.parametrize(
    ("x", "y", "degrees", "yaw", "pitch"),
    [(0, 0, 0, 0, 0), (0.5, 0.4, 10, 0.3, 0.1), (-0.4, 0.3, 90, -0.4, 0.0), (0.2, -0.5, -80, 0.0, -0.1)],
)
def test_the_pose_is_read_back_from_the_picture(x: float, y: float, degrees: float, yaw: float, pitch: float) -> None:
    lab = filming("camera.formatDetail = 1|; camera.resolution = 0|;")
    body = lab.device.body
    body.x, body.y, body.heading = x, y, math.radians(degrees)
    lab.say(f"HeadYaw.val = {yaw}; HeadPitch.val = {pitch};", 1.0)
    found = pose_of(picture(lab), HEIGHTS["standing"])
    assert math.remainder(found["heading"] - math.radians(degrees) - yaw, math.tau) == pytest.approx(0, abs=0.02)
    assert found["pitch"] == pytest.approx(pitch + TILTS[0], abs=0.01)
    assert all(found.get(name, true) == pytest.approx(true, abs=0.05) for name, true in (("x", x), ("y", y)))


def test_the_index_chooses_the_camera() -> None:
    lab = filming("camera.formatDetail = 6|;")
    top = bytes(picture(lab).data)
    lab.say("camera.index = 1;", 0.5)
    (client,) = lab.device.video.subscribers.values()
    assert client.camera == 1
    assert bytes(picture(lab).data) != top
    assert "this slot takes one of 0, 1" in lab.say("camera.index = 2;")


@pytest.mark.parametrize(
    ("detail", "keywords", "size", "space"),
    [
        (1, "rgb 320 240", 230_400, 11),
        (2, "ycbcr 320 240", 230_400, 10),
        (4, "ppm 320 240", 230_415, 11),
        (5, "yuv422 320 240", 153_600, 9),
        (6, "grey8 320 240", 76_800, 0),
        (7, "grey4 320 240", 38_400, 0),
    ],
)
def test_raw_formats(detail: int, keywords: str, size: int, space: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(camera, "has_pillow", lambda: False)
    lab = Lab.ready()
    lab.say(f"camera.formatDetail = {detail}; camera.load = 1;")
    image = picture(lab)
    (client,) = lab.device.video.subscribers.values()
    assert (image.keywords, len(image), client.space) == (keywords, size, space)
    assert lab.look("camera.format") == "0"


def test_what_raw_formats_show_is_the_same_room() -> None:
    lab = filming("camera.formatDetail = 1|; camera.resolution = 3|;")
    rgb = bytes(picture(lab).data)
    images = {}
    for detail in (2, 4, 5, 6, 7):
        lab.say(f"camera.formatDetail = {detail};", 0.6)
        images[detail] = bytes(picture(lab).data)
    assert images[4] == b"P6\n80 60\n255\n" + rgb
    grey = bytes(
        round(0.299 * r + 0.587 * g + 0.114 * b) for r, g, b in zip(rgb[0::3], rgb[1::3], rgb[2::3], strict=True)
    )
    assert images[6] == images[2][0::3] == images[5][0::2] == grey
    assert images[7] == bytes(left & 0xF0 | right >> 4 for left, right in zip(grey[0::2], grey[1::2], strict=True))


def test_jpeg_shows_the_same_room_and_quality_is_its_size() -> None:
    Image = pytest.importorskip("PIL.Image")
    lab = filming("camera.formatDetail = 1|;")
    rgb = bytes(picture(lab).data)
    assert lab.say("camera.format = 1; camera.formatDetail; camera.quality = 90;", 0.6) == "1\n3\n90"
    fine = picture(lab)
    shown = Image.open(io.BytesIO(bytes(fine.data))).convert("RGB")
    assert shown.size == (320, 240)
    differences = [abs(a - b) for a, b in zip(shown.tobytes(), rgb, strict=True)]
    assert sum(differences) / len(differences) < 3
    lab.say("camera.quality = 5;", 0.6)
    assert len(picture(lab)) < len(fine) * 0.8
    lab.say("camera.format = 0;", 0.6)
    assert (picture(lab).keywords, lab.look("camera.formatDetail")) == ("ycbcr 320 240", "2")


def test_resolutions() -> None:
    lab = filming("camera.formatDetail = 6|;")
    for resolution, width, height in ((0, 640, 480), (1, 320, 240), (2, 160, 120), (3, 80, 60)):
        lab.say(f"camera.resolution = {resolution};", 0.0)
        assert lab.look("[camera.width, camera.height]") == f"[{width}, {height}]"
        lab.run(0.5)
        assert (picture(lab).keywords, len(picture(lab))) == (f"grey8 {width} {height}", width * height)
    assert "this slot takes one of 0, 1, 2, 3" in lab.say("camera.resolution = 4;")
    assert lab.look("camera.resolution") == "3"
    assert "this slot can only be read" in lab.say("camera.width = 5;")


def test_no_picture_of_another_kind_is_left_when_the_kind_changes() -> None:
    lab = filming("camera.formatDetail = 6|;")
    lab.say("loop { camera.val | sleep(500ms) },", 1.0)
    seen: list[str] = []

    def note(image: UImage) -> None:
        seen.append(f"{image.keywords} {len(image)}")

    lab.robot.camera.val.notify_change(note)
    lab.say("camera.resolution = 2;", 0.0)
    assert lab.look("camera.val").startswith("BIN 0") and seen.pop().endswith(" 0")
    lab.run(1.0)
    assert seen and set(seen) == {"grey8 160 120 19200"}
    lab.say("camera.quality = 50; camera.rate = 8; camera.resolution = 2;", 0.0)
    assert "19200" in lab.look("camera.val")[:40]


def test_a_large_raw_picture_comes_whole() -> None:
    lab = filming("camera.formatDetail = 1|; camera.resolution = 0|;")
    assert len(picture(lab)) == 921_600
    assert {pixel for row in rows_of(picture(lab)) for pixel in row} <= {(235,) * 3, (90,) * 3, *COLOURS.values()}


def test_the_angles_of_view_are_those_of_the_picture() -> None:
    lab = filming()
    assert lab.look("camera.xfov") == "nan"
    picture(lab)
    assert lab.number("camera.xfov") == pytest.approx(1.0641, abs=1e-3)
    assert lab.number("camera.yfov") == pytest.approx(0.8315, abs=1e-2)


# ---------------------------------------------------------------- how many


@pytest.mark.parametrize("rate", [0.5, 4.0, 10.0, 25.0])
def test_the_rate_is_kept_and_never_exceeded(rate: float) -> None:
    lab = filming(f"camera.formatDetail = 6|; camera.resolution = 3|; camera.rate = {rate}|;")
    lab.say("loop { camera.val | sleep(1s) },", 3.0)
    video, before = lab.device.video, lab.number("camera.frames")
    asked, sent = video.calls["getImageRemote"], video.sent
    lab.run(6.0)
    asked, sent, shown = video.calls["getImageRemote"] - asked, video.sent - sent, lab.number("camera.frames") - before
    assert rate * 6 * 0.9 - 1 <= shown <= rate * 6 + 1
    assert abs(shown - sent) <= 1 and asked <= rate * 6 + 1


def test_one_picture_is_asked_for_at_a_time_and_a_slow_network_delays_only_pictures() -> None:
    lab = filming("head.load = 1|; camera.rate = 10|;")
    lab.say("loop { camera.val | sleep(500ms) },", 1.0)
    lab.delay = 1.5
    asked, cycles = lab.device.video.calls["getImageRemote"], lab.device.memory.calls["getListData"]
    lab.say("HeadYaw.val = 0 sin:2s ampli:1,", 6.0)
    assert lab.device.video.calls["getImageRemote"] - asked <= 5
    assert lab.device.memory.calls["getListData"] - cycles > 200
    assert lab.look("nao.link") == "true"
    yaw = lab.device.body.joints["HeadYaw"].angle
    lab.run(0.5)
    assert abs(lab.device.body.joints["HeadYaw"].angle - yaw) > 0.3


def test_settings_of_the_sensor_are_calls_of_the_service() -> None:
    lab = Lab.ready()
    lab.say('ALProxy("VideoDevice", ["video"])|; video.setParameter(0, 0, 70);', 0.5)
    assert lab.say("video.getParameter(0, 0);", 0.5) == "70"


# ---------------------------------------------------------------- what goes wrong


def test_handles_that_an_earlier_worker_has_left_are_given_back_at_the_login() -> None:
    robot = Nao()
    for _ in range(6):
        assert robot.video.subscribe("urbihw", 0, 1, 9, 4)
    other = robot.video.subscribe("another", 0, 1, 9, 4)
    lab = Lab.ready(robot)
    assert list(robot.video.subscribers) == [other]
    lab.say("camera.load = 1;")
    assert len(picture(lab)) > 0


def test_switching_on_and_off_while_naoqi_answers_leaves_no_handles() -> None:
    lab = filming()
    for seconds in (0.0, 0.02, 0.04, 0.06, 0.08, 0.02, 0.04, 0.06):
        lab.say("camera.load = 1; camera.val|;", seconds)
        lab.say("camera.load = 0;", 0.1)
    lab.say("camera.load = 1;")
    assert len(picture(lab)) > 0 and len(lab.device.video.subscribers) == 1


def test_a_stop_gives_the_handle_back_and_pictures_go_on() -> None:
    lab = filming()
    lab.say("loop { camera.val | sleep(500ms) },", 1.0)
    released = lab.device.video.calls["unsubscribe"]
    lab.say("robot.stop;", 0.04)
    assert lab.device.video.calls["unsubscribe"] == released + 1
    frames = lab.number("camera.frames")
    lab.run(1.5)
    assert lab.number("camera.frames") > frames + 3 and len(lab.device.video.subscribers) == 1


def test_the_end_of_a_worker_gives_the_handle_back() -> None:
    lab = filming()
    picture(lab)
    assert lab.worker is not None and len(lab.device.video.subscribers) == 1
    lab.worker.stop()
    lab.worker._engine.run()
    assert lab.device.video.subscribers == {}


def test_it_goes_on_after_a_lost_link_with_the_same_settings() -> None:
    lab = filming("camera.formatDetail = 6|; camera.resolution = 2|;")
    lab.say("loop { camera.val | sleep(500ms) },", 1.0)
    lab.unplug()
    lab.run(1.0)
    lab.end.replug()
    lab.run(4.0)
    frames = lab.number("camera.frames")
    lab.run(2.0)
    assert lab.number("camera.frames") > frames + 5
    assert (picture(lab).keywords, len(lab.device.video.subscribers)) == ("grey8 160 120", 1)


def test_a_lost_second_connection_costs_only_pictures(caplog: pytest.LogCaptureFixture) -> None:
    lab = filming("head.load = 1|;")
    lab.say("loop { camera.val | sleep(500ms) },", 1.0)
    (end,) = lab.others
    end.hang_up()
    lab.run(0.5)
    assert lab.look("nao.link") == "true"
    assert "camera: " in caplog.text and "trying again" in caplog.text
    frames = lab.number("camera.frames")
    lab.run(RETRY_S + 1.5)
    assert lab.number("camera.frames") > frames + 3 and len(lab.device.video.subscribers) == 1


def test_a_handle_that_naoqi_has_dropped_is_asked_for_again(caplog: pytest.LogCaptureFixture) -> None:
    lab = filming()
    lab.say("loop { camera.val | sleep(500ms) },", 1.0)
    lab.device.video.subscribers.clear()
    lab.run(1.0)
    assert "camera: getImageRemote: NAOqi has no picture" in caplog.text
    frames = lab.number("camera.frames")
    lab.run(RETRY_S + 1.0)
    assert lab.number("camera.frames") > frames + 2


def test_a_camera_that_naoqi_does_not_give_is_said_and_asked_for_again(caplog: pytest.LogCaptureFixture) -> None:
    lab = filming()
    methods = lab.device.video.methods
    kept = dict(methods)
    for uid, method in kept.items():
        if method.name == "subscribeCamera":
            methods[uid] = replace(method, run=lambda *_: "")
    picture(lab)
    assert "subscribeCamera: NAOqi gives no handle" in caplog.text
    assert lab.device.video.calls["subscribeCamera"] == 1
    methods.update(kept)
    lab.look("camera.val")
    assert len(picture(lab, RETRY_S)) > 0


def test_a_robot_without_cameras_says_so_when_they_are_used() -> None:
    robot = Nao()
    for number, service in list(robot.services.items()):
        if service.name == "ALVideoDevice":
            del robot.services[number]
    lab = Lab.ready(robot)
    assert "this robot has no ALVideoDevice: there are no pictures" in lab.say("camera.load = 1;")
    assert lab.look("camera.load") == "0"


def test_without_pillow_jpeg_is_an_error_that_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(camera, "has_pillow", lambda: False)
    lab = Lab.ready()
    assert install_command("images") in lab.say("camera.load = 1;")
    assert "this slot takes one of 1, 2, 3, 4, 5, 6, 7" in lab.say("camera.formatDetail = 8;")
    lab.say("camera.formatDetail = 1; camera.load = 1;")
    assert install_command("images") in lab.say("camera.format = 1;")
    assert picture(lab).keywords == "rgb 320 240"


def test_a_silent_picture_is_given_up(caplog: pytest.LogCaptureFixture) -> None:
    lab = filming()
    lab.delay = 3600.0
    lab.say("loop { camera.val | sleep(500ms) },", PICTURE_TIMEOUT_S + RETRY_S + 1.0)
    assert lab.look("nao.link") == "true" and "camera: " in caplog.text


MODE = CameraMode(0, 3, 6, 75, 4.0)
GOOD: tuple[Any, ...] = (80, 60, 1, 0, 5, 5, bytes(4800), 0, 0.5, -0.4, -0.5, 0.4)


def changed(at: int, value: Any) -> tuple[Any, ...]:
    """A picture with one element changed."""
    return (*GOOD[:at], value, *GOOD[at + 1 :])


@pytest.mark.parametrize("answer", [None, [], (), 0, "x", changed(0, 0)[:1], (0, 0, 0, 0, 0, 0, b"", 0, 0, 0, 0, 0)])
def test_answers_without_a_picture(answer: Any) -> None:
    assert read_picture(answer, MODE) is None


@pytest.mark.parametrize(
    "answer",
    [
        changed(0, 81), changed(1, 1 << 30), changed(3, 11), changed(6, bytes(4799)), changed(6, bytes(4801)),
        changed(6, "x" * 4800), changed(6, None), changed(0, "x"), changed(8, None), GOOD[:7],
    ],
)  # fmt: skip
def test_pictures_that_are_none_are_refused(answer: Any) -> None:
    with pytest.raises(BadValue):
        read_picture(answer, MODE)


def test_a_picture_may_be_a_list_and_its_bytes_a_bytearray() -> None:
    found = read_picture([*changed(6, bytearray(4800))], MODE)
    assert found is not None and (found.width, found.height, found.keyword) == (80, 60, "grey8")
    strange = read_picture(changed(8, math.inf), replace(MODE))
    assert strange is not None and math.isnan(strange.xfov)


def test_formats_have_the_numbers_of_the_manual() -> None:
    assert [pictures.FORMATS[number].keyword for number in range(1, 8)] == [
        "rgb", "ycbcr", "jpeg", "ppm", "yuv422", "grey8", "grey4",
    ]  # fmt: skip


@pytest.mark.parametrize("detail", range(1, 8))
def test_the_image_program_shows_the_same_room_in_each_format(detail: int) -> None:
    pytest.importorskip("PIL")
    lab = filming(f"camera.resolution = 2|; camera.formatDetail = {detail}|;")
    image = picture(lab)
    shown = ShownPicture.of(Binary(image.keywords, bytes(image.data))).decoded().convert("L")
    lab.say("camera.formatDetail = 6;", 1.0)
    grey = bytes(picture(lab).data)
    differences = [abs(a - b) for a, b in zip(shown.tobytes(), grey, strict=True)]
    assert sum(differences) / len(differences) < (9 if detail == 7 else 3)
