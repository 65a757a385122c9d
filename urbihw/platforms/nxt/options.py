"""What the configuration may say of an NXT: ``[options]`` in ``urbihw.toml``."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from urbihw.settings import TEXT, Mistake, Table, number, setting

LAYOUT: Final = Path(__file__).with_name("TriBot.u")
EMPTY: Final = 6.1
"""V at which the brick's own display shows an empty battery."""
FULL: Final = 8.0
_MOST: Final = 15.0
"""V that no battery of a brick has."""


@dataclass(frozen=True)
class Options(Table):
    """The options.

    Attributes:
        layout: the urbiscript file that says which device is on which port; "" for none.
        battery_empty: V at which the battery's charge is 0.
        battery_full: V at which it is 1.
    """

    layout: str = setting(str(LAYOUT), TEXT)
    battery_empty: float = setting(EMPTY, number(0, _MOST, " V"))
    battery_full: float = setting(FULL, number(0, _MOST, " V"))

    def clashes(self) -> Iterator[Mistake]:
        """See ``Table``."""
        if self.battery_empty >= self.battery_full:
            yield Mistake("battery_empty", f"{self.battery_empty:g} must be fewer volts than battery_full, "
                                           f"{self.battery_full:g}")  # fmt: skip
