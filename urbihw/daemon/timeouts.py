"""The chain of time-outs between a program and the robot: each link ends before the next one fires.

1. A job that holds the interpreter gets an error after ``hold_limit``, and is ended when it goes on for half of that
   again (``urbihw.kernel.server.watchdog``).
2. The worker stops the robot after ``dead_man`` without a sign of life; there are four in that time.  So a program that
   holds the interpreter, from one sign of life to the next that it delays, is over before: no program of one client
   stops the robot of another.
3. Clients wait for an answer for 3 s and more (``urbihw.client.connect.PROMPT_TIMEOUT_S``): the robot is stopped before
   they give up.

The first is processor time, because a machine with much else to do must not end innocent programs; the second is time
by the clock, because the body moves by the clock.
"""

from __future__ import annotations

from typing import Final

from urbihw.kernel.server.bounds import HOLD_LIMIT
from urbihw.platforms.manifest import Manifest
from urbihw.settings import Mistake

MAX_SHARE: Final = 1 / 2
"""The longest hold as a share of the dead man: with its grace it takes three quarters, a sign of life the fourth."""
DEFAULT_SHARE: Final = 1 / 3
"""The share by default, which leaves a quarter of the time to a loaded machine."""


def dead_man_in_force(wanted: float, manifest: Manifest | None) -> float:
    """The dead man's time in s; 0 for never.  A robot that cannot wait (a Segway) has one that is never longer."""
    most = 0.0 if manifest is None else manifest.dead_man
    return min(wanted or most, most) if most else wanted


def default_hold_limit(dead_man: float) -> float:
    """The limit in s for a job that holds the interpreter, where the settings give none."""
    return min(HOLD_LIMIT, DEFAULT_SHARE * dead_man) if dead_man else HOLD_LIMIT


def mistake_in_order(hold_limit: float, dead_man: float) -> Mistake | None:
    """What is wrong with a limit beside a dead man's time in force, None if nothing is.

    0 is no limit, and allowed: a job that holds then stops the robot.
    """
    longest = MAX_SHARE * dead_man
    if not dead_man or hold_limit <= longest:
        return None
    return Mistake("hold_limit", f"{hold_limit:g} s is too long: the robot is stopped after {dead_man:g} s without a "
                   f"sign of life of the daemon (dead_man), so one program could stop it; give at most {longest:g} s")
