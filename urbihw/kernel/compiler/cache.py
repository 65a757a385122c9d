"""A cache of compiled statements by their text.

A unit depends on the compiler's state, and on the names in its text that the client alone knows to belong to lazy
functions: these are part of the key, and when the state changes, which is rare, all units are dropped.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from urbihw.kernel.compiler.unit import CompiledUnit, CompilerState

MAX_UNITS: Final = 512
"""Maximum number of units; a new one replaces the oldest."""
MAX_TEXT: Final = 1000
"""Maximum length of the text of a cached statement, in characters."""


class UnitCache:
    """The cache of one world."""

    def __init__(self) -> None:
        self._state: CompilerState | None = None
        self._units: dict[tuple[str, frozenset[str]], CompiledUnit] = {}

    def __len__(self) -> int:
        return len(self._units)

    def get(
        self, text: str, state: CompilerState, own: frozenset[str], make: Callable[[], CompiledUnit]
    ) -> CompiledUnit:
        """The unit of a statement; ``make`` compiles it if it is not in the cache.

        ``text`` is the source without its position, ``state`` what holds for all clients, ``own`` are the lazy names in
        the text that only some clients know.
        """
        if state != self._state:
            self._state = state
            self._units.clear()
        key = (text, own)
        unit = self._units.get(key)
        if unit is None:
            unit = make()
            if len(text) <= MAX_TEXT:
                if len(self._units) >= MAX_UNITS:
                    del self._units[next(iter(self._units))]
                self._units[key] = unit
        return unit
