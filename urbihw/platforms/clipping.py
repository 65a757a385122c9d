"""The limits of the settings as the daemon computes them for what a device shows.

The bus worker enforces the limits; its report comes some milliseconds after the write.  The daemon has the same table,
so that ``applied`` and ``limitedBy`` are right behind the write already.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

from urbihw.buses.messages import Limit, Limited

Key = tuple[Any, str]


class ClippingConverter(Protocol):
    """Converts raw targets for the comparison with limits."""

    def signed_target(self, device: Any, item: str, raw: Any) -> float:
        """Return a raw target as a signed number."""
        ...

    def raw_target(self, device: Any, item: str, signed: float) -> Any:
        """Return the raw target of a signed number: the inverse."""
        ...


class TargetLimits:
    """The limits of all targets of a robot; ``report`` gets the message that the worker will send for a target."""

    def __init__(self, converter: ClippingConverter, report: Callable[[Limited], None]) -> None:
        self._converter, self._report = converter, report
        self._table: Mapping[Key, Limit] = {}
        self._newest: dict[Key, Any] = {}
        self._limited: set[Key] = set()

    def set_table(self, table: Mapping[Key, Limit]) -> None:
        """Use these limits from now on."""
        self._table = table
        self._newest.clear()

    def check_target(self, device: Any, item: str, raw: Any) -> None:
        """Report a target that its limit changes, and the first one that is within the limit again."""
        key = device, item
        limit = self._table.get(key)
        if limit is None or raw.__class__ is bool or not isinstance(raw, int | float):
            return
        self._newest[key] = raw
        asked = self._converter.signed_target(device, item, raw)
        applied = min(max(asked, limit.low), limit.high)
        if applied != asked:
            self._limited.add(key)
            self._report(Limited(device, item, raw, self._converter.raw_target(device, item, applied), limit.name))
        elif key in self._limited:
            self._limited.discard(key)
            self._report(Limited(device, item, raw, raw, ""))

    def is_outdated(self, message: Limited) -> bool:
        """Whether a report of the worker is about a target that was written before the newest one."""
        newest = self._newest.get((message.device, message.item))
        return newest is not None and bool(newest != message.requested)
