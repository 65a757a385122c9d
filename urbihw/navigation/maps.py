"""Maps from files: ARIA's ``.map`` and the PGM or PNG pictures with a YAML file of ROS's map_server.

ARIA's format (``ArMap.cpp``): lines of words; mm and degrees; walls behind ``LINES``, points behind ``DATA``, places as
``Cairn: RobotHome x y heading ...``.  map_server's: ``image``, ``resolution``, ``origin: [x, y, yaw]``, ``negate``,
``occupied_thresh``, ``free_thresh``; dark is occupied.  Beyond map_server's keys, ``home: [x, y, heading]`` is
understood.  A YAML file of map_server is a flat list of keys; only that much of YAML is read.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Iterable
from dataclasses import field
from pathlib import Path
from typing import Final, Protocol

from urbihw.extras import install_command
from urbihw.files import BadFile, cannot_read, read_regular
from urbihw.frozen import frozen
from urbihw.navigation.frames import MAX_METRES, ORIGIN, Pose

MAX_FILE_BYTES: Final = 16 * 1024 * 1024
MAX_LINES: Final = 200_000

Segment = tuple[float, float, float, float]
Bounds = tuple[float, float, float, float]


class BadMap(Exception):
    """A map that cannot be used; the message gives the file and the error."""


class Walls(Protocol):
    """Receives the obstacles of a map."""

    def block_line(self, x1: float, y1: float, x2: float, y2: float) -> None:
        """Add a wall from one point to another, in m."""
        ...

    def block_box(self, left: float, bottom: float, right: float, top: float) -> None:
        """Add an occupied box, in m."""
        ...


@frozen(slots=False)
class Map:
    """A map: its obstacles, in m.

    Attributes:
        bounds: left, bottom, right, top.
        home: pose at which the robot starts; None if the map has none.
        goals: named places.
        lines, boxes: walls and blocks that are occupied or forbidden.
        forbidden, unknown: those lines that no sensor sees, and those blocks of which the map does not know what is
            there: a scan that goes through them does not free them.
        fine: resolution in m (the size of a pixel), below which a smaller cell of a grid gains nothing; 0 for none.
    """

    bounds: Bounds
    home: Pose | None = None
    goals: dict[str, Pose] = field(default_factory=dict)
    lines: tuple[Segment, ...] = ()
    boxes: tuple[Bounds, ...] = ()
    fine: float = 0.0
    forbidden: frozenset[Segment] = frozenset()
    unknown: tuple[Bounds, ...] = ()

    def draw(self, walls: Walls) -> None:
        """Add all obstacles to ``walls``."""
        self.draw_seen(walls)
        for line in self.forbidden:
            walls.block_line(*line)

    def draw_seen(self, walls: Walls) -> None:
        """Add the obstacles that a laser sees."""
        for line in self.lines:
            if line not in self.forbidden:
                walls.block_line(*line)
        for box in self.boxes:
            walls.block_box(*box)

    def draw_fixed(self, walls: Walls) -> None:
        """Add what scans do not free."""
        for line in self.forbidden:
            walls.block_line(*line)
        for box in self.unknown:
            walls.block_box(*box)


def check_name(path: str) -> None:
    """Raise BadMap for a name that is not that of a map, and if there is no such file."""
    _reader_of(path)
    try:
        Path(path).stat()
    except FileNotFoundError:
        raise BadMap(f"{path}: there is no such file") from None
    except OSError as error:
        raise BadMap(cannot_read(Path(path), error)) from error
    except ValueError as error:
        raise BadMap(f"{path!r} is no name of a file") from error


def _reader_of(path: str) -> Callable[[str, Path], Map]:
    reader = _READERS.get(Path(path).suffix.lower())
    if reader is None:
        raise BadMap(f"{path}: maps end in {', '.join(sorted(_READERS))}")
    return reader


def read(path: str) -> Map:
    """The map in a file.  Raises BadMap."""
    file, reader = Path(path), _reader_of(path)
    try:
        text = read_regular(file, MAX_FILE_BYTES).data.decode("latin-1")
    except FileNotFoundError:
        raise BadMap(f"{path}: there is no such file") from None
    except BadFile as error:
        raise BadMap(str(error)) from error
    try:
        return reader(text, file)
    except (ValueError, IndexError, OverflowError) as error:
        raise BadMap(f"{path}: {error}") from error


def _coordinates(words: Iterable[str], scale: float = 1.0) -> list[float]:
    """Words as m (or as an angle), divided by ``scale``.  Raises ValueError for what no map can mean."""
    values = [float(word) / scale for word in words]
    if not all(abs(value) <= MAX_METRES for value in values):
        raise ValueError(f"a coordinate is no number up to {MAX_METRES:g} m")
    return values


# --- ARIA ------------------------------------------------------------------------------------------------------------


class _AriaReader:
    """Parses the lines of a map of ARIA."""

    def __init__(self) -> None:
        self.home: Pose | None = None
        self.goals: dict[str, Pose] = {}
        self.lines: list[Segment] = []
        self.forbidden: list[Segment] = []
        self.boxes: list[Bounds] = []
        self.points: list[tuple[float, float]] = []

    def cairn(self, line: str) -> None:
        kind, *numbers = line.split()[1:5]
        x, y = _coordinates(numbers[:2], 1000)
        (degrees,) = _coordinates(numbers[2:3])
        pose = (x, y, math.radians(degrees))
        quoted = line.split('"')
        name = quoted[3] if len(quoted) > 3 else ""
        corners = _coordinates(quoted[4].split(), 1000) if len(quoted) > 4 else []
        if kind in ("RobotHome", "Dock") and self.home is None:
            self.home = pose
        elif kind in ("Goal", "GoalWithHeading"):
            self.goals[name] = pose
        elif kind.startswith("Forbidden") and len(corners) == 4:
            self.forbid(kind, pose[2], corners)

    def forbid(self, kind: str, turned: float, corners: list[float]) -> None:
        """Add a forbidden line or area; the corners of an area are those of a box in a turned frame."""
        x1, y1, x2, y2 = corners
        c, s = math.cos(turned), math.sin(turned)

        def at(x: float, y: float) -> tuple[float, float]:
            return c * x - s * y, s * x + c * y

        if kind == "ForbiddenLine":
            self.forbidden.append((x1, y1, x2, y2))
            return
        ring = [at(x1, y1), at(x2, y1), at(x2, y2), at(x1, y2)]
        self.forbidden += [(*a, *b) for a, b in zip(ring, [*ring[1:], ring[0]], strict=True)]

    def done(self) -> Map:
        self.lines += self.forbidden
        self.boxes += [(x, y, x, y) for x, y in self.points]
        xs = [x for line in self.lines for x in line[::2]] + [x for x, _ in self.points]
        ys = [y for line in self.lines for y in line[1::2]] + [y for _, y in self.points]
        if not xs:
            raise ValueError("it has neither lines nor points")
        bounds = (min(xs), min(ys), max(xs), max(ys))
        forbidden = frozenset(self.forbidden)
        return Map(bounds, self.home, self.goals, tuple(self.lines), tuple(self.boxes), forbidden=forbidden)


def _aria(text: str, file: Path) -> Map:
    rows = text.splitlines()
    if not rows or not rows[0].startswith("2D-Map"):
        raise ValueError("a map of ARIA begins with 2D-Map")
    if len(rows) > MAX_LINES:
        raise ValueError(f"more than {MAX_LINES} lines")
    reader = _AriaReader()
    section = ""
    for number, row in enumerate(rows[1:], 2):
        words = row.split()
        try:
            if row.startswith("Cairn:"):
                reader.cairn(row)
            elif words[:1] in (["LINES"], ["DATA"]):
                section = words[0]
            elif not words or words[0].endswith(":"):
                continue
            elif section == "LINES":
                x1, y1, x2, y2 = _coordinates(words, 1000)
                reader.lines.append((x1, y1, x2, y2))
            elif section == "DATA":
                x, y = _coordinates(words, 1000)
                reader.points.append((x, y))
        except (ValueError, IndexError):
            why = f"cannot be understood, or is no place within {MAX_METRES:g} m"
            raise ValueError(f"line {number} {why}: {row[:60]!r}") from None
    return reader.done()


# --- map_server ------------------------------------------------------------------------------------------------------

_KEYS: Final = {"resolution": 0.05, "negate": 0.0, "occupied_thresh": 0.65, "free_thresh": 0.196}


def _numbers(text: str, key: str) -> Pose:
    parts = text.strip().removeprefix("[").removesuffix("]").split(",")
    try:
        x, y, heading = _coordinates(parts)
    except ValueError:
        raise ValueError(f"{key} must be [x, y, heading] in m and rad, not {text[:60]!r}") from None
    return x, y, heading


def _ros(text: str, file: Path) -> Map:
    table = {}
    for row in text.splitlines():
        key, colon, value = row.partition("#")[0].partition(":")
        if colon:
            table[key.strip()] = value.strip().strip("'\"")
    if "image" not in table:
        raise ValueError("a map of map_server names its image")
    values = {}
    for key, default in _KEYS.items():
        try:
            values[key] = float(table.get(key, default))
        except ValueError:
            raise ValueError(f"{key} must be a number, not {table[key]!r}") from None
    if not 0.001 <= values["resolution"] <= 10:
        raise ValueError(f"resolution {values['resolution']:g} is not from 0.001 to 10 m")
    origin = _numbers(table["origin"], "origin") if "origin" in table else ORIGIN
    if origin[2]:
        raise ValueError("an origin that is turned is not understood; turn the picture")
    home = _numbers(table["home"], "home") if "home" in table else None
    try:
        pictures = importlib.import_module("urbihw.navigation.pictures")
    except ImportError as error:
        raise ValueError(f"reading pictures needs Pillow: {install_command('images')}") from error
    occupied, free = (255 * (1 - values[key]) for key in ("occupied_thresh", "free_thresh"))
    size, (left, bottom, _) = values["resolution"], origin

    def boxes(above: float) -> tuple[tuple[Bounds, ...], float, float]:
        image, negate = file.parent / table["image"], bool(values["negate"])
        width, height, runs = pictures.dark_runs(image, above, free, negate=negate)
        high = bottom + height * size
        return tuple(
            (left + first * size, high - (row + 1) * size, left + end * size, high - row * size)
            for row, first, end in runs
        ), left + width * size, high  # fmt: skip

    all_, right, top = boxes(-1.0)
    return Map((left, bottom, right, top), home, {}, (), all_, size, unknown=boxes(occupied)[0])


_READERS: Final[dict[str, Callable[[str, Path], Map]]] = {".map": _aria, ".yaml": _ros, ".yml": _ros}
"""Extension of a file -> function that reads it."""
