"""Lights: what was written last to each of them goes out once a tick."""

from __future__ import annotations

from typing import Any, Final

from urbihw.platforms.nao.exchange import Exchange
from urbihw.platforms.nao.finding import LEDS
from urbihw.platforms.nao.part import Part

LED: Final = "led"


class LightPart(Part):
    """Targets "rgb" (0xRRGGBB) and "level" (0 to 1) of ("led", NAME)."""

    def __init__(self, exchange: Exchange) -> None:
        super().__init__(exchange)
        self._waiting: dict[tuple[str, str], float] = {}

    def end(self) -> None:
        """See ``Part``."""
        self._waiting.clear()

    def owns(self, device: Any) -> bool:
        """See ``Part``."""
        return isinstance(device, tuple) and device[0] == LED

    def set_target(self, device: Any, item: str, value: float) -> str:
        """See ``Part``."""
        if item not in ("rgb", "level"):
            return "no such target"
        self._waiting[device[1], item] = value
        return ""

    def send(self) -> None:
        """See ``Part``."""
        if not self._waiting:
            return
        lights, self._waiting = self._waiting, {}
        service = self.exchange.session.look_up(LEDS)
        for (name, item), value in lights.items():
            if item == "rgb":
                self.exchange.post(service, "fadeRGB", name, int(value), 0.0)
            else:
                self.exchange.post(service, "setIntensity", name, value)
