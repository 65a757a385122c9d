"""A cache of compiled statements by their text.

A unit depends on which names are known to belong to lazy functions, which is not the same for all clients, and on
whether arithmetic is generic.
"""

from __future__ import annotations

from collections.abc import Callable

from urbihw.kernel.compiler.unit import CompiledUnit, CompilerState


class UnitCache:
    """The cache: at most ``size`` statements of at most ``longest`` characters."""

    def __init__(self, size: int = 2048, longest: int = 1000) -> None:
        self.size = size
        self.longest = longest
        self._units: dict[tuple[str, CompilerState], CompiledUnit] = {}

    def get(self, text: str, state: CompilerState, make: Callable[[], CompiledUnit]) -> CompiledUnit:
        """The unit of a statement; ``make`` compiles it if it is not in the cache.  ``text`` is the source without its
        position.
        """
        key = (text, state)
        unit = self._units.get(key)
        if unit is None:
            unit = make()
            if len(text) <= self.longest:
                if len(self._units) >= self.size:
                    del self._units[next(iter(self._units))]
                self._units[key] = unit
        return unit
