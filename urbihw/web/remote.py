"""Stop, emergency stop, release and state of a robot on another machine: by the daemon, on port 54000.

Its bus worker is not reached from here, so a program that holds the interpreter holds these, too: what is not answered
is reported as not confirmed.
"""

from __future__ import annotations

from typing import Any, Final

from urbihw.client.literals import string_literal
from urbihw.web.lobby import LobbyError, LobbyLink

TIMEOUT_S: Final = 1.0
"""Seconds within which the daemon must answer."""
_ORDERS: Final = {"stop": "{}.stop", "estop": "{}.estop = true", "release": "{}.estop = false"}
_STATE: Final = "robot.link, robot.estop"


async def obey(link: LobbyLink, verb: str, platform: str) -> dict[str, Any]:
    """Have the daemon carry out a verb; ``estop`` and ``link`` as they are then.  Raises LobbyError.

    ``platform`` is the path of the robot's own object, such as ``bioloid``.
    """
    if not platform:
        raise LobbyError("the daemon has not told yet which robot it has", "gone")
    told = await link.value(f"{_ORDERS[verb].format(platform)} | [{_STATE}]", TIMEOUT_S)
    return {"link": told[0] is True, "estop": told[1] is True}


async def look(link: LobbyLink) -> dict[str, Any]:
    """``link``, ``estop``, ``problems`` in words, and ``key``, which changes with the tree.  Raises LobbyError."""
    body = f"[{_STATE}, robot.problems.map(function (each) {{ each.asString }}), System.treeKey(robot)]"
    there = f'if (Global.hasLocalSlot({string_literal("robot")})) {body} else nil'
    told = await link.value(f"{{ {there} }}", TIMEOUT_S)
    if not isinstance(told, list) or len(told) != 4 or not isinstance(told[2], list):
        return {"link": False, "estop": False, "problems": ["the daemon has no robot yet"], "key": ""}
    return {"link": told[0] is True, "estop": told[1] is True, "problems": list(map(str, told[2])), "key": told[3]}
