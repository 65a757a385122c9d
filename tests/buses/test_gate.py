"""The limits of the moment hold for everything that the gate itself writes, judged at the registers of a servo."""

from __future__ import annotations

import pytest

from urbihw.buses import messages as m

from .conftest import Rig
from .test_worker import Bench

ITEM = (6, "torque_limit")


def hot(restored: int) -> m.Threshold:
    return m.Threshold(
        6, "present_temperature", 10.0, "limits.motor6.temperature", targets=((ITEM[1], 200),),
        restored=((ITEM[1], restored),),
    )  # fmt: skip


@pytest.mark.parametrize(("limit", "becomes"), ((m.Limit(0, 500), 500), (m.Limit(0, 1023), 900), (None, 900)))
def test_what_a_removed_threshold_had_changed_is_restored_within_the_new_limits(
    rig: Rig, limit: m.Limit | None, becomes: int
) -> None:
    bench = Bench(rig, m.Configure(dead_man=0))
    bench.tell(m.Limits({}, (hot(900),)), m.Watch(6, ("present_temperature",), 0.0))
    bench.run(0.8)
    registers = rig.kit.servo(6).registers
    assert registers.get("torque_limit") == 200
    bench.tell(m.Limits({} if limit is None else {ITEM: limit}))
    bench.run(0.3)
    assert registers.get("torque_limit") == becomes
    bench.close()
