"""Component: a node of a robot's structure tree, implemented in urbiscript (manual, chapter 22).

The native half finds the compact names, and stores them: those of the robot belong to the library, whichever program
has them made.
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Any, Final

from urbihw.kernel.library import Dictionary, Table, Value, World

PROTOS = {"Component": ("Object",), "Localization": ("Object",)}
"""Made here because Localizer, which has a native half, derives from them before any urbiscript runs."""
TABLE = Table("Component")
ROBOT: Final = "robot"
"""The slot of Global with the robot (manual, chapter 22)."""
DIRECTIONS = frozenset(("yaw", "pitch", "roll", "x", "y", "z"))
"""Names that are never sufficient alone."""

EXPERIMENTAL: Final = re.compile(r"experimental(?=[A-Z])")
"""Beginning of the name of a part that has no standard name; its compact name is without it."""

Names = tuple[str, ...]
"""The names on the way from the root to a part."""


@TABLE.primitive("storeNames")
def store_names(world: World, this: Value, made: Dictionary) -> None:
    """Store each part of a Dictionary in the slot of Global with its name.

    The names of the tree of the robot that is served become part of the library's record: no later check takes them for
    damage; those of a robot that a program made do not.  Raises ``cannot modify const slot`` if a name is taken by a
    protected slot with another value.
    """
    slots = world.global_.slots

    def store() -> None:
        for name, part in made.d.items():
            if slots.get(name) is part:
                continue
            if name in slots:
                world.ops.update_slot(world.global_, name, part)
            else:
                world.ops.set_slot(world.global_, name, part)

    if slots.get(ROBOT) is this and world.record.has(world.global_, ROBOT):
        world.record.adopt(store)
    else:
        store()


@TABLE.primitive("briefNames")
def brief_names(world: World, this: Value, paths: list[Any]) -> list[str]:
    """The shortest name of each of these Lists of names by which no other of them is meant (without places)."""
    checks = world.checks
    return [*_brief_names(tuple(tuple(checks.to_str(name, 1) for name in checks.to_list(path, 1)) for path in paths))]


@lru_cache(maxsize=16)
def _brief_names(paths: tuple[Names, ...]) -> tuple[str, ...]:
    """See ``brief_names``; a robot that arrives again has the same paths."""
    paths = tuple(tuple(map(_short_word, path)) for path in paths)
    with_word: dict[str, dict[Names, None]] = {}
    for path in paths:
        for word in path:
            with_word.setdefault(word, {})[path] = None
    return tuple(_brief_name(path, with_word) for path in paths)


def _short_word(name: str) -> str:
    """The name of a part without the word that tells that it is no standard name."""
    rest = EXPERIMENTAL.sub("", name, 1)
    return name if rest == name else rest[0].lower() + rest[1:]


def _brief_name(path: Names, with_word: dict[str, dict[Names, None]]) -> str:
    """Leave out each name that is not needed to identify the path, from the first on."""
    kept, index = path, 0
    while index < len(kept) > 1:
        fewer = kept[:index] + kept[index + 1 :]
        alone = len(fewer) == 1 and fewer[-1] in DIRECTIONS
        if alone or any(_is_meant(fewer, other, path) for other in with_word[fewer[-1]]):
            index += 1
        else:
            kept = fewer
    return kept[0] + "".join(word[:1].upper() + word[1:] for word in kept[1:])


def _is_meant(words: Names, other: Names, path: Names) -> bool:
    """Whether words for a path describe another one, too: they occur there in this order.

    The path itself does not count, nor do those below it.
    """
    if other[: len(path)] == path:
        return False
    rest = iter(other)
    return all(word in rest for word in words)
