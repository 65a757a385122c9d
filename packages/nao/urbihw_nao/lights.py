"""What the lights of a Nao were told: of each actuator, so that a light and the groups that contain it agree.

A light or a group of lights is a name of NAOqi for some actuators, such as ``Face/Led/Red/Left/0Deg/Actuator/Value``
(fact sheet, section 10).  A write changes the actuators of its name, and all lights that have one of them show it.
Writing red leaves green and blue of each member as they are.  NAOqi has no call for that: if the members differ, the
write goes out as one call for each part of the group that is alike.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Final, NamedTuple

from urbihw.frozen import frozen

COLOURS: Final = ("Red", "Green", "Blue")
ONE_COLOUR_PARTS: Final = ("Ear", "Brain")
"""Parts of the names of lights and groups that have one colour (fact sheet, section 10)."""

Levels = tuple[float, float, float]
"""Red, green and blue, 0 to 1."""
Show = Callable[[Levels], None]


class LightCall(NamedTuple):
    """A target of ``LightPart``: ``item`` "rgb" (0xRRGGBB) or "level" (0 to 1) of a light."""

    name: str
    item: str
    value: float


@frozen(slots=False, eq=False)
class Light:
    """A light or a group: its actuators, in order, with their colours ("" for what has one colour only).

    Attributes:
        is_level: whether it is written by a brightness, as all its actuators have the same colour.
    """

    name: str
    colours: Mapping[str, str]
    is_level: bool

    @property
    def is_one_of_three(self) -> bool:
        """Whether it is one colour of lights of three."""
        return self.is_level and "" not in self.colours.values()


def light_of(name: str, actuators: Iterable[str]) -> Light:
    """A light, by what NAOqi tells of its actuators; one of which it tells nothing shares them with no other light."""
    known = {actuator: _colour_of(actuator) for actuator in actuators}
    if not known:
        has_colours = not name.endswith(COLOURS) and not any(part in name for part in ONE_COLOUR_PARTS)
        known = {f"{name}/{colour}": colour for colour in COLOURS} if has_colours else {name: ""}
    return Light(name, known, len({*known.values()}) == 1)


def _colour_of(actuator: str) -> str:
    words = actuator.split("/")
    return next((colour for colour in COLOURS if colour in words), "")


class LightBoard:
    """All lights of a robot; nothing is known of what others have written."""

    def __init__(self, members: Mapping[str, tuple[str, ...]]) -> None:
        """``members`` are the actuators of each light."""
        self.lights = {name: light_of(name, actuators) for name, actuators in members.items()}
        self._levels = {actuator: 0.0 for light in self.lights.values() for actuator in light.colours}
        self._shows: dict[str, Show] = {}
        self._with_actuator: dict[str, dict[str, None]] = {}
        for name, light in self.lights.items():
            for actuator in light.colours:
                self._with_actuator.setdefault(actuator, {})[name] = None
        self._pieces: dict[str, list[Light]] = {}

    def join(self, name: str, show: Show) -> None:
        """Let ``show`` get what this light shows when a write to another one has changed it."""
        self._shows[name] = show

    def write(self, name: str, parts: Mapping[str, float], level: float) -> list[LightCall]:
        """Write parts of the colour of a light, ``level`` to what has one colour; return the calls for it."""
        light = self.lights[name]
        changed: dict[str, None] = {}
        for actuator, colour in light.colours.items():
            new = parts.get(colour) if colour and not light.is_level else level
            if new is not None and new != self._levels[actuator]:
                self._levels[actuator] = new
                changed |= self._with_actuator[actuator]
        for other in changed:
            if other != name and other in self._shows:
                self._shows[other](self.levels(other))
        return self._calls(light)

    def levels(self, name: str) -> Levels:
        """What a light shows: in each colour that of its brightest actuator."""
        light = self.lights[name]
        most = dict.fromkeys(COLOURS, 0.0)
        for actuator, colour in light.colours.items():
            for each in (colour,) if colour and not light.is_level else COLOURS:
                most[each] = max(most[each], self._levels[actuator])
        return most["Red"], most["Green"], most["Blue"]

    def _calls(self, light: Light) -> list[LightCall]:
        """One call if the light is alike; else one for each of the largest pieces that are."""
        whole = self._call(light)
        if whole is not None:
            return [whole]
        calls = []
        rest = dict.fromkeys(light.colours)
        for piece in self._pieces_of(light):
            call = self._call(piece) if rest.keys() >= piece.colours.keys() else None
            if call is not None:
                calls.append(call)
                for actuator in piece.colours:
                    del rest[actuator]
        return calls + [LightCall(actuator, "level", self._levels[actuator]) for actuator in rest]

    def _call(self, light: Light) -> LightCall | None:
        """The call that lets a light show what its actuators were told; None if no single call can."""
        told: dict[str, float] = {}
        for actuator, colour in light.colours.items():
            level = self._levels[actuator]
            if told.setdefault(colour, level) != level:
                return None
        if len({*told.values()}) == 1 and (light.is_level or "" in told):
            return LightCall(light.name, "level", next(iter(told.values())))
        if "" in told:
            return None
        red, green, blue = (round(told.get(colour, 0.0) * 255) for colour in COLOURS)
        return LightCall(light.name, "rgb", red << 16 | green << 8 | blue)

    def _pieces_of(self, light: Light) -> list[Light]:
        """The lights within a group, the largest first; those that are one of three colours come last."""
        if light.name not in self._pieces:
            within = (each for each in self.lights.values() if each.colours.keys() < light.colours.keys())
            self._pieces[light.name] = sorted(within, key=lambda each: (each.is_one_of_three, -len(each.colours)))
        return self._pieces[light.name]
