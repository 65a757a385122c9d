"""``figure.toml`` as dataclasses, checked with messages for the author of the file.

    [[links]]
    name = "forearm"
    on = "upper_arm"                 # the link above; the first one has none
    at = [0.1126, 0, 0.028]          # where its frame is in that one; turn = [roll, pitch, yaw]
    joint = { device = "elbow_flex", axis = [0, 1, 0], range = [-1.69, 1.69], zero = 0, unit = "rad" }
    shapes = [{ box = [0.13, 0.03, 0.03], at = [0.06, 0, 0], colour = "#f0c020" }]

A joint turns its link about ``axis`` (unit m: it slides along it) by its reading minus ``zero``, so at this reading the
link is as drawn.  ``device`` is the name of the device in urbiscript; a joint without one, such as a wheel that is not
measured, has the name of its link.  A link with ``device`` and without a joint is where that sensor sits, and looks
along its x.  ``as_table`` gives the same table back, for JSON.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

from urbihw.frozen import frozen

Triple = tuple[float, float, float]
FILE: Final = "figure.toml"
UNITS: Final = {"rad": 1.0, "deg": math.pi / 180, "turn": 2 * math.pi, "m": 1.0}
"""Unit of a reading -> rad, or m, of one."""
KINDS: Final = {"box": 3, "cylinder": 2, "capsule": 2, "sphere": 1, "ellipsoid": 3}
"""Kind of a shape -> how many sizes it has: edges; radius and length along z (of a capsule without its caps); radius;
three radii."""
GREY: Final = "#808080"
_ORIGIN: Final = (0.0, 0.0, 0.0)
_NAME: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_COLOUR: Final = re.compile(r"#[0-9a-f]{6}")
_LINK_KEYS: Final = {"name", "on", "at", "turn", "joint", "device", "shapes"}
_JOINT_KEYS: Final = {"device", "axis", "range", "zero", "unit"}


class BadFigure(ValueError):
    """An invalid figure; the message names the link, the key and the expected value."""


@frozen
class FigureShape:
    """A solid of a link: its kind and sizes (``KINDS``), place and turn in the link, and colour as ``#rrggbb``."""

    kind: str
    sizes: tuple[float, ...]
    at: Triple = _ORIGIN
    turn: Triple = _ORIGIN
    colour: str = GREY


@frozen
class FigureJoint:
    """How a link moves on the one above.

    Attributes:
        device: what measures it; "" for a joint that is not measured.
        axis: of length 1, in the frame of the link.
        low, high: the range of the reading, in ``unit``; infinite for one that turns for ever.
        zero: the reading in the drawn pose, in ``unit``.
        unit: of the reading; m for a joint that slides.
    """

    device: str
    axis: Triple
    low: float = -math.inf
    high: float = math.inf
    zero: float = 0.0
    unit: str = "rad"

    def travel(self, reading: float) -> float:
        """How far the link is from the drawn pose: rad or m."""
        return (reading - self.zero) * UNITS[self.unit]


@frozen
class FigureLink:
    """A rigid part: its name, the link above ("" for the first one), place and turn there, joint, device, shapes."""

    name: str
    on: str = ""
    at: Triple = _ORIGIN
    turn: Triple = _ORIGIN
    joint: FigureJoint | None = None
    device: str = ""
    shapes: tuple[FigureShape, ...] = ()


@frozen(slots=False)
class Figure:
    """All links, each behind the one above it."""

    links: tuple[FigureLink, ...]

    def link(self, name: str) -> FigureLink:
        """A link by name.  Raises KeyError."""
        for link in self.links:
            if link.name == name:
                return link
        raise KeyError(name)

    def chain(self, name: str) -> list[FigureLink]:
        """The links from the first one to this one.  Raises KeyError."""
        link = self.link(name)
        return [*(self.chain(link.on) if link.on else ()), link]

    @property
    def joints(self) -> dict[str, FigureLink]:
        """The links that move, by the names of their joints."""
        return {link.joint.device or link.name: link for link in self.links if link.joint is not None}

    @property
    def devices(self) -> list[str]:
        """The devices that measure joints."""
        return [link.joint.device for link in self.links if link.joint is not None and link.joint.device]

    def as_table(self) -> dict[str, Any]:
        """The table of which ``parse`` makes the same figure, without what is left out in the file."""
        return {"links": [_link_table(link) for link in self.links]}


def figure_file(beside: Path) -> Path | None:
    """The file of the figure beside a manifest or a module of a platform; None if there is none."""
    path = beside.with_name(FILE)
    return path if path.is_file() else None


def read(path: Path) -> Figure:
    """The figure of a file; the same object until the file changes.  Raises BadFigure, also for a file that cannot be
    read.
    """
    try:
        return _read(path, path.stat().st_mtime_ns)
    except OSError as error:
        raise BadFigure(f"{path}: cannot be read: {error}") from error


@lru_cache(maxsize=8)
def _read(path: Path, changed: int) -> Figure:
    try:
        return parse(tomllib.loads(path.read_text("utf-8")))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise BadFigure(f"{path}: cannot be read: {error}") from error
    except BadFigure as error:
        raise BadFigure(f"{path}: {error}") from None


