"""Pictures of a camera that is not on the robot's own wire: a network camera, or one of Linux (V4L2).

    http://host/snapshot.jpg     one JPEG for each request, asked for again and again
    http://host/stream.mjpg      a stream of JPEGs (multipart/x-mixed-replace), as mjpg-streamer sends
    v4l2:/dev/video0             a camera of Linux that makes JPEGs, by the package linuxpy (extra ``camera``)

A thread reads them while somebody wants them.  The kernel gets the newest picture only: what it could not take in
meanwhile is dropped.
"""

from __future__ import annotations

import base64
import contextlib
import importlib
import threading
from collections.abc import Callable, Iterator
from http.client import HTTPConnection, HTTPException, HTTPResponse, HTTPSConnection
from typing import Any, Final
from urllib.parse import SplitResult, unquote, urlsplit

from urbihw.extras import install_command
from urbihw.platforms import jpeg

MAX_BYTES: Final = 8 * 1024 * 1024
"""The longest picture."""
TIMEOUT_S: Final = 5.0
"""Seconds without a byte after which a camera counts as gone."""
RETRY_S: Final = 2.0
"""Seconds until it is tried again."""
SNAPSHOT_PERIOD_S: Final = 0.1
"""Seconds between two snapshots."""
V4L2: Final = "v4l2:"
V4L2_SIZE: Final = (640, 480)
_LONGEST_LINE: Final = 4096
_MOST_LINES: Final = 100
"""Lines of the head of a picture in a stream."""


class BadCamera(Exception):
    """A camera that gives no pictures; the message says why, without the password of its url."""


def check_url(url: str) -> str:
    """Why a url cannot be that of a camera; "" if it can."""
    if url.startswith(V4L2 + "/"):
        return ""
    try:
        parts = urlsplit(url)
        is_web = parts.scheme in ("http", "https") and bool(parts.hostname) and (parts.port or 80) > 0
    except ValueError:
        is_web = False
    return "" if is_web else "write http://HOST/PATH of a JPEG or of an MJPEG stream, or v4l2:/dev/video0"


class Film:
    """The pictures of one camera."""

    def __init__(
        self,
        url: str,
        post: Callable[[Callable[[], None]], None],
        show: Callable[[bytes], None],
        tell: Callable[[str], None],
    ) -> None:
        """``post`` runs a function in the kernel's thread; there ``show`` gets each picture, and ``tell`` why none
        come: once, and "" when they come again."""
        self._url, self._post, self._show, self._tell = url, post, show, tell
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._wanted = False
        self._unwanted = threading.Event()
        self._newest: bytes | None = None
        self._problem = ""

    def start(self) -> None:
        """Begin to read pictures."""
        with self._lock:
            self._wanted = True
            self._unwanted.clear()
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="camera", daemon=True)
                self._thread.start()

    def stop(self) -> None:
        """Read no more, without waiting for the thread, which ends with the next picture or its timeout."""
        with self._lock:
            self._wanted = False
            self._newest = None
            self._unwanted.set()

    def _run(self) -> None:
        while True:
            try:
                for picture in pictures_of(self._url, self._unwanted):
                    if not self._wanted:
                        break
                    self._offer(picture)
                self._unwanted.wait(SNAPSHOT_PERIOD_S)
            except BadCamera as error:
                self._report(str(error))
                self._unwanted.wait(RETRY_S)
            with self._lock:
                if not self._wanted:
                    self._thread = None
                    return

    def _offer(self, picture: bytes) -> None:
        self._report("")
        with self._lock:
            waits, self._newest = self._newest is not None, picture
        if not waits:
            self._post(self._take)

    def _take(self) -> None:
        with self._lock:
            picture, self._newest = self._newest, None
        if picture is not None:
            self._show(picture)

    def _report(self, problem: str) -> None:
        if problem != self._problem:
            self._problem = problem
            self._post(lambda: self._tell(problem))


