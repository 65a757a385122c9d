"""The control tables: one data file a family in `models/`, read when a device of the family is found.

`models/index.toml` names the tables of each file and the models (number = "name") that have them, so that a model
number leads to its file without reading the others. A file holds::

    source = "manual and pages"          # where the rows come from
    [[table]]
    name = "XM430"
    base = "X"                           # begin with a copy of that table (of any file), "" for none
    protocol = 2                         # as shipped; 3 is Feetech
    byte_order = "little"                # or "big", of items of more than one byte
    sync_read = true                     # answers SYNC READ; without it: those of protocol 2 do
    eeprom_lock = "lock"                 # the item that must be 0 for a write of the EEPROM to be kept
    fast_firmware = 45                   # FAST SYNC READ from this firmware on; 0: never
    indirect = [[168, 224, 28]]          # from 168 on 28 addresses, for which the 28 bytes from 224 on stand
    follows = [0.03, 0.17]               # a joint is so many s behind its goal, and pushes hardest so many rad from it
    without = ["acceleration_limit"]     # rows of the base that this table does not have
    modes = ["velocity", "position"]     # the modes of the base that this table has; without it: all
    rows = [                             # name, address, size, access, area, low, high, default ("-": none named), unit
        ["goal_current", 102, 2, "RW", "R", -1193, 1193, "-", "xm_current"],
        ["moving_speed", 32, 2, "RW", "R", 0, 2047, "-", "ax_goal_speed", { wheel_unit = "ax_wheel" }],
    ]
    [table.change]                       # single properties of rows of the base
    goal_pwm = { low = -100, high = 100 }
    [table.hardware_errors]              # bit of the item "hardware_error" = words
    5 = "overload"
    [[table.mode]]                       # in this order: the first whose `when` holds is the mode
    name = "position"
    when = { operating_mode = 3 }        # item = raw value; {} holds always
    effector = "goal_position"           # the item that moves the shaft
    motion = "position"                  # or "rate"
    limits = ["min_position_limit", "max_position_limit"]

The columns of a row, and what the inline table behind them may hold, are the attributes of `Item`. Rows that the
driver uses have the same name in all tables: torque_enable, goal_position, present_position, and where a model has them
moving, bus_watchdog (0 off, -1 fired), status_return_level, hardware_error. A row that moves the shaft is called
goal_something, or is the effector of a mode.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, Final

from urbihw.buses.servos.item import ControlTable, Item, Mode, ShaftMotion, by_name
from urbihw.buses.servos.status import FEETECH

_FILES: Final = Path(__file__).with_name("models")
_NO_DEFAULT: Final = "-"
_COLUMNS: Final = ("name", "address", "size", "access", "area", "low", "high", "default", "unit")


def table_of(model: int) -> ControlTable | None:
    """Return the control table of a model number, None for a model we have no table of."""
    name = _tables_by_model().get(model)
    return None if name is None else table_named(name)


def table_for(model: int, protocol: int) -> ControlTable:
    """Return the control table of a device; of an unknown model, what all models of its protocol share.

    Feetech and Dynamixel give their numbers on their own, so a number alone does not tell a model.
    """
    table = table_of(model)
    known = table is not None and (table.protocol == FEETECH) == (protocol == FEETECH)
    return table if table is not None and known else generic_table(protocol)


@cache
def table_named(name: str) -> ControlTable:
    """Return a control table by its name. Raises KeyError."""
    file, models = _index()[name]
    rows = _read(file)["table"]
    return _table(next(row for row in rows if row["name"] == name), models)


@cache
def generic_table(protocol: int) -> ControlTable:
    """Return the rows that all models of a protocol share, read only: what is known of an unknown model."""
    return table_named(f"unknown model, protocol {protocol}")


def all_tables() -> tuple[ControlTable, ...]:
    """Return the tables of all models, in order of the index. This reads every file."""
    return tuple(table_named(name) for name, (_, models) in _index().items() if models)


def model_names() -> frozenset[str]:
    """Return the names of all models that have a table. This reads the index only."""
    return frozenset(model for _, models in _index().values() for model in models.values())


@cache
def _index() -> Mapping[str, tuple[str, Mapping[int, str]]]:
    """Return name of a table -> file, and model number -> name of the model."""
    return {
        table: (file, {int(number): model for number, model in models.items()})
        for file, tables in _read("index").items()
        for table, models in tables.items()
    }


@cache
def _tables_by_model() -> Mapping[int, str]:
    return {model: name for name, (_, models) in _index().items() for model in models}


@cache
def _read(file: str) -> dict[str, Any]:
    return tomllib.loads((_FILES / f"{file}.toml").read_text(encoding="utf-8"))


def _table(data: Mapping[str, Any], models: Mapping[int, str]) -> ControlTable:
    base = table_named(data["base"]) if data.get("base") else None

    def get(name: str, default: Any) -> Any:
        return data.get(name, default if base is None else getattr(base, name))

    big_endian = data["byte_order"] == "big" if "byte_order" in data else get("big_endian", False)
    errors = {int(bit): words for bit, words in data.get("hardware_errors", {}).items()}
    return ControlTable(
        name=data["name"],
        protocol=get("protocol", 0),
        models=models,
        items=_items(data, base, big_endian),
        modes=_modes(data, base),
        fast_firmware=get("fast_firmware", 0) or None,
        big_endian=big_endian,
        eeprom_lock=get("eeprom_lock", ""),
        sync_read=get("sync_read", data.get("protocol") == 2),
        hardware_errors=errors or ({} if base is None else base.hardware_errors),
        indirect=tuple(map(tuple, get("indirect", ()))),
        follows=tuple(get("follows", ControlTable.follows)),
    )


def _items(data: Mapping[str, Any], base: ControlTable | None, big_endian: bool) -> dict[str, Item]:
    rows = {} if base is None else {name: replace(row, big_endian=big_endian) for name, row in base.items.items()}
    for name in data.get("without", ()):
        del rows[name]
    for name, changed in data.get("change", {}).items():
        rows[name] = replace(rows[name], **_values(changed))
    own = by_name(_item(row, big_endian) for row in data.get("rows", ()))
    return by_name((rows | own).values())


def _item(row: list[Any], big_endian: bool) -> Item:
    more = row[-1] if isinstance(row[-1], dict) else {}
    return Item(**_values(dict(zip(_COLUMNS, row[:-1] if more else row, strict=False)) | more), big_endian=big_endian)


def _values(row: Mapping[str, Any]) -> dict[str, Any]:
    return {name: None if name == "default" and value == _NO_DEFAULT else value for name, value in row.items()}


def _modes(data: Mapping[str, Any], base: ControlTable | None) -> tuple[Mode, ...]:
    inherited = () if base is None else base.modes
    if "modes" in data:
        inherited = tuple(mode for mode in inherited if mode.name in data["modes"])
    own = tuple(
        Mode(
            name=mode["name"],
            effector=mode["effector"],
            motion=ShaftMotion(mode["motion"]),
            limits=tuple(mode.get("limits", ())),
            when=tuple(mode["when"].items()),
            direction_bit=mode.get("direction_bit"),
        )
        for mode in data.get("mode", ())
    )
    return own or inherited
