"""One connection's world: an urbiscript object whose slots are the variables of the connection, and its jobs.

All code of a connection runs under its ``connectionTag``.  When the connection closes, the tag is stopped, and with it
the jobs, the ``at``s and the detached jobs.
"""

from __future__ import annotations

import contextlib
import ipaddress
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from urbihw.kernel import errors
from urbihw.kernel.lobby.advice import advice, of_hiding
from urbihw.kernel.lobby.connection_tag import ConnectionTag
from urbihw.kernel.lobby.lease import ClientLease
from urbihw.kernel.lobby.output import Output
from urbihw.kernel.lobby.printing import described
from urbihw.kernel.lobby.shell import Shell
from urbihw.kernel.lobby.statements import execute
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.holdings import Address, Holdings
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.sched.arrivals import UnreadInput
from urbihw.kernel.sched.signals import JobAborted

if TYPE_CHECKING:
    from urbihw.kernel.lobby.shell import Programs
    from urbihw.kernel.runtime.world import World
    from urbihw.kernel.sched.tag import Tag
    from urbihw.kernel.syntax.reader import Statement


BROWSER: Final = " (panel)"
"""The end of the names that a gateway (``urbihw.web``) gives the connections of its browsers."""
FINALLY_TIMEOUT_S: Final = 1.0
"""Seconds after which waiting ``finally`` clauses of a closed connection are ended."""


