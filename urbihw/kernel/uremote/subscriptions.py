"""What a connection remembers for its remote: the variables and events it hears of, and the calls it is to answer."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from urbihw.kernel.runtime.event import Emission
from urbihw.kernel.sched.job import Job
from urbihw.kernel.uremote.remote import Code

if TYPE_CHECKING:
    from urbihw.kernel.uremote.connection import Connection


class VariableSubscription:
    """How often a remote said that it wants to hear of a variable, and under which name."""

    __slots__ = ("count", "name")

    def __init__(self, name: str) -> None:
        self.name = name
        self.count = 0


class PendingCall:
    """A call that waits for its answer."""

    __slots__ = ("failed", "job", "value", "waits")

    def __init__(self, job: Job) -> None:
        self.job = job
        self.value: Any = None
        self.failed = False
        self.waits = True


class EventSubscription:
    """Tells a remote of the emissions of an event with a certain number of arguments."""

    __slots__ = ("_arity", "_connection", "_name")

    def __init__(self, connection: Connection, name: str, arity: int) -> None:
        self._connection = connection
        self._name = name
        self._arity = arity

    def offer(self, emission: Emission) -> None:
        """An emission begins."""
        if len(emission.payload) == self._arity:
            emission.matches.append((self, True))
            self._say(Code.EVENT, emission)

    def ended(self, emission: Emission, match: Any) -> None:
        """It is over."""
        self._say(Code.EVENT_END, emission)

    def _say(self, code: Code, emission: Emission) -> None:
        self._connection.send(code, self._connection.world.string(self._name), *emission.payload)
