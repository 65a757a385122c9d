"""Messages as lines of JSON: nothing that a driver or a platform puts into one ends the loop of the worker."""

from __future__ import annotations

import json
from types import MappingProxyType
from typing import Any

import pytest

from urbihw.buses.events import event_line

HUGE = 10**5000


class Shy:
    """A value that does not show itself."""

    def __str__(self) -> str:
        raise RuntimeError("not today")

    __repr__ = __str__


@pytest.mark.parametrize(("value", "shown"), [
    (HUGE, "a number of 16610 bits"), (-HUGE, "a number of 16610 bits"),
    ([{"a": HUGE}], [{"a": "a number of 16610 bits"}]),
    ({HUGE: 1}, {"a number of 16610 bits": 1}), (Shy(), "a Shy"), ({(1, 2): Shy()}, {"(1, 2)": "a Shy"}),
    ({(HUGE,): 1}, {"a tuple": 1}), (MappingProxyType({"a": {HUGE}}), {"a": ["a number of 16610 bits"]}),
    ({True: None, None: 1.5}, {"true": None, "null": 1.5}), (10**100, 10**100),
], ids=map(str, range(10)))  # fmt: skip
def test_odd_values_have_a_line(value: Any, shown: Any) -> None:
    line = event_line({"event": "Reply", "value": value})
    assert json.loads(line) == {"event": "Reply", "value": shown} and line.count(b"\n") == 1
