"""What browsers may ask, by role; who drives; what a slow browser misses."""

from __future__ import annotations

import asyncio
import base64
import json
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
from browser_lab import SCHEMA, Site, check, site

from urbihw.web import session
from urbihw.web.lobby import LobbyLink
from urbihw.web.moving import TAKEN_S
from urbihw.web.outbox import WebOutbox
from urbihw.web.tree import Tree
from urbihw.web.verbs import VERBS

SLOT = {"kind": "number", "unit": "", "min": None, "max": None, "readable": True, "writable": True, "effector": False}
GO = {**SLOT, "name": "go", "kind": "function"}
TREE = Tree({"robot": {"name": "robot", "path": "robot", "global": "robot", "slots": [
    GO, {**SLOT, "name": "speed", "kind": "list", "unit": "m/s", "effector": True},
], "parts": [
    {"name": "joint", "path": "robot.joint[6]", "global": "motor6", "slots": [
        {**SLOT, "name": "val", "unit": "rad", "effector": True},
        {**SLOT, "name": "speed", "unit": "rad/s", "effector": True},
        {**SLOT, "name": "turn", "unit": "turn", "effector": True},
        {**SLOT, "name": "goalPwm", "unit": "1", "effector": True},
        {**SLOT, "name": "torque", "unit": "N m", "effector": True},
        {**SLOT, "name": "power", "unit": "%", "effector": True},
        {**SLOT, "name": "share", "unit": "%", "min": -100.0, "max": 100.0, "effector": True},
        {**SLOT, "name": "light", "unit": "ratio", "effector": True},
        {**SLOT, "name": "offset", "unit": "rad"},
    ]}, {"name": "speaker", "path": "robot.speaker", "global": "speaker", "slots": [
        {**SLOT, "name": "val", "kind": "binary", "effector": True},
    ]}]}, "platform": {"name": "toy", "path": "toy", "slots": [{**SLOT, "name": "lost", "kind": "event"}]},
})  # fmt: skip


def play(folder: Path, test: Callable[[Site], Awaitable[None]]) -> None:
    async def run() -> None:
        async with site(folder) as made:
            made.gateway.robot.tree = TREE
            await test(made)

    asyncio.run(run())


async def refused(asked: Awaitable[dict[str, Any]]) -> str:
    """The code of a refusal."""
    answer = await asked
    assert answer["ok"] is False
    return str(answer["code"])


