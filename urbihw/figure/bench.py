"""The figure of a robot of which only its joints are known: each one on a bench of its own, in a row, with a pointer.

That is all that can be drawn of a chain of servos or of drives whose build the settings do not tell.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from urbihw.figure.model import UNITS, Figure, FigureJoint, FigureLink, FigureShape

PER_ROW = 9
APART_M = 0.07
SERVO, POINTER = "#404047", "#e8b820"


def bench(joints: Mapping[str, tuple[str, float, float]]) -> Figure:
    """The figure of joints: the name of each -> unit of its reading, least and greatest reading (infinite: no limit).

    A unit that is no angle, or a name that a link cannot have, leaves the joint out.
    """
    known = {name: row for name, row in joints.items() if row[0] in UNITS and row[0] != "m" and name.isidentifier()}
    links = [FigureLink("bench", shapes=tuple(_board(min(PER_ROW, len(known)), math.ceil(len(known) / PER_ROW))))]
    rows = min(PER_ROW, len(known))
    for index, (name, (unit, low, high)) in enumerate(known.items()):
        row, column = divmod(index, PER_ROW)
        left = ((rows - 1) / 2 - column) * APART_M
        joint = FigureJoint(name, (0.0, 0.0, 1.0), low, high, 0.0, unit)
        links.append(FigureLink(f"{name}_link", "bench", (-row * 1.5 * APART_M, left, 0.042), joint=joint, shapes=(
            FigureShape("cylinder", (0.012, 0.006), (0.0, 0.0, 0.003), colour="#cccccc"),
            FigureShape("box", (0.05, 0.008, 0.005), (0.025, 0.0, 0.008), colour=POINTER),
        )))  # fmt: skip
    return Figure(tuple(links))


def _board(columns: int, rows: int) -> Iterable[FigureShape]:
    for row in range(rows):
        for column in range(columns):
            left = ((columns - 1) / 2 - column) * APART_M
            place = (-row * 1.5 * APART_M, left, 0.02)
            yield FigureShape("box", (0.05, 0.032, 0.04), place, colour=SERVO)
