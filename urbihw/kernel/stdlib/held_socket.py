"""Sockets and Servers as resources of a lobby: their limits, opening and closing.

A Socket or a Server belongs to the lobby of the job that opened it; connections accepted by a Server belong to the
lobby of the Server.  All of them are closed when the lobby's connection ends; the objects remain.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeVar

from urbihw.kernel import errors
from urbihw.kernel.runtime.holdings import Holdings, holdings_of
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.socket_channel import ConnectionAttempt, SocketChannel, SocketListener, SocketStream
from urbihw.kernel.stdlib.support import check_descriptors, in_thread

Made = TypeVar("Made", SocketListener, SocketStream)

MAX_SOCKETS: Final = 64
"""Maximum number of open Sockets and Servers per connection, including those accepted by Servers."""
MAX_UNSENT_SIZE: Final = 16 * 1024 * 1024
"""Maximum number of bytes that the Sockets of a connection may hold unsent, before the last message."""
GUARANTEED_UNSENT_SIZE: Final = 1024 * 1024
"""Number of unsent bytes that each Socket may hold, regardless of the others."""
DRAIN_TIMEOUT_S: Final = 1.0
"""Time in seconds for sending the remaining data after the end of the connection that opened the Socket."""


class HeldSocket:
    """A Socket or a Server as held by a lobby: from the attempt to open it until it is closed and handled."""

    def __init__(self, world: World, owner: Any, holdings: Holdings) -> None:
        """Raises Exception.Primitive when the lobby has too many."""
        self.world = world
        self.owner = owner
        self._holdings = holdings
        self.attempt = ConnectionAttempt()
        self._made: SocketChannel | SocketListener | None = None
        self._closed = False
        opener = world.scheduler.current
        ordered = 0 if opener is None else opener.ordered
        holdings.register(self, "sockets", MAX_SOCKETS, self.attempt.address, ordered)

    @classmethod
    def of_job(cls, world: World) -> HeldSocket:
        """Make one for the lobby of the running job."""
        check_descriptors()
        return cls(world, world.scheduler.running().context, holdings_of(world))

    def for_accepted(self) -> HeldSocket:
        """Make one for the same lobby, for an accepted connection."""
        return HeldSocket(self.world, self.owner, self._holdings)

    def open(self, make: Callable[[], Made]) -> Made:
        """The result of an action that may take long: it runs in a thread while the running job waits.

        If the job stops waiting before the action ends, the thread counts as held until then.
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
        """Raise Exception.Primitive if the lobby has too many unsent bytes."""
        own = self._unsent()
        others = (one for one in self._holdings.held() if isinstance(one, HeldSocket))
        if own > GUARANTEED_UNSENT_SIZE and sum(one._unsent() for one in others) > MAX_UNSENT_SIZE:
            raise errors.primitive(f"the other side does not read: {own} bytes wait for it")

    def _unsent(self) -> int:
        return self._made.unsent if isinstance(self._made, SocketChannel) else 0

    def set_channel(self, made: SocketChannel | SocketListener) -> None:
        """Store the opened channel."""
        self._made = made

    def release(self) -> None:
        """Release the resource because it is closed; a second call has no effect."""
        self._holdings.unregister(self)

    def close(self) -> None:
        """Close the channel because the connection that opened it has ended."""
        self._closed = True
        made = self._made
        if made is not None:
            made.close()
        if isinstance(made, SocketChannel):
            scheduler = self.world.scheduler
            scheduler.call_at(scheduler.clock.now() + DRAIN_TIMEOUT_S, made.abort)


def _blocking(world: World, action: Callable[[], Any]) -> Any:
    """The result of an action that may take long: it runs in a thread while the running job waits."""
    try:
        return in_thread(world, action)
    except OSError as problem:
        raise errors.primitive(problem.strerror or str(problem)) from problem
    except UnicodeError as problem:  # ``encodings.idna`` raises this for an invalid host name
        raise errors.primitive("invalid host name") from problem
