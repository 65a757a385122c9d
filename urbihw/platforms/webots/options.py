"""The options of a simulation: ``[options]`` in ``urbihw.toml``."""

from __future__ import annotations

from typing import Final

from urbihw.frozen import frozen
from urbihw.settings import TEXT, SettingsTable, choice, number, setting, whole

FAST: Final = "fast"
SPEEDS: Final = ("real", FAST, "pause")


@frozen(slots=False)
class WebotsOptions(SettingsTable):
    """The options.

    Attributes:
        mode: of the start: real (paced by the clock, times ``factor``), fast (as fast as it can), pause.
        factor: simulated seconds in one second of real time, in the mode real.
        step: time step in ms, a multiple of the basic step of the world; 0 for that.
        program: a file of urbiscript that makes the objects of the devices; "" for the one that the world names.
        camera_far: far clipping distance in m of cameras whose simulator does not tell it (Webots).
    """

    mode: str = setting("real", choice(*SPEEDS, wants=f"one of {', '.join(SPEEDS)}"))
    factor: float = setting(1.0, number(0.01, 100.0))
    step: int = setting(0, whole(0, 1000))
    program: str = setting("", TEXT)
    camera_far: float = setting(1000.0, number(0.01, 1e6, " m"))
