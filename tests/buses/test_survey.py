"""The survey of a line: all ids at all speeds, its time, what is wrong, and that nothing is written."""

from __future__ import annotations

import pytest

from urbihw.buses.servos.findings import cycle_time, findings
from urbihw.buses.servos.survey import BAUDS, ServoSurvey, survey
from urbihw_fakes.dynamixel.unit import Unit
from urbihw_fakes.feetech.bus import FeetechBus
from urbihw_fakes.feetech.servo import FeetechServo

from .line_rig import LineRig, ax, xl


def where(found: ServoSurvey) -> list[tuple[int, int, str]]:
    return [(servo.baud, servo.device.id, servo.device.name) for servo in found.servos]


def test_254_ids_at_one_speed_in_half_a_second_in_each_protocol() -> None:
    rig = LineRig(ax(number, return_delay=250) for number in range(1, 19))
    found = survey(rig.line, [1_000_000], [1])
    assert [servo.device.id for servo in found.servos] == list(range(1, 19))
    assert found.seconds < 0.5
    rig = LineRig(xl(number, 1_000_000) for number in range(1, 19))
    assert len(survey(rig.line, [1_000_000], [2]).servos) == 18
    assert found.seconds < 0.5


def test_all_speeds_of_a_port_in_five_seconds() -> None:
    rig = LineRig([])
    found = survey(rig.line)
    assert found.bauds == BAUDS and found.servos == ()
    assert found.seconds < 5.0
    rig = LineRig(ax(number) for number in range(1, 19))
    assert len(survey(rig.line).servos) == 18
    assert rig.clock.now() - 100.0 < 5.5


def test_servos_of_both_protocols_at_different_speeds_are_found() -> None:
    units = [ax(1), ax(253, 19_231), ax(7, 57_142), xl(2), xl(252, 9_600), xl(3, 4_000_000), ax(9, 400_000)]
    rig = LineRig(units)
    assert sorted(where(survey(rig.line))) == sorted(
        [
            (1_000_000, 1, "AX-12A"), (19_200, 253, "AX-12A"), (57_600, 7, "AX-12A"), (57_600, 2, "XL430-W250"),
            (9_600, 252, "XL430-W250"), (4_000_000, 3, "XL430-W250"), (400_000, 9, "AX-12A"),
        ]
    )  # fmt: skip


def test_feetech_servos_are_found_at_all_their_speeds() -> None:
    units = [FeetechServo("STS3215", 1), FeetechServo("SCS0009", 2), FeetechServo("STS3215", 3)]
    for unit, baud in zip(units, (1_000_000, 500_000, 38_400), strict=True):
        unit.set_baud(baud)
    rig = LineRig([], kit=FeetechBus(units))
    assert where(survey(rig.line)) == [(1_000_000, 1, "STS3215"), (500_000, 2, "SCS0009"), (38_400, 3, "STS3215")]
    assert rig.instructions() == {1, 2}


def test_a_slow_adapter_hides_nobody() -> None:
    units = [*(ax(number) for number in range(1, 8)), *(xl(number, 1_000_000) for number in range(8, 12)), xl(9)]
    rig = LineRig(units, delay=0.016)
    found = survey(rig.line, [1_000_000, 57_600])
    assert found.conflicts == ()
    assert [servo.device.id for servo in found.servos] == [*range(1, 12), 9]


def test_an_adapter_that_echoes_is_nobody() -> None:
    rig = LineRig([ax(1, 57_142), xl(2)])
    rig.kit.faults.start("echo")
    assert sorted(servo.device.id for servo in survey(rig.line).servos) == [1, 2]
    rig = LineRig([])
    rig.kit.faults.start("echo")
    assert survey(rig.line).servos == ()
    assert rig.clock.now() - 100.0 < 5.5


def settings(unit: Unit) -> dict[str, int]:
    """All registers that a host may write."""
    return {row.name: unit.registers.get(row.name) for row in unit.registers.rows if row.writable}


@pytest.mark.parametrize("thorough", [False, True])
def test_a_survey_writes_nothing(thorough: bool) -> None:
    rig = LineRig([ax(1), xl(2), ax(5), ax(5), xl(8), xl(8)])
    before = [settings(unit) for unit in rig.kit]
    survey(rig.line, thorough=thorough)
    assert rig.instructions() == {1, 2}
    assert [settings(unit) for unit in rig.kit] == before


def test_two_with_one_id_are_a_conflict_at_each_speed() -> None:
    rig = LineRig([ax(5), ax(5), ax(6), xl(5), xl(5), ax(8, 200_000), ax(8, 200_000)])
    found = survey(rig.line)
    assert found.conflicts == ((1_000_000, 5), (57_600, 5), (200_000, 8))
    assert where(found) == [(1_000_000, 6, "AX-12A")]


def test_progress_goes_up_to_one() -> None:
    parts: list[float] = []
    survey(LineRig([ax(1)]).line, progress=lambda part, what: parts.append(part))
    assert parts == sorted(parts) and parts[0] == 0.0 and parts[-1] == 1.0 and len(parts) > 50


def texts(*units: Unit) -> list[list[str]]:
    found = survey(LineRig(units).line, [1_000_000, 57_600])
    return [[finding.text for finding in findings(servo)] for servo in found.servos]


def test_what_is_wrong_is_told_and_what_it_costs() -> None:
    good = ax(1, return_delay=0)
    slow = ax(2)
    narrow = ax(3, return_delay=0, cw_limit=500, ccw_limit=530)
    wheel = ax(4, return_delay=0, cw_limit=0, ccw_limit=0)
    quiet = ax(5, return_delay=0, status_level=1)
    mute = ax(6, return_delay=0, status_level=0)
    weak = ax(7, return_delay=0)
    weak.volts = 5.0
    off = ax(8, return_delay=0)
    off.overload()
    alert = xl(9)
    alert.registers.put("return_delay", 0)
    alert.pin_register("hardware_error", 0x20)
    assert texts(good, slow, narrow, wheel, quiet, mute, weak, off, alert) == [
        [],
        ["return delay 250: set return_delay_time to 0"],
        ["narrow limits: it moves only from -0.06 to 0.09 rad (cw_angle_limit, ccw_angle_limit)"],
        ["wheel mode: it turns and is no joint"],
        ["status return level 1: writes are not confirmed; set status_return_level to 2"],
        ["status return level 0: it answers pings only and cannot be read"],
        ["alarm: input voltage", "voltage 5.0 V is outside its limits 6.0..14.0 V: check the supply"],
        ["alarm: overload", "torque limit 0: it has shut itself down; mend the cause, then switch it off and on"],
        ["hardware error (overload): mend the cause, then urbihw servo reboot"],
    ]
    (servo,) = survey(LineRig([ax(2)]).line, [1_000_000]).servos
    assert findings(servo)[0].cost == pytest.approx(0.0005)
    assert cycle_time(servo) == pytest.approx(0.00072)
    assert cycle_time(servo, 0.016) == pytest.approx(0.01672)
