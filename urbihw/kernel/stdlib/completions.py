"""System.completions: the names that may follow in a console, those that its user looks for first.  Not in the manual.

Consoles ask it at each Tab, so it looks at slots only, and calls nothing.
"""

from __future__ import annotations

import re
from typing import Any, Final

from urbihw.kernel.runtime.code import Executable
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.slot import peek_meta
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.documentation import docstrings_of
from urbihw.kernel.value import Value

TABLE = Table("System")

USERS, TOLD, OWN, EVERYBODYS = "0", "1", "2", "3"
"""Ranks: what the robot or a program has made, and the slots that move a device; other slots that have a meaning; those
without one; what every object of its kind has, and the library."""
_OF_LOBBIES: Final = ("connectionTag", "remoteIP")
"""Slots that each connection has of its own."""
_EVERY: Final = ("UObject", "Interface", "Component", "Localizer", "Lobby", "Group")
"""Prototypes whose slots tell nothing about the object, beside those of all objects."""
_MARKER: Final = re.compile(r"as[A-Z]\w*$", re.ASCII)
"""A slot by which instances of a class are known."""
_IDENTIFIER: Final = re.compile(r"[A-Za-z_]\w*", re.ASCII)


@TABLE.primitive("completions")
def completions(world: World, this: Value, holder: Value, prefix: str) -> Value:
    """The slots of an object whose names begin with a text: a List of [name, rank, meaning] for each, all Strings.  The
    rank is "0" for what the robot and programs have made, and for slots that move a device; "1" for others with a
    meaning, "2" for those without; "3" for what every object has.  Names with ``_`` in front only after a ``_``."""
    obj = world.peek_obj(holder)
    every = {id(one) for one in _lineage(world.global_)}
    for name in _EVERY:
        proto = world.global_.slots.get(name)
        every |= {id(one) for one in _lineage(proto)} if isinstance(proto, Obj) else set()
    rows = []
    for name, found in _slots(obj).items():
        if name.startswith(prefix) and _IDENTIFIER.fullmatch(name) and (prefix or not name.startswith("_")):
            rows.append([name, *_judged(world, obj, found, name, every)])
    rows.sort(key=lambda row: (row[1], row[0].lower(), row[0]))
    return world.new_list([world.new_list([world.string(word) for word in row]) for row in rows])


def _slots(obj: Obj) -> dict[str, Obj]:
    """The slots of an object and its prototypes, each with the object that holds it."""
    found: dict[str, Obj] = {}
    for one in _lineage(obj):
        for name in one.slots:
            found.setdefault(name, one)
    return found


def _lineage(obj: Obj) -> list[Obj]:
    """An object and its prototypes, in the order in which a slot is looked for."""
    seen: dict[int, Obj] = {}
    waiting = [obj]
    while waiting:
        one = waiting.pop(0)
        if id(one) not in seen:
            seen[id(one)] = one
            waiting[:0] = [proto for proto in one.protos if isinstance(proto, Obj)]
    return [*seen.values()]


def _judged(world: World, obj: Obj, holder: Obj, name: str, every: set[int]) -> tuple[str, str]:
    """The rank of a slot and its meaning; ``every`` are the identities of what tells nothing about an object."""
    said = docstrings_of(world)
    value: Any = holder.slots[name]
    is_thing = isinstance(value, Obj) and not isinstance(value, Executable | Event)
    is_device = isinstance(getattr(value, "kind", None), type)
    meaning = said.meaning(obj, name) or (said.about(value).partition("\n")[0] if is_device else "")
    if holder is world.global_ and (obj is holder or getattr(obj, "is_per_connection", False)):
        if world.record.is_librarys(name):
            return EVERYBODYS, meaning
        return (TOLD if name[0].isupper() else USERS), meaning
    meta = peek_meta(holder, name)
    if id(holder) in every or name in _OF_LOBBIES or _MARKER.match(name):
        return EVERYBODYS, meaning
    if holder is obj and is_thing or getattr(meta and meta.accessor, "effector", None) is not None:
        return USERS, meaning
    return (TOLD if meaning else OWN), meaning