def test_role_view_only_looks_and_stops(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        browser = await made.browser("view")
        for do, fields in (
            ("set", {"slot": "motor6.val", "value": 1}), ("call", {"slot": "robot.go", "args": [1]}),
            ("drive", {"x": 1, "yaw": 0}), ("go", {"x": 1, "y": 1}), ("run", {"text": "motor6.val = 1;"}),
            ("release", {}), ("lease", {"take": True}), ("tag", {"tag": "t", "action": "stop"}), ("fake", {}),
            ("complete", {"text": "mo"}),
        ):  # fmt: skip
            assert await refused(browser.ask(do, **fields)) == "role", do
        assert await refused(browser.ask("events", slots=["robot.stop"])) == "role"
        assert not any(text in made.daemon.said for text in ("motor6", "robot.go", "drive.order", "moveTo"))
        assert (await browser.ask("get", slot="motor6.val"))["value"] == 1
        assert (await browser.ask("estop"))["confirmed"] and (await browser.ask("stop"))["confirmed"]
        assert made.worker.asked == ["estop anna (panel)", "stop anna (panel)"]

    play(tmp_path, test)


def test_an_emergency_stop_that_a_worker_left_unanswered_reaches_its_replacement(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        browser = await made.browser("view")
        made.worker.dies = ["estop"]
        assert (await browser.ask("estop"))["confirmed"]
        assert made.worker.asked == ["estop anna (panel)"]
        kept = made.worker.path.with_suffix(".estop").read_text()
        assert kept == "anna (panel)\tanna (panel)\n", "for one that begins now"

    play(tmp_path, test)


def test_a_release_is_that_of_the_browser_and_role_full_may_release_those_it_was_shown(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        drive, full = await made.browser("drive"), await made.browser("full")
        holders = [{"user": "bob (panel)", "who": "bob (panel)"}, {"user": "uid 1000", "who": "me@pts/0"}]
        made.worker.state = {"estop": "bob (panel) and me@pts/0", "holders": holders, "released": False}
        told = await full.event("state", lambda told: told["estop"] != "")
        assert (told["holders"], told["holds"]) == (["bob (panel)", "me@pts/0"], False)
        assert await refused(drive.ask("release")) == "held"
        assert made.worker.heard == {"do": "release", "who": "anna (panel)", "user": "anna (panel)"}
        assert await refused(drive.ask("release", of=told["holders"])) == "role"
        assert await refused(full.ask("release", of=[7])) == "bad"
        made.worker.state = {"released": True}
        assert (await full.ask("release", of=told["holders"]))["estop"] == ""
        assert made.worker.heard["others"] == told["holders"]
        made.worker.state = {"estop": "anna (panel)", "holders": [{"user": "anna (panel)", "who": "anna (panel)"}]}
        assert (await full.event("state", lambda told: told["holds"]))["holders"] == ["anna (panel)"]

    play(tmp_path, test)


def test_an_emergency_stop_that_is_not_kept_says_so(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        browser = await made.browser("view")
        made.worker.state = {"estop": "anna (panel)", "unkept": "no inode is left"}
        assert (await browser.ask("estop"))["unkept"] == "no inode is left"

    play(tmp_path, test)


def test_role_drive_has_effectors_and_limits(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        browser = await made.browser("drive")
        assert await refused(browser.ask("set", slot="motor6.offset", value=1)) == "role"
        assert await refused(browser.ask("set", slot="System.period", value=1)) == "role"
        assert await refused(browser.ask("call", slot="robot.shutdown", args=[])) == "role"
        assert await refused(browser.ask("run", text="1;")) == "role"
        assert (await browser.ask("set", slot="motor6.val", value=0.5))["ok"]
        assert "motor6.val = 0.5 speed:1 " in made.daemon.said
        assert (await browser.ask("set", slot="motor6.val", value=0.5, speed=9))["ok"]
        assert "speed:9" not in made.daemon.said
        assert (await browser.ask("set", slot="motor6.speed", value=-50))["ok"]
        assert "motor6.speed = (-1.0)" in made.daemon.said
        assert (await browser.ask("call", slot="robot.go", args=[0.5]))["ok"]

    play(tmp_path, test)


def test_role_drive_writes_only_what_has_a_limit_of_speed(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        browser = await made.browser("drive")
        assert (await browser.ask("set", slot="motor6.turn", value=0.25))["ok"]
        assert "motor6.turn = 0.25 speed:0.159155 " in made.daemon.said, "1 rad/s"
        for slot in ("goalPwm", "torque", "power"):
            assert await refused(browser.ask("set", slot=f"motor6.{slot}", value=0.1)) == "role"
        assert (await browser.ask("set", slot="motor6.share", value=-100))["ok"]
        assert (await browser.ask("set", slot="motor6.light", value=0.9))["ok"]
        assert "motor6.share = (-50.0)" in made.daemon.said and "motor6.light = 0.9" in made.daemon.said

    play(tmp_path, test)


def test_requests_that_no_text_or_number_can_be(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        browser = await made.browser("full")
        half = "\ud800"
        assert await refused(browser.ask("run", text=half)) == "bad"
        assert await refused(browser.ask("tag", uid=half, action="stop")) == "bad"
        assert await refused(browser.ask("subscribe", slots=[f'motor6["{half}"]'])) == "bad"
        assert await refused(browser.ask("set", slot="motor6.val", value=half)) == "bad"
        for tag in ("if", "nil", "a b", "a" * 100):
            assert await refused(browser.ask("run", text="1", tag=tag)) == "bad"
        for number in ("[" * 500 + "]" * 500, '{"a": 1}', '"' + "a" * 200 + '"', "1e999"):
            await browser.socket.send_str(f'{{"id": {number}, "do": "stop"}}')
            assert await refused(browser.answer(None)) == "bad"
        assert not made.worker.asked
        assert (await browser.ask("set", slot="robot.new", value=1))["ok"]
        assert "robot.'new' = 1" in made.daemon.said, "a word of the language"

    play(tmp_path, test)


@pytest.mark.parametrize("value", [True, "1", [1], {"a": 1}, None, float("nan"), float("inf"), 10**400])
def test_role_drive_writes_nothing_that_passes_by_its_limits(tmp_path: Path, value: Any) -> None:
    async def test(made: Site) -> None:
        browser = await made.browser("drive")
        for slot in ("motor6.val", "motor6.speed", "robot.speed"):
            assert await refused(browser.ask("set", slot=slot, value=value)) in ("role", "bad")
        assert await refused(browser.ask("set", slot="robot.speed", value=[9, 0, 0, 0, 0, 0])) == "role"
        assert "motor6" not in made.daemon.said and "robot.speed = [9" not in made.daemon.said

    play(tmp_path, test)


@pytest.mark.parametrize("slot", ["motor6.val = 1; robot.go", 'a["b"] | 1', "1", "", "motor6.val\n", "a" * 300, 7])
def test_what_is_no_path_never_reaches_the_daemon(tmp_path: Path, slot: Any) -> None:
    async def test(made: Site) -> None:
        browser = await made.browser("full")
        for do in ("get", "set", "call"):
            assert await refused(browser.ask(do, slot=slot, value=1)) == "bad"
        assert await refused(browser.ask("subscribe", slots=[slot])) == "bad"
        assert "robot.go" not in made.daemon.said

    play(tmp_path, test)


def test_what_only_tells_something_is_answered_however_long_it_takes(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        browser = await made.browser("full")
        made.daemon.value, made.daemon.delay = '[["wave", []]]', 3 * TAKEN_S
        assert (await browser.ask("call", slot="robot.teaching", args=[]))["value"] == ["wave", []]
        assert "value" not in await browser.ask("call", slot="robot.go", args=[1])

    play(tmp_path, test)


def test_role_drive_plays_no_faster_than_it_was_recorded(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        drive, full = await made.browser("drive"), await made.browser("full", "bob")
        assert (await drive.ask("call", slot="robot.play", args=["wave", 9, 2]))["ok"]
        await drive.ask("get", slot="a.b")  # the call was answered before it ended
        assert 'robot.play("wave", 1.0, 2.0)' in made.daemon.said
        assert (await drive.ask("call", slot="robot.pose", args=["up", 0.5]))["ok"]
        await drive.ask("get", slot="a.b")
        assert 'robot.pose("up", 0.5)' in made.daemon.said
        for speed in (True, "9", [9], -1, 10**400, None):
            assert await refused(drive.ask("call", slot="robot.play", args=["wave", speed])) == "role"
        assert (await full.ask("lease", take=True))["ok"]
        assert (await full.ask("call", slot="robot.play", args=["wave", 9]))["ok"]
        await full.ask("get", slot="a.b")
        assert 'robot.play("wave", 9.0)' in made.daemon.said

    play(tmp_path, test)


def test_jobs_by_which_gateways_look_are_not_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def test(made: Site) -> None:
        browser = await made.browser("view")
        rows = [
            {"name": "shell_1", "lobby": "anna (panel)", "state": "starting"},
            {"name": "subscription __web_1", "lobby": "anna (panel)", "state": "waiting"},
            {"name": "shell_3", "lobby": "anna (panel)", "state": "sleeping"},
            {"name": "shell_4", "lobby": "Lobby_1 (127.0.0.1)", "state": "starting"},
        ]

        async def tell(self: LobbyLink, body: str) -> Any:
            return {"jobs": rows, "tags": []}

        monkeypatch.setattr(LobbyLink, "json", tell)
        assert [each["name"] for each in (await browser.ask("jobs"))["jobs"]] == ["shell_3", "shell_4"]

    play(tmp_path, test)


def test_names_of_the_gateway_itself_are_not_told(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        for role in ("view", "full"):
            browser = await made.browser(role, role)
            for slot in ("__web", "__web.subs", "lobby.__web"):
                assert await refused(browser.ask("get", slot=slot)) == "bad"
                assert await refused(browser.ask("subscribe", slots=[slot])) == "bad"
                assert await refused(browser.ask("picture", slot=slot)) == "bad"

    play(tmp_path, test)


def test_a_picture_comes_after_the_answer_that_tells_its_number(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        made.daemon.before = b'[00000001:__web_1] {"t": 1.5, "lost": 0}\n[00000001:__web_1] BIN 4 jpeg 320 240\nabcd\n'
        made.daemon.delay = 0.2
        browser = await made.browser()
        told = await browser.ask("picture", slot="camera.val")  # fails at a binary message
        assert told["ok"], told
        picture = await browser.socket.receive_bytes(timeout=10)
        assert picture.endswith(b"abcd") and json.loads(picture[4:-4])["sub"] == told["sub"]

    play(tmp_path, test)


@pytest.mark.parametrize("value", ["NaN", "Infinity", "-Infinity", "1e999", "[1, [-1e999]]"])
def test_numbers_that_json_has_not_are_refused_for_every_role(tmp_path: Path, value: str) -> None:
    async def test(made: Site) -> None:
        browser = await made.browser("full")
        for field in ("value", "speed", "args", "take"):
            await browser.socket.send_str(f'{{"id": "n", "do": "set", "slot": "motor6.val", "{field}": {value}}}')
            while (message := await browser._read()).get("id") != "n":
                pass
            assert message["code"] == "bad" and "is no number of a request" in message["error"]
        assert "motor6" not in made.daemon.said

    play(tmp_path, test)


def test_a_lease_is_taken_or_left_expressly(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        browser = await made.browser("drive")
        assert (await browser.ask("lease", take=True))["ok"]
        assert await refused(browser.ask("lease")) == "bad"
        assert made.gateway.driver is not None

    play(tmp_path, test)


def test_a_lease_with_a_time_is_the_daemons_and_only_messages_of_the_browser_keep_it(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        browser = await made.browser("full")
        assert (await browser.ask("lease", take=True, seconds=0.5))["ok"]
        assert "lobby.lease = 0.5" in made.daemon.said

        def signs() -> int:
            return made.daemon.said.splitlines().count("")

        before = signs()
        await asyncio.sleep(0.7)
        assert signs() == before, "the gateway lives on by itself"
        await browser.ask("get", slot="motor6.val")
        assert signs() == before + 1
        await browser.ask("run", text="1;")
        assert made.daemon.said.count("lobby.lease = 0.5") == 2, "the console moves the robot, too"
        assert (await browser.ask("lease", take=False))["ok"]
        assert made.daemon.said.count("lobby.lease = 0.0") == 2
        before = signs()
        await browser.ask("get", slot="motor6.val")
        assert signs() == before
        for wrong in (-1, 4000, "x"):
            assert await refused(browser.ask("lease", take=True, seconds=wrong)) == "bad"

    play(tmp_path, test)


def test_values_are_quoted(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        browser = await made.browser("full")
        assert (await browser.ask("set", slot="speech.text", value='"; robot.go(1); "\n'))["ok"]
        assert '= "\\"; robot.go(1); \\"\\n"' in made.daemon.said

    play(tmp_path, test)


def test_sound_goes_to_loudspeakers_as_it_is(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        drive, full = await made.browser("drive"), await made.browser("full", "bob")
        data = base64.b64encode(bytes(range(10, 256))).decode()
        sound = {"slot": "speaker.val", "keywords": "raw 1 16000 16 1", "data": data}
        assert await refused(drive.ask("sound", **{**sound, "slot": "motor6.offset"})) == "role"
        for wrong in ({"keywords": "raw 1 16000 16 1; 1"}, {"data": "?"}, {"data": 7}, {"slot": "a;b"}):
            assert await refused(full.ask("sound", **{**sound, **wrong})) == "bad"
        assert "BIN" not in made.daemon.said
        assert (await drive.ask("sound", **sound))["ok"]
        assert await refused(full.ask("sound", **sound)) == "lease"
        told = made.daemon.said.encode("utf-8", "surrogateescape")
        assert b"speaker.val = BIN 246 raw 1 16000 16 1;" + bytes(range(10, 256)) + b"; 1" in told

    play(tmp_path, test)


def test_one_browser_drives_and_another_one_takes_over(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        anna, bob = await made.browser("drive", "anna"), await made.browser("full", "bob")
        assert (await anna.ask("set", slot="motor6.val", value=0.5))["ok"]
        await anna.event("state", lambda told: told["driver"] == "anna" and told["drives"])
        await bob.event("state", lambda told: told["driver"] == "anna" and not told["drives"])
        assert await refused(bob.ask("set", slot="motor6.val", value=0)) == "lease"
        assert (await bob.ask("lease", take=True))["ok"]
        assert await refused(anna.ask("set", slot="motor6.val", value=0)) == "lease"
        await anna.event("state", lambda told: told["driver"] == "bob")
        assert "__web.endAll" in made.daemon.said
        await bob.socket.close()
        await anna.event("state", lambda told: told["driver"] == "")
        assert (await anna.ask("set", slot="motor6.val", value=0))["ok"]

    play(tmp_path, test)


def test_the_connections_to_the_daemon_end_with_the_browser(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        browser = await made.browser("full")
        assert (await browser.ask("get", slot="a.b"))["ok"]
        before = made.daemon.open
        await browser.socket.close()
        while made.daemon.open != before - 1:
            await asyncio.sleep(0.01)

    play(tmp_path, test)


def test_nonsense_and_floods_are_refused(tmp_path: Path) -> None:
    async def test(made: Site) -> None:
        browser = await made.browser("view")
        for text in ("", "[]", "nonsense", '{"do": []}', '{"do": "x", "id": 5}', "[" * 5000):
            await browser.socket.send_str(text)
            message = await browser._read()
            while "event" in message:
                message = await browser._read()
            assert message["ok"] is False and message["code"] == "bad"
        await browser.socket.send_str('{"id": "\\ud800", "do": "tree"}')
        while "event" in (message := await browser._read()):
            pass
        assert message["ok"] and message["id"] == "?"
        for _ in range(1000):
            await browser.socket.send_str('{"id": 9, "do": "tree"}')
        codes = set()
        for _ in range(1000):
            message = await browser._read()
            if "event" not in message:
                codes.add(message.get("code"))
        assert "limit" in codes
        await browser.socket.send_str("x" * 100_000)
        while not browser.socket.closed:
            await browser.socket.receive(timeout=10)
        assert browser.socket.close_code == 1009

    play(tmp_path, test)


class Stuck:
    """A socket that takes nothing until it is let go."""

    def __init__(self) -> None:
        self.go = asyncio.Event()
        self.sent: list[Any] = []

    async def send_str(self, data: str) -> None:
        await self.go.wait()
        self.sent.append(json.loads(data))

    async def send_bytes(self, data: bytes) -> None:
        await self.go.wait()
        self.sent.append(data)


def test_a_slow_browser_gets_the_newest_samples_and_is_told_how_many_were_lost() -> None:
    async def run() -> None:
        flows: list[bool] = []
        outbox, socket = WebOutbox(flows.append), Stuck()
        task = asyncio.create_task(outbox.run(socket))
        for number in range(100):
            outbox.put_newest(1, {"event": "samples", "n": number, "lost": 2, "v": [float("nan")]}, kept=4)
        for number in range(600):
            outbox.put({"id": number})
        await asyncio.sleep(0)
        assert flows == [True]
        socket.go.set()
        while len(socket.sent) < 604:
            await asyncio.sleep(0)
        samples = [each for each in socket.sent if "n" in each]
        assert [each["n"] for each in samples] == [96, 97, 98, 99]
        assert samples[-1] == {"event": "samples", "n": 99, "lost": 98, "v": [None]}
        assert [each["id"] for each in socket.sent if "id" in each] == list(range(600)) and flows == [True, False]
        task.cancel()

    asyncio.run(run())


@pytest.mark.parametrize(("count", "length"), [(5000, 1), (100, 1_000_000)])
def test_a_browser_that_reads_nothing_is_given_up(count: int, length: int) -> None:
    async def run() -> None:
        outbox, socket = WebOutbox(), Stuck()
        task = asyncio.create_task(outbox.run(socket))
        for number in range(count):
            outbox.put({"id": number, "text": "x" * length})
        socket.go.set()
        await asyncio.wait_for(task, 5)
        assert outbox.overflowed

    asyncio.run(run())


def test_the_schema_has_all_requests() -> None:
    described = {row["properties"]["do"]["const"] for row in SCHEMA["$defs"]["request"]["oneOf"]}
    assert described == set(VERBS)
    check({"id": 1, "do": "set", "slot": "motor6.val", "value": 0.5, "speed": 1}, "request")


def test_a_request_right_behind_the_opening_waits_for_the_daemon_but_a_stop_does_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def test(made: Site) -> None:
        made.daemon.close()
        browser = await made.browser("full")
        asked = asyncio.create_task(browser.ask("get", slot="a.b"))
        await asyncio.sleep(0)
        await made.daemon.start()
        assert (await asked)["value"] == 1
        made.daemon.close()
        monkeypatch.setattr(session, "OPENING_S", 0.3)
        other = await made.browser("full", "bob")
        assert (await other.ask("estop"))["confirmed"]
        assert await refused(other.ask("get", slot="a.b")) == "gone"
        assert await refused(other.ask("drive", x=1, yaw=0)) == "gone"

    play(tmp_path, test)
