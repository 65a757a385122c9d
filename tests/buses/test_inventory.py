"""The comparison of expected devices with those that answer, and its place in the state of the control socket."""

from __future__ import annotations

from urbihw.buses import messages as m
from urbihw.buses.inventory import Inventory
from urbihw.buses.servos.device import DeviceInfo

HIP, KNEE = m.ExpectedDevice(3, "hip"), m.ExpectedDevice(4, "knee", "AX-12A", "24")


def info(number: int, name: str = "AX-12A", firmware: int = 24) -> DeviceInfo:
    return DeviceInfo(number, 12, name, "AX-12", firmware, 1, "joint")


def test_without_expected_devices_nothing_differs() -> None:
    inventory = Inventory(())
    assert inventory.hear(m.Found((info(3),))) is None
    assert inventory.state_fields() == {"expected": [], "missing": [], "unexpected": [], "other": []}


def test_each_kind_and_only_changes() -> None:
    inventory = Inventory((HIP, KNEE))
    found = inventory.hear(m.Found((info(4, firmware=25), info(9))))
    assert found == m.Differences(
        (m.Difference(3, "hip", "any model"),),
        (m.Difference(9, "", "", "AX-12A, firmware 24"),),
        (m.Difference(4, "knee", "AX-12A, firmware 24", "AX-12A, firmware 25"),),
    )
    assert inventory.hear(m.Found((info(9),))) is None
    assert inventory.state_fields()["missing"] == [{"id": 3, "name": "hip", "expected": "any model", "found": ""}]
    assert inventory.hear(m.Found((info(3), info(4)))) == m.Differences((), found.unexpected)
    lost = inventory.hear(m.DeviceState(4, "suspect", "lost", "no answer"))
    assert lost is not None and [each.name for each in lost.missing] == ["knee"]
    back = inventory.hear(m.DeviceState(4, "lost", "back", ""))
    assert back is not None and back.missing == ()
