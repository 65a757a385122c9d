"""The latch of an emergency stop in a file beside the control socket: the worker that replaces a hanging one reads it.

``urbihw estop`` must be quick, so this imports nothing but ``os``.
"""

from __future__ import annotations

import os


def write_latch(control: str | os.PathLike[str], who: str) -> bool:
    """Set the latch of the robot with this control socket; returns whether that was possible."""
    try:
        with open(os.path.splitext(control)[0] + ".estop", "w", encoding="utf-8") as file:
            file.write(f"{who}\n")
    except OSError:
        return False
    return True
