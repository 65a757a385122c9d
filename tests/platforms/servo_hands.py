"""Hands at the horns of simulated servos: they hold a joint, turn it, and let it go."""

from __future__ import annotations

import math
from typing import Any

from random_programs import INF, Hand

from urbihw_fakes.dynamixel.ax12 import DEGREES, Ax12
from urbihw_fakes.dynamixel.servo import Shaft
from urbihw_fakes.dynamixel.xseries import XSeries
from urbihw_fakes.dynamixel.xtables import STEPS
from urbihw_fakes.feetech.servo import FeetechServo


def body_of(unit: Any) -> Any:
    """What turns of a servo: with ``held``, and ``load`` where the fake has forces."""
    return unit.motor if isinstance(unit, XSeries | FeetechServo) else unit


def turn_horn(unit: Any, way: float) -> None:
    """Turn the horn of a servo by an angle, rad."""
    match unit:
        case XSeries():
            unit.motor.position += way / math.tau * STEPS
        case FeetechServo():
            unit.motor.turn(way / math.tau * unit.steps)
        case Ax12():
            unit.position += way / math.radians(DEGREES)
        case Shaft():
            unit.position += way / math.tau * unit.family.counts


def hand_at(number: int, middle: float, springs: float = INF) -> Hand:
    """A hand at the joint with this id of a lab with a ``kit``; see ``random_programs.Hand``."""

    def hold(lab: Any, held: bool) -> None:
        lab.kit.tick(lab.bus_clock.now())
        body_of(lab.kit[number]).held = held

    def turn_it(lab: Any, way: float) -> None:
        lab.kit.tick(lab.bus_clock.now())
        turn_horn(lab.kit[number], way)

    return Hand(hold, turn_it, middle, springs)
