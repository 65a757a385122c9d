"""A network camera on TCP: ``/snapshot.jpg``, and ``/stream.mjpg`` as multipart/x-mixed-replace (mjpg-streamer).

Each picture is a JPEG of the size 320 x 240 with its number in a comment; no decoder is needed to tell them apart.
"""

from __future__ import annotations

import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

BOUNDARY = "boundarydonotcross"
PERIOD_S = 0.05


def picture(number: int, width: int = 320, height: int = 240) -> bytes:
    """A JPEG: start, comment, frame header (ITU-T T.81, B.2.2), end."""
    comment = b"picture %d" % number
    size = height.to_bytes(2, "big") + width.to_bytes(2, "big")
    frame = b"\xff\xc0\x00\x0b\x08" + size + b"\x01\x01\x11\x00"
    return b"\xff\xd8\xff\xfe" + (len(comment) + 2).to_bytes(2, "big") + comment + frame + b"\xff\xd9"


class NetCamera:
    """The camera; ``with`` starts and ends it.

    Attributes:
        sent: pictures sent.
        login: the value of the header Authorization that it demands; "" for none.
        with_length: whether it tells the length of each picture of the stream.
        silent: it answers nothing any more; garbage: what it sends instead of pictures.
    """

    def __init__(self) -> None:
        self.sent = 0
        self.login = ""
        self.with_length = True
        self.silent = False
        self.garbage = b""
        camera = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                camera._answer(self)

            def log_message(self, format: str, *args: object) -> None:
                pass

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._server.daemon_threads = True
        self._ended = threading.Event()

    @property
    def port(self) -> int:
        """The TCP port of the camera."""
        return self._server.server_address[1]

    def url(self, path: str, user: str = "") -> str:
        """The url of a path."""
        return f"http://{user}127.0.0.1:{self.port}{path}"

    def __enter__(self) -> NetCamera:
        threading.Thread(target=self._server.serve_forever, args=(0.02,), daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._server.shutdown()
        self._server.server_close()

    def _next(self) -> bytes:
        self.sent += 1
        return self.garbage or picture(self.sent)

    def _answer(self, request: BaseHTTPRequestHandler) -> None:
        if self.login and request.headers["Authorization"] != self.login:
            request.send_error(401)
        elif request.path == "/snapshot.jpg":
            data = self._next()
            request.send_response(200)
            request.send_header("Content-Type", "image/jpeg")
            request.send_header("Content-Length", str(len(data)))
            request.end_headers()
            request.wfile.write(data)
        elif request.path == "/stream.mjpg":
            request.send_response(200)
            request.send_header("Content-Type", f"multipart/x-mixed-replace;boundary={BOUNDARY}")
            request.end_headers()
            self._stream(request)
        else:
            request.send_error(404)

    def _stream(self, request: BaseHTTPRequestHandler) -> None:
        while not self._ended.is_set():
            if not self.silent:
                data = self._next()
                length = f"Content-Length: {len(data)}\r\n" if self.with_length else ""
                head = f"--{BOUNDARY}\r\nContent-Type: image/jpeg\r\n{length}\r\n".encode("ascii")
                try:
                    request.wfile.write(head + data + b"\r\n")
                except OSError:
                    return
            time.sleep(PERIOD_S)
