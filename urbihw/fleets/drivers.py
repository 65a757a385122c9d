"""Far clients that drive this robot: each has a connection of its own to the daemon, under a lease.

The daemon has the mechanism, ``lobby.lease``: what a connection moves stops when it gives no sign of life.  The bridge
lives longer than a far client, so it gives none on its own: it hands on those of the far client, and none that was long
on its way.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable, Collection
from typing import Any, Final

from urbihw.client.aio import AsyncRobot
from urbihw.client.literals import string_literal
from urbihw.fleets.told import number_in

MOST_DRIVERS: Final = 16
IDLE_S: Final = 10.0
"""Seconds without a sign of life after which a far client makes room for others."""


class FleetRefusal(Exception):
    """What a far client asks for is not done; the message is one line that tells why."""


class TooOld(FleetRefusal):
    """An order was long on its way, or the far client does not know the clock of this robot any more."""


def made_in(made: Any) -> float:
    """The time at which an order was made, as it says.  Raises FleetRefusal."""
    at = number_in(made)
    if at is None:
        raise FleetRefusal("an order to move says when it was made: say hello first")
    return at


class FarDriver:
    """One far client, by its name; ``heard`` is the time of its last sign of life."""

    def __init__(self, who: str, robot: AsyncRobot, dead_man: float, heard: float) -> None:
        self.who = who
        self.robot = robot
        self.heard = heard
        self._lease = robot.lease(dead_man, fed=False)

    async def begin(self) -> None:
        """Begin the lease.  Raises ClientError."""
        await self.robot.run(f"lobby.introduce({string_literal(f'{self.who} (fleet)')})|")
        await self._lease.__aenter__()

    def feed(self, now: float) -> None:
        """Hand on a sign of life."""
        self.heard = now
        if self.robot.connected:
            self._lease.feed()

    async def end(self) -> None:
        """End the connection: what it moves stops."""
        await self.robot.close()


class FarDrivers:
    """All far clients that drive.  ``named``: those who may; ``dead_man`` in s; ``clock`` is monotonic, in s."""

    def __init__(
        self,
        connect: Callable[[], Awaitable[AsyncRobot]],
        named: Collection[str],
        dead_man: float,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._connect = connect
        self._named = named
        self._dead_man = dead_man
        self._clock = clock
        self._drivers: dict[tuple[str, str], FarDriver] = {}
        self._opening = asyncio.Lock()

    @property
    def names(self) -> list[str]:
        """The names of those who drive now."""
        return sorted({who for who, _ in self._drivers})

    def may_drive(self, who: str) -> bool:
        """Whether the settings of this robot let somebody drive."""
        return who in self._named

    def check_right(self, who: str) -> None:
        """Raises FleetRefusal for somebody who may not drive."""
        if not self.may_drive(who):
            raise FleetRefusal(f"{who} may not drive: fleet_drive of its settings does not name {who}")

    def check_age(self, made: Any) -> None:
        """Whether an order is young enough; ``made`` is the time at which it was given, by this robot's clock as the
        far client knows it.  Raises FleetRefusal.

        The far client takes the time of an answer for the present, which makes an order older, never younger.
        """
        age = self._clock() - made_in(made)
        if not -self._dead_man <= age <= self._dead_man:
            raise TooOld(f"the order was {age:.1f} s on its way: it is not carried out any more")

    async def driver(self, who: str, session: str) -> FarDriver:
        """The connection of a far client that may drive, made if needed.  Raises FleetRefusal, ClientError."""
        self.check_right(who)
        async with self._opening:
            found = self._drivers.get((who, session))
            if found is not None and found.robot.connected:
                found.feed(self._clock())
                return found
            await self._end_idle()
            if len(self._drivers) >= MOST_DRIVERS:
                raise FleetRefusal(f"{MOST_DRIVERS} others drive already")
            made = FarDriver(who, await self._connect(), self._dead_man, self._clock())
            self._drivers[who, session] = made
            try:
                await made.begin()
            except BaseException:  # also of an order that was cancelled
                await self.end(who, session)
                raise
            return made

    async def _end_idle(self) -> None:
        for (who, session), each in list(self._drivers.items()):
            if self._clock() - each.heard > IDLE_S or not each.robot.connected:
                await self.end(who, session)

    def feed(self, who: str, session: str, made: Any) -> None:
        """Hand on a sign of life of a far client, unless it was long on its way."""
        found = self._drivers.get((who, session))
        if found is not None:
            try:
                self.check_age(made)
            except FleetRefusal:
                return
            found.feed(self._clock())

    async def end(self, who: str, session: str) -> None:
        """A far client is gone: what it moves stops."""
        found = self._drivers.pop((who, session), None)
        if found is not None:
            await found.end()

    async def end_all(self) -> None:
        """The bridge has left the fleet, or ends."""
        for who, session in list(self._drivers):
            await self.end(who, session)
