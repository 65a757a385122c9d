"""What the help of a slot says of its unit and range, which the interfaces and devices declare."""

from __future__ import annotations

import pytest
from bioloid_lab import BAUD
from bioloid_lab import Lab as Bioloid
from nxt_lab import Lab as Nxt

from urbihw_fakes.bioloid import Bioloid as Kit


@pytest.mark.parametrize(
    ("slot", "words"),
    [
        ("val", "Unit: rad. Range: -2.61799 to 2.61799."),
        ("speed", "Unit: rad/s. Range: 0 to 11.8912."),
        ("torque", "Unit: N m."),
        ("voltage", "Unit: V."),
        ("temperature", "Unit: degC."),
        ("load", "Range: 0 to 1."),
        ("model", ""),
    ],
)
def test_unit_and_range_of_a_servo(slot: str, words: str) -> None:
    fresh = Bioloid.ready(Kit(servos=(6,), sensors=(), baud=BAUD))
    assert fresh.look(f'System.documentation(motor6, "{slot}")') == f'"{words}"'


def test_a_unit_that_only_the_interface_declares() -> None:
    nxt = Nxt.ready()
    assert nxt.look('System.documentation(wheelL, "angle")') == '"Unit: rad."'
    assert nxt.look('System.documentation(wheelL, "speed")') == '"Range: -100 to 100."'


def test_a_range_that_a_program_changes_is_told_as_it_is() -> None:
    fresh = Bioloid.ready(Kit(servos=(6,), sensors=(), baud=BAUD))
    fresh.say("motor6.val->rangemax = 1|;")
    assert "Range: -2.61799 to 1." in fresh.look('System.documentation(motor6, "val")')
