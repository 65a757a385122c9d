"""The latch of an emergency stop in a file beside the control socket: the worker that replaces a hanging one reads it.

It imports nothing of asyncio: ``urbihw estop`` must be quick.
"""

from __future__ import annotations

from pathlib import Path


def write_latch(control: Path, who: str) -> bool:
    """Set the latch of the robot with this control socket; returns whether that was possible."""
    try:
        control.with_suffix(".estop").write_text(f"{who}\n", "utf-8")
    except OSError:
        return False
    return True
