"""Calls of modules by HTTP: ``/?eval=Module.method(args)`` (manual), and who may not."""

from __future__ import annotations

import base64
import socket
from collections.abc import Callable, Iterator
from typing import Any
from urllib.parse import quote

import pytest
from nao_caller import Plug
from nao_lab import Lab

from urbihw.settings import BadSetting
from urbihw_nao.http_request import LARGEST
from urbihw_nao.http_visitor import REQUEST_TIMEOUT_S, HttpVisitor, find_allowed_hosts, write_value
from urbihw_nao.literals import DEEPEST, parse_call
from urbihw_nao.options import NaoOptions
from urbihw_nao.qimessaging.login import Login
from urbihw_nao.qimessaging.login_guard import LoginGuard

MODULE = """
var Global.mathematics = ALModule.new("mathematics")|;
function mathematics.add(a, b) { return a + b }|;
function mathematics.echoOf(x) { return x }|;
function mathematics.secret() { return 42 }|;
function mathematics.slow() { sleep(1s); Global.done = 1 }|;
mathematics.bindUrbiMethod("add", "", [["a", ""], ["b", ""]], []);
mathematics.bindUrbiMethod("echoOf", "", [["x", ""]], []);
mathematics.bindUrbiMethod("slow", "", [], []);
var Global.done = 0|;
"""
FIREFOX = "Mozilla/5.0 (X11; Linux x86_64; rv:128.0) Gecko/20100101 Firefox/128.0"


def free_port() -> int:
    """A port without a listener."""
    with socket.create_server(("127.0.0.1", 0)) as found:
        port: int = found.getsockname()[1]
        return port


class HttpLab:
    """A robot, and what a client reads over HTTP."""

    def __init__(self, **options: Any) -> None:
        self.port = free_port()
        self.lab = Lab.ready(module_http_port=self.port, **options)
        assert self.lab.say(MODULE, 0.5) == ""

    def plug(self) -> Plug:
        """A connection."""
        return Plug(("127.0.0.1", self.port), lambda: self.lab.run(self.lab.tick))

    def fetch(self, data: bytes) -> tuple[int, str, str]:
        """Status, head, and what stands in PRE."""
        with self.plug() as plug:
            plug.send(data)
            plug.until(lambda: plug.closed)
            head, _, body = plug.data.decode().partition("\r\n\r\n")
        text = body.partition("<PRE>")[2].partition("</PRE>")[0]
        return int(head.split()[1]), head, text

    def ask(self, path: str, method: str = "GET", **headers: str) -> tuple[int, str]:
        """Status and text; ``Host`` is right unless it is given, and "" leaves a header out."""
        rows = {"Host": f"127.0.0.1:{self.port}"} | {name.replace("_", "-"): value for name, value in headers.items()}
        lines = [f"{method} {path} HTTP/1.1", *[f"{name}: {value}" for name, value in rows.items() if value]]
        status, _, text = self.fetch(("\r\n".join(lines) + "\r\n\r\n").encode())
        return status, text

    def call(self, text: str, **headers: str) -> tuple[int, str]:
        """The same of a call."""
        return self.ask("/?eval=" + quote(text), **headers)


@pytest.fixture(scope="module")
def open_lab() -> Iterator[Callable[..., HttpLab]]:
    """Makes robots; at the end nothing listens any more."""
    made: list[HttpLab] = []

    def open_one(**options: Any) -> HttpLab:
        made.append(HttpLab(**options))
        return made[-1]

    yield open_one
    for each in made:
        each.lab.unplug()
        each.lab.run(0.1)


@pytest.fixture(scope="module")
def http(open_lab: Callable[..., HttpLab]) -> HttpLab:
    """A robot whose modules are called by HTTP."""
    return open_lab()


# ---------------------------------------------------------------- calls


def test_the_urls_of_the_manual(http: HttpLab) -> None:
    assert http.ask("/?eval=mathematics.add(2,3)") == (200, "5")
    assert http.ask("/?eval=mathematics.ping();") == (200, "true")
    assert http.ask("/?eval=mathematics.version()")[0] == 200


