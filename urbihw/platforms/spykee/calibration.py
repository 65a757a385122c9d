"""The speeds of a robot at full power, measured by its owner, kept in a file.

A Spykee measures no distance: ``robot.go`` and ``robot.turn`` run the tracks for a time that is computed from these two
numbers.  The file holds them as JSON for each robot, by its identifier.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

from urbihw.frozen import frozen

FILE: Final = "spykee-calibration.json"
LEAST, MOST = 0.2, 5.0
"""Limits of the factor by which a calibration may change a number; a typing error is outside."""


@frozen
class Calibration:
    """``speed``: m/s of both tracks at 100; ``turn``: rad/s with the tracks at 100 and -100."""

    speed: float
    turn: float

    def tracks(self, x: float, yaw: float) -> tuple[float, float]:
        """The speeds of the tracks (left, right; -100..100) for a speed ahead (m/s) and to the left (rad/s).

        Speeds beyond the maximum are scaled together, so that the path keeps its shape.
        """
        left, right = x / self.speed - yaw / self.turn, x / self.speed + yaw / self.turn
        scale = 100 / max(1.0, abs(left), abs(right))
        return left * scale, right * scale

    def after_going(self, asked: float, went: float) -> Calibration:
        """The calibration with which ``robot.go(asked)`` would have been right.  Raises ValueError."""
        return replace(self, speed=self.speed * _ratio(asked, went))

    def after_turning(self, asked: float, turned: float) -> Calibration:
        """The calibration with which ``robot.turn(asked)`` would have been right.  Raises ValueError."""
        return replace(self, turn=self.turn * _ratio(asked, turned))


def _ratio(asked: float, found: float) -> float:
    ratio = found / asked if asked and math.isfinite(asked) and math.isfinite(found) else math.nan
    if not LEAST <= ratio <= MOST:
        raise ValueError(f"what was asked for and what was measured must be alike; not {asked:g} and {found:g}")
    return ratio


def calibration_file(option: str, environment: Mapping[str, str] = os.environ) -> Path:
    """The file of calibrations: that of the settings, or one in the folder of the service or of the user."""
    if option:
        return Path(option)
    if environment.get("STATE_DIRECTORY"):
        return Path(environment["STATE_DIRECTORY"].split(":")[0]) / FILE
    home = environment.get("XDG_STATE_HOME") or os.path.join(environment.get("HOME", "~"), ".local", "state")
    return Path(home).expanduser() / "urbihw" / FILE


def load(path: Path, uid: str, default: Calibration) -> Calibration:
    """The calibration of a robot; the default if there is none.  Raises ValueError for a damaged file."""
    try:
        row = _read(path).get(uid)
        return default if row is None else Calibration(_positive(row["speed"]), _positive(row["turn"]))
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"{path}: no calibration: {error!r}; remove the file and calibrate again") from error


def save(path: Path, uid: str, calibration: Calibration) -> None:
    """Write the calibration of a robot.  Raises ValueError, OSError."""
    rows = _read(path)
    rows[uid] = {"speed": calibration.speed, "turn": calibration.turn}
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = path.with_name(f"{path.name}.{os.getpid()}")
    fresh.write_text(json.dumps(rows, indent=1) + "\n", "utf-8")
    fresh.replace(path)


def _read(path: Path) -> dict[str, dict[str, float]]:
    try:
        rows = json.loads(path.read_text("utf-8"))
    except OSError:
        return {}
    except ValueError as error:
        raise ValueError(f"{path}: no calibration: {error}; remove the file and calibrate again") from error
    if not isinstance(rows, dict):
        raise ValueError(f"{path}: no calibration: it is no table; remove the file and calibrate again")
    return rows


def _positive(value: object) -> float:
    if not isinstance(value, int | float) or not 0 < value < 100:
        raise KeyError(str(value))
    return float(value)
