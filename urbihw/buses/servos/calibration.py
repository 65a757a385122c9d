"""Calibration files of servo chains, in the JSON format of LeRobot.

One object per joint, all numbers raw counts::

    {"shoulder_pan": {"id": 1, "drive_mode": 0, "homing_offset": -1470, "range_min": 700, "range_max": 3400}}

`homing_offset` is the register of the same name in the servo (Feetech: present = actual - offset; Dynamixel X: present
= actual + offset); `range_min` and `range_max` are positions as the servo reports them with that offset; `drive_mode`
1 reverses the direction of the joint. A file that is written anew keeps the former versions beside it: `arm.json.1` is
the oldest. Source of the format: LeRobot, `lerobot/motors/motors_bus.py`, class MotorCalibration.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, Final

from urbihw.buses.errors import BadValue
from urbihw.files import BadFile, cannot_read, read_regular, write_regular
from urbihw.frozen import frozen

Calibration = Mapping[str, "JointCalibration"]
_MAX_FILE_SIZE: Final = 1 << 20
_MAX_ID: Final = 253
_COUNT_LIMIT: Final = 1 << 31


class BadCalibration(BadValue):
    """A calibration file cannot be read, written or understood; the message is one line that names the file."""


@frozen(slots=False)
class JointCalibration:
    """The calibration of one joint, in raw counts.

    Attributes:
        id: of the servo on its bus, 0..253.
        drive_mode: 1 if the direction of the joint is the reverse of that of the servo, else 0.
        homing_offset: the offset in the servo when the range was recorded; 0 for a servo without such a register.
        range_min, range_max: lowest and highest position, with that offset; range_min < range_max.

    Raises BadCalibration for a field outside its range.
    """

    id: int
    drive_mode: int
    homing_offset: int
    range_min: int
    range_max: int

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if type(value) is not int or not -_COUNT_LIMIT <= value < _COUNT_LIMIT:
                raise BadCalibration(f"{field.name} is a whole number, not {value!r}")
        if not 0 <= self.id <= _MAX_ID:
            raise BadCalibration(f"id is 0..{_MAX_ID}, not {self.id}")
        if self.drive_mode not in (0, 1):
            raise BadCalibration(f"drive_mode is 0 or 1, not {self.drive_mode}")
        if self.range_min >= self.range_max:
            raise BadCalibration(f"range_min {self.range_min} is not below range_max {self.range_max}")

    @property
    def middle(self) -> float:
        """The middle of the range, in counts."""
        return (self.range_min + self.range_max) / 2


def load(path: str | Path) -> dict[str, JointCalibration]:
    """Return the joints of a file by name, in its order. Raises BadCalibration."""
    try:
        rows = json.loads(read_regular(Path(path), _MAX_FILE_SIZE).data, object_pairs_hook=_unique)
    except FileNotFoundError as error:
        raise BadCalibration(cannot_read(Path(path), error)) from error
    except BadFile as error:
        raise BadCalibration(str(error)) from error
    except BadCalibration as error:
        raise BadCalibration(f"{path}: {error}") from error
    except (ValueError, RecursionError) as error:
        raise BadCalibration(f"{path}: this is no JSON ({error})") from error
    if not isinstance(rows, dict):
        raise BadCalibration(f"{path}: write an object with one entry per joint")
    calibration = {name: _joint(path, name, row) for name, row in rows.items()}
    _check(path, calibration)
    return calibration


def save(path: str | Path, calibration: Calibration) -> Path | None:
    """Write a file; it is replaced in one step, and is the old or the new one if that is interrupted.

    Returns where the former version is kept, None if there was none or it is the same. Raises BadCalibration.
    """
    path = Path(path)
    _check(path, calibration)
    text = json.dumps({name: asdict(joint) for name, joint in calibration.items()}, indent=4) + "\n"
    try:
        if path.exists() and path.read_text("utf-8", "replace") == text:
            return None
        kept = keep_version(path)
        write_regular(path, text.encode())
    except BadFile as error:
        raise BadCalibration(str(error)) from error
    except OSError as error:
        raise BadCalibration(f"{path}: cannot be written: {error.strerror or error}") from error
    return kept


def diff(old: Calibration, new: Calibration) -> list[str]:
    """Return what differs between two calibrations, one line per joint, in order of the names."""
    lines = []
    for name in sorted(old.keys() | new.keys()):
        before, after = old.get(name), new.get(name)
        if before is None or after is None:
            lines.append(f"{name}: only in the {'second' if before is None else 'first'} file")
        elif before != after:
            one, two = asdict(before), asdict(after)
            changed = [f"{field} {one[field]} -> {two[field]}" for field in one if one[field] != two[field]]
            lines.append(f"{name}: {', '.join(changed)}")
    return lines


def versions(path: str | Path) -> list[Path]:
    """Return the former versions of a file, the oldest first."""
    path = Path(path)
    found = path.parent.glob(f"{path.name}.*")
    numbered = [file for file in found if file.suffix[1:].isdigit() and file.name == f"{path.name}{file.suffix}"]
    return sorted(numbered, key=lambda file: int(file.suffix[1:]))


def keep_version(path: Path) -> Path | None:
    """Keep the present file, if there is one, under the next free number, and return that. Raises OSError."""
    if not path.exists():
        return None
    kept = versions(path)
    number = int(kept[-1].suffix[1:]) + 1 if kept else 1
    target = path.with_name(f"{path.name}.{number}")
    shutil.copy2(path, target)
    return target


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    rows: dict[str, Any] = {}
    for name, value in pairs:
        if name in rows:
            raise BadCalibration(f"{name!r} is there twice")
        rows[name] = value
    return rows


def _joint(path: str | Path, name: str, row: object) -> JointCalibration:
    """Return one joint of a file. Fields that a later LeRobot may add are passed over. Raises BadCalibration."""
    if not name or not name.isprintable():
        raise BadCalibration(f"{path}: joint {name!r}: a name is printable text")
    wanted = [field.name for field in fields(JointCalibration)]
    if not isinstance(row, dict) or (missing := [field for field in wanted if field not in row]):
        lack = ", ".join(missing) if isinstance(row, dict) else ", ".join(wanted)
        raise BadCalibration(f"{path}: joint {name!r} lacks {lack}")
    try:
        return JointCalibration(**{field: row[field] for field in wanted})
    except BadCalibration as error:
        raise BadCalibration(f"{path}: joint {name!r}: {error}") from error


def _check(path: str | Path, calibration: Calibration) -> None:
    """Raise BadCalibration if two joints have one id."""
    owners: dict[int, str] = {}
    for name, joint in calibration.items():
        if joint.id in owners:
            raise BadCalibration(f"{path}: {owners[joint.id]} and {name} have the same id {joint.id}")
        owners[joint.id] = name