def test_the_form_of_the_answer(http: HttpLab) -> None:
    request = f"GET /?eval=mathematics.echoOf('%3Cscript%3E') HTTP/1.0\r\nHost: localhost:{http.port}\r\n\r\n"
    status, head, text = http.fetch(request.encode())
    assert (status, text) == (200, "&lt;script&gt;")
    assert "Content-Type: text/html; charset=utf-8" in head
    assert "Content-Security-Policy: default-src 'none'" in head
    assert "Cache-Control: no-store" in head


@pytest.mark.parametrize(
    ("text", "answer"),
    [
        ("mathematics.echoOf(-2.5e3)", "-2500"),
        ("mathematics.echoOf('it\\'s')", "it&#x27;s"),
        ("mathematics.echoOf([1, 'a', true, []])", "[1, &#x27;a&#x27;, true, []]"),
        (" mathematics . echoOf ( false ) ; ", "false"),
        ("mathematics.add('a', 'ä')", "aä"),
    ],
)
def test_arguments(http: HttpLab, text: str, answer: str) -> None:
    assert http.call(text) == (200, answer)


@pytest.mark.parametrize(
    ("text", "status", "error"),
    [
        ("mathematics.secret()", 404, "mathematics.secret is not there, or was not declared with bindUrbiMethod"),
        ("mathematics.exit()", 404, "mathematics.exit is not there, or was not declared with bindUrbiMethod"),
        ("ALMotion.rest()", 404, "ALMotion.rest is not there, or was not declared with bindUrbiMethod"),
        ("mathematics.add(1)", 500, "add: 1 arguments, 2 expected"),
        ("mathematics.add(1, mathematics)", 400, "no number"),
        ("mathematics.add(1, System.shutdown())", 400, "no number"),
        ("shutdown", 400, "write Module.method(arguments)"),
        ("mathematics.add(2,3); shutdown", 400, "something follows the call"),
    ],
)
def test_what_is_refused(http: HttpLab, text: str, status: int, error: str) -> None:
    found, told = http.call(text)
    assert found == status and told.startswith(error)


@pytest.mark.parametrize(
    "path", ["/", "/?eval=a.b()&eval=a.b()", "/x?eval=mathematics.ping()", "/?EVAL=mathematics.ping()"]
)
def test_other_addresses(http: HttpLab, path: str) -> None:
    assert http.ask(path)[0] == 404


def test_a_caller_that_leaves_ends_its_call(http: HttpLab) -> None:
    with http.plug() as plug:
        plug.send(f"GET /?eval=mathematics.slow() HTTP/1.1\r\nHost: localhost:{http.port}\r\n\r\n".encode())
        for _ in range(10):
            plug.look()
    http.lab.run(2.0)
    assert http.lab.number("done") == 0
    assert http.call("mathematics.slow()") == (200, "1")
    assert http.lab.number("done") == 1
    http.lab.say("Global.done = 0|;")


# ---------------------------------------------------------------- web pages


@pytest.mark.parametrize(
    "headers",
    [
        {"Sec_Fetch_Site": "cross-site"},
        {"Sec_Fetch_Site": "same-site"},
        {"Origin": "https://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1:1", "Sec_Fetch_Site": "same-origin"},
        {"Referer": "http://evil.example/page"},
        {"User_Agent": FIREFOX},
        {"User_Agent": FIREFOX, "Sec_Fetch_Site": "none", "Sec_Purpose": "prefetch"},
        {"Host": "evil.example"},
        {"Host": "evil.example:80", "Sec_Fetch_Site": "same-origin", "Origin": "http://evil.example:80"},
        {"Host": "127.0.0.1:1"},
        {"Sec_Fetch_Mode": "no-cors"},
        {"Sec_Fetch_Dest": "image"},
        {"Sec_CH_UA": "x"},
        {"Cookie": "a=b"},
        {"Accept_Language": "de"},
        {"Upgrade_Insecure_Requests": "1"},
    ],
    ids=str,
)
def test_a_web_page_cannot_call(http: HttpLab, headers: dict[str, str]) -> None:
    status, text = http.call("mathematics.slow()", **headers)
    assert status == 403 and text
    http.lab.run(2.0)
    assert http.lab.number("done") == 0


@pytest.mark.parametrize(
    "headers",
    [{}, {"User_Agent": "curl/8.5"}, {"User_Agent": FIREFOX, "Sec_Fetch_Site": "none"}, {"Host": "LOCALHOST"}],
    ids=str,
)
def test_a_user_can(http: HttpLab, headers: dict[str, str]) -> None:
    assert http.call("mathematics.add(2,3)", **headers) == (200, "5")


