"""The tree of a robot (``System.tree``): which slots may be read, written and called by whom."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

SAFE_CALLS: Final = frozenset((
    "stop", "go", "turn", "goTo", "goToAbsolute", "moveTo", "play", "endPlaying", "pose", "savePose", "say", "beep",
    "playTone", "playSound", "motions", "poses", "pages", "playing", "teaching",
))  # fmt: skip
"""The functions of a robot and its devices that a browser of role drive may call."""
PACED_CALLS: Final = ("play", "pose")
"""Functions whose second argument is a share of the recorded speed, or of the speed of poses."""
TELLING_CALLS: Final = frozenset(("motions", "poses", "pages", "playing", "teaching"))
"""Functions that only return a value: their answer is waited for, since no answer does not mean "no"."""
FREE_CALLS: Final = TELLING_CALLS | {"stop", "endPlaying"}
"""Functions that need no lease: they only return a value, or end a movement."""


class Tree:
    """What a robot has.

    Attributes:
        told: the tree as the daemon tells it.
        slots: all slots by their path, such as ``motor6.val`` and ``robot.joint[6].val``.
    """

    def __init__(self, told: Mapping[str, Any] | None) -> None:
        self.told = told
        self.slots: dict[str, Mapping[str, Any]] = {}
        self.owners: set[str] = set()
        if told is not None:
            for owner, slot in _slots_of(told):
                for path in _paths_of(owner):
                    self.owners.add(path)
                    self.slots.setdefault(f"{path}.{slot.get('name')}", slot)

    @property
    def name(self) -> str:
        """The name of the robot."""
        platform = (self.told or {}).get("platform")
        return str(platform.get("name") or "") if isinstance(platform, Mapping) else ""

    @property
    def platform_path(self) -> str:
        """The path of the object of the platform, which stops the robot; "" if it is not known."""
        platform = (self.told or {}).get("platform")
        return str(platform.get("path") or "") if isinstance(platform, Mapping) else ""

    def may_write(self, path: str) -> bool:
        """Whether role drive may write a slot: it is an effector."""
        slot = self.slots.get(path)
        return slot is not None and slot.get("effector") is True

    def may_call(self, path: str) -> bool:
        """Whether role drive may call a function."""
        owner, _, name = path.rpartition(".")
        return name in SAFE_CALLS and owner in self.owners

    def is_event(self, path: str) -> bool:
        """Whether a slot is an event of the tree."""
        return self.slots.get(path, {}).get("kind") == "event"


EMPTY: Final = Tree(None)


def _slots_of(node: Any) -> Iterator[tuple[Mapping[str, Any], Mapping[str, Any]]]:
    """All slots in a tree, each with the node that has it."""
    if isinstance(node, Mapping):
        for slot in node.get("slots") or ():
            if isinstance(slot, Mapping):
                yield node, slot
        for key, inner in node.items():
            if key != "slots":
                yield from _slots_of(inner)
    elif isinstance(node, list):
        for inner in node:
            yield from _slots_of(inner)


def _paths_of(node: Mapping[str, Any]) -> list[str]:
    """The paths of a node: by the tree, and by its name in Global."""
    return [path for key in ("path", "name", "global") if isinstance(path := node.get(key), str) and path]
