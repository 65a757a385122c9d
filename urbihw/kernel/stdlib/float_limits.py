"""Float.limits: the limits of floating point numbers."""

from __future__ import annotations

import sys
from typing import Any

from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib import prototype
from urbihw.kernel.stdlib.support import constant

PROTOS = {"Float.limits": ("Singleton",)}


def install(world: World, programs: Any) -> None:
    """Make the constants, with the names of the manual and the values of the platform's double."""
    limits = prototype(world, "Float.limits")
    info = sys.float_info
    values = {
        "digits": info.mant_dig,
        "digits10": info.dig,
        "epsilon": info.epsilon,
        "max": info.max,
        "maxExponent": info.max_exp,
        "maxExponent10": info.max_10_exp,
        "min": info.min,
        "minExponent": info.min_exp,
        "minExponent10": info.min_10_exp,
        "radix": info.radix,
    }
    for name, value in values.items():
        constant(limits, name, float(value))
