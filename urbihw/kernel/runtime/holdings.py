"""What the jobs of a connection hold of the operating system (sockets, child processes): closed when it ends.

A job holds on the account of the lobby that it speaks to.  What is held by jobs that speak to none (files that are
loaded at the start) lasts as long as the kernel.  Lobbies that belong to another one count together with it.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from urbihw.kernel import errors

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

log = logging.getLogger("urbihw.kernel")

Address = tuple[str, int]


class Holding(Protocol):
    """Something to be closed when the connection ends."""

    def close(self) -> None:
        """Close it: at once, without waiting, in the kernel's thread; twice is harmless."""
        ...


@dataclass(frozen=True)
class _Entry:
    """Something held."""

    one: Holding
    kind: str
    address: Callable[[], Address | None]


class Holdings:
    """What one lobby holds."""

    def __init__(self, maker: Holdings | None = None) -> None:
        """``maker``: of the lobby that this one belongs to; the bounds are for both together."""
        self._numbers: Counter[str] = Counter() if maker is None else maker._numbers
        self._held: dict[int, _Entry] = {}
        """By identity: objects of the language may be equal to others."""
        self._sealed = False

    def check(self, kind: str, most: int) -> None:
        """Raise Exception.Primitive if no further one of a kind may be held: see ``own``."""
        if self._sealed:
            raise errors.primitive("the connection is closed: nothing can be opened for it any more")
        if self._numbers[kind] >= most:
            raise errors.primitive(f"too many {kind}: this connection has {most}; close one")

    def own(self, one: Holding, kind: str, most: int, address: Callable[[], Address | None] = lambda: None) -> None:
        """Hold something until ``disown``, and close it when the connection ends.

        ``kind`` is what they are called in the plural ("sockets"), ``most`` how many of them there may be;
        ``address()`` says from which address it connects, if it does.  Raises Exception.Primitive when there are so
        many, or when the connection is closed; then it is not held, and the caller closes it.  Something that is held
        already stays held.
        """
        if id(one) in self._held:
            return
        self.check(kind, most)
        self._numbers[kind] += 1
        self._held[id(one)] = _Entry(one, kind, address)

    def disown(self, one: Holding) -> None:
        """Hold something no more: it is closed, or over.  Harmless if it is not held."""
        found = self._held.pop(id(one), None)
        if found is not None:
            self._numbers[found.kind] -= 1

    def held(self) -> list[Holding]:
        """All that is held."""
        return [entry.one for entry in self._held.values()]

    def connects_from(self, address: Address) -> bool:
        """Whether something that is held connects from this address."""
        return any(entry.address() == address for entry in self._held.values())

    def seal(self) -> None:
        """The connection is gone: nothing new is held from now on."""
        self._sealed = True

    def close(self) -> None:
        """Close all that is held, and hold nothing from now on."""
        self.seal()
        for one in self.held():
            self.disown(one)
            try:
                one.close()
            except Exception as error:
                log.error("error while closing what a connection held: %s", error)


def holdings_of(world: World) -> Holdings:
    """Where the running job holds what it opens: with its lobby, or with the kernel if it speaks to none."""
    context = world.scheduler.running().context
    found: Holdings = world.holdings if context is None else context.holdings
    return found
