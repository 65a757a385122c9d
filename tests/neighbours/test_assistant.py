"""An assistant (the client of the package mcp) before a robot, in one process, over real sockets to the server."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable, Iterator
from typing import Any

import pytest
from lan_server import Lan, wait_for
from mcp import Client
from mcp.client import ClientRequestContext
from mcp.types import BlobResourceContents, ElicitRequestParams, ElicitResult, ImageContent, Implementation, TextContent

import urbihw
from urbihw.client.credentials import Credentials
from urbihw.client.where import Where
from urbihw.neighbours.assistant.server import make_server
from urbihw.neighbours.assistant.settings import AssistantSettings
from urbihw.neighbours.orders import OrderSettings

pytestmark = pytest.mark.e2e

SETUP = """
class Global.Elbow { var val = 0; var limitedBy = ""; var far = 0; }; Elbow.addProto(Interface.RotationalMotor);
class Global.Eye { var val = 3; }; Eye.addProto(Interface.DistanceSensor);
var Global.robot = Component.new("robot"); robot.addComponent("arm");
robot.arm.addDevice("elbow", Elbow.new); robot.arm.addDevice("eye", Eye.new); robot.makeCompactNames;
var robot.problems = ["a\\nlong " + "x" * 999];
var robot.stops = 0; var robot.playing = false; var robot.motions = ["wave"]; var robot.poses = [];
function robot.stop() { stops += 1 };
function robot.play(name, speed) { if (name != "wave") throw "no motion " + name;
  playing = true; try { sleep(60s) } finally { playing = false } };
