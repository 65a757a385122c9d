"""The names that are known to belong to lazy functions, so that calls by them are compiled for both kinds of functions.

The compiler cannot know which functions are lazy.  A call by a known name evaluates its arguments, or passes them
unevaluated, at about the same cost.  A call by another name is compiled for strict functions; if it meets a lazy one,
it takes a detour (``compiler.late``), which is correct and slower.

So a name is known to a client whose programs have given it to a lazy function, or have met such a function: what one
client defines makes the code of no other client longer.  The names of the library, and logical operators that a program
has redefined, are known to all.
"""

from __future__ import annotations

import re
from typing import Any, Final
from weakref import WeakKeyDictionary

from urbihw.kernel.runtime.slots import LOGICAL, STRICT_NAMES
from urbihw.kernel.sched.scheduler import Scheduler

NO_NAMES: Final[frozenset[str]] = frozenset()
_WORD: Final = re.compile(r"\w+")
MAX_NAMES: Final = 1000
"""Maximum number of names known to one client: its code is compiled anew after each of them."""


class LazyNames:
    """The lazy names of one world.

    Attributes:
        shared: the names known to all clients.
    """

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self.shared: frozenset[str] = frozenset()
        self._own: WeakKeyDictionary[Any, frozenset[str]] = WeakKeyDictionary()
        """All names known to a client that has made some known, by its lobby."""

    def known(self) -> frozenset[str]:
        """The names known to the client of the running job."""
        job = self._scheduler.current
        return self.shared if job is None else self.known_to(job.context)

    def known_to(self, lobby: Any) -> frozenset[str]:
        """The names known to the client of a lobby; those known to all for None."""
        return self._own.get(lobby, self.shared) if self._own and lobby is not None else self.shared

    def own_in(self, text: str) -> frozenset[str]:
        """The names in a text that the client of the running job knows and that are not known to all.

        A name that is spelt with escapes is not found: its calls take the detour.
        """
        known = self.known()
        return NO_NAMES if known is self.shared else known.intersection(_WORD.findall(text)) - self.shared

    def add(self, name: str) -> None:
        """Record that a name belongs to a lazy function, or that a logical operator is redefined."""
        known = self.known()
        if name in known or name in STRICT_NAMES:
            return
        job = self._scheduler.current
        if name in LOGICAL or job is None or job.context is None:
            self.shared |= {name}
            for lobby, names in list(self._own.items()):
                self._own[lobby] = names | {name}
        elif len(known) < MAX_NAMES:
            self._own[job.context] = known | {name}
