"""The program ``watchdog.py`` on the robot: while something moves it is fed, so that it stops a robot that lost us."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from urbihw.buses.errors import Unavailable
from urbihw_nao.exchange import NaoExchange
from urbihw_nao.part import NaoPart
from urbihw_nao.qimessaging.session import QiService

NAME: Final = "UrbihwWatchdog"
KIND: Final = "watchdog"
FEED_PERIOD_S: Final = 0.2
"""Seconds between two feeds."""
HOLD_S: Final = 1.0
"""Seconds without a feed after which the robot is stopped."""


class WatchdogPart(NaoPart):
    """Feeds the service while one of ``parts`` moves something; does nothing for a robot without it.

    It comes before those parts in a cycle, so that the robot is guarded when it starts.  A service that fails once is
    fed no more until the next login, which is reported.
    """

    def __init__(self, exchange: NaoExchange, parts: Sequence[NaoPart]) -> None:
        super().__init__(exchange)
        self._parts = parts
        self._service: QiService | None = None
        self._fed = False
        self._due = 0.0

    def begin(self) -> None:
        """See ``Part``: find the service; one that is there but out of reach guards nothing, which the robot tells."""
        exchange, self._service, self._fed = self.exchange, None, False
        if NAME not in exchange.info.services:
            exchange.info = replace(exchange.info, unguarded=f"the robot has no {NAME}")
            return
        try:
            self._service = exchange.session.look_up(NAME)
        except Unavailable as error:
            exchange.info = replace(exchange.info, unguarded=str(error))

    def end(self) -> None:
        """See ``Part``: from now on the robot counts."""
        self._service = None

    def send(self) -> None:
        """See ``Part``: feed, or tell that nothing moves any more."""
        exchange = self.exchange
        if self._service is None or self._fed and exchange.now() < self._due or exchange.busy(KIND):
            return
        if exchange.last_error(KIND):
            self._service = None
        elif self._is_moving():
            self._fed, self._due = True, exchange.now() + FEED_PERIOD_S
            exchange.call(KIND, self._service, "feed", HOLD_S)
        elif self._fed:
            self._fed = False
            exchange.call(KIND, self._service, "release")

    def release(self) -> None:
        """A stop was sent, perhaps the last message of an orderly end: nothing is left to guard.  Raises LinkGone."""
        if self._service is not None and self._fed and not self._is_moving():
            self._fed = False
            self.exchange.post(self._service, "release")

    def _is_moving(self) -> bool:
        return any(part.is_moving() for part in self._parts)
