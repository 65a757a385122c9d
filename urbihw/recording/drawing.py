"""Curves as text, for a terminal: dots of braille, two by four in each character; no I/O."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

Curve = Sequence[tuple[float, float]]
"""Times in s, in order, and values."""

GUTTER: Final = 10
"""Characters to the left of a drawing, for its highest and lowest value."""
LEAST_COLUMNS, LEAST_LINES = 10, 3
"""Characters of a drawing at least."""
_BLANK: Final = 0x2800
_DOTS: Final = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
"""The bits of the dots of a character: two columns, from the top (Unicode, Braille Patterns)."""
_LONGEST_GAP: Final = 0.02
"""Share of the width up to which two values are joined by a line, however long that takes."""
_GAP_TIMES: Final = 5
"""Usual distances between values from which on there is a gap: nothing was measured."""


def draw(name: str, curve: Curve, since: float, until: float, columns: int, lines: int) -> Iterator[str]:
    """Yield the lines of a drawing of a curve between two times in s, in so many columns and lines in all."""
    wide, high = max(columns - GUTTER, LEAST_COLUMNS), max(lines - 1, LEAST_LINES)
    yield f"{'':{GUTTER}}{name}"[: max(columns, GUTTER + LEAST_COLUMNS)]
    shown = [(time, value) for time, value in curve if since <= time <= until and math.isfinite(value)]
    if not shown:
        yield f"{'':{GUTTER}}no values between {since:g} and {until:g} s"
        return
    low, top = min(value for _, value in shown), max(value for _, value in shown)
    cells = _cells(shown, (since, until), (low, top), wide, high)
    for row in range(high):
        label = _number(top) if row == 0 else _number(low) if row == high - 1 and top > low else ""
        yield f"{label:>{GUTTER - 1}} " + "".join(map(chr, cells[row]))


def _cells(
    curve: Curve, times: tuple[float, float], values: tuple[float, float], wide: int, high: int
) -> list[list[int]]:
    """The characters of a drawing."""
    cells = [[_BLANK] * wide for _ in range(high)]
    joined = max(_LONGEST_GAP * (times[1] - times[0]), _GAP_TIMES * _usual_step(curve))
    before: tuple[float, int, int] | None = None
    for time, value in curve:
        x = round(_share(time, times) * (2 * wide - 1)) if times[1] > times[0] else 0
        y = 4 * high - 1 - round(_share(value, values) * (4 * high - 1)) if values[1] > values[0] else 2 * high
        begin = before if before is not None and time - before[0] <= joined else (time, x, y)
        for x_dot, y_dot in _line(begin[1:], (x, y)):
            cells[y_dot // 4][x_dot // 2] |= _DOTS[x_dot % 2][y_dot % 4]
        before = time, x, y
    return cells


def _share(value: float, ends: tuple[float, float]) -> float:
    """Where a value is between two others, 0..1; also if they are farther apart than a float can tell."""
    scale = 1.0 if math.isfinite(ends[1] - ends[0]) else 0.5
    return (value * scale - ends[0] * scale) / (ends[1] * scale - ends[0] * scale)


def _usual_step(curve: Curve) -> float:
    """The median distance in s of two values."""
    steps = sorted(after[0] - before[0] for before, after in zip(curve, curve[1:], strict=False))
    return steps[len(steps) // 2] if steps else 0.0


def _line(begin: tuple[int, int], end: tuple[int, int]) -> Iterator[tuple[int, int]]:
    """The dots from one dot to another."""
    steps = max(abs(end[0] - begin[0]), abs(end[1] - begin[1]))
    for step in range(steps + 1):
        share = step / steps if steps else 0.0
        yield round(begin[0] + (end[0] - begin[0]) * share), round(begin[1] + (end[1] - begin[1]) * share)


def _number(value: float) -> str:
    return f"{value:.4g}"
