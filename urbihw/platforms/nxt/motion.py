"""The targets of motors, inputs and speaker, and the position control of motors.

Targets (device, item):
    ("A", "power")      -100..100, regulated; 0 holds
    ("A", "coast")      any value: switch the motor off
    ("A", "goal")       degrees of the rotation count; the worker turns the motor there and holds
    (1, "mode")         (type, mode) of an input
    ("brick", "tone")   (Hz, ms); with 0 ms until "silence"; a tone longer than one command is renewed
    ("brick", "silence")

Positions are controlled here because an NXT motor accepts only powers.  The power is proportional to the remaining
angle, but at least the power that moves the motor, and at most the limit of the settings; within a few degrees of the
goal the motor holds.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any, Final

from urbihw.buses.errors import BadValue
from urbihw.buses.messages import Limit
from urbihw.platforms.nxt import protocol as p
from urbihw.platforms.nxt.reading import BRICK

GAIN: Final = 0.6  # power per remaining degree
LEAST: Final = 8  # power
MOST: Final = 75
NEAR: Final = 3  # degrees
EXCLUSIVE: Final = frozenset({"power", "coast", "goal"})
"""What a motor does is the last one of these targets."""
_NO_LIMIT: Final = Limit()

LONGEST_TONE: Final = 65_535  # ms
_RENEW_S = 60.0  # before the end of the longest tone
LOWEST_HZ, HIGHEST_HZ = 200, 14_000


class NxtMotion:
    """Collects targets and converts them to telegrams: with a reply in ``next_request``, the rest in
    ``silent_telegrams``.

    Attributes:
        limits: the limits of targets by (device, item); the one of its power bounds a motor on its way to a goal, too.
    """

    def __init__(self) -> None:
        self.limits: Mapping[tuple[Any, str], Limit] = {}
        self._targets: dict[tuple[Any, str], Any] = {}
        self._powers: dict[str, int | None] = {}
        self._goals: dict[str, float] = {}
        self._modes: list[bytes] = []
        # Frequency and end of a tone that is longer than one command.
        self._long_tone: tuple[int, float] | None = None
        self._renew_at = math.inf

    def set_target(self, device: Any, item: str, value: Any) -> None:
        """Send a target with the next tick; the head of this file lists the items.  Raises BadValue."""
        _check_target(device, item, value)
        if item in EXCLUSIVE:
            for other in EXCLUSIVE:
                self._targets.pop((device, other), None)
        self._targets[device, item] = value

    def drop_targets(self, devices: Collection[Any] | None = None) -> None:
        """Drop the targets of some devices, None for all: the link is gone, or they are being stopped."""
        if devices is not None:
            for key in [key for key in self._targets if key[0] in devices]:
                del self._targets[key]
            for device in devices:
                self._powers.pop(device, None)
                self._goals.pop(device, None)
            return
        self._targets.clear()
        self._powers.clear()
        self._goals.clear()
        self._modes.clear()
        self._long_tone = None
        self._renew_at = math.inf

    def drop_goals(self, devices: Iterable[str]) -> None:
        """Drop the goals of motors that a telegram of a program runs."""
        for device in devices:
            self._powers.pop(device, None)
            self._goals.pop(device, None)

    def active_motors(self) -> frozenset[str]:
        """Return the motors that run or hold."""
        return frozenset(device for device, power in self._powers.items() if power is not None)

    def silent_telegrams(self, now: float) -> Iterator[bytes]:
        """Yield the telegrams of a tick that request no reply."""
        targets, self._targets = self._targets, {}
        for (device, item), value in targets.items():
            if item == "mode":
                self._modes.append(p.input_mode(device - 1, *value))
            elif item == "goal":
                self._goals[device] = value
            elif device == BRICK:
                yield from self._play_sound(item, value, now)
            else:
                self._goals.pop(device, None)
                if not value:
                    # Another program may run a motor that stands for us.
                    self._powers.pop(device, None)
                yield from self._set_power(device, value if item == "power" else None)
        if now >= self._renew_at and self._long_tone is not None:
            yield self._play_tone(*self._long_tone, now)

    def next_request(self) -> bytes | None:
        """Return the next telegram that requests a reply, or None."""
        return self._modes.pop(0) if self._modes else None

    def control_position(self, device: str, rotation: int) -> Iterator[bytes]:
        """Yield the telegram that moves a motor from ``rotation`` degrees towards its goal."""
        goal = self._goals.get(device)
        if goal is None:
            return
        left = goal - rotation
        power = 0
        if abs(left) > NEAR:
            most = min(MOST, self.limits.get((device, "power"), _NO_LIMIT).high)
            power = round(math.copysign(min(most, max(LEAST, abs(left) * GAIN)), left))
        yield from self._set_power(device, power)

    def _set_power(self, device: str, power: int | None) -> Iterator[bytes]:
        """Yield the telegram for a power, None to coast; none if the motor has this power already."""
        if device in self._powers and self._powers[device] == power:
            return
        self._powers[device] = power
        port = p.OUTPUTS.index(device)
        yield p.coast(port) if power is None else p.run(port, power)

    def _play_sound(self, item: str, value: Any, now: float) -> Iterator[bytes]:
        if item == "silence":
            self._long_tone, self._renew_at = None, math.inf
            yield p.stop_sound()
            return
        frequency, milliseconds = value
        yield self._play_tone(frequency, now + milliseconds / 1000 if milliseconds else math.inf, now)

    def _play_tone(self, frequency: int, end: float, now: float) -> bytes:
        """Return the telegram of a tone until a time; one that is longer than a command is renewed before its end."""
        left = (end - now) * 1000
        if left <= LONGEST_TONE:
            self._long_tone, self._renew_at = None, math.inf
            return p.tone(frequency, max(1, round(left)))
        self._long_tone, self._renew_at = (frequency, end), now + _RENEW_S
        return p.tone(frequency, LONGEST_TONE)


def _check_target(device: Any, item: str, value: Any) -> None:
    """Check a target.  Raises BadValue."""
    if device in p.OUTPUTS and item == "power":
        sound = isinstance(value, int) and -100 <= value <= 100
    elif device in p.OUTPUTS and item == "goal":
        sound = isinstance(value, int | float) and abs(value) < 2**31
    elif device in p.INPUTS and item == "mode":
        sound = len(value) == 2 and all(0 <= part <= 255 for part in value)
    elif device == BRICK and item == "tone":
        sound = LOWEST_HZ <= value[0] <= HIGHEST_HZ and 0 <= value[1] < math.inf
    elif (device in p.OUTPUTS and item == "coast") or (device == BRICK and item == "silence"):
        sound = True
    else:
        raise BadValue(f"port {device!r} of an NXT has no {item!r} to set")
    if not sound:
        raise BadValue(f"{value!r} is no {item} for port {device!r}")
