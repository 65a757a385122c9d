"""The resources of the operating system that a connection holds (sockets, child processes); closed when it ends.

A resource belongs to the lobby of the job that opens it.  Resources of jobs without a lobby (files that are loaded at
the start) last as long as the kernel.  A lobby that belongs to another one shares the limits of that one.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from urbihw.frozen import frozen
from urbihw.kernel import errors

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

log = logging.getLogger("urbihw.kernel")

Address = tuple[str, int]


class Holding(Protocol):
    """A resource that is closed when the connection ends."""

    def close(self) -> None:
        """Close the resource without waiting, in the kernel's thread; a second call does nothing."""
        ...


@frozen(slots=False)
class _Holding:
    """A registered resource, with its kind."""

    one: Holding
    kind: str
    address: Callable[[], Address | None]
    ordered: int


class Holdings:
    """The resources of one lobby."""

    def __init__(self, maker: Holdings | None = None) -> None:
        """``maker`` has the resources of the lobby that this lobby belongs to; the limits are for both together."""
        self._numbers: Counter[str] = Counter() if maker is None else maker._numbers
        self._held: dict[int, _Holding] = {}
        """The resources by identity, since objects of the language may be equal to others."""
        self._sealed = False

    def check(self, kind: str, most: int) -> None:
        """Raise Exception.Primitive if no further resource of a kind may be registered."""
        if self._sealed:
            raise errors.primitive("the connection is closed: nothing can be opened for it any more")
        if self._numbers[kind] >= most:
            raise errors.primitive(f"too many {kind}: this connection has {most}; close one")

    def register(
        self,
        one: Holding,
        kind: str,
        most: int,
        address: Callable[[], Address | None] = lambda: None,
        ordered: int = 0,
    ) -> None:
        """Hold a resource until ``unregister``, and close it when the connection ends.

        ``kind`` is a plural name ("sockets"), ``most`` the maximum number of that kind; ``address()`` is the local
        address from which the resource connects, None if it does not, ``ordered`` the ``Job.ordered`` of the program
        that has opened it.  Raises Exception.Primitive when that number is reached or the connection is closed; the
        caller then closes the resource.  Registering a resource again does nothing.
        """
        if id(one) in self._held:
            return
        self.check(kind, most)
        self._numbers[kind] += 1
        self._held[id(one)] = _Holding(one, kind, address, ordered)

    def unregister(self, one: Holding) -> None:
        """Remove a resource that is closed or over; does nothing if it is not registered."""
        found = self._held.pop(id(one), None)
        if found is not None:
            self._numbers[found.kind] -= 1

    def held(self) -> list[Holding]:
        """All resources that are registered now."""
        return [entry.one for entry in self._held.values()]

    def order_of(self, address: Address) -> int | None:
        """The ``Job.ordered`` of the program whose resource connects from this address, None if there is none."""
        return next((entry.ordered for entry in self._held.values() if entry.address() == address), None)

    def seal(self) -> None:
        """Refuse further resources, because the connection is closed."""
        self._sealed = True

    def close(self) -> None:
        """Close all resources, and refuse further ones."""
        self.seal()
        for one in self.held():
            self.unregister(one)
            try:
                one.close()
            except Exception as error:
                log.error("error while closing what a connection held: %s", error)


def holdings_of(world: World) -> Holdings:
    """The resources to which the running job adds: those of its lobby, or those of the kernel if it has no lobby."""
    context = world.scheduler.running().context
    found: Holdings = world.holdings if context is None else context.holdings
    return found
