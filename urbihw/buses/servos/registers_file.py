"""Backups of the registers of servos, as TOML that people can read.

    [servo.3]
    model = 12              # AX-12A
    protocol = 1
    firmware = 24
    baud = 1000000

    [servo.3.registers]
    return_delay_time = 0   # 0 s

All values are raw counts; the comments give SI units.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

from urbihw.buses.errors import BadValue
from urbihw.buses.servos import units
from urbihw.buses.servos.calibration import keep_version
from urbihw.buses.servos.item import ControlTable
from urbihw.buses.servos.tables import table_of
from urbihw.files import BadFile, cannot_read, read_regular, write_regular
from urbihw.frozen import frozen

_MAX_FILE_SIZE: Final = 1 << 22
_NUMBERS: Final = ("model", "protocol", "firmware", "baud")
_BAUDS: Final = range(300, 10_500_001)
"""The speeds that a serial line may have, in bits per second."""


class BadBackup(BadValue):
    """A backup cannot be read, written or understood; the message is one line that names the file."""


@frozen(slots=False)
class ServoBackup:
    """The registers of one servo.

    Attributes:
        id, model, protocol, firmware: as it was found.
        baud: its speed, bits per second.
        registers: item -> raw value.
    """

    id: int
    model: int
    protocol: int
    firmware: int
    baud: int
    registers: Mapping[str, int]

    @property
    def table(self) -> ControlTable | None:
        """Its control table, None for an unknown model."""
        return table_of(self.model)

    @property
    def name(self) -> str:
        """Name of its model, or its number."""
        return f"model {self.model}" if self.table is None else self.table.models.get(self.model, f"model {self.model}")


def save(path: str | Path, backups: Iterable[ServoBackup], title: str) -> Path | None:
    """Write a backup; a file that is there is kept as a former version, which is returned. Raises BadBackup."""
    path = Path(path)
    try:
        kept = keep_version(path)
        write_regular(path, to_toml(backups, title).encode())
    except BadFile as error:
        raise BadBackup(str(error)) from error
    except OSError as error:
        raise BadBackup(f"{path}: cannot be written: {error.strerror or error}") from error
    return kept


def load(path: str | Path) -> dict[int, ServoBackup]:
    """Return the servos of a backup by id. Raises BadBackup."""
    try:
        return from_toml(tomllib.loads(read_regular(Path(path), _MAX_FILE_SIZE).data.decode("utf-8")))
    except FileNotFoundError as error:
        raise BadBackup(cannot_read(Path(path), error)) from error
    except BadFile as error:
        raise BadBackup(str(error)) from error
    except BadBackup as error:
        raise BadBackup(f"{path}: {error}") from error
    except (ValueError, RecursionError) as error:  # a number of thousands of digits is a ValueError, too
        raise BadBackup(f"{path}: this is no TOML ({error})") from error


def to_toml(backups: Iterable[ServoBackup], title: str) -> str:
    """Return backups as a text, with a comment at its head."""
    lines = [f"# {title}", "# Raw counts; the comments give SI units. urbihw servo restore writes the EEPROM back."]
    for backup in backups:
        lines += ["", f"[servo.{backup.id}]", f"model = {backup.model}  # {backup.name}"]
        lines += [f"{key} = {getattr(backup, key)}" for key in _NUMBERS[1:]]
        lines += ["", f"[servo.{backup.id}.registers]"]
        lines += [_row(backup.table, name, raw) for name, raw in backup.registers.items()]
    return "\n".join(lines) + "\n"


def describe(table: ControlTable | None, name: str, raw: int) -> str:
    """Return a raw value in SI units, such as "1.57 rad"; "" for a plain number or an unknown item."""
    item = table.items.get(name) if table else None
    if item is None or item.unit == "count":
        return ""
    try:
        value = units.to_si(item, raw)
    except (BadValue, LookupError):
        return ""
    if math.isinf(value):
        return "no limit"
    return f"{value:.6g} {units.unit_of(item).symbol}".strip()


def from_toml(rows: Mapping[str, Any]) -> dict[int, ServoBackup]:
    """Return the backups of a parsed file by id. Raises BadBackup."""
    servos = rows.get("servo")
    if not isinstance(servos, dict) or rows.keys() != {"servo"}:
        raise BadBackup("a backup has tables such as [servo.3] and nothing else")
    return {backup.id: backup for backup in (_backup(key, row) for key, row in servos.items())}


def _row(table: ControlTable | None, name: str, raw: int) -> str:
    words = describe(table, name, raw)
    return f"{name} = {raw}" + (f"  # {words}" if words else "")


def _backup(key: str, row: Any) -> ServoBackup:
    if not (key.isascii() and key.isdigit() and int(key) <= 253):
        raise BadBackup(f"servo.{key}: the id is a number from 0 to 253")
    if not isinstance(row, dict) or row.keys() != {*_NUMBERS, "registers"}:
        raise BadBackup(f"servo.{key}: {', '.join(_NUMBERS)} and a table registers are wanted")
    registers = row["registers"]
    if not isinstance(registers, dict):
        raise BadBackup(f"servo.{key}.registers: this is no table")
    for name, value in [*((name, row[name]) for name in _NUMBERS), *registers.items()]:
        if type(value) is not int or abs(value) >= 1 << 32:
            raise BadBackup(f"servo.{key}: {name} is a whole number, not {value!r}")
    if row["baud"] not in _BAUDS:
        raise BadBackup(f"servo.{key}: baud is {_BAUDS[0]}..{_BAUDS[-1]}, not {row['baud']}")
    backup = ServoBackup(int(key), row["model"], row["protocol"], row["firmware"], row["baud"], registers)
    _check_names(backup)
    return backup


def _check_names(backup: ServoBackup) -> None:
    """Raise BadBackup for a register that the model does not have; nothing is passed over in silence."""
    if backup.table is None:
        return
    for name in backup.registers:
        if name not in backup.table.items:
            raise BadBackup(f"servo.{backup.id}: {backup.name} has no register {name!r}: correct or remove that line")
