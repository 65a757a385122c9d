"""The options of an NXT: ``[options]`` in ``urbihw.toml``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

from urbihw.frozen import frozen
from urbihw.navigation.options import DrivenBaseOptions
from urbihw.settings import TEXT, Mistake, number, setting

LAYOUT: Final = Path(__file__).with_name("TriBot.u")
WHEEL_RADIUS: Final = 0.028
TRACK: Final = 0.112
"""m: the radius of the 56 mm tyre in the kit, and the distance between the wheels of the TriBot."""
EMPTY: Final = 6.1
"""V at which the brick's own display shows an empty battery."""
FULL: Final = 8.0
_MOST: Final = 15.0
"""V; no battery of a brick has more."""


@frozen(slots=False)
class NxtOptions(DrivenBaseOptions):
    """The options, beside those of navigation.

    Attributes:
        wheel_radius: of the driving wheels, m, the initial ``nxt.wheelRadius``; times the gear ratio if there is one,
            negative if the motors are mounted the other way round.
        track: distance of these wheels, m, the initial ``nxt.track``.
        layout: the urbiscript file that makes the devices on the ports; "" for none.
        battery_empty: V at which the battery's charge is 0.
        battery_full: V at which it is 1.
    """

    radius: float = setting(0.15, number(0.02, 3.0, " m"))
    wheel_radius: float = setting(WHEEL_RADIUS, number(-1.0, 1.0, " m"))
    track: float = setting(TRACK, number(0.01, 5.0, " m"))
    layout: str = setting(str(LAYOUT), TEXT)
    battery_empty: float = setting(EMPTY, number(0, _MOST, " V"))
    battery_full: float = setting(FULL, number(0, _MOST, " V"))

    def clashes(self) -> Iterator[Mistake]:
        """Yield a wheel without a radius, battery voltages in the wrong order, and what is wrong with the laser."""
        yield from super().clashes()
        if not self.wheel_radius:
            yield Mistake("wheel_radius", "a wheel has a radius other than 0, in m")
        if self.battery_empty >= self.battery_full:
            yield Mistake("battery_empty", f"{self.battery_empty:g} must be fewer volts than battery_full, "
                                           f"{self.battery_full:g}")  # fmt: skip
