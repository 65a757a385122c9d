"""The latches of emergency stops in a file beside the control socket: the worker that replaces a hanging one reads it.

``urbihw estop`` must be quick, so this imports nothing but ``os``.
"""

from __future__ import annotations

import os


def write_latch(control: str | os.PathLike[str], who: str, user: str) -> bool:
    """Set a user's latch of the robot with this control socket, beside those of others; returns whether that was
    possible."""
    try:
        with open(os.path.splitext(control)[0] + ".estop", "a", encoding="utf-8") as file:
            file.write(f"{who}\t{user}\n")
    except OSError:
        return False
    return True