BROWSER = "Sec-Fetch-Site: cross-site\r\nOrigin: http://evil.example\r\n"


def test_no_padding_hides_a_web_page(http: HttpLab) -> None:
    for size in range(LARGEST - 400, LARGEST + 100, 25):
        for end in (BROWSER, f"{BROWSER}X: {'B' * 3000}\r\n"):
            target = "/?eval=mathematics.slow()&x=" + "A" * (size - 100)
            data = f"GET {target} HTTP/1.1\r\nHost: localhost\r\n{end}\r\n".encode()
            assert http.fetch(data)[0] == (403 if len(data) <= LARGEST else 431)
    http.lab.run(2.0)
    assert http.lab.number("done") == 0


@pytest.mark.parametrize(
    "rows",
    [
        "Host : localhost", "Host: localhost\r\nbogus line", "Host: localhost\r\n evil", "Host: localhost\r\n\tevil",
        "Host: localhost\r\nOrigin : http://evil", "Host: localhost\r\nA: b\rOrigin: c", "Host: localhost\nA: b",
        "Host: localhost\r\nA: b\0", "Host: localhost\r\n: b", "Host: localhost\r\nHost: localhost",
        "Host: localhost\r\nhOST: evil", "Host: localhost\r\nOrigin: http://localhost\r\nORIGIN: http://evil",
        "Host: localhost\r\nSec-Fetch-Site: none\r\nSec-Fetch-Site: cross-site", " Host: localhost", "A: b",
        "Host: localhost\r\nContent-Length: 4", "Host: localhost\r\nTransfer-Encoding: chunked",
        "Host: localhost\r\nO\x80rigin: a", "\r\nHost: localhost",
    ],
    ids=repr,
)  # fmt: skip
def test_odd_headers_are_refused(http: HttpLab, rows: str) -> None:
    data = f"GET /?eval=mathematics.slow() HTTP/1.1\r\n{rows}\r\n\r\n".encode("latin-1")
    assert http.fetch(data)[0] == 400


@pytest.mark.parametrize(
    ("line", "status"),
    [
        ("GET http://localhost/?eval=mathematics.slow() HTTP/1.1", 400),
        ("GET //evil/?eval=mathematics.slow() HTTP/1.1", 404),
        ("GET /?eval=mathematics.slow()#x HTTP/1.1", 400),
        ("GET  /?eval=mathematics.slow() HTTP/1.1", 400),
        ("GET /?eval=mathematics.slow() HTTP/1.999", 400),
        ("GET /?eval=mathematics.slow()", 400),
        ("get /?eval=mathematics.slow() HTTP/1.1", 400),
        ("GET /?eval=mathematics.slow()%ff HTTP/1.1", 400),
        ("HEAD /?eval=mathematics.slow() HTTP/1.1", 405),
    ],
)
def test_odd_request_lines_are_refused(http: HttpLab, line: str, status: int) -> None:
    assert http.fetch(f"{line}\r\nHost: localhost\r\n\r\n".encode())[0] == status
    http.lab.run(1.5)
    assert http.lab.number("done") == 0


def test_a_long_error_is_cut(http: HttpLab) -> None:
    status, text = http.call("a" * 3000 + ".b()")
    assert status == 404 and len(text) <= 300


