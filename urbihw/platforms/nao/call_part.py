"""What programs ask of services: their methods, calls, and events of ALMemory."""

from __future__ import annotations

from typing import Any, Final

from urbihw.buses.messages import FromWorker, Happened, Reply, Request
from urbihw.buses.qi.session import Call
from urbihw.platforms.nao.exchange import Exchange
from urbihw.platforms.nao.finding import LEDS, MEMORY, SONAR
from urbihw.platforms.nao.part import Devices, Part

SERVICES: Final = "services"
"""Stands for all that services were told to do, for stops and for who may move."""
BLOCKING_TIMEOUT_S: Final = 1e6
"""Seconds that a call of a program may take."""
HARMLESS: Final = frozenset({
    MEMORY, LEDS, SONAR, "ALBattery", "ALTextToSpeech", "ALVideoDevice", "ALAudioDevice", "ALAudioPlayer", "ALLogger",
    "ServiceDirectory",
})  # fmt: skip
"""Services that move nothing."""
ASKING: Final = ("get", "is", "are", "robotIs", "moveIs", "walkIs", "list", "ping", "version")
"""How methods begin that move nothing."""


def may_move(service: str, method: str) -> bool:
    """Whether a method may move the robot: all of which it is not known that they do not."""
    return service not in HARMLESS and not method.startswith(ASKING)


class CallPart(Part):
    """Requests "describe", "call" and "listen"; see ``driver``."""

    verbs = frozenset({"describe", "call", "listen"})

    def __init__(self, exchange: Exchange) -> None:
        super().__init__(exchange)
        self._described: set[str] = set()
        self._events: set[str] = set()
        self._moved = False

    def begin(self) -> None:
        """See ``Part``: look up again what programs use, and listen to the same events."""
        for name in sorted(self._described):
            self.exchange.session.look_up(name)
        for key in sorted(self._events):
            self._listen(key)

    def request(self, message: Request) -> list[FromWorker]:
        """See ``Part``."""
        match message.verb:
            case "describe":
                found = self.exchange.session.look_up(str(message.device))
                self._described.add(found.name)
                return [Reply(message.reply_id, True, found.meta.names())]
            case "listen":
                self._events.add(str(message.device))
                self._listen(str(message.device))
                return [Reply(message.reply_id, True)]
            case _:
                self._call(message)
                return []

    def _call(self, message: Request) -> None:
        exchange = self.exchange

        def answered(call: Call) -> None:
            exchange.news.append(Reply(message.reply_id, not call.error, call.value, call.error))

        service = exchange.session.look_up(str(message.device))
        exchange.session.call(service, message.item, *message.value, then=answered, timeout=BLOCKING_TIMEOUT_S)
        self._moved = self._moved or may_move(str(message.device), message.item)

    def _listen(self, key: str) -> None:
        exchange = self.exchange
        subscriber = exchange.ask(exchange.memory, "subscriber", key)

        def heard(values: tuple[Any, ...]) -> None:
            exchange.news.append(Happened("event", key, values[0]))

        exchange.session.listen_to_object(subscriber, "signal", heard)

    def stop(self, devices: Devices) -> None:
        """End what services were told to do."""
        if self._moved and (devices is None or SERVICES in devices):
            self._moved = False
            self.exchange.post_motion("stopMove")
            self.exchange.post_motion("killAll")
