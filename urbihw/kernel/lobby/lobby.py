"""One connection's world: an urbiscript object whose slots are the variables of the connection, and its jobs.

Everything a connection runs is under its ``connectionTag``; when it closes, the tag is stopped, and with it its jobs,
its ``at``s and what they detached.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from urbihw.kernel.lobby.connection_tag import ConnectionTag
from urbihw.kernel.lobby.output import Output
from urbihw.kernel.lobby.printing import described
from urbihw.kernel.lobby.shell import Shell
from urbihw.kernel.lobby.statements import execute
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.holdings import Address, Holdings
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.sched.signals import JobAborted

if TYPE_CHECKING:
    from urbihw.kernel.lobby.shell import Programs
    from urbihw.kernel.runtime.world import World


FINALLY_S: Final = 1.0
"""Seconds that the ``finally`` clauses of a closed connection have, if they wait for something."""


class Lobby(Obj):
    """An urbiscript Lobby."""

    of_connection = True
    __slots__ = (
        "connected", "holdings", "in_command", "intake", "maker", "on_quit", "output", "peer", "programs", "received",
        "shell", "tag", "user",
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
        self.connected = True
        self.in_command = True
        """Whether the client can still say something, a stop for instance; without that it moves nothing."""
        self.received = 0
        self.on_quit: Callable[[], None] = lambda: None
        self.peer = remote
        """The address of the client, None for none; ``remoteIP`` says the same, but a program may change a slot."""
        self.holdings = Holdings()
        """What its jobs hold of the operating system."""
        self.maker: Lobby | None = None
        """The lobby that this one belongs to."""
        self.user = ""
        """The name of who showed a token, "" if nobody was asked."""
        name = programs.lobby_name()
        self.tag = ConnectionTag(world, name)
        self.slots["connectionTag"] = self.tag
        if remote is not None:
            self.slots["remoteIP"] = world.string(remote)
        self.shell = Shell(self, name)
        self.intake: Callable[[bytes], None] = self.shell.feed
        """What takes the bytes of the client; a remote in binary mode sends no urbiscript."""
        programs.lobbies[self] = None

    def greet(self) -> None:
        """Say the banner: the one of the library, whatever a program made of it since."""
        try:
            self.world.invoke(self.world.record.original(self.world.lobby_proto, "banner"), self)
        except Exception as error:
            self.report(error)

    def belong_to(self, maker: Lobby) -> None:
        """A job of another lobby made this one: it ends with that one, and both count together in what they hold."""
        self.maker = maker
        self.holdings = Holdings(maker.holdings)

    def came_from(self, address: Address) -> None:
        """The address from which the client connects: if a program of another lobby does, this one belongs to it."""
        for other in self.programs.lobbies:
            if other is not self and other.holdings.connects_from(address):
                self.belong_to(other)
                return

    def _made(self) -> list[Lobby]:
        """The lobbies that belong to this one."""
        return [lobby for lobby in self.programs.lobbies if lobby.maker is self]

    def feed(self, data: bytes) -> None:
        """Bytes from the client."""
        self.received += len(data)
        if self.connected:
            self.intake(data)

    def end_of_input(self, done: Callable[[], None]) -> None:
        """The client has ended its sending side: ``done`` is called once what it sent was run in the foreground.

        A client that was killed looks the same from the other end of a tunnel.  So what this one moves is stopped.
        """
        self.lose_command()
        if self.intake == self.shell.feed:
            self.shell.when_idle(done)
        else:
            done()  # a remote in binary mode, whose foreground never ends

    def lose_command(self) -> None:
        """The client will say nothing new: what it moves is stopped, and it moves nothing any more, nor do those who
        belong to it."""
        if self.in_command:
            self.in_command = False
            for other in self._made():
                other.lose_command()
            for hear in list(self.world.client_gone):
                hear(self)

    def execute(self, text: str) -> None:
        """Run one statement in the running job, as if the client had typed it; raises what it raises."""
        execute(self, text)

    def report(self, error: BaseException) -> None:
        """Tell the client of an uncaught error; never fails, though describing one may run the client's functions."""
        for line in described(self, error):
            self.output.line(f"!!! {line}", "error")

    def close(self) -> None:
        """The connection is gone: what it runs ends, its ``finally`` clauses run, ``Lobby.onDisconnect`` is emitted.

        Then what it holds is closed.  ``finally`` clauses that are not over ``FINALLY_S`` seconds later are left, too.
        """
        if not self.connected:
            return
        self.connected = False
        self.programs.lobbies.pop(self, None)
        self.output.close()
        self.holdings.seal()
        if self.maker is not None:
            self.maker.holdings.disown(self)
        try:
            self.lose_command()
        finally:
            # In this order, but in two jobs: the guards of those who hear of it may wait as long as they like.
            self.world.spawn_own(self._say_gone, "disconnect")
            self.world.spawn_own(self._end, "disconnect")
            for other in self._made():
                other.quit()

    def _say_gone(self) -> None:
        event = self.world.lobby_proto.slots.get("onDisconnect")
        if isinstance(event, Event):
            event.emit([self])

    def _end(self) -> None:
        scheduler = self.world.scheduler
        try:
            self.shell.close()
        finally:
            try:
                self.tag.tag.stop(self.world.void)  # what is left by it may run code of the program
            finally:
                self.output.let_go()
                scheduler.yield_()  # finally clauses may say a last word to what the program is connected to
                self.holdings.close()
                if scheduler.jobs_of(self):
                    scheduler.call_at(scheduler.clock.now() + FINALLY_S, self._abort_jobs)

    def _abort_jobs(self) -> None:
        """End the jobs whose ``finally`` clauses are not over."""
        scheduler = self.world.scheduler
        for job in list(scheduler.jobs):
            if job.payer is self:
                scheduler.throw(job, JobAborted())

    def quit(self) -> None:
        """``lobby.quit``: what was said is delivered, then the connection is closed."""
        if self.connected:
            self.on_quit()
            self.close()


def lobby_of(job: Any) -> Lobby | None:
    """The lobby a job speaks to."""
    return job.context if isinstance(job.context, Lobby) else None
