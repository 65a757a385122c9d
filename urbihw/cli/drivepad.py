"""The gamepad of ``urbihw drive``: the left stick drives as long as a shoulder button is held.

The button is the dead man.  Axes and buttons have the names of the Linux kernel.  Not tested with a real device.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

from urbihw.cli.drivekeys import STAND, Wish
from urbihw.cli.options import CliRefused
from urbihw.exitcodes import EX_CONFIG
from urbihw.extras import install_command

DEAD_ZONE: Final = 0.12
"""Share of the way of the stick that counts as its middle."""
DEAD_MAN: Final = ("BTN_TL", "BTN_TR")
"""The shoulder buttons; one of them must be held."""


class Pad:
    """A gamepad; ``device`` is an ``evdev.InputDevice``, ``codes`` are ``evdev.ecodes.ecodes``."""

    def __init__(self, device: Any, codes: Any) -> None:
        self._device = device
        self._key, self._abs = codes["EV_KEY"], codes["EV_ABS"]
        self._buttons = {codes[name] for name in DEAD_MAN}
        self._x, self._y = codes["ABS_X"], codes["ABS_Y"]
        self._ranges = {axis: device.absinfo(axis) for axis in (self._x, self._y)}
        self._held: set[int] = set()
        self._left = self._forward = 0.0

    @classmethod
    def open(cls, path: str) -> Pad:
        """The gamepad at a path.  Raises CliRefused."""
        try:
            import evdev
        except ImportError:
            raise CliRefused(
                f"--gamepad needs the Python package evdev: {install_command('evdev')}", EX_CONFIG
            ) from None
        try:
            return cls(evdev.InputDevice(path), evdev.ecodes.ecodes)
        except OSError as error:
            raise CliRefused(f"cannot open {path}: {error.strerror}; is it plugged in, may you read it?",
                             EX_CONFIG) from error  # fmt: skip
        except KeyError:
            raise CliRefused(f"{path} has no stick; evtest lists the devices", EX_CONFIG) from None

    def fileno(self) -> int:
        """The descriptor, for ``select``."""
        return int(self._device.fileno())

    def read(self) -> None:
        """Take the events that have arrived.  Raises OSError when it was unplugged."""
        self.feed(self._device.read())

    def feed(self, events: Iterable[Any]) -> None:
        """Take events: ``type``, ``code`` and ``value``."""
        for event in events:
            if event.type == self._key and event.code in self._buttons:
                if event.value:
                    self._held.add(event.code)
                else:
                    self._held.discard(event.code)
            elif event.type == self._abs and event.code == self._x:
                self._left = -self._share(event)
            elif event.type == self._abs and event.code == self._y:
                self._forward = -self._share(event)

    def _share(self, event: Any) -> float:
        """The position of an axis, -1 to 1; 0 in the dead zone."""
        limits = self._ranges[event.code]
        share: float = 2 * (event.value - limits.min) / ((limits.max - limits.min) or 1) - 1
        beyond = max(abs(share) - DEAD_ZONE, 0.0) / (1 - DEAD_ZONE)
        # Steps of 1 %, so that a trembling stick is not a new order each time.
        return round(min(beyond, 1.0) if share > 0 else -min(beyond, 1.0), 2)

    def release(self) -> None:
        """The dead man must be pressed again."""
        self._held.clear()

    def wish(self) -> Wish:
        """What the stick asks for; nothing, unless the dead man is held."""
        return Wish(self._forward, self._left) if self._held else STAND
