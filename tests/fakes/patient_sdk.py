"""Patience for the makers' packages, which wait for some 35 ms of wall time that a busy machine may need for others."""

from __future__ import annotations

import time
from typing import Any

SLOWER = 20
"""How many times slower the clock of a port goes than ours."""


def make_patient(port: Any) -> Any:
    """Let the clock of an SDK's port go slower, and return the port: its time limits are then that much longer."""
    port.getCurrentTime = lambda: round(time.time() * 1e9) / 1e6 / SLOWER
    return port
