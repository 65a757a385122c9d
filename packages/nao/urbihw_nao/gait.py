"""Foot-step parameters of walking: the list that goes with ``ALMotion.move`` (NAOqi: "move config parameters")."""

from __future__ import annotations

from typing import Any, Final

from urbihw.kernel.uobject import finite_number

PARAMETERS: Final = (
    "MaxStepX", "MaxStepY", "MaxStepTheta", "MaxStepFrequency", "StepHeight", "TorsoWx", "TorsoWy",
)  # fmt: skip
"""m, m, rad, a share of 1, m, rad, rad; with "Left" or "Right" before it for the steps of one foot."""

Gait = list[tuple[str, float]]


def parse_gait(value: Any) -> Gait:
    """Check a list of names and numbers, such as [["MaxStepX", 0.02]].  Raises ValueError."""
    if not isinstance(value, list | tuple):
        raise ValueError('takes a list such as [["MaxStepX", 0.02]]')
    found: dict[str, float] = {}
    for row in value:
        if not isinstance(row, list | tuple) or len(row) != 2 or not isinstance(row[0], str):
            raise ValueError('takes a list such as [["MaxStepX", 0.02]]')
        name = row[0]
        if name.removeprefix("Left").removeprefix("Right") not in PARAMETERS:
            known = ", ".join(PARAMETERS)
            raise ValueError(f"no parameter of steps {name}; there are {known}, and these with Left or Right")
        found[name] = finite_number(row[1])
    return list(found.items())
