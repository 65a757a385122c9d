"""What may move a robot after the release of an emergency stop: what is ordered then, and nothing that was before.

A motion without an order is not expected.  So a release disarms what was ordered until then (``Job.ordered``): running
programs, also those that catch errors, an ``at`` that waits, and text that was sent before and has waited in its
connection.  ``rearm`` lets all of that move again.  Nor does anything that was ordered before an emergency stop
release it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from operator import itemgetter
from typing import TYPE_CHECKING, Any, Final

from urbihw.kernel import errors

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World
    from urbihw.kernel.sched.job import Job
    from urbihw.kernel.sched.timequeue import Timer

WANTING_S: Final = 10.0
"""Seconds after which a program that has ended, or has not tried again, does not count as wanting to move any more."""
_SHOWN: Final = 3


@dataclass(slots=True)
class UnarmedClient:
    """A client whose programs want to move though they were begun before the release: its name, when one of them tried
    last (s), and the jobs that did, except that of its statements in the foreground."""

    name: str
    tried_at: float
    jobs: dict[Job, None] = field(default_factory=dict)

    def wants_since(self, time: float) -> bool:
        """Whether one of the programs has tried to move since a time, or goes on."""
        self.jobs = {job: None for job in self.jobs if not job.done}
        return bool(self.jobs) or self.tried_at >= time


class Arming:
    """The emergency stops of one robot and what was ordered before them; ``name`` is that of the robot.

    Attributes:
        on_unarmed: called when ``explain`` changes.
    """

    def __init__(self, world: World, name: str) -> None:
        self._world = world
        self._name = name
        self.on_unarmed: Callable[[], None] = lambda: None
        self._since = 0
        """The lowest ``Job.ordered`` of what may move the robot."""
        self._presses: dict[tuple[str, Any], int] = {}
        """The last emergency stops that were pressed: whose they are, by which client (None for others and for those
        who are gone), and in which era."""
        self._unarmed: dict[Any, UnarmedClient] = {}
        self._looking: Timer | None = None

    def press(self, user: str, lobby: Any = None) -> None:
        """A client, or None for anybody else, presses an emergency stop, which belongs to ``user``.  What was ordered
        before does not release it (``check_release``)."""
        era = self._world.scheduler.begin_era()
        presses: dict[tuple[str, Any], int] = {}
        for (whose, client), pressed in sorted(self._presses.items(), key=itemgetter(1)):
            presses[whose, client if client is not None and client.connected else None] = pressed
        self._presses = presses | {(user, lobby): era}

    def check_release(self, users: Collection[str]) -> None:
        """Raise the error for a release of the stops of these users that was ordered before they were pressed: text
        that has waited, or a program.  The robot itself, and the connection that has pressed, know of the stop."""
        job = self._world.scheduler.current
        if job is None or job.context is None:
            return
        presses = [era for (user, lobby), era in self._presses.items() if user in users and lobby is not job.context]
        if any(job.ordered < era for era in presses):
            why = "this was begun before the emergency stop, so it does not release it: begin it again"
            raise errors.MovementRefused(f"{self._name}: {why}")

    def release(self) -> None:
        """The robot is free: what was ordered until now does not move it."""
        self._presses.clear()
        self._set_since(self._world.scheduler.begin_era())

    def rearm(self) -> None:
        """Let move again what was ordered before the release and has not ended; as ``check``."""
        job = self._world.scheduler.current
        if job is not None:
            self.check(job)
        self._set_since(0)

    def order_anew(self) -> None:
        """Let the running statement count as ordered now, with what its client has sent behind it: it has released the
        emergency stop itself."""
        job = self._world.scheduler.current
        if job is not None:
            since = job.ordered
            job.begin_statement()
            if job.context is not None:
                job.context.shell.order_anew(job, since)

    def check(self, job: Job) -> None:
        """Raise MovementRefused for a job that was ordered before the release, and warn its client, even if it catches
        the error."""
        if job.ordered >= self._since:
            return
        why = "an emergency stop was released after this program had begun: begin it again, or call rearm"
        scheduler, lobby = self._world.scheduler, job.context
        known = self._unarmed.get(lobby)
        if known is None:
            known = self._unarmed[lobby] = UnarmedClient(str(getattr(lobby, "title", "robot")), scheduler.now)
            output = getattr(lobby, "output", None)
            if output is not None:
                output.line(f"!!! warning: {self._name}: {why}", "warning")
            self.on_unarmed()
        known.tried_at = scheduler.now
        if lobby is None or not lobby.shell.serves(job):
            known.jobs[job] = None
        if self._looking is None:
            self._looking = scheduler.call_at(scheduler.now + WANTING_S, self._forget_ended)
        raise errors.MovementRefused(f"{self._name}: {why}")

    def explain(self) -> str:
        """Whose programs want to move though they were begun before the release, and what to do; "" for none."""
        names = [each.name for each in self._unarmed.values()]
        if not names:
            return ""
        shown = ", ".join(names[:_SHOWN]) + (f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else "")
        return f"programs of {shown}, begun before the emergency stop, want to move: " \
            f"begin them again, or say {self._name}.rearm"

    def client_gone(self, lobby: Any) -> None:
        """The connection of a client has ended, and its programs with it."""
        if self._unarmed.pop(lobby, None) is not None:
            self.on_unarmed()

    def _set_since(self, since: int) -> None:
        self._since = since
        self._unarmed.clear()
        self.on_unarmed()

    def _forget_ended(self) -> None:
        """Forget the clients whose programs do not try to move any more."""
        scheduler, before = self._world.scheduler, len(self._unarmed)
        since = scheduler.now - WANTING_S
        self._unarmed = {lobby: each for lobby, each in self._unarmed.items() if each.wants_since(since)}
        again = scheduler.now + WANTING_S
        self._looking = scheduler.call_at(again, self._forget_ended) if self._unarmed else None
        if len(self._unarmed) != before:
            self.on_unarmed()
