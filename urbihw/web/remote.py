"""Stop, emergency stop, release and state of a robot on another machine: by the daemon, on port 54000.

Its bus worker is not reached from here, so a program that holds the interpreter holds these, too: what is not answered
is reported as not confirmed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from urbihw.client.literals import string_literal
from urbihw.web.lobby import LobbyError, LobbyLink

TIMEOUT_S: Final = 1.0
"""Seconds within which the daemon must answer."""
_ORDERS: Final = {"stop": "{}.stop", "estop": "{}.estop = true", "release": "{}.estop = false"}
_HOLDERS: Final = 'if ({0}.estop) {0}.estopHolders.join(" and ") else ""'
"""Who holds the robot, in words."""


async def obey(link: LobbyLink, verb: str, platform: str, others: Sequence[str] = ()) -> dict[str, Any]:
    """Have the daemon carry out a verb, and release the stops of ``others``; ``estop`` and ``link`` as they are then.

    ``platform`` is the path of the robot's own object, such as ``bioloid``.  Raises LobbyError.
    """
    if not platform:
        raise LobbyError("the daemon has not told yet which robot it has", "gone")
    orders = [f"{platform}.releaseOf({string_literal(each)})" for each in others]
    if not orders:
        orders = [_ORDERS[verb].format(platform)]
    told = await link.value(f"{' | '.join(orders)} | [robot.link, {{ {_HOLDERS.format(platform)} }}]", TIMEOUT_S)
    return {"link": told[0] is True, "estop": str(told[1])}


async def look(link: LobbyLink, platform: str) -> dict[str, Any]:
    """``link``, ``estop`` (who holds the robot), ``holders``, ``problems`` in words, and ``key``, which changes with
    the tree.  Raises LobbyError."""
    held = f"if (robot.estop) {platform}.estopHolders else []" if platform else "[]"
    problems = "robot.problems.map(function (each) { each.asString })"
    body = f"[robot.link, robot.estop, {{ {held} }}, {problems}, System.treeKey(robot)]"
    there = f'if (Global.hasLocalSlot({string_literal("robot")})) {body} else nil'
    told = await link.value(f"{{ {there} }}", TIMEOUT_S)
    if not isinstance(told, list) or len(told) != 5 or not isinstance(told[2], list) or not isinstance(told[3], list):
        problem = "the daemon has no robot yet"
        return {"link": False, "estop": "", "holders": [], "problems": [problem], "key": ""}
    holders = list(map(str, told[2]))
    holder = (" and ".join(holders) or "another user") if told[1] is True else ""
    return {
        "link": told[0] is True, "estop": holder, "holders": holders, "problems": list(map(str, told[3])),
        "key": told[4],
    }  # fmt: skip
