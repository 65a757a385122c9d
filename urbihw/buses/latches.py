"""Who holds a robot by an emergency stop: what a press and a release make of the latches.

Worker and daemon share these rules.  The daemon knows at once what its own orders will do, and the worker, which has
the last word, reports later (``urbihw.buses.latch_view``).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Final

MOST: Final = 200
"""Characters of a name."""
UNKNOWN: Final = ""
"""The user of a latch that anybody may release, since its owner is unknown."""
SHARED: Final = "others"
"""The user of the latch that the worker gives to all users beyond those who have one of their own."""
_THEN: Final = ", then "


def pressed(holders: Mapping[str, str], who: str, user: str) -> dict[str, str]:
    """The latches (user -> name) after a user has pressed; a second name of the same user stands behind the first."""
    user, who = plain_name(user), plain_name(who) or "emergency stop"
    first = holders.get(user, who).partition(_THEN)[0]
    return {**holders, user: who if first == who else plain_name(first + _THEN + who)}


def released(
    holders: Mapping[str, str], user: str, others: Collection[str] = (), everyone: bool = False
) -> dict[str, str]:
    """The latches after the release of a user, and of others, by user or name, or all.

    All of them if none of the others holds the robot: a mistyped name releases nothing.
    """
    if everyone:
        return {}
    theirs = {each for each, who in holders.items() if each in others or who in others}
    if others and not theirs:
        return dict(holders)
    return {each: who for each, who in holders.items() if each not in theirs | {UNKNOWN, plain_name(user)}}


def plain_name(text: str, most: int = MOST) -> str:
    """A name or user for one line of a log, a terminal and a file: ``most`` characters, all of them printable."""
    short = " ".join(text[: 4 * most].split())[:most]
    return "".join(each if each.isprintable() else "?" for each in short)
