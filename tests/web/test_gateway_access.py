"""Who reaches the gateway: pairing, cookies, foreign hosts and origins, header fields."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import aiohttp
import pytest
from browser_lab import Site, site

from urbihw.cli.main import main
from urbihw.daemon.state import state_folder
from urbihw.web.pairing import CODE_LIFETIME_S, COOKIE_DAYS, BadPairing, Pairings

Test = Callable[[Site], Awaitable[None]]


def play(folder: Path, test: Test) -> None:
    async def run() -> None:
        async with site(folder) as made:
            await test(made)

    asyncio.run(run())


def test_a_browser_needs_a_cookie_and_a_code_is_good_once(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        client = made.client()
        code = made.gateway.pairings.make_code("anna", "view", made.gateway.port)
        url = f"{made.base}/pair?c={code}"
        assert (await client.get(f"{made.base}/")).status == 401
        assert (await client.get(f"{made.base}/ws")).status == 401
        assert (await client.get(url, headers={"Sec-Purpose": "prefetch"})).status == 400
        assert (await client.head(url)).status == 400
        answer = await client.get(url, allow_redirects=False)
        assert answer.status == 303 and answer.headers["Location"] == "/"
        cookie = answer.headers["Set-Cookie"]
        assert "HttpOnly" in cookie and "SameSite=Strict" in cookie and cookie.startswith("urbihw_")
        assert (await client.get(f"{made.base}/")).status in (200, 404)  # 404 without the files of the panel
        assert (await made.client().get(url, allow_redirects=False)).status == 403
        wrong = await made.client().get(f"{made.base}/pair?c=wrong")
        assert wrong.status == 403
        assert '<link rel="stylesheet" href="/static/style.css">' in await wrong.text()
        assert (await made.client().get(f"{made.base}/static/style.css")).status == 200  # which needs no cookie

    play(tmp_path, test)


@pytest.mark.parametrize(("headers", "status"), [
    ({"Host": "evil.example"}, 421),
    ({"Host": "evil.example:54080"}, 421),
    ({"Host": "127.0.0.1.evil.example"}, 421),
    ({"Host": "192.168.1.5"}, 421),
    ({"Origin": "http://evil.example"}, 403),
    ({"Origin": "null"}, 403),
    ({"Origin": "http://127.0.0.1:1"}, 403),
    ({"Sec-Fetch-Site": "cross-site"}, 403),
    ({"Sec-Fetch-Site": "same-site"}, 403),
])  # fmt: skip
def test_foreign_pages_do_not_open_the_socket(tmp_path: Path, headers: dict[str, str], status: int) -> None:
    async def test(made: Site) -> None:
        client = await made.paired()
        with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
            await client.ws_connect(f"{made.base}/ws", headers=headers)
        assert refused.value.status == status
        assert made.gateway.sessions == []

    play(tmp_path, test)


@pytest.mark.parametrize("others", [["{base}", "{base}"], ["{base}", "http://evil.example"]])
def test_two_origins_do_not_open_the_socket(tmp_path: Path, others: list[str]) -> None:
    async def test(made: Site) -> None:
        client = await made.paired()
        headers = [("Origin", each.format(base=made.base)) for each in others]
        with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
            await client.ws_connect(f"{made.base}/ws", headers=headers)
        assert refused.value.status == 403
        assert made.gateway.sessions == []

    play(tmp_path, test)


def test_the_own_origin_opens_the_socket(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        client = await made.paired()
        socket = await client.ws_connect(f"{made.base}/ws", headers={"Origin": made.base,
                                                                     "Sec-Fetch-Site": "same-origin"})
        assert (await socket.receive_json(timeout=5))["event"] == "hello"
        await socket.close()

    play(tmp_path, test)


def test_each_answer_has_the_header_fields_and_nothing_is_written_by_http(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        client = made.client()
        for path in ("/", "/healthz", "/nothing", "/schema.json"):
            answer = await client.get(made.base + path)
            policy = answer.headers["Content-Security-Policy"]
            assert "default-src 'self'" in policy and "script-src" not in policy and "unsafe-eval" not in policy
            assert answer.headers["X-Content-Type-Options"] == "nosniff"
            assert "Python" not in answer.headers.get("Server", "")
            assert "Access-Control-Allow-Origin" not in answer.headers
        assert (await client.post(f"{made.base}/pair", data=b"c=1")).status == 405

    play(tmp_path, test)


def test_a_link_of_another_site_opens_the_page_again(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        headers = {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate"}
        answer = await made.client().get(f"{made.base}/", headers=headers)
        assert answer.status == 200 and 'http-equiv="refresh"' in await answer.text()

    play(tmp_path, test)


def test_a_removed_browser_is_disconnected(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        browser = await made.browser()
        made.gateway.pairings.remove("anna")
        while not browser.socket.closed:
            await browser.socket.receive(timeout=10)
        assert browser.socket.close_code == 1008

    play(tmp_path, test)


class Clock:
    """A clock that is set by hand."""

    now = 1e9

    def __call__(self) -> float:
        return self.now


def test_a_code_ends_after_two_minutes_and_belongs_to_its_port(tmp_path: Path) -> None:
    clock = Clock()
    pairings = Pairings(tmp_path, clock)
    code = pairings.make_code("anna", "drive", 54080)
    assert pairings.redeem(code, 54081) is None
    clock.now += CODE_LIFETIME_S + 1
    assert pairings.redeem(code, 54080) is None
    code = pairings.make_code("anna", "drive", 54080)
    made = pairings.redeem(code, 54080)
    assert made is not None
    browser, cookie = made
    assert browser.role == "drive" and pairings.find(cookie, 54080) == browser
    assert pairings.find(cookie, 54081) is None and pairings.find("x", 54080) is None
    assert cookie not in (tmp_path / "browsers").read_text()
    assert (tmp_path / "browsers").stat().st_mode & 0o077 == 0


def test_a_cookie_ends_after_its_days(tmp_path: Path) -> None:
    pairings = Pairings(tmp_path, Clock())
    made = pairings.redeem(pairings.make_code("anna", "drive", 54080), 54080)
    assert made is not None
    browser, cookie = made
    file, today = tmp_path / "browsers", datetime.now(UTC).date()
    for days, known in ((COOKIE_DAYS - 1, True), (COOKIE_DAYS + 2, False)):
        file.write_text(file.read_text().replace(browser.made, (today - timedelta(days=days)).isoformat()))
        assert (pairings.find(cookie, 54080) is not None) is known
        file.write_text(file.read_text().replace((today - timedelta(days=days)).isoformat(), browser.made))


def test_the_list_of_browsers_for_programs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path))
    pairings = Pairings(state_folder())
    assert pairings.redeem(pairings.make_code("anna", "drive", 54080), 54080) is not None
    assert main(["panel", "list", "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert (row["name"], row["role"], row["port"]) == ("anna", "drive", 54080)
    assert row["since"] == datetime.now(UTC).date().isoformat()


def test_wrong_names_and_roles_are_refused(tmp_path: Path) -> None:
    pairings = Pairings(tmp_path)
    for name, role in (("", "view"), ("two words", "view"), ("a\nb", "view"), ("anna", "root")):
        with pytest.raises(BadPairing):
            pairings.make_code(name, role, 1)
    with pytest.raises(BadPairing, match="there are: none"):
        pairings.remove("anna")
