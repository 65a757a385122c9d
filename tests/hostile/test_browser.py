"""A page in a real browser on the same machine tries all that a page can to reach the port: nothing of it runs.

Needs Chromium (``apt install chromium-headless-shell``); skipped where there is none.
"""

from __future__ import annotations

import contextlib
import http.server
import shutil
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

pytestmark = pytest.mark.e2e

NAMES = "chromium-headless-shell", "chromium", "chromium-browser", "google-chrome"
BROWSER = next(filter(None, map(shutil.which, NAMES)), None)
FLAGS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-extensions",
         "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage",
         "--disable-default-apps", "--no-proxy-server", "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1")
TIMEOUT_S = 60.0
"""Seconds for the browser to start, and for the page to try all."""

PAGE = """<!doctype html><title>page</title><body><script>
const at = "http://127.0.0.1:@PORT@", run = name => `System.system("touch @FOLDER@/${name}")`;
const attack = name => `*/;${run(name)};\\r\\n`, tried = [];
const attempt = (name, does) => tried.push((async () => {
  try {
    await Promise.race([does(attack(name), name), new Promise(over => setTimeout(over, 2000))]);
  } catch (refused) {}
})());
const loaded = part => new Promise(over => {
  part.onload = part.onerror = part.onclose = over; if (part.src) document.body.append(part); });
const form = (body, type) => { const sent = document.createElement("form"), into = document.createElement("iframe");
  into.name = "f" + tried.length; document.body.append(into);
  Object.assign(sent, {action: at, method: "POST", enctype: type, target: into.name});
  const field = document.createElement("textarea"); field.name = body; field.value = body; sent.append(field);
  document.body.append(sent); sent.submit(); return loaded(into); };
const element = (kind, src) => loaded(Object.assign(document.createElement(kind), {src}));
attempt("text", body => fetch(at, {method: "POST", body, mode: "no-cors", headers: {"Content-Type": "text/plain"}}));
attempt("cors", body => fetch(at, {method: "POST", body}));
attempt("put", body => fetch(at, {method: "PUT", body}));
attempt("long", body => fetch(at, {method: "POST", body: body.repeat(5000), mode: "no-cors"}));
attempt("again", async body => { for (let i = 0; i < 20; i++)
  await fetch(at, {method: "POST", body, mode: "no-cors"}).catch(() => 0); });
attempt("data", body => { const data = new FormData(); data.set("a", body);
  data.set(body, new Blob([body])); return fetch(at, {method: "POST", body: data, mode: "no-cors"}); });
attempt("form", body => form(body, "application/x-www-form-urlencoded"));
attempt("parts", body => form(body, "multipart/form-data"));
attempt("plain", body => form(body, "text/plain"));
attempt("image", (body, name) => element("img", `${at}/;${run(name)};?${body}`));
attempt("script", (body, name) => element("script", `${at}//;${run(name)};`));
attempt("frame", (body, name) => element("iframe", `${at}/*/;${run(name)};`));
attempt("socket", body => { const line = new WebSocket(at.replace("http", "ws"), ["x"]);
  line.onopen = () => line.send(body); return loaded(line); });
attempt("beacon", async body => navigator.sendBeacon(at, body));
attempt("tls", body => fetch(at.replace("http", "https"), {method: "POST", body, mode: "no-cors"}));
attempt("shutdown", () => fetch(`${at}/;shutdown;`, {mode: "no-cors"}));
Promise.all(tried).then(() => fetch(`/done?${tried.length}`));
</script>"""


class Site:
    """The web site with the page; ``done`` is set when the page has tried all."""

    def __init__(self, page: str) -> None:
        self.done = threading.Event()
        site = self

        class Answer(http.server.BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                if self.path.startswith("/done"):
                    site.done.set()
                body = page.encode() if self.path == "/" else b""
                self.send_response(200)
                self.send_header("Content-Type", "text/html; charset=utf-8")
                self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                self.wfile.write(body)

            def log_message(self, format: str, *args: object) -> None:
                pass

        self._server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Answer)
        self.url = f"http://127.0.0.1:{self._server.server_port}/"
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()


@contextlib.contextmanager
def visit(port: int, folder: Path) -> Iterator[Site]:
    """A browser that looks at the page."""
    assert BROWSER is not None
    site = Site(PAGE.replace("@PORT@", str(port)).replace("@FOLDER@", str(folder)))
    browser = subprocess.Popen(
        (BROWSER, *FLAGS, f"--user-data-dir={folder / 'profile'}", "--remote-debugging-port=0", site.url),
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        yield site
    finally:
        browser.terminate()
        try:
            browser.wait(10)
        except subprocess.TimeoutExpired:
            browser.kill()
            browser.wait()
        site.close()


class Recorder:
    """A port that takes what comes and answers nothing, to see what the page sends."""

    def __init__(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self.heard = b""
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                line, _ = self._listener.accept()
                threading.Thread(target=self._listen, args=(line,), daemon=True).start()

    def _listen(self, line: socket.socket) -> None:
        line.settimeout(0.5)
        with line, contextlib.suppress(OSError):
            while data := line.recv(65536):
                self.heard += data

    def close(self) -> None:
        self._listener.close()


needs_browser = pytest.mark.skipif(BROWSER is None, reason="no Chromium here: apt install chromium-headless-shell")


@needs_browser
def test_the_page_sends_what_it_should(tmp_path: Path) -> None:
    """Else the other test would show nothing."""
    recorder = Recorder()
    with visit(recorder.port, tmp_path) as site:
        assert site.done.wait(TIMEOUT_S)
    recorder.close()
    heard = recorder.heard.decode("latin-1")
    sent = ("text", "cors", "long", "again", "data", "parts", "plain", "beacon")
    assert [name for name in sent if f'*/;System.system("touch {tmp_path}/{name}");' not in heard] == []
    assert "Upgrade: websocket" in heard
    assert "GET /;shutdown; " in heard
    assert "\x16\x03" in heard


@needs_browser
def test_nothing_that_a_page_sends_runs(tmp_path: Path) -> None:
    port_file, log = tmp_path / "port", tmp_path / "log"
    command = (sys.executable, "-m", "urbihw.cli.urbi", "--quiet", "--port", "0", "--port-file", str(port_file))
    with log.open("w") as errors:
        server = subprocess.Popen(command, stdin=subprocess.DEVNULL, stderr=errors)
    try:
        end = time.monotonic() + TIMEOUT_S
        while not (port_file.exists() and port_file.read_text().endswith("\n")):
            assert server.poll() is None and time.monotonic() < end, log.read_text()
            time.sleep(0.01)
        port = int(port_file.read_text())
        with visit(port, tmp_path) as site:
            assert site.done.wait(TIMEOUT_S)
            with socket.create_connection(("127.0.0.1", port), TIMEOUT_S) as line:
                line.sendall(b"40 + 2;\n")
                assert line.recv(100).endswith(b"] 42\n")
        assert server.poll() is None
    finally:
        server.kill()
        server.wait()
    ran = sorted(path.name for path in tmp_path.iterdir())
    assert ran == ["log", "port", "profile"]
    assert "Traceback" not in log.read_text()
    assert len(log.read_text().splitlines()) < 20
