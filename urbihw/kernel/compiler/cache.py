"""A cache of compiled statements by their text.

A unit depends on which names belong to lazy functions and on whether arithmetic is generic; when either changes, the
cache is emptied.
"""

from __future__ import annotations

from collections.abc import Callable, Set

from urbihw.kernel.compiler.unit import CompiledUnit


class UnitCache:
    """The cache: at most ``size`` statements of at most ``longest`` characters."""

    def __init__(self, size: int = 2048, longest: int = 1000) -> None:
        self.size = size
        self.longest = longest
        self._units: dict[str, CompiledUnit] = {}
        self._state: tuple[int, bool] = (0, False)

    def get(self, text: str, lazy_names: Set[str], generic: bool, make: Callable[[], CompiledUnit]) -> CompiledUnit:
        """The unit of a statement; ``make`` compiles it if it is not in the cache.  ``text`` is the source without its
        position.
        """
        state = (len(lazy_names), generic)
        if state != self._state:
            self._units.clear()
            self._state = state
        unit = self._units.get(text)
        if unit is None:
            unit = make()
            if len(text) <= self.longest and self._state == state:
                if len(self._units) >= self.size:
                    del self._units[next(iter(self._units))]
                self._units[text] = unit
        return unit
