"""Pictures of a network camera on TCP; the kernel gets the newest only, and never waits."""

from __future__ import annotations

import base64
import sys
import time
from collections.abc import Callable, Iterator
from queue import Queue
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
from p3dx_lab import Lab

from urbihw.platforms import film, jpeg
from urbihw.platforms.film import Film, check_url
from urbihw.platforms.p3dx.options import P3dxOptions
from urbihw.settings import BadSetting
from urbihw_fakes.netcamera import NetCamera, picture

PATIENCE_S = 10.0


class Screen:
    """The kernel's side: functions wait in ``posted`` until ``take`` runs one."""

    def __init__(self, url: str) -> None:
        self.posted: Queue[Callable[[], None]] = Queue()
        self.shown: list[bytes] = []
        self.told: list[str] = []
        self.film = Film(url, self.posted.put, self.shown.append, self.told.append)

    def take(self, until: Callable[[], Any]) -> None:
        """Run what is posted until something is true."""
        while not until():
            self.posted.get(timeout=PATIENCE_S)()


@pytest.fixture
def camera() -> Iterator[NetCamera]:
    with NetCamera() as made:
        yield made


@pytest.mark.parametrize("path", ["/snapshot.jpg", "/stream.mjpg"])
@pytest.mark.parametrize("with_length", [True, False])
def test_pictures_come_one_after_the_other(camera: NetCamera, path: str, with_length: bool) -> None:
    camera.with_length = with_length
    screen = Screen(camera.url(path))
    screen.film.start()
    screen.take(lambda: len(screen.shown) >= 3)
    screen.film.stop()
    numbers = [next(n for n in range(1, 1000) if picture(n) == shown) for shown in screen.shown]
    assert numbers == sorted(set(numbers))
    assert jpeg.size_of(screen.shown[0]) == (320, 240)
    assert screen.told == []


def test_a_kernel_that_is_busy_gets_the_newest_picture_only(camera: NetCamera) -> None:
    screen = Screen(camera.url("/stream.mjpg"))
    screen.film.start()
    first = screen.posted.get(timeout=PATIENCE_S)
    while camera.sent < 10:
        assert screen.posted.empty()
    first()
    screen.film.stop()
    assert len(screen.shown) == 1 and screen.shown[0] not in [picture(n) for n in range(1, 6)]


def test_a_camera_that_is_gone_is_told_once_and_comes_back(camera: NetCamera, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(film, "RETRY_S", 0.05)
    camera.login = "Basic " + base64.b64encode(b"pilot:se:cret").decode()
    refused = Screen(camera.url("/snapshot.jpg"))
    refused.film.start()
    refused.take(lambda: refused.told)
    camera.login = ""
    refused.take(lambda: len(refused.told) > 1)
    refused.film.stop()
    assert refused.told == ["the camera at 127.0.0.1 gives no picture: it answers 401 'Unauthorized'", ""]


def test_its_password_is_sent_and_not_told(camera: NetCamera) -> None:
    camera.login = "Basic " + base64.b64encode(b"pilot:se:cret").decode()
    screen = Screen(camera.url("/stream.mjpg", "pilot:se%3Acret@"))
    screen.film.start()
    screen.take(lambda: screen.shown)
    camera.garbage = b"<html>"
    screen.take(lambda: screen.told)
    screen.film.stop()
    assert screen.told == ["the camera at 127.0.0.1 gives no picture: what it sends is no JPEG"]


def test_a_silent_camera_is_told(camera: NetCamera, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(film, "TIMEOUT_S", 0.2)
    screen = Screen(camera.url("/stream.mjpg"))
    screen.film.start()
    screen.take(lambda: screen.shown)
    camera.silent = True
    screen.take(lambda: screen.told)
    screen.film.stop()
    assert "timed out" in screen.told[0]


@pytest.mark.parametrize("path", ["/snapshot.jpg", "/stream.mjpg"])
def test_a_picture_without_end_is_refused(camera: NetCamera, monkeypatch: pytest.MonkeyPatch, path: str) -> None:
    monkeypatch.setattr(film, "MAX_BYTES", 5000)
    camera.garbage = b"\xff\xd8" + bytes(6000)
    screen = Screen(camera.url(path))
    screen.film.start()
    screen.take(lambda: screen.told)
    screen.film.stop()
    assert "bytes" in screen.told[0] and not screen.shown


def test_a_camera_of_linux_is_asked_for_jpegs(monkeypatch: pytest.MonkeyPatch) -> None:
    """linuxpy itself needs a device: here its place is taken by what its documentation describes."""
    asked: list[Any] = []

    class Capture(list[bytes]):
        def __init__(self, device: Any) -> None:
            super().__init__([picture(1), picture(2)])

        def set_format(self, *wanted: Any) -> None:
            asked.append(wanted)

        def __enter__(self) -> Capture:
            return self

        def __exit__(self, *_: object) -> None:
            pass

    class Device:
        def __init__(self, path: str) -> None:
            asked.append(path)

        def __enter__(self) -> Device:
            return self

        def __exit__(self, *_: object) -> None:
            pass

    device: Any = ModuleType("linuxpy.video.device")
    device.__dict__.update(vars(SimpleNamespace(Device=Device, VideoCapture=Capture, V4L2Error=RuntimeError)))
    for name, module in (("linuxpy", ModuleType("linuxpy")), ("linuxpy.video", ModuleType("linuxpy.video"))):
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setitem(sys.modules, "linuxpy.video.device", device)
    screen = Screen("v4l2:/dev/video0")
    screen.film.start()
    screen.take(lambda: screen.shown)
    screen.film.stop()
    assert asked[:2] == ["/dev/video0", (640, 480, "MJPG")]


@pytest.mark.parametrize(
    ("url", "good"),
    [("http://10.0.0.9/a.jpg", True), ("https://user:x@cam/stream", True), ("v4l2:/dev/video0", True),
     ("ftp://cam/x", False), ("cam.jpg", False), ("http://", False), ("http://cam:99999/x", False), ("v4l2:", False)],
)  # fmt: skip
def test_urls(url: str, good: bool) -> None:
    assert (check_url(url) == "") is good


def test_a_pioneer_shows_the_pictures_of_a_network_camera(camera: NetCamera) -> None:
    lab = Lab.ready(camera_url=camera.url("/stream.mjpg"))
    assert lab.look("P3dx.body.camera.frames") == "0"
    lab.say("var pictures = 0|; at (P3dx.body.camera.val->changed?) pictures++;")
    begun = time.monotonic()
    while lab.number("P3dx.body.camera.frames") < 3 and time.monotonic() - begun < PATIENCE_S:
        lab.say("P3dx.body.camera.val|;", 0.02)
    assert lab.look("[P3dx.body.camera.width, P3dx.body.camera.height]") == "[320, 240]"
    assert "jpeg 320 240" in lab.look("P3dx.body.camera.val.keywords")
    lab.say("P3dx.body.camera.load = 1; P3dx.body.camera.yaw = 0.3;", 0.5)
    assert lab.number("P3dx.body.camera.yaw") == 0.3
    lab.robot.close()


def test_a_pioneer_with_a_wrong_url_says_so() -> None:
    with pytest.raises(BadSetting, match="camera_url"):
        P3dxOptions.of({"camera_url": "cam.jpg"})
