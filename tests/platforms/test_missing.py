"""Which devices of a servo bus are missing, when the settings are read again."""

from __future__ import annotations

import logging

import pytest

from urbihw.platforms.devicelog import DeviceLog
from urbihw.platforms.servos.missing import MissingDevices


@pytest.mark.parametrize(("before", "ids", "expected", "missing"), [
    ((), (1, 2), (), []),
    ((), (1, 2), (5,), [5.0]),
    ((1, 5), (1, 2), (), []),
    ((1, 2), (1, 2), (), []),
    ((1, 2), (), (), [5.0]),
])  # fmt: skip
def test_what_the_settings_do_not_name_any_more_is_not_missing(
    before: tuple[int, ...], ids: tuple[int, ...], expected: tuple[int, ...], missing: list[float]
) -> None:
    shown: list[list[float]] = []
    log = DeviceLog(logging.getLogger("urbihw.test"), lambda: 0.0, lambda seconds, call: lambda: None)
    devices = MissingDevices(log, shown.append)
    devices.open(before)
    devices.add(5)
    devices.reload(ids, expected)
    assert (shown[-1], devices.words()) == (missing, ", missing: 5" if missing else "")