class Lobby(Obj):
    """An urbiscript Lobby: a connection and its state."""

    is_per_connection = True
    __slots__ = (
        "_advised", "answering", "connected", "holdings", "in_command", "input_handler", "label", "lease", "maker",
        "noted_until", "on_quit", "ordered", "output", "peer", "programs", "received", "released_at", "served",
        "shell", "tag", "unread", "user",
    )  # fmt: skip

    def __init__(
        self,
        world: World,
        programs: Programs,
        wanted: Callable[[Lobby], None],
        remote: str | None = None,
        limit: int = 8 * 1024 * 1024,
    ) -> None:
        super().__init__(world, [world.lobby_proto])
        scheduler = world.scheduler
        self.programs = programs
        self.output = Output(scheduler, lambda: wanted(self), limit)
        self.answering: dict[str, Tag] = {}
        """The tags of statements that run and answer on a channel that the client chose, by the channels."""
        self.connected = True
        self.in_command = True
        """Whether the client can still send statements, such as a stop.  Without command, its programs may not move
        devices."""
        self.received = 0
        self.served = False
        """Whether a statement of the client has run, or the first turn of one in the background."""
        self.released_at = 0
        """The lowest ``Job.era`` of a statement that may move devices: ``release_devices`` sets it."""
        self.ordered: int | None = None
        """The ``Job.ordered`` that no statement exceeds, if a device in another process sends them or a program has
        created the lobby: that is one program.  None for a client, whose statements are orders themselves."""
        self.lease = ClientLease(self)
        self.on_quit: Callable[[], None] = lambda: None
        self.unread = UnreadInput()
        """What the client has sent that has not been handed to ``feed`` yet."""
        self.peer = remote
        """The address of the client, None for none; ``remoteIP`` has the same value, but a program can change that
        slot."""
        self.holdings = Holdings()
        """The sockets, child processes and the like of its jobs."""
        self.maker: Lobby | None = None
        """The lobby whose program opened this connection, if any."""
        self.user = ""
        """The name of the user who presented a token, "" without access control."""
        self.label = ""
        """The name that the client has given to the connection, "" for none."""
        self.noted_until = 0.0
        """Until when the lines that the client has written into the log use up what it may write."""
        self._advised: set[str] = set()
        """The subjects of the advice that this connection was given once."""
        name = programs.lobby_name()
        self.tag = ConnectionTag(world, name)
        self.slots["connectionTag"] = self.tag
        if remote is not None:
            self.slots["remoteIP"] = world.string(remote)
        self.shell = Shell(self, name)
        self.input_handler: Callable[[bytes, int], None] = self.shell.feed
        """The function that handles input with its ``Job.ordered``; a remote in binary mode sends no urbiscript."""
        programs.lobbies[self] = None

    def greet(self) -> None:
        """Print the banner of the library, even if a program has redefined the slot."""
        try:
            self.world.invoke(self.world.record.original(self.world.lobby_proto, "banner"), self)
        except Exception as error:
            self.report(error)

    @property
    def title(self) -> str:
        """The name of the connection for ``why``, the log and the list of jobs, with its user and its address."""
        who = ", ".join(text for text in (self.user, self.peer) if text)
        return (self.label or str(self.tag.tag.name)) + (f" ({who})" if who else "")

    @property
    def person(self) -> str:
        """Who the client is, whatever connection it uses: the browser of a gateway, the user of its token, or the
        address of another machine; "" for a client of this machine."""
        if self.label.endswith(BROWSER):
            return self.label
        return self.user or ("" if self.peer is None or _is_loopback(self.peer) else self.peer)

    @property
    def silence(self) -> str:
        """What the client has done, in words, while it may not move devices because its ``lease`` is over; else "".
        What its programs have opened is as silent."""
        return self.lease.silence or ("" if self.maker is None else self.maker.silence)

    def set_maker(self, maker: Lobby) -> None:
        """Make this lobby belong to another one, whose program opened it: it ends with that lobby and shares the limits
        of its resources.
        """
        self.maker = maker
        self.holdings = Holdings(maker.holdings)

    def find_maker(self, address: Address) -> None:
        """If a program in this server connects from the client's address, this lobby is as old as that program, and
        belongs to its lobby, if it has one.
        """
        # It is one program, which began with the one that has connected: a program that connects anew is no newer.
        self.ordered = self.world.holdings.order_of(address)
        for other in self.programs.lobbies:
            ordered = None if other is self else other.holdings.order_of(address)
            if ordered is not None:
                self.set_maker(other)
                self.ordered = ordered
                return

    def _made(self) -> list[Lobby]:
        """The lobbies that belong to this one."""
        return [lobby for lobby in self.programs.lobbies if lobby.maker is self]

    def feed(self, data: bytes) -> None:
        """Bytes from the client, which were just read."""
        arrived, lately = self.unread.read(self.world.scheduler.era, not self.shell.waiting)
        if lately:
            self.lease.hear(arrived)
        self.take_input(data, arrived)

    def take_input(self, data: bytes, ordered: int) -> None:
        """Bytes from the client, or from a program in its place, that were ``ordered`` then (``Job.ordered``)."""
        self.received += len(data)
        if self.connected:
            self.input_handler(data, ordered)

    def end_of_input(self, done: Callable[[], None]) -> None:
        """The client has closed its sending side: call ``done`` when its input was run in the foreground.

        Through a tunnel, a killed client looks the same, so the devices that it moves are stopped.
        """
        self.revoke_command()
        if self.input_handler == self.shell.feed:
            self.shell.when_idle(done)
        else:
            done()  # a remote in binary mode, whose foreground never ends

    def revoke_command(self) -> None:
        """Stop the devices that the client moves, and let neither it nor the lobbies that belong to it move any device
        again, because the client cannot send statements any more.
        """
        if self.in_command:
            self.in_command = False
            for other in self._made():
                other.revoke_command()
            for hear in list(self.world.client_gone):
                hear(self)

    def release_devices(self) -> None:
        """Stop the devices that this lobby and those that belong to it move.  The statements that move them end; those
        that begin later may move them.
        """
        self.released_at = self.world.scheduler.begin_era()
        for hear in list(self.world.devices_released):
            hear(self)
        for other in self._made():
            other.release_devices()

    def execute(self, text: str) -> None:
        """Run one statement in the running job, as if the client had typed it; raises the errors of the statement."""
        execute(self, text)

    def report(self, error: BaseException, statement: Statement | None = None) -> None:
        """Report an uncaught error of a statement to the client; never fails, although describing an error may run the
        client's functions.
        """
        if isinstance(error, errors.ToldBefore):
            return
        for line in described(self, error):
            self.output.line(f"!!! {line}", "error")
        if not self.programs.quiet:
            self.advise(advice(self, error, statement))

    def advise_hiding(self, before: int) -> None:
        """Tell a client that its statement has hidden an object of the robot; it had so many variables ``before``."""
        if len(self.slots) > before and not self.programs.quiet:
            self.advise(of_hiding(self))

    def advise(self, text: str) -> None:
        """Tell a client what to write instead of a mistake; nothing for an empty text, and for clients that are to get
        the answers of the original only.
        """
        if text and not self.programs.quiet:
            self.output.line(f"!!!    hint: {text}", "error")

    def advise_once(self, subject: str, text: str) -> None:
        """Give advice that a connection needs once, whatever it does again and again; there are few subjects."""
        if subject not in self._advised:
            self._advised.add(subject)
            self.advise(text)

    def close(self) -> None:
        """Close the connection: its jobs end, their ``finally`` clauses run, and ``Lobby.onDisconnect`` is emitted.

        Then its resources are closed.  ``finally`` clauses that are not over ``FINALLY_TIMEOUT_S`` later are ended.
        """
        if not self.connected:
            return
        self.connected = False
        self.lease.end()
        self.programs.lobbies.pop(self, None)
        self.output.close()
        self.holdings.seal()
        if self.maker is not None:
            self.maker.holdings.unregister(self)
        try:
            self.revoke_command()
        finally:
            # In this order, but in two jobs, because the guards of ``onDisconnect`` may wait for any time.
            self.world.spawn_own(self._emit_disconnect, "disconnect")
            self.world.spawn_own(self._end, "disconnect")
            for other in self._made():
                other.quit()

    def _emit_disconnect(self) -> None:
        event = self.world.lobby_proto.slots.get("onDisconnect")
        if isinstance(event, Event):
            event.emit([self])

    def _end(self) -> None:
        scheduler = self.world.scheduler
        try:
            self.shell.close()
        finally:
            try:
                self.tag.tag.stop(self.world.void)  # the stopped jobs may run code of the program
            finally:
                self.output.release_writers()
                scheduler.yield_()  # finally clauses may still send to the sockets of the program
                self.holdings.close()
                if scheduler.shares.of(self):
                    scheduler.call_at(scheduler.clock.now() + FINALLY_TIMEOUT_S, self._abort_jobs)

    def _abort_jobs(self) -> None:
        """End the jobs whose ``finally`` clauses are not over."""
        scheduler = self.world.scheduler
        for job in list(scheduler.jobs):
            if job.charged_context is self:
                scheduler.throw(job, JobAborted())

    def quit(self) -> None:
        """``lobby.quit``: deliver the pending output, then close the connection."""
        if self.connected:
            self.on_quit()
            self.close()


def lobby_of(job: Any) -> Lobby | None:
    """The lobby of a job, None if it has none."""
    return job.context if isinstance(job.context, Lobby) else None


def _is_loopback(address: str) -> bool:
    """Whether a numeric address is this machine."""
    with contextlib.suppress(ValueError):
        return ipaddress.ip_address(address.partition("%")[0]).is_loopback
    return False
