"""What goes out: the targets of motors, inputs and speaker, and the control of positions.

Targets (device, item):
    ("A", "power")      -100..100, regulated; 0 holds
    ("A", "coast")      anything: let go
    ("A", "goal")       degrees of the rotation count; the worker turns the motor there and holds
    (1, "mode")         (type, mode) of an input
    ("brick", "tone")   (Hz, ms); 0 ms is until "silence"
    ("brick", "silence")

Positions are controlled here because a motor of the NXT knows only powers: proportional to what is left, no less than
what moves the motor at all, and within a few degrees it holds.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator
from typing import Any, Final

from urbihw.buses.errors import BadValue
from urbihw.platforms.nxt import protocol as p
from urbihw.platforms.nxt.reading import BRICK

GAIN: Final = 0.6  # power for each degree that is left
LEAST: Final = 8  # power
MOST: Final = 75
NEAR: Final = 3  # degrees

LONGEST_TONE: Final = 65_535  # ms
_RENEW = 60.0  # s, before the longest tone is over
LOWEST_HZ, HIGHEST_HZ = 200, 14_000


class Motion:
    """Collects targets and turns them into telegrams: ``silent()`` those without a reply, ``asked()`` the others."""

    def __init__(self) -> None:
        self._aims: dict[tuple[Any, str], Any] = {}
        self._powers: dict[str, int | None] = {}
        self._goals: dict[str, float] = {}
        self._modes: list[bytes] = []
        self._endless: int | None = None
        self._renew_at = math.inf

    def aim(self, device: Any, item: str, value: Any) -> None:
        """Take a target.  Raises BadValue."""
        _check(device, item, value)
        if item in ("power", "coast", "goal"):
            # They exclude each other: the last one counts.
            for other in ("power", "coast", "goal"):
                self._aims.pop((device, other), None)
        self._aims[device, item] = value

    def forget(self, devices: Collection[Any] | None = None) -> None:
        """Drop the targets of some devices, None for all: the link is gone, or they are being stopped."""
        if devices is not None:
            for key in [key for key in self._aims if key[0] in devices]:
                del self._aims[key]
            for device in devices:
                self._powers.pop(device, None)
                self._goals.pop(device, None)
            return
        self._aims.clear()
        self._powers.clear()
        self._goals.clear()
        self._modes.clear()
        self._endless = None
        self._renew_at = math.inf

    def told_otherwise(self, devices: Iterable[str]) -> None:
        """Somebody else's telegram has moved these motors: they follow that, not their goals."""
        for device in devices:
            self._powers.pop(device, None)
            self._goals.pop(device, None)

    def on(self) -> frozenset[str]:
        """The motors that were told to run or to hold."""
        return frozenset(device for device, power in self._powers.items() if power is not None)

    def silent(self, now: float) -> Iterator[bytes]:
        """The telegrams of the tick that want no reply."""
        aims, self._aims = self._aims, {}
        for (device, item), value in aims.items():
            if item == "mode":
                self._modes.append(p.input_mode(device - 1, *value))
            elif item == "goal":
                self._goals[device] = value
            elif device == BRICK:
                yield from self._sound(item, value, now)
            else:
                self._goals.pop(device, None)
                yield from self._power(device, value if item == "power" else None)
        if now >= self._renew_at and self._endless is not None:
            yield from self._sound("tone", (self._endless, 0), now)

    def asked(self) -> bytes | None:
        """The next telegram that wants a reply."""
        return self._modes.pop(0) if self._modes else None

    def control(self, device: str, rotation: int) -> Iterator[bytes]:
        """A motor was seen at ``rotation`` degrees: what brings it nearer to its goal."""
        goal = self._goals.get(device)
        if goal is None:
            return
        left = goal - rotation
        power = 0
        if abs(left) > NEAR:
            power = round(math.copysign(min(MOST, max(LEAST, abs(left) * GAIN)), left))
        yield from self._power(device, power)

    def _power(self, device: str, power: int | None) -> Iterator[bytes]:
        """None lets go.  What a motor was told already is not said again."""
        if device in self._powers and self._powers[device] == power:
            return
        self._powers[device] = power
        port = p.OUTPUTS.index(device)
        yield p.coast(port) if power is None else p.run(port, power)

    def _sound(self, item: str, value: Any, now: float) -> Iterator[bytes]:
        self._endless, self._renew_at = None, math.inf
        if item == "silence":
            yield p.stop_sound()
            return
        frequency, milliseconds = value
        if not milliseconds:
            self._endless, self._renew_at = frequency, now + _RENEW
        yield p.tone(frequency, milliseconds or LONGEST_TONE)


def _check(device: Any, item: str, value: Any) -> None:
    """Raises BadValue for a target that no brick can have."""
    if device in p.OUTPUTS and item == "power":
        sound = isinstance(value, int) and -100 <= value <= 100
    elif device in p.OUTPUTS and item == "goal":
        sound = isinstance(value, int | float) and abs(value) < 2**31
    elif device in p.INPUTS and item == "mode":
        sound = len(value) == 2 and all(0 <= part <= 255 for part in value)
    elif device == BRICK and item == "tone":
        sound = LOWEST_HZ <= value[0] <= HIGHEST_HZ and 0 <= value[1] <= LONGEST_TONE
    elif (device in p.OUTPUTS and item == "coast") or (device == BRICK and item == "silence"):
        sound = True
    else:
        raise BadValue(f"port {device!r} of an NXT has no {item!r} to set")
    if not sound:
        raise BadValue(f"{value!r} is no {item} for port {device!r}")
