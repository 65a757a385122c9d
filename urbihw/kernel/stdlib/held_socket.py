"""What lobbies hold of Sockets and Servers: how many there may be, opening them, and their end.

A Socket or a Server belongs to the lobby that the job spoke to which opened it, and what a Server accepts belongs to
the lobby of the Server.  All of them are closed when the connection ends; the objects remain.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeVar

from urbihw.kernel import errors
from urbihw.kernel.runtime.holdings import Holdings, holdings_of
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.support import check_descriptors, in_thread
from urbihw.kernel.stdlib.wire import Listener, Stream, Trial, Wire

Made = TypeVar("Made", Listener, Stream)

MOST_SOCKETS: Final = 64
"""Sockets and Servers that the jobs of one connection may have open, those that a Server accepted too."""
MOST_UNSENT: Final = 16 * 1024 * 1024
"""Bytes that may wait to be sent by the Sockets of a connection, and one message more."""
SHARE: Final = 1024 * 1024
"""Bytes of one Socket that may, whatever waits for the others."""
LAST_WORDS: Final = 1.0
"""Seconds in which the other side may take what was written before the connection ended that had opened the Socket."""


class HeldSocket:
    """What a lobby holds of a Socket or a Server: from the attempt to open it until it is closed and handled."""

    def __init__(self, world: World, owner: Any, holdings: Holdings) -> None:
        """Raises Exception.Primitive when the lobby has too many."""
        self.world = world
        self.owner = owner
        self._holdings = holdings
        self.trial = Trial()
        self._made: Wire | Listener | None = None
        self._closed = False
        holdings.own(self, "sockets", MOST_SOCKETS, self.trial.address)

    @classmethod
    def of_job(cls, world: World) -> HeldSocket:
        """One of the running job."""
        check_descriptors()
        return cls(world, world.scheduler.running().context, holdings_of(world))

    def further(self) -> HeldSocket:
        """One of the same lobby, for who was accepted."""
        return HeldSocket(self.world, self.owner, self._holdings)

    def open(self, make: Callable[[], Made]) -> Made:
        """What an action gives that may take long: it is done in a thread while the running job waits.

        If the job does not wait for the end of it, the thread is held until then.
        """
        made: list[Made] = []
        waits, ended = True, False

        def settled() -> None:
            nonlocal ended
            ended = True
            if not waits:
                self.release()
                for one in made:
                    one.close()

        def work() -> None:
            try:
                made.append(make())
            finally:
                self.world.scheduler.post(settled)

        try:
            _blocking(self.world, work)
            if self._closed:
                raise errors.primitive("the connection that opened it is closed")
        except BaseException:
            waits = False
            if ended:
                settled()
            raise
        return made[0]

    def check_unsent(self) -> None:
        """Raise Exception.Primitive if nothing more may be sent before the other side has read."""
        own = self._unsent()
        others = (one for one in self._holdings.held() if isinstance(one, HeldSocket))
        if own > SHARE and sum(one._unsent() for one in others) > MOST_UNSENT:
            raise errors.primitive(f"the other side does not read: {own} bytes wait for it")

    def _unsent(self) -> int:
        return self._made.unsent if isinstance(self._made, Wire) else 0

    def hold(self, made: Wire | Listener) -> None:
        """It is open."""
        self._made = made

    def release(self) -> None:
        """It is closed; twice is harmless."""
        self._holdings.disown(self)

    def close(self) -> None:
        """The connection that opened it has ended."""
        self._closed = True
        made = self._made
        if made is not None:
            made.close()
        if isinstance(made, Wire):
            scheduler = self.world.scheduler
            scheduler.call_at(scheduler.clock.now() + LAST_WORDS, made.abort)


def _blocking(world: World, action: Callable[[], Any]) -> Any:
    """What an action gives that may take long: it is done in a thread while the running job waits."""
    try:
        return in_thread(world, action)
    except OSError as problem:
        raise errors.primitive(problem.strerror or str(problem)) from problem
    except UnicodeError as problem:  # the names of hosts have a grammar of their own
        raise errors.primitive("invalid host name") from problem
