"""What a worker on a Dynamixel wire may be told beyond what every worker is told (`messages.Configure.options`)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, Self

from urbihw.buses.errors import BadValue

_LAST_ID = 252


@dataclass(frozen=True)
class Options:
    """The options of the family, checked.

    Attributes:
        protocol: 1, 2 or "auto"; read when the link opens.
        ids: devices to look for when the link opens, None for all.
        fast_read: use FAST SYNC READ where all devices of a group can do it.
    """

    protocol: Literal[1, 2, "auto"] = "auto"
    ids: tuple[int, ...] | None = None
    fast_read: bool = True

    @classmethod
    def of(cls, options: Mapping[str, Any]) -> Self:
        """Check options by name; those of others are left alone. Raises BadValue, saying what is wanted."""
        protocol, ids = options.get("protocol", "auto"), options.get("ids")
        if protocol not in (1, 2, "auto"):
            raise BadValue(f'protocol must be 1, 2 or "auto", not {protocol!r}')
        if ids is not None and not (isinstance(ids, list | tuple) and all(isinstance(number, int) for number in ids)):
            raise BadValue(f"ids must be a list of numbers, such as [1, 2, 100], not {ids!r}")
        if ids is not None and not all(0 <= number <= _LAST_ID for number in ids):
            raise BadValue(f"ids are 0 to {_LAST_ID}, not {next(n for n in ids if not 0 <= n <= _LAST_ID)}")
        fast_read = options.get("fast_read", True)
        if not isinstance(fast_read, bool):
            raise BadValue(f"fast_read must be true or false, not {fast_read!r}")
        return cls(protocol, None if ids is None else tuple(ids), fast_read)