var Global.photo = Binary.new("rgb 2 1", "abcdef");
"""
Steps = Callable[[Client], Awaitable[None]]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lan]:
    made = Lan(tmp_path_factory.mktemp("lan"))
    try:
        with urbihw.connect("127.0.0.1", made.plain_port, timeout=120) as robot:
            robot.run(SETUP)
        yield made
    finally:
        made.close()


@pytest.fixture
def lan(server: Lan) -> Lan:
    """The server, with the robot as it was at first."""
    with urbihw.connect("127.0.0.1", server.plain_port, timeout=120) as robot:
        robot.run("elbow.val = 0|; robot.stops = 0|;")
    wait_for(lambda: server.count() == (0, 0), "the end of the connections")
    return server


def assisted(lan: Lan, steps: Steps, role: str = "drive", asks: bool = True, **options: Any) -> None:
    """Let an assistant of some name do its steps."""
    settings = AssistantSettings(
        OrderSettings(Where("127.0.0.1", lan.plain_port, False), Credentials(), "assistant"), role, asks
    )

    async def use() -> None:
        server = make_server(settings)
        async with Client(server, client_info=Implementation(name="clod \x1b", version="1"), **options) as client:
            await steps(client)

    asyncio.run(use())


async def told(client: Client, tool: str, **arguments: Any) -> Any:
    """What a tool answers: its value, or "error: ..."."""
    answer = await client.call_tool(tool, arguments)
    if answer.is_error:
        assert isinstance(answer.content[0], TextContent)
        return f"error: {answer.content[0].text}"
    return answer.structured_content


def test_an_assistant_looks(lan: Lan) -> None:
    async def steps(client: Client) -> None:
        tools = {tool.name for tool in (await client.list_tools()).tools}
        assert tools == {"overview", "look", "picture", "health", "explain", "stop", "estop"}
        overview = await told(client, "overview")
        assert overview["effectors"] == [{"slot": "elbow.val", "role": "joint", "unit": "rad"}]
        assert overview["motions"] == ["wave"]
        seen = await told(client, "look", slots=["eye.val", "nobody.val", "robot.stop"])
        assert seen["values"]["eye.val"] == 3
        assert "nobody" in seen["errors"]["nobody.val"] and seen["errors"].keys() == {"nobody.val", "robot.stop"}
        assert "no path" in await told(client, "look", slots=["shutdown; eye.val"])
        (problem,) = (await told(client, "health"))["problems"]
        assert len(problem) == 300 and problem.startswith("a long xx")
        assert "Unit: rad." in (await told(client, "explain", slot="elbow.val"))["result"]
        for slot in ("robot.stop.x", "robot.stop", "stop.x", "lobby.quit.x", "robot[System.shutdown].x", "a; quit"):
            await told(client, "explain", slot=slot)
        shown = await client.call_tool("picture", {"slot": "photo"})
        assert isinstance(shown.content[0], ImageContent) and shown.content[0].mime_type == "image/jpeg"
        (guide,) = (await client.read_resource("robot://guide")).contents
        assert not isinstance(guide, BlobResourceContents) and "`overview` first" in guide.text
        assert "move" in await told(client, "move", goals={"elbow": 1})  # an unknown tool

    assisted(lan, steps, "view")
    with urbihw.connect("127.0.0.1", lan.plain_port) as robot:
        assert robot.robot.stops == 0


def test_an_assistant_has_few_orders_at_a_time(lan: Lan) -> None:
    async def steps(client: Client) -> None:
        async with asyncio.TaskGroup() as group:
            tasks = [group.create_task(told(client, "play", name="wave", seconds=1.5)) for _ in range(9)]
        answers = [task.result() for task in tasks]
        assert sum("4 orders are carried out" in answer for answer in answers) == 5
        assert sum("not done within 1.5 s" in answer for answer in answers) == 4

    assisted(lan, steps)


@pytest.mark.parametrize("mode", ["auto", "legacy"])
def test_a_movement_waits_for_its_end_and_for_the_person(
    lan: Lan, mode: Any, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO", "urbihw.server")
    asked, answers = list[str](), [True, False]

    async def person(context: ClientRequestContext, params: ElicitRequestParams) -> ElicitResult:
        asked.append(params.message)
        return ElicitResult(action="accept", content={"agreed": answers.pop(0)})

    async def steps(client: Client) -> None:
        (schema,) = (tool.input_schema for tool in (await client.list_tools()).tools if tool.name == "move")
        assert "consent" not in json.dumps(schema)
        moved = await told(client, "move", goals={"elbow": 0.2}, speed=99)
        assert moved["now"] == {"elbow.val": 0.2}
        assert await told(client, "move", goals={"elbow": 0}) == (
            "error: Error executing tool move: the person did not agree: nothing was done"
        )

    assisted(lan, steps, mode=mode, elicitation_callback=person)
    assert asked == ["Move elbow to 0.2, at most by 99 a second?", "Move elbow to 0, at most by 0.5 a second?"]
    with urbihw.connect("127.0.0.1", lan.plain_port) as robot:
        assert robot.elbow.val == 0.2
    notes = [record.message for record in caplog.records if "assistant" in record.message]
    assert notes == ["clod (assistant) (127.0.0.1): moves elbow to 0.2"]


def test_what_makes_no_sense_is_refused_with_a_reason(lan: Lan) -> None:
    async def steps(client: Client) -> None:
        for arguments, reason in (
            ({"goals": {"eye": 1}}, "there is no joint eye; there are: elbow.val"),
            ({"goals": {"elbow.val = 1; shutdown; elbow": 1}}, "there is no joint"),
            ({"goals": {"elbow": "1; shutdown"}}, "valid number"),
            ({"goals": {"elbow": float("nan")}}, "valid number"),
            ({"goals": {}}, "name 1 to 64 joints"),
            ({"goals": {"elbow": 1}, "speed": -1}, "greater than 0"),
        ):
            assert reason in await told(client, "move", **arguments)
        assert "does not drive" in await told(client, "go", x=1, y=0)
        assert "no motion beep" in await told(client, "play", name='beep')
        assert "no motion" in await told(client, "play", name='"); shutdown; ("')
        assert "not done within 0.3 s" in await told(client, "play", name="wave", seconds=0.3)
        assert "run" in await told(client, "run", text="1")
        await told(client, "stop")

    assisted(lan, steps)
    with urbihw.connect("127.0.0.1", lan.plain_port) as robot:
        assert robot.elbow.val == 0
        assert robot.robot.stops == 1


def test_nothing_runs_on_behind_a_request_that_is_given_up(lan: Lan) -> None:
    async def steps(client: Client) -> None:
        with urbihw.connect("127.0.0.1", lan.plain_port) as robot:
            playing = asyncio.create_task(client.call_tool("play", {"name": "wave"}))
            await until(lambda: robot["robot.playing"])
            playing.cancel()
            await until(lambda: lan.count() == (1, 1) and not robot["robot.playing"])

    async def until(holds: Callable[[], bool]) -> None:
        await asyncio.to_thread(wait_for, holds, "the robot")

    assisted(lan, steps)


def test_with_the_role_full_programs_run_and_end(lan: Lan) -> None:
    async def steps(client: Client) -> None:
        assert (await told(client, "run", text="var Global.left = 5; 1 + 1; { sleep(0.1s); left = 6; sleep(9s) },"))
        assert (await told(client, "run", text="left"))["value"] == "5.0"
        assert "lookup failed: nowhere" in await told(client, "run", text="nowhere")

    assisted(lan, steps, "full")


def test_a_person_sees_a_program_whole_or_it_is_refused(lan: Lan) -> None:
    asked = list[str]()

    async def person(context: ClientRequestContext, params: ElicitRequestParams) -> ElicitResult:
        asked.append(params.message)
        return ElicitResult(action="accept", content={"agreed": False})

    async def steps(client: Client) -> None:
        harmless = "// only a look\n"
        for text in (f"{harmless}//{'-' * 1000}\nGlobal.elbow.val = 1", harmless + "\n" * 40 + "Global.elbow.val = 1"):
            assert "a person has to see it whole" in await told(client, "run", text=text)
        many = {f"elbow{'w' * 100}{number}": 1 for number in range(12)}
        assert "a person has to see it whole" in await told(client, "move", goals=many)
        for text in (f"{harmless}{'1 + ' * 200}1;\nGlobal.elbow.val = 1", "\u202e1 \x1b[2K + 1"):
            assert "did not agree" in await told(client, "run", text=text)
        await told(client, "go", x=1, y=2, heading=0.5, frame="map")
        await told(client, "play", name="wave", speed=0.5)

    assisted(lan, steps, "full", elicitation_callback=person)
    assert asked == [
        f"Run this program?\n// only a look\n{'1 + ' * 200}1;\nGlobal.elbow.val = 1",
        "Run this program?\n\\u202e1 \\x1b[2K + 1",
        "Drive to x = 1 m, y = 2 m on the map, heading 0.5 rad?",
        "Play wave, at 0.5 of its speed?",
    ]