def parse(table: Mapping[str, Any]) -> Figure:
    """The figure of a table.  Raises BadFigure."""
    rows = table.get("links")
    if set(table) != {"links"} or not isinstance(rows, list) or not rows:
        raise BadFigure("a figure has [[links]] and nothing else")
    links: list[FigureLink] = []
    names: set[str] = set()
    for row in rows:
        link = _link(row)
        if link.name in names:
            raise BadFigure(f"link {link.name}: there are two of this name")
        if (link.on not in names) if names else bool(link.on):
            raise BadFigure(f"link {link.name}: on wants the name of a link before it, and the first link has none")
        names.add(link.name)
        links.append(link)
    return Figure(tuple(links))


def _link(row: Any) -> FigureLink:
    name = row.get("name") if isinstance(row, Mapping) else None
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise BadFigure(f"a link wants a name of letters, digits and _, not {name!r}")
    _keys(row, _LINK_KEYS, f"link {name}")
    shapes = row.get("shapes", ())
    if not isinstance(shapes, list | tuple):
        raise BadFigure(f"link {name}: shapes wants a list")
    joint = row.get("joint")
    return FigureLink(
        name, _text(row, "on", name), _triple(row, "at", name), _triple(row, "turn", name),
        None if joint is None else _joint(joint, name), _text(row, "device", name),
        tuple(_shape(shape, name) for shape in shapes),
    )  # fmt: skip


def _joint(row: Any, link: str) -> FigureJoint:
    where = f"joint of {link}"
    _keys(row, _JOINT_KEYS, where)
    axis = _triple(row, "axis", where)
    size = math.hypot(*axis)
    if not size:
        raise BadFigure(f"{where}: axis wants three numbers, not all 0")
    low, high = _numbers(row["range"], 2, f"{where}: range") if "range" in row else (-math.inf, math.inf)
    if not low < high:
        raise BadFigure(f"{where}: range wants the least and the greatest reading")
    unit = _text(row, "unit", where) or "rad"
    if unit not in UNITS:
        raise BadFigure(f"{where}: unit is one of {', '.join(UNITS)}, not {unit!r}")
    (zero,) = _numbers([row.get("zero", 0.0)], 1, f"{where}: zero")
    x, y, z = axis
    return FigureJoint(_text(row, "device", where), (x / size, y / size, z / size), low, high, zero, unit)


def _shape(row: Any, link: str) -> FigureShape:
    where = f"shape of {link}"
    _keys(row, {*KINDS, "at", "turn", "colour"}, where)
    kinds = [kind for kind in KINDS if kind in row]
    if len(kinds) != 1:
        raise BadFigure(f"{where}: it wants one of {', '.join(KINDS)}")
    kind = kinds[0]
    sizes = _numbers(row[kind] if KINDS[kind] > 1 else [row[kind]], KINDS[kind], f"{where}: {kind}")
    if not all(size > 0 for size in sizes):
        raise BadFigure(f"{where}: the sizes of a {kind} are above 0")
    colour = row.get("colour", GREY)
    if not isinstance(colour, str) or not _COLOUR.fullmatch(colour):
        raise BadFigure(f"{where}: colour wants #rrggbb in small letters, not {colour!r}")
    return FigureShape(kind, sizes, _triple(row, "at", where), _triple(row, "turn", where), colour)


def _keys(row: Any, known: Iterable[str], where: str) -> None:
    if not isinstance(row, Mapping):
        raise BadFigure(f"{where}: it wants a table")
    for key in row:
        if key not in known:
            raise BadFigure(f"{where}: {key!r} is no key; known: {', '.join(sorted(known))}")


def _text(row: Mapping[str, Any], key: str, where: str) -> str:
    value = row.get(key, "")
    if not isinstance(value, str):
        raise BadFigure(f"{where}: {key} wants a text, not {value!r}")
    return value


def _triple(row: Mapping[str, Any], key: str, where: str) -> Triple:
    return _numbers(row.get(key, _ORIGIN), 3, f"{where}: {key}")  # type: ignore[return-value]


def _numbers(value: Any, count: int, where: str) -> tuple[float, ...]:
    if not isinstance(value, list | tuple) or len(value) != count or not all(map(_is_number, value)):
        raise BadFigure(f"{where} wants {count} finite numbers, not {value!r}")
    return tuple(map(float, value))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _link_table(link: FigureLink) -> dict[str, Any]:
    made: dict[str, Any] = {"name": link.name}
    _put(made, on=link.on, at=link.at, turn=link.turn)
    joint = link.joint
    if joint is not None:
        row: dict[str, Any] = {"axis": list(joint.axis)}
        _put(row, device=joint.device, zero=joint.zero, unit="" if joint.unit == "rad" else joint.unit)
        if math.isfinite(joint.low):
            row["range"] = [joint.low, joint.high]
        made["joint"] = row
    _put(made, device=link.device)
    if link.shapes:
        made["shapes"] = [_shape_table(shape) for shape in link.shapes]
    return made


def _shape_table(shape: FigureShape) -> dict[str, Any]:
    made: dict[str, Any] = {shape.kind: list(shape.sizes) if len(shape.sizes) > 1 else shape.sizes[0]}
    _put(made, at=shape.at, turn=shape.turn)
    return {**made, "colour": shape.colour}


def _put(row: dict[str, Any], **values: Any) -> None:
    """Put values into a table, but for those that it means without them."""
    row.update({
        key: list(value) if isinstance(value, tuple) else value
        for key, value in values.items() if value not in ("", 0.0, _ORIGIN)
    })  # fmt: skip
