"""The analog side of the four input ports, and the sensors for them (firmware: c_input.c).

A sensor has a 10-bit raw value that depends on the type of the port; the port computes the normalised and the scaled
value.
"""

from __future__ import annotations

from dataclasses import dataclass

from urbihw_fakes.nxt import codes

FULL = 1023
PRESSED_AT = 460  # raw, 45 %: true at or below
RELEASED_AT = 562  # raw, 55 %: false at or above
PASS = 0.001  # s, of the firmware's main loop

# type -> (offset, divisor) of `1023 - min(1023, max(0, raw - offset) * 100 / divisor)`
_SCALES = {
    codes.RCX_LIGHT: (476, 41),
    codes.LIGHT_ACTIVE: (200, 68),
    codes.LIGHT_INACTIVE: (200, 68),
    codes.SOUND_DB: (162, 83),
    codes.SOUND_DBA: (162, 83),
}
_COLOURS = range(codes.COLOUR_FULL, codes.COLOUR_NONE + 1)


def normalise(kind: int, raw: int) -> int:
    """Return 0..1023, larger if brighter or louder; other types unchanged."""
    if kind not in _SCALES:
        return raw
    offset, divisor = _SCALES[kind]
    return FULL - min(FULL, max(0, raw - offset) * 100 // divisor)


def raw_of(kind: int, share: float) -> int:
    """Return the raw value whose normalised value is `share` (0..1) of the full scale."""
    offset, divisor = _SCALES[kind]
    return round(offset + (1 - share) * FULL * divisor / 100)


class Plugged:
    """Base of what can be plugged in; by itself an open input."""

    def raw(self, kind: int) -> int:
        """Return the 10-bit value for this type of the port."""
        return FULL


@dataclass
class Touch(Plugged):
    """A touch sensor on an input port."""

    pressed: bool = False

    def raw(self, kind: int) -> int:
        """Return the value of a closed contact while pressed, else that of an open input."""
        return 183 if self.pressed else FULL


@dataclass
class Light(Plugged):
    """A light sensor: raw values with its LED on, and without."""

    reflected: int = raw_of(codes.LIGHT_ACTIVE, 0.45)
    ambient: int = raw_of(codes.LIGHT_INACTIVE, 0.3)

    def raw(self, kind: int) -> int:
        """Return the reflected light when the LED is on, else the ambient light."""
        return self.reflected if kind == codes.LIGHT_ACTIVE else self.ambient


@dataclass
class Sound(Plugged):
    """A sound sensor: loudness 0..1 of the whole band, and of its audible part."""

    loudness: float = 0.1
    audible: float = 0.08

    def raw(self, kind: int) -> int:
        """Return the audible part in mode DBA, else the loudness of the whole band."""
        return raw_of(codes.SOUND_DB, self.audible if kind == codes.SOUND_DBA else self.loudness)


@dataclass
class Colour(Plugged):
    """A colour sensor: 1 black, 2 blue, 3 green, 4 yellow, 5 red, 6 white; and its light value."""

    colour: int = 6
    brightness: int = 500

    def raw(self, kind: int) -> int:
        """Return the brightness for the colour types, else an open input."""
        return self.brightness if kind in _COLOURS else FULL


class InputPort:
    """One port as SETINPUTMODE and GETINPUTVALUES see it."""

    def __init__(self) -> None:
        self.plugged: Plugged = Plugged()
        self.reset(0.0)

    def reset(self, now: float) -> None:
        """Reset as at the start or end of a program."""
        self.kind, self.mode = codes.NO_SENSOR, codes.RAW
        self._valid_at = now
        self._state = False
        self._edges = 0

    def set_type(self, kind: int, mode: int, now: float) -> None:
        """SETINPUTMODE; values are valid again after some passes of the main loop."""
        if kind != self.kind:
            passes = 300 if kind in (codes.SOUND_DB, codes.SOUND_DBA) else 400 if kind in _COLOURS else 20
            self._valid_at = now + passes * PASS
        elif mode != self.mode:
            self._valid_at = now + PASS
        self.kind, self.mode = kind, mode
        self._edges = 0

    def reset_scaled(self) -> None:
        """RESETINPUTSCALEDVALUE: restart the counts."""
        self._edges = 0

    def advance(self) -> None:
        """Sample the input once, for the counting modes."""
        raw = self.plugged.raw(self.kind)
        state = raw <= PRESSED_AT or (self._state and raw < RELEASED_AT)
        if state != self._state:
            self._state = state
            self._edges += 1

    def values(self, now: float) -> tuple[bool, int, int, int]:
        """Return valid, raw, normalised, scaled."""
        self.advance()
        raw = self.plugged.raw(self.kind)
        normalised = normalise(self.kind, raw)
        return now >= self._valid_at, raw, normalised, self._scaled(normalised)

    def _scaled(self, normalised: int) -> int:
        if self.kind == codes.COLOUR_FULL:
            return self.plugged.colour if isinstance(self.plugged, Colour) else 0
        mode = self.mode & codes.MODE_MASK
        if mode == codes.BOOLEAN:
            return int(self._state)
        if mode == codes.TRANSITIONS:
            return self._edges
        if mode == codes.PERIODS:
            return self._edges // 2
        if mode == codes.PERCENT:
            return normalised * 100 // FULL
        return normalised
