"""Unique identifiers of values.  They look like addresses, as in the manual; the same program gets the same
identifiers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.value import Value

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

UID_BASE, UID_STEP = 0x10000000, 0x10
"""The first identifier is one step above the base."""
MAX_NUMBERED_FLOATS = 1000
"""Maximum number of Floats without slots whose identifiers are kept; these Floats are kept alive."""


class Identifiers:
    """The identifiers of one world; ``count`` is their number."""

    def __init__(self, world: World) -> None:
        self._world = world
        self.count = 0
        self._floats: dict[int, tuple[float, int]] = {}
        """The Floats without slots and their identifiers, by Python identity."""

    def uid(self, value: Value) -> str:
        """The identifier of a value: ``0x`` and hexadecimal digits, in the order of the first requests."""
        if value.__class__ is float and id(value) not in self._world.float_slots:
            known = self._floats.get(id(value))
            if known is None or known[0] is not value:
                if len(self._floats) >= MAX_NUMBERED_FLOATS:
                    self._floats.pop(next(iter(self._floats)))
                known = self._floats[id(value)] = (value, self._next_number())
            return hex(known[1])
        obj = self._world.as_obj(value)
        if not obj.number:
            obj.number = self._next_number()
        return hex(obj.number)

    def _next_number(self) -> int:
        self.count += 1
        return UID_BASE + UID_STEP * self.count

    def move_to_holder(self, value: float, holder: Obj) -> None:
        """Move the identifier of a Float to the ``holder`` of its slots, when it gets slots."""
        numbered = self._floats.pop(id(value), None)
        if numbered is not None and numbered[0] is value:
            holder.number = numbered[1]
