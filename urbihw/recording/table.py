"""Measured values as a table: CSV with a column for each value of each device, a row for each time; no I/O."""

from __future__ import annotations

import csv
import math
import sys
from collections.abc import Collection, Iterator
from typing import TYPE_CHECKING, Final

from urbihw.recording import topics
from urbihw.recording.reading import NO_SENSE, RecordedMessage, Recording, UnreadableRecording
from urbihw.settings import escape_unprintable

if TYPE_CHECKING:
    from _typeshed import SupportsWrite

_MAX_FLOAT: Final = int(sys.float_info.max)
MOST_COLUMNS: Final = 10_000
MOST_NAME: Final = 200
"""Characters of the name of a column at most."""


def write_csv(recording: Recording, wanted: Collection[str], stream: SupportsWrite[str], *, raw: bool) -> int:
    """Write the values of a recording, in SI units or (``raw``) as the counts of each tick; return the rows.

    ``wanted`` are columns such as ``6.position``, or devices; none for all. An empty cell was not measured at that
    time. The file is read twice: the first time for its columns. Raises UnreadableRecording.
    """
    topic = topics.SAMPLES if raw else topics.VALUES
    columns: dict[str, None] = {}
    for _, row in _rows(recording, topic):
        columns |= dict.fromkeys(row)
        if len(columns) > MOST_COLUMNS:
            raise UnreadableRecording(f"{recording.path}: has more than {MOST_COLUMNS} values")
    chosen = _chosen(recording, columns, wanted)
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["time", *chosen])
    count = 0
    for message, row in _rows(recording, topic):
        if any(name in row for name in chosen):
            writer.writerow([f"{message.time:.6f}", *(row.get(name, "") for name in chosen)])
            count += 1
    return count


def curves(
    recording: Recording, wanted: Collection[str], since: float, until: float, *, raw: bool
) -> dict[str, list[tuple[float, float]]]:
    """Return the values between two times in s as curves: times and numbers, by the names of their columns.

    ``wanted`` are columns or devices, at least one, ``raw`` as for ``write_csv``.  A whole number that is too large for
    a float is left out.  Raises UnreadableRecording.
    """
    found: dict[str, list[tuple[float, float]]] = {}
    for message, row in _rows(recording, topics.SAMPLES if raw else topics.VALUES, since, until):
        for name, value in row.items():
            is_wanted = name in wanted or name.partition(".")[0] in wanted
            if is_wanted and (isinstance(value, float) or isinstance(value, int) and abs(value) <= _MAX_FLOAT):
                found.setdefault(name, []).append((message.time, float(value)))
            else:
                found.setdefault(name, [])
        if len(found) > MOST_COLUMNS:
            raise UnreadableRecording(f"{recording.path}: has more than {MOST_COLUMNS} values")
    return {name: found[name] for name in _chosen(recording, found, wanted)}


def _chosen(recording: Recording, columns: Collection[str], wanted: Collection[str]) -> list[str]:
    """The columns that are wanted.  Raises UnreadableRecording if one of them is not there."""
    missing = [name for name in wanted if not any(name in (each, each.partition(".")[0]) for each in columns)]
    if missing:
        known = ", ".join(columns) or "none"
        raise UnreadableRecording(f"{recording.path}: has no values of {missing[0]}; it has: {known}")
    return [name for name in columns if not wanted or name in wanted or name.partition(".")[0] in wanted]


def _rows(
    recording: Recording, topic: str, since: float = -math.inf, until: float = math.inf
) -> Iterator[tuple[RecordedMessage, dict[str, object]]]:
    for message in recording.messages((topic,), since, until):
        try:
            values = message.content()["values"]
            row = {
                _name(device, item): _cell(value) for device, items in values.items() for item, value in items.items()
            }
        except NO_SENSE:
            continue
        yield message, row


def _name(device: str, item: str) -> str:
    """The name of a column.  Raises ValueError for one that is too long."""
    if len(device) + len(item) > MOST_NAME:
        raise ValueError("too long")
    return _text(f"{device}.{item}")


def _cell(value: object) -> object:
    """A value as a cell: a number, or a text."""
    if value is None or isinstance(value, int | float):
        return "" if value is None else value
    return _text(str(value))


def _text(text: str) -> str:
    """A text as a cell, in printable characters: what a spreadsheet would take for a formula is quoted."""
    return escape_unprintable(f"'{text}" if text[:1] in ("=", "+", "-", "@") else text)