def test_a_long_request_is_more_work() -> None:
    asked: list[str] = []

    def ask(visitor: HttpVisitor, module: str, method: str, arguments: Any, then: Any) -> bool:
        asked.append(method)
        return True

    for count, work in ((1, 1), (2000, 16)):
        guard = LoginGuard(lambda: 0.0)
        visitor = HttpVisitor(0.0, "127.0.0.1", ["localhost"], ask, lambda visitor: None, guard, Login())
        target = f"/?eval=a.b([{','.join('1' * count)}])"
        visitor.receive(f"GET {target} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
        assert visitor.work(64) == work
    assert asked == ["b", "b"]


def test_names_of_another_address() -> None:
    found = find_allowed_hosts("192.168.1.20", 8080)
    assert {"192.168.1.20", "192.168.1.20:8080", "localhost:8080", f"{socket.gethostname().lower()}:8080"} <= found
    assert "192.168.1.20" not in find_allowed_hosts("127.0.0.1", 8080)
    assert "[::1]:80" in find_allowed_hosts("::1", 80)


# ---------------------------------------------------------------- bytes


@pytest.mark.parametrize(
    ("data", "status"),
    [
        (b"POST /?eval=mathematics.ping() HTTP/1.1\r\nHost: localhost\r\n\r\n", 405),
        (b"OPTIONS * HTTP/1.1\r\nHost: localhost\r\n\r\n", 405),
        (b"GET /?eval=mathematics.ping() HTTP/1.1\r\n\r\n", 400),
        (b"GET / HTTP/1.1\r\nHost: localhost\r\nHost: localhost\r\n\r\n", 400),
        (b"GET http://[/ HTTP/1.1\r\nHost: localhost\r\n\r\n", 400),
        (b"GET / HTTP/2.0\r\nHost: localhost\r\n\r\n", 400),
        (b"\x00\xff\n\n", 400),
        (b"GET /" + b"x" * (LARGEST + 10), 431),
        (b"GET / HTTP/1.1\r\n" + b"".join(b"A%d: b\r\n" % n for n in range(200)) + b"\r\n", 400),
        (b"GET /?" + b"&".join([b"a=b"] * 50) + b" HTTP/1.1\r\nHost: localhost\r\n\r\n", 400),
    ],
    ids=range(10),
)
def test_bad_requests(http: HttpLab, data: bytes, status: int) -> None:
    assert http.fetch(data)[0] == status
    assert http.call("mathematics.add(2,3)") == (200, "5")


def test_one_who_says_nothing_is_dismissed(http: HttpLab) -> None:
    with http.plug() as plug:
        plug.send(b"GET /")
        began = http.lab.clock.now()
        plug.until(lambda: plug.closed)
        assert http.lab.clock.now() - began == pytest.approx(REQUEST_TIMEOUT_S, abs=0.5)


# ---------------------------------------------------------------- on, off, and who


def test_off_by_default() -> None:
    assert (NaoOptions().module_http_port, NaoOptions().module_http_host) == (0, "127.0.0.1")


def test_nothing_listens_without_a_module(open_lab: Callable[..., HttpLab]) -> None:
    http = open_lab()
    assert http.lab.say("mathematics.withdraw;", 0.2) == ""
    with pytest.raises(ConnectionRefusedError):
        http.plug()


def test_a_password_is_asked_for(open_lab: Callable[..., HttpLab]) -> None:
    http = open_lab(user="nao", password="secret")
    assert http.call("mathematics.add(2,3)")[0] == 401
    for wrong in ("Basic ?", "Basic " + base64.b64encode(b"nao:guess").decode(), "Bearer x"):
        assert http.call("mathematics.add(2,3)", Authorization=wrong)[0] == 401
    right = "Basic " + base64.b64encode(b"nao:secret").decode()
    assert http.call("mathematics.add(2,3)", Authorization=right)[0] == 429
    http.lab.run(2.5)
    assert http.call("mathematics.add(2,3)", Authorization=right) == (200, "5")


@pytest.mark.parametrize("name", ["module_http_host", "module_host"])
def test_a_host_must_be_an_address(name: str) -> None:
    with pytest.raises(BadSetting, match=f"options.{name}: takes an address such as 127.0.0.1, not 'robot'"):
        NaoOptions.of({name: "robot"}).end_point()


# ---------------------------------------------------------------- literals


@pytest.mark.parametrize(
    "text",
    ["", "a", "a.b", "a.b(", "a.b(1", "a.b(,)", "a.b(1 2)", "a.b('x)", "a.b([1)", "a.b(])", "a.b(1e999)", "a.b(x)",
     "1.b()", "a.b(nan)", "a.b(1;)", "a.b(" + "[" * (DEEPEST + 2), "a.b('" + "x" * 5000 + "')"],
)  # fmt: skip
def test_what_is_no_call(text: str) -> None:
    with pytest.raises(ValueError, match=".+"):
        parse_call(text)


def test_values_are_written_as_literals() -> None:
    assert write_value([None, True, 1.0, 0.1, "a'b", [2], {"k": 1.0}]) == "[, true, 1, 0.1, 'a\\'b', [2], ['k': 1]]"
