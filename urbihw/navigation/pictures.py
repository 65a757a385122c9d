"""Reads the image of a map (PGM, PNG ...) with Pillow: the occupied pixels, row by row.

Unknown cells (grey) count as occupied: a robot is not sent into unexplored areas.
"""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Final

from PIL import Image, UnidentifiedImageError

from urbihw.files import read_regular

MAX_PIXELS: Final = 16_000_000
MAX_FILE_BYTES: Final = 64 * 1024 * 1024

Run = tuple[int, int, int]
"""A run of pixels: row from the top, first column, column behind the last."""


def dark_runs(path: Path, above: float, up_to: float, *, negate: bool) -> tuple[int, int, list[Run]]:
    """Width, height and the runs of pixels that are lighter than ``above`` and not lighter than ``up_to``.  Raises
    ValueError."""
    try:
        with Image.open(BytesIO(read_regular(path, MAX_FILE_BYTES).data)) as picture:
            width, height = picture.size
            if width * height > MAX_PIXELS:
                raise ValueError(f"{path.name} has {width} by {height} pixels; {MAX_PIXELS} are the most")
            data = picture.convert("L").tobytes()
    except (OSError, UnidentifiedImageError, Image.DecompressionBombError) as error:
        why = getattr(error, "strerror", None) or "Pillow does not know its format"
        raise ValueError(f"{str(path)!r} cannot be read as a picture: {why}") from error
    blocked = bytes(above < (255 - value if negate else value) <= up_to for value in range(256))
    flags = data.translate(blocked)
    runs = []
    for row in range(height):
        line = flags[row * width : (row + 1) * width]
        first = line.find(1)
        while first >= 0:
            end = line.find(0, first)
            end = width if end < 0 else end
            runs.append((row, first, end))
            first = line.find(1, end)
    return width, height, runs
