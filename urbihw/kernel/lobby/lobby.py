"""One connection's world: an urbiscript object whose slots are the variables of the connection, and its jobs.

Everything a connection runs is under its ``connectionTag``; when it closes, the tag is stopped, and with it its jobs,
its ``at``s and what they detached.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from urbihw.kernel.lobby.output import Output
from urbihw.kernel.lobby.shell import Shell
from urbihw.kernel.lobby.statements import execute
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.passage import TagObject
from urbihw.kernel.sched.tag import Tag

if TYPE_CHECKING:
    from urbihw.kernel.lobby.shell import Programs
    from urbihw.kernel.runtime.world import World


class Lobby(Obj):
    """An urbiscript Lobby."""

    __slots__ = ("connected", "intake", "on_quit", "output", "programs", "received", "shell", "tag")

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
        self.output = Output(lambda: scheduler.now, lambda: wanted(self), limit)
        self.connected = True
        self.received = 0
        self.on_quit: Callable[[], None] = lambda: None
        name = programs.lobby_name()
        self.tag = TagObject(world, [world.tag_proto], Tag(scheduler, name))
        self.slots["connectionTag"] = self.tag
        if remote is not None:
            self.slots["remoteIP"] = world.string(remote)
        self.shell = Shell(self, name)
        self.intake: Callable[[bytes], None] = self.shell.feed
        """What takes the bytes of the client; a remote in binary mode sends no urbiscript."""
        programs.lobbies[self] = None

    def feed(self, data: bytes) -> None:
        """Bytes from the client."""
        self.received += len(data)
        if self.connected:
            self.intake(data)

    def execute(self, text: str) -> None:
        """Run one statement in the running job, as if the client had typed it; raises what it raises."""
        execute(self, text)

    def report(self, error: BaseException) -> None:
        """Tell the client of an uncaught error; never fails, though describing one may run the client's functions."""
        try:
            lines = self.world.describe(error)
        except Exception as second:
            lines = self._describe_plainly(second)
        for line in lines:
            self.output.line(f"!!! {line}", "error")

    def _describe_plainly(self, error: Exception) -> list[str]:
        """What went wrong while an error was described; if that cannot be described either, only that there was one."""
        try:
            return self.world.describe(error)
        except Exception as third:
            return [f"error while printing an error: {type(self.world.normalized(third)).__name__}"]

    def close(self) -> None:
        """The connection is gone: what it runs ends, its ``finally`` clauses run, ``Lobby.onDisconnect`` is emitted."""
        if not self.connected:
            return
        self.connected = False
        self.programs.lobbies.pop(self, None)
        self.output.close()
        for hear in list(self.world.client_gone):
            hear(self)
        self.world.scheduler.spawn(self._end, "disconnect")

    def _end(self) -> None:
        event = self.world.lobby_proto.slots.get("onDisconnect")
        if isinstance(event, Event):
            event.emit([self])
        self.shell.close()
        self.tag.tag.stop(self.world.void)

    def quit(self) -> None:
        """``lobby.quit``: what was said is delivered, then the connection is closed."""
        if self.connected:
            self.on_quit()
            self.close()


def lobby_of(job: Any) -> Lobby | None:
    """The lobby a job speaks to."""
    return job.context if isinstance(job.context, Lobby) else None
