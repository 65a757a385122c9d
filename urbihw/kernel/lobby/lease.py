"""How long a client may be silent before it loses what it moves: ``lobby.lease``.

A client that was killed closes its connection, and a cut cable is noticed by TCP.  A client that is held (by SIGSTOP, a
debugger, a machine that sleeps) keeps its connection open, and what it has set in motion goes on.  A client that asks
for a lease promises to send something, an empty line at least, before the lease is over.

Only the client keeps its lease, not a program that it has left in the server: what counts is what arrives from it after
the lease has begun.  So the beginning of a lease begins an era, too.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from urbihw.kernel.lobby.lobby import Lobby
    from urbihw.kernel.sched.timequeue import Timer

MIN_LEASE_S: Final = 0.1
MAX_LEASE_S: Final = 3600.0
GRACE_S: Final = 0.05
"""Seconds between the end of a lease and its effect: what has arrived while a job held the interpreter is read in
them."""


class ClientLease:
    """The lease of one lobby."""

    def __init__(self, lobby: Lobby) -> None:
        self._lobby = lobby
        self._scheduler = lobby.world.scheduler
        self.seconds = 0.0
        """The length of the lease, 0 for none."""
        self.silence = ""
        """What the client has done, in words, since its lease is over; else ""."""
        self._era = 0
        """The era that the lease has begun."""
        self._answered = False
        """Whether something has arrived since then."""
        self._heard = 0.0
        self._timer: Timer | None = None

    def set_length(self, seconds: float) -> None:
        """Begin a lease of so many seconds, change or end it (0).

        Raises ValueError for a time that no lease has, and when a program that the client had sent before changes the
        lease in force.
        """
        if seconds and not MIN_LEASE_S <= seconds <= MAX_LEASE_S:
            raise ValueError(f"a lease lasts for {MIN_LEASE_S:g} to {MAX_LEASE_S:g} s, or 0 s for none")
        if self.seconds and not self._is_asked_by_client():
            raise ValueError(
                "a lease is changed and ended by what the client sends after it has begun, not by a program that it "
                "had sent before"
            )
        self.end()
        self.seconds = seconds
        self.silence = ""
        self._era, self._answered = self._scheduler.begin_era(), False
        self._heard = self._scheduler.clock.now()
        if seconds:
            self._arm()

    def hear(self, arrived: int) -> None:
        """The client has sent something, which arrived in an era."""
        if not self.seconds or arrived < self._era:
            return
        self._answered = True
        self._heard = self._scheduler.clock.now()
        self.silence = ""
        if self._timer is None:
            self._arm()

    def _is_asked_by_client(self) -> bool:
        """Whether the running statement arrived after the lease had begun.  A program that releases its own emergency
        stop counts as ordered anew, but nothing has arrived by that."""
        job = self._scheduler.current
        return job is None or self._answered and job.ordered >= self._era

    def end(self) -> None:
        """Stop watching the connection."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _arm(self) -> None:
        self._timer = self._scheduler.call_at(self._heard + self.seconds, self._check)

    def _check(self) -> None:
        """The lease was to end now."""
        self._timer = None
        if self._is_over():
            self._timer = self._scheduler.call_at(self._scheduler.clock.now() + GRACE_S, self._lapse)
        else:
            self._arm()

    def _lapse(self) -> None:
        self._timer = None
        if self._is_over():
            self.silence = f"has sent nothing for {self.seconds:g} s (lobby.lease)"
            self._lobby.release_devices()
        else:
            self._arm()

    def _is_over(self) -> bool:
        return self._scheduler.clock.now() >= self._heard + self.seconds
