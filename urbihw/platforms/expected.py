"""The table ``[devices]`` of the settings: the devices that a chain should have, with their names.

::

    [devices]
    hip_l = 3                           # the name and the id on the bus
    [devices.hip_r]                     # the same with more
    id = 4
    model = "AX-12A"
    firmware = 24
    offset = 0.1                        # rad, added to the measured position
    direction = -1                      # 1, or -1 for a servo that is mounted the other way round
    limits = [-0.5, 1.2]                # rad, of the joint
    groups = ["legs"]

Nothing here opens anything.  The bus worker compares the table with what it finds (``urbihw.buses.inventory``); the
platform names its objects after it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator, Mapping
from typing import Any, Final

from urbihw.buses.messages import ExpectedDevice
from urbihw.frozen import frozen
from urbihw.kernel.syntax.tokens import is_identifier
from urbihw.kernel.uobject import BadConfig
from urbihw.platforms.taken import TAKEN
from urbihw.settings import (
    TEXT,
    TEXTS,
    Mistake,
    SettingRule,
    SettingsTable,
    checked,
    choice,
    guess,
    number,
    rising,
    setting,
    whole,
)

MAX_ID: Final = 253
"""The last id of any servo protocol."""
MAX_NAME: Final = 64
"""Characters of the name of a device or a group: it stands in messages and tables."""
MAX_ANGLE: Final = 1000.0
"""Maximum offset in rad: an arm of many turns has less."""
_NUMBERED: Final = re.compile(r"(?:motor|sensor|device)([0-9]+)")


@frozen(slots=False)
class DeviceSettings(SettingsTable):
    """A row of ``[devices]``.

    Attributes:
        id: on the bus.
        model: name of the model, such as "AX-12A"; empty for any.
        firmware: its version, such as 24 or "3.10"; empty for any.
        offset: rad, added to the measured position of the servo.
        direction: 1, or -1 for a servo whose positive direction is the joint's negative one.
        limits: lowest and highest position of the joint in rad.
        groups: the groups that it belongs to.
    """

    id: int = setting(0, whole(0, MAX_ID))
    model: str = setting("", TEXT)
    firmware: str = setting("", SettingRule((str, int), 'a version, such as 24 or "3.10"', str))
    offset: float = setting(0.0, number(-MAX_ANGLE, MAX_ANGLE, " rad"))
    direction: int = setting(1, choice(1, -1))
    limits: tuple[float, float] = setting((-math.inf, math.inf), rising(2, "[-1.0, 1.0]"))
    groups: tuple[str, ...] = setting((), TEXTS)


def read(table: Mapping[str, Any]) -> dict[str, DeviceSettings]:
    """Return the rows by the names of the devices.  Raises BadConfig for the first mistake."""
    for mistake in mistakes(table):
        raise BadConfig(f"devices.{mistake}")
    rules = DeviceSettings.rules()
    return {name: DeviceSettings(**checked(rules, _row(value), "key")[0]) for name, value in table.items()}


def ids(table: Mapping[str, Any]) -> dict[str, int]:
    """Return the ids by the names of the devices; rows with mistakes are left out."""
    found = ((name, _row(value).get("id")) for name, value in table.items())
    return {name: number for name, number in found if isinstance(number, int)}


def for_worker(table: Mapping[str, Any]) -> tuple[ExpectedDevice, ...]:
    """Return what the bus worker compares with the devices it finds.  Raises BadConfig."""
    return tuple(ExpectedDevice(row.id, name, row.model, row.firmware) for name, row in read(table).items())


def mistakes(
    table: Mapping[str, Any], models: Collection[str] | None = None, taken: Collection[str] = ()
) -> Iterator[Mistake]:
    """Yield the mistakes in a table; ``models`` are the known models, None if unknown, ``taken`` further names."""
    owners: dict[int, str] = {}
    grouped: set[str] = set()
    for name, value in table.items():
        row = _row(value)
        wrong = list(_mistakes_in_row(name, row, value, models, taken))
        text = mistake_in_name(name, row.get("id"), taken)
        if text:
            yield Mistake(name, text)
        yield from wrong
        if wrong:
            continue
        if row["id"] in owners:
            yield Mistake(name, f"id {row['id']} already belongs to {owners[row['id']]}")
        owners.setdefault(row["id"], name)
        grouped |= {*row.get("groups", ())}
    for name in sorted(grouped & table.keys()):
        yield Mistake(name, "is the name of a device and of a group; rename one of them")


def _row(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else {"id": value}


def _mistakes_in_row(
    name: str, row: Mapping[str, Any], value: Any, models: Collection[str] | None, taken: Collection[str]
) -> Iterator[Mistake]:
    if not isinstance(value, dict):
        if not DeviceSettings.rules()["id"].accepts(value):
            yield Mistake(name, f"wants the id of a device, a whole number from 0 to {MAX_ID}, or a table")
        return
    if "id" not in row:
        yield Mistake(name, "has no id; add id = 3")
    for mistake in checked(DeviceSettings.rules(), row, "key")[1]:
        yield Mistake(f"{name}.{mistake.key}", mistake.text)
    model = row.get("model")
    if models is not None and isinstance(model, str) and model and model not in models:
        yield Mistake(f"{name}.model", f'no model "{model}" is known{guess(model, sorted(models))}')
    groups = row.get("groups", ())
    for group in groups if isinstance(groups, list | tuple) else ():
        if isinstance(group, str) and mistake_in_name(group, None, taken):
            yield Mistake(f"{name}.groups", f'"{group}" cannot be the name of a group')


def mistake_in_name(name: str, id_: Any, taken: Collection[str] = ()) -> str:
    """Return why the device with this id cannot have a name, "" if it can; ``taken`` are further names.

    Everything of urbiscript inherits the slots of Global, and a named device gets one: it must hide none.
    """
    if len(name) > MAX_NAME:
        return f"is longer than {MAX_NAME} characters"
    if not is_identifier(name):
        return "is no name in urbiscript: letters, digits and _ only, and no keyword"
    if name in TAKEN or name in taken:
        return "is a slot of urbiscript or of the robot; choose another name"
    numbered = _NUMBERED.fullmatch(name)
    if numbered and int(numbered[1]) != id_:
        return f"is the name of the device with id {int(numbered[1])}; choose another name"
    return ""
