"""Lights: what was written last to each of them goes out once a tick, some lights a tick, one round after the other."""

from __future__ import annotations

from typing import Any, Final

from urbihw.buses.messages import Refused
from urbihw_nao.exchange import NaoExchange
from urbihw_nao.finding import LEDS
from urbihw_nao.part import NaoPart

LED: Final = "led"
LIGHTS_PER_TICK: Final = 8
"""Calls that go out in one tick at most: the lights must not delay the joints.  The others follow in the next ticks."""


class LightPart(NaoPart):
    """Targets "rgb" (0xRRGGBB) and "level" (0 to 1) of ("led", NAME)."""

    def __init__(self, exchange: NaoExchange) -> None:
        super().__init__(exchange)
        self._waiting: dict[str, tuple[str, float]] = {}

    def end(self) -> None:
        self._waiting.clear()

    def owns(self, device: Any) -> bool:
        return isinstance(device, tuple) and device[0] == LED

    def set_target(self, device: Any, item: str, value: float) -> str:
        if item not in ("rgb", "level"):
            return "no such target"
        # The last one written comes last: groups overlap.
        self._waiting.pop(device[1], None)
        self._waiting[device[1]] = item, value
        return ""

    def send(self) -> None:
        """See ``Part``: the next lights, when the last ones were answered."""
        exchange = self.exchange
        if not self._waiting or exchange.busy(LED):
            return
        service = exchange.find_service(LEDS)
        if service is None:
            self._waiting.clear()
            exchange.news.append(Refused(LED, LEDS, "this robot has no such service: its lights cannot be written"))
            return
        for name in list(self._waiting)[:LIGHTS_PER_TICK]:
            item, value = self._waiting.pop(name)
            if item == "rgb":
                exchange.call(LED, service, "fadeRGB", name, int(value), 0.0)
            else:
                exchange.call(LED, service, "setIntensity", name, value)
