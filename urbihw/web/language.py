"""Requests of the language, for role full: run, completion, jobs and tags, and the faults of a simulated robot."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from urbihw.client.literals import checked_name, literal, string_literal
from urbihw.client.subject import subject
from urbihw.web.asked import WebRefusal, number_of, text_of
from urbihw.web.lobby import LobbyError
from urbihw.web.session import PANEL, WebSession

MAX_TEXT: Final = 60_000
ACTIONS: Final = ("stop", "freeze", "unfreeze")
MAX_WORDS: Final = 200
MAX_TAG: Final = 60
Request = Mapping[str, Any]


async def run(session: WebSession, request: Request) -> dict[str, Any]:
    """Run text in the console of the browser; its output comes as events."""
    text = text_of(request, "text")
    if len(text) > MAX_TEXT:
        raise WebRefusal(f"a text has {MAX_TEXT} characters at most", "limit")
    tag = text_of(request, "tag", "")
    if tag:
        name = _tag_name(tag)
        body = text.rstrip(" ;,|\r\n\t")
        text = f'if (!hasSlot("{name}")) setSlot("{name}", Tag.new("{name}"))|;\n{name}: {{ {body}\n}},'
    (await session.console()).send(text.rstrip("\n") + "\n")
    return {}


async def complete(session: WebSession, request: Request) -> dict[str, Any]:
    """The names that may follow the beginning of a path in a text: of slots that exist now."""
    text = text_of(request, "text")[:MAX_TEXT]
    text = text[: int(number_of(request, "at", 0, MAX_TEXT, len(text)))]
    wanted = subject(text)
    if wanted is None:
        return {"words": []}
    await session.console()
    path = literal(list(wanted.path))
    asked = f"{string_literal(session.console_uid)}, {path}, {string_literal(wanted.prefix)}"
    names = [str(row[0]) for row in await session.link.value(f"assistant_names({asked})")]
    hidden = wanted.prefix.startswith("_")
    words = [each for each in names if each.startswith(wanted.prefix) and (hidden or each[0] != "_")]
    return {"words": words[:MAX_WORDS]}


async def jobs(session: WebSession, request: Request) -> dict[str, Any]:
    """The jobs of all connections but for those by which gateways look, and the tags that can be stopped."""
    told = await session.link.json("System.jobsText")
    if not isinstance(told, dict):
        raise LobbyError("the daemon told no jobs", "gone")
    return {"jobs": [each for each in told.get("jobs", []) if not _looks(each)], "tags": told.get("tags", [])}


def _looks(job: Mapping[str, Any]) -> bool:
    """Whether a job only looks for a gateway: a subscription of it, or the question for the jobs itself, which has not
    come to its first statement."""
    of_panel = str(job.get("lobby")).endswith(PANEL)
    return of_panel and (job.get("state") == "starting" or str(job.get("name")).startswith("subscription __web_"))


async def tag(session: WebSession, request: Request) -> dict[str, Any]:
    """Stop, freeze or unfreeze a tag: one of any connection by its ``id`` in ``jobs`` (field ``uid``), or one of the
    console by name."""
    name, action = text_of(request, "tag", ""), text_of(request, "action")
    if action not in ACTIONS:
        raise WebRefusal(f"action wants one of {', '.join(ACTIONS)}")
    if "uid" in request:
        await session.link.ask(f'System.controlTag({string_literal(text_of(request, "uid"))}, "{action}") | 1')
    else:
        link = await session.console()
        await link.ask(f"{_tag_name(name)}.{action} | 1")
    return {}


async def fake(session: WebSession, request: Request) -> dict[str, Any]:
    """The faults of a simulated robot: the list, or one of them."""
    if not session.gateway.robot.about["fake"]:
        raise WebRefusal("this robot is not simulated")
    if "tell" in request:
        return {"answer": await session.link.value(f"fake.tell({string_literal(text_of(request, 'tell'))})")}
    return {"commands": await session.link.value("fake.commands")}


def _tag_name(text: str) -> str:
    if len(text) > MAX_TAG:
        raise WebRefusal(f"the name of a tag has {MAX_TAG} characters at most")
    try:
        return checked_name(text)
    except ValueError as error:
        raise WebRefusal(str(error)) from error
