"""ALLeds: every light of the head, the chest and the feet, with its short names and the groups that NAOqi has."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from urbihw_nao_fakes.services import Failed, Service, as_list, method

COLOURS = ("Red", "Green", "Blue")
COLOUR_NAMES = {
    "white": 0xFFFFFF, "red": 0xFF0000, "green": 0x00FF00, "blue": 0x0000FF, "yellow": 0xFFFF00, "magenta": 0xFF00FF,
    "cyan": 0x00FFFF,
}  # fmt: skip
SIDES = ("Left", "Right")
EYE_DEGREES = {"Left": (45, 0, 315, 270, 225, 180, 135, 90), "Right": (315, 270, 225, 180, 135, 90, 45, 0)}
"""Place of FaceLedLeft0 to 7 and of FaceLedRight0 to 7 (V3.3 to V5)."""
EAR_DEGREES = tuple(range(0, 360, 36))
EYE_PARTS = {"Bottom": (3, 4), "External": (5, 6), "Internal": (1, 2), "Top": (7, 0)}
BRAIN = (
    "Front/Right/1", "Front/Right/0", "Middle/Right/0", "Rear/Right/0", "Rear/Right/1", "Rear/Right/2",
    "Rear/Left/2", "Rear/Left/1", "Rear/Left/0", "Middle/Left/0", "Front/Left/0", "Front/Left/1",
)  # fmt: skip
BRAIN_PARTS = {
    "": range(12), "Back": range(3, 9), "Front": (0, 1, 10, 11), "Left": range(6, 12), "Middle": (2, 9),
    "Right": range(6),
}  # fmt: skip
SUFFIX = "/Actuator/Value"
STEPS = {"Ears": 16, "Face": 64, "Head": 255, "ChestBoard": 255, "LFoot": 255, "RFoot": 255}
"""Levels that a light of each part can have."""


def _rgb(*places: str) -> list[str]:
    """The actuators of lights of three colours; ``%s`` stands for the colour."""
    return [place % colour + SUFFIX for place in places for colour in COLOURS]


def _single_lights() -> dict[str, list[str]]:
    """Short name of each light -> its actuators."""
    found = {f"Brain{index}": [f"Head/Led/{place}{SUFFIX}"] for index, place in enumerate(BRAIN)}
    for side in SIDES:
        for index, degrees in enumerate(EYE_DEGREES[side]):
            number = index + 1 if side == "Left" else 8 - index
            found[f"{side}FaceLed{number}"] = _rgb(f"Face/Led/%s/{side}/{degrees}Deg")
        for index, degrees in enumerate(EAR_DEGREES):
            found[f"{side}EarLed{index + 1}"] = [f"Ears/Led/{side}/{degrees}Deg{SUFFIX}"]
    return found


def _groups(single: dict[str, list[str]]) -> dict[str, list[str]]:
    """Name of each group -> its actuators."""
    found: dict[str, list[str]] = {}
    for part, indices in BRAIN_PARTS.items():
        found[f"BrainLeds{part}"] = [single[f"Brain{index}"][0] for index in indices]
    for side in SIDES:
        eye = [_rgb(f"Face/Led/%s/{side}/{degrees}Deg") for degrees in EYE_DEGREES[side]]
        found.update({f"FaceLed{side}{index}": light for index, light in enumerate(eye)})
        found[f"{side}FaceLeds"] = sum(eye, [])
        for part, indices in EYE_PARTS.items():
            found[f"FaceLeds{side}{part}"] = sum((eye[index] for index in indices), [])
        ear = [f"Ears/Led/{side}/{degrees}Deg{SUFFIX}" for degrees in EAR_DEGREES]
        found[f"{side}EarLeds"] = ear
        found[f"{side}EarLedsFront"], found[f"{side}EarLedsBack"] = ear[:3] + ear[8:], ear[3:8]
        found[f"{side}EarLedsEven"], found[f"{side}EarLedsOdd"] = ear[::2], ear[1::2]
        found[f"{side}FootLeds"] = _rgb(f"{side[0]}Foot/Led/%s")
    both = {"FaceLeds": "{}FaceLeds", "EarLeds": "{}EarLeds", "FeetLeds": "{}FootLeds"}
    both |= {f"FaceLed{index}": f"FaceLed{{}}{index}" for index in range(8)}
    both |= {f"FaceLeds{part}": f"FaceLeds{{}}{part}" for part in EYE_PARTS}
    found |= {name: found[one.format("Left")] + found[one.format("Right")] for name, one in both.items()}
    found["ChestLeds"] = _rgb("ChestBoard/Led/%s")
    found["AllLeds"] = sum((found[f"{part}Leds"] for part in ("Brain", "Ear", "Face", "Chest", "Feet")), [])
    for colour in COLOURS:
        for name in ("AllLeds", "LeftFaceLeds", "RightFaceLeds"):
            found[name + colour] = [actuator for actuator in found[name] if f"/{colour}" in actuator]
    return found


class Leds(Service):
    """ALLeds.

    Attributes:
        values: of each actuator, 0 to 1, in the steps of its part.
        written: names of lights and groups, in the order in which they were written.
    """

    name = "ALLeds"

    def __init__(self) -> None:
        super().__init__()
        self._single = _single_lights()
        self._groups = _groups(self._single)
        self.values = dict.fromkeys(self._groups["AllLeds"], 0.0)
        self.written: list[str] = []

    def colour(self, name: str) -> int:
        """What a light, or the first one of a group, shows: 0xRRGGBB; a light of one colour counts as that colour."""
        shown = 0
        for actuator in self._find(name)[:3]:
            shift = next((16 - 8 * index for index, colour in enumerate(COLOURS) if f"/{colour}" in actuator), 0)
            shown = shown & ~(0xFF << shift) | round(self.values[actuator] * 255) << shift
        return shown

    def level(self, name: str) -> float:
        """The brightest actuator of a light or group, 0 to 1."""
        level: float = max(self.values[actuator] for actuator in self._find(name))
        return level

    def _find(self, name: str) -> list[str]:
        if name in self.values:
            return [name]
        found = self._groups.get(name) or self._single.get(name)
        if found is None:
            raise Failed(f"ALLeds: no such led or group {name}\n\n    at alleds.cpp:88")
        return found

    def _write(self, actuator: str, value: float) -> None:
        steps = STEPS[actuator.partition("/")[0]]
        self.values[actuator] = round(min(max(value, 0.0), 1.0) * steps) / steps

    # ---------------------------------------------------------------- writing

    @method("fadeRGB", "(sif)")
    def fade_colour(self, name: str, colour: int, seconds: float) -> None:
        """0xRRGGBB, at once; of a light with one colour only its own part counts."""
        self.written.append(name)
        for actuator in self._find(name):
            shifts = [16 - 8 * index for index, one in enumerate(COLOURS) if f"/{one}" in actuator]
            # The ears are blue; the lights of the head, white, follow the brightest part.
            parts = [
                colour >> shift & 0xFF for shift in shifts or ((0,) if actuator.startswith("Ears") else (16, 8, 0))
            ]
            self._write(actuator, max(parts) / 255)

    @method("fadeRGB", "(ssf)")
    def fade_to_name(self, name: str, colour: str, seconds: float) -> None:
        """White, red, green, blue, yellow, magenta or cyan."""
        if colour not in COLOUR_NAMES:
            raise Failed(f"ALLeds: no colour {colour}")
        self.fade_colour(name, COLOUR_NAMES[colour], seconds)

    @method("fade", "(sff)")
    def fade(self, name: str, value: float, seconds: float) -> None:
        """0 to 1 for all colours, at once."""
        self.set_intensity(name, value)

    @method("setIntensity", "(sf)")
    def set_intensity(self, name: str, value: float) -> None:
        """0 to 1 for all colours."""
        self.written.append(name)
        for actuator in self._find(name):
            self._write(actuator, value)

    @method("on", "(s)")
    def switch_on(self, name: str) -> None:
        """Turn a group of LEDs white."""
        self.set_intensity(name, 1.0)

    @method("off", "(s)")
    @method("reset", "(s)")
    def switch_off(self, name: str) -> None:
        """Turn a group of LEDs dark."""
        self.set_intensity(name, 0.0)

    # ---------------------------------------------------------------- groups

    @method("createGroup", "(sm)")
    def create_group(self, name: str, lights: Any) -> None:
        """A group of lights, groups or actuators; one of the same name is replaced."""
        self._groups[name] = [actuator for light in as_list(lights) for actuator in self._find(light)]

    @method("listGroup", "(s)", "[s]")
    def get_group(self, name: str) -> list[str]:
        """The actuators of a group."""
        return list(self._find(name))

    @method("listLED", "(s)", "[s]")
    def get_light(self, name: str) -> list[str]:
        """The actuators of a single light."""
        if name not in self._single:
            raise Failed(f"ALLeds: no such led {name}\n\n    at alleds.cpp:88")
        return list(self._single[name])

    @method("listGroups", "()", "[s]")
    def get_groups(self) -> list[str]:
        """The names of the groups of LEDs."""
        return sorted(self._groups)

    @method("listLEDs", "()", "[s]")
    def get_lights(self) -> list[str]:
        """Names of single lights: the short ones, then the actuators."""
        return [*sorted(self._single), *self._actuators()]

    def _actuators(self) -> Iterator[str]:
        return iter(sorted(self.values))