def pictures_of(url: str, unwanted: threading.Event) -> Iterator[bytes]:
    """The JPEGs of a camera, until it ends them or ``unwanted`` is set.  Raises BadCamera."""
    if url.startswith(V4L2):
        yield from _linux_pictures(url.removeprefix(V4L2))
        return
    parts = urlsplit(url)
    try:
        yield from _web_pictures(parts, unwanted)
    except (OSError, HTTPException, ValueError) as error:
        why = str(error) or type(error).__name__
        raise BadCamera(f"the camera at {parts.hostname} gives no picture: {why}") from error


# --- network ----------------------------------------------------------------------------------------------------------


def _web_pictures(parts: SplitResult, unwanted: threading.Event) -> Iterator[bytes]:
    kind = HTTPSConnection if parts.scheme == "https" else HTTPConnection
    path = (parts.path or "/") + (f"?{parts.query}" if parts.query else "")
    with contextlib.closing(kind(parts.hostname or "", parts.port, timeout=TIMEOUT_S)) as connection:
        while not unwanted.is_set():
            connection.request("GET", path, headers=_credentials(parts))
            answer = connection.getresponse()
            if answer.status != 200:
                raise ValueError(f"it answers {answer.status} {answer.reason[:60]!r}")
            if answer.headers.get_content_maintype() == "multipart":
                yield from _stream(answer, unwanted)
                raise ValueError("the stream has ended")
            yield _checked(answer.read(MAX_BYTES + 1))
            answer.close()
            unwanted.wait(SNAPSHOT_PERIOD_S)


def _credentials(parts: SplitResult) -> dict[str, str]:
    if parts.username is None:
        return {}
    pair = f"{unquote(parts.username)}:{unquote(parts.password or '')}"
    return {"Authorization": "Basic " + base64.b64encode(pair.encode()).decode("ascii")}


def _stream(answer: HTTPResponse, unwanted: threading.Event) -> Iterator[bytes]:
    """The parts of multipart/x-mixed-replace: a boundary, a head, and a picture, with or without its length."""
    while not unwanted.is_set():
        length = _read_head(answer)
        if length is None:
            return
        if length > MAX_BYTES:
            raise ValueError(f"a picture of {length} bytes")
        yield _checked(answer.read(length) if length else _read_to_end(answer))


def _read_head(answer: HTTPResponse) -> int | None:
    """The length that the head of a picture tells, 0 if it tells none; None at the end of the stream."""
    length, has_begun = 0, False
    for _ in range(_MOST_LINES):
        line = answer.readline(_LONGEST_LINE)
        if not line:
            return None
        name, _, value = line.partition(b":")
        if line.startswith(b"--"):
            has_begun = True
        elif name.strip().lower() == b"content-length" and value.strip()[:9].isdigit():
            length = int(value.strip()[:9])
        elif has_begun and not line.strip():
            return length
    raise ValueError("its stream has no pictures")


def _read_to_end(answer: HTTPResponse) -> bytes:
    """A picture without a length, up to the end that it marks itself."""
    data = bytearray()
    while len(data) <= MAX_BYTES:
        piece = answer.readline(65536)
        data += piece
        if not piece or data.rstrip(b"\r\n").endswith(jpeg.END):
            break
    return bytes(data.rstrip(b"\r\n"))


def _checked(picture: bytes) -> bytes:
    if len(picture) > MAX_BYTES:
        raise ValueError(f"a picture of more than {MAX_BYTES} bytes")
    if not picture.startswith(jpeg.START):
        raise ValueError("what it sends is no JPEG")
    return picture


# --- Linux ------------------------------------------------------------------------------------------------------------


def _linux_pictures(path: str) -> Iterator[bytes]:
    try:
        video: Any = importlib.import_module("linuxpy.video.device")
    except ImportError as error:
        raise BadCamera(f"pictures of {path} need linuxpy: {install_command('camera')}") from error
    try:
        with video.Device(path) as device:
            capture = video.VideoCapture(device)
            capture.set_format(*V4L2_SIZE, "MJPG")
            with capture:
                for frame in capture:
                    yield _checked(bytes(frame))
    except (OSError, ValueError, video.V4L2Error) as error:
        raise BadCamera(f"{path} gives no picture: {error}") from error
