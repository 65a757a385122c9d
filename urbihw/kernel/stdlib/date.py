"""Date: a date and time of day, to the microsecond."""

from __future__ import annotations

import re
from datetime import datetime, timedelta
from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.duration import make_duration
from urbihw.kernel.value import Value

TABLE = Table("Date")
PROTOS = {"Date": ("Orderable", "Comparable")}
EPOCH = datetime(1970, 1, 1)
_FORM = re.compile(
    r"\s*(\d{4})-(\d{1,2}|[A-Za-z]{3})-(\d{1,2})(?:[ T]+(\d{1,2})(?::(\d{1,2})(?::(\d{1,2})(\.\d+)?)?)?)?\s*"
)
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")


class DateObject(Obj):
    """An urbiscript Date; ``moment`` is in local time, without time zone."""

    __slots__ = ("moment",)

    def __init__(self, world: World, protos: list[Obj], moment: datetime = EPOCH) -> None:
        super().__init__(world, protos)
        self.moment = moment

    def clone(self) -> DateObject:
        """A new Date with the same value."""
        return DateObject(self.world, [self], self.moment)


CLASSES = {"Date": DateObject}


def _make(world: World, moment: datetime) -> DateObject:
    proto: Any = world.classes["Date"]
    return DateObject(world, [proto], moment)


def parse(text: str) -> datetime:
    """Parse ``yyyy-mm-dd hh:mn:ss``; the month may be a name of three letters, minutes and seconds are optional."""
    found = _FORM.fullmatch(text)
    if found is None:
        raise errors.primitive(f"cannot convert to date: {text}")
    year, month, day, hour, minute, second, fraction = found.groups()
    try:
        number = int(month) if month.isdigit() else _MONTHS.index(month.lower()) + 1
        micro = round(float(fraction or 0) * 1e6)
        return datetime(int(year), number, int(day), int(hour or 0), int(minute or 0), int(second or 0), micro)
    except ValueError as error:
        raise errors.primitive(f"cannot convert to date: {text}") from error


def _later(world: World, moment: datetime, seconds: float) -> DateObject:
    try:
        return _make(world, moment + timedelta(seconds=seconds))
    except (OverflowError, ValueError) as error:  # ValueError: not a number
        raise errors.primitive("date out of range: years go from 1 to 9999") from error


@TABLE.primitive("init")
def init(world: World, this: DateObject, text: str | None = None) -> None:
    """Make a Date of the present time, or of a text ``yyyy-mm-dd hh:mn:ss``.  Raises ``cannot convert to date``."""
    this.moment = datetime.now() if text is None else parse(text)


@TABLE.primitive("now")
def now(world: World, this: Value) -> Value:
    """The present date and time."""
    return _make(world, datetime.now())


@TABLE.primitive("epoch")
def epoch(world: World, this: Value) -> Value:
    """The origin of times: 1970-01-01 00:00."""
    return _make(world, EPOCH)


@TABLE.primitive("+")
def plus(world: World, this: DateObject, duration: float) -> Value:
    """The Date that is later by ``duration`` seconds."""
    return _later(world, this.moment, duration)


@TABLE.primitive("-")
def minus(world: World, this: DateObject, that: Value) -> Value:
    """The Duration since another Date, or the Date that is earlier by a number of seconds."""
    if isinstance(that, DateObject):
        return make_duration(world, (this.moment - that.moment).total_seconds())
    return _later(world, this.moment, -world.as_float(that, 1, "-"))


@TABLE.primitive("==")
def equal(world: World, this: DateObject, that: Value) -> bool:
    """Whether both Dates have the same value."""
    return isinstance(that, DateObject) and this.moment == that.moment


@TABLE.primitive("<")
def less(world: World, this: DateObject, that: DateObject) -> bool:
    """Whether this Date is before the argument."""
    return this.moment < that.moment


@TABLE.primitive("asFloat", "timestamp")
def as_float(world: World, this: DateObject) -> float:
    """The seconds since the epoch."""
    return (this.moment - EPOCH).total_seconds()


@TABLE.primitive("asString")
def as_string(world: World, this: DateObject) -> str:
    """``yyyy-mm-dd hh:mn:ss``, with microseconds if they are not 0."""
    return str(this.moment)
