"""Lobby: the urbiscript face of a connection.

Source: manual, specs/lobby; server protocol, sections 1 and 5.  The object itself belongs to ``kernel/lobby``; what is
used of it here is written down as ``Lobby``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, Protocol

from urbihw.kernel import errors
from urbihw.kernel.runtime.holdings import Holdings
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import List
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.channel import starred
from urbihw.kernel.stdlib.members import members_of

TABLE = Table("Lobby")
GLOBAL = Table("Global")
TABLES = [TABLE, GLOBAL]

MOST_WAITING: Final = 8 * 1024 * 1024
"""How many bytes may wait in a lobby to be read."""
MOST_CREATED: Final = 64
"""How many lobbies made by ``Lobby.create`` a connection may have."""

NOTES = {
    "Lobby.connectionTag": "The tag of all that the connection runs; stopping it leaves the connection usable.",
    "Lobby.remoteIP": "The address of the client; only of a connection by TCP.",
    "Lobby.onDisconnect": "The event emitted with the lobby of a connection that is gone.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


class Output(Protocol):
    """What is needed of a lobby's output."""

    sent: int
    root: Any

    def line(self, text: str, channel: str = "") -> None:
        """Send one line."""
        ...

    def write(self, data: bytes) -> None:
        """Send bytes."""
        ...

    def take(self) -> bytes:
        """What waits to be sent."""
        ...


class Lobby(Protocol):
    """What is needed of the lobby of a connection."""

    output: Output
    connected: bool
    received: int
    programs: Any
    shell: Any
    holdings: Holdings

    def feed(self, data: bytes) -> None:
        """Bytes as if from the client."""
        ...

    def quit(self) -> None:
        """Close the connection."""
        ...


def current(world: World) -> Any:
    """The lobby of the running job, or nil."""
    context = world.scheduler.running().context
    return world.nil if context is None else context


def real(this: Any) -> Lobby:
    """A lobby that has a connection; raises for Lobby itself."""
    if type(this).__name__ != "Lobby":
        raise errors.primitive("must be called on Lobby derivative")
    lobby: Lobby = this
    return lobby


def mine(world: World, this: Any) -> Lobby:
    """A lobby of the running job's own connection, or one that was created by it; raises for anybody else's."""
    lobby = real(this)
    context = current(world)
    if context is not world.nil and lobby.output.root is not context.output.root:
        raise errors.primitive(f"{world.text(this)} belongs to another connection: only that one may do this")
    return lobby


def echo_to(world: World, lobby: Lobby, value: Any, channel: str) -> None:
    """One line behind three stars."""
    lobby.output.line(starred(world.text(value)), channel)


# ---------------------------------------------------------------- saying


@TABLE.primitive("echo")
def echo(world: World, this: Any, value: Any, channel: str = "") -> None:
    """Send the text of a value behind three stars, under a label if one is given."""
    echo_to(world, real(this), value, channel)


@TABLE.primitive("echoEach")
def echo_each(world: World, this: Any, values: Any, channel: str = "") -> None:
    """``echo`` every member of a list."""
    for value in members_of(world, values):
        echo_to(world, real(this), value, channel)


@TABLE.primitive("send")
def send(world: World, this: Any, text: str, channel: str = "") -> None:
    """Send one line with a time stamp, as it is, under a label if one is given."""
    real(this).output.line(text, channel)


@TABLE.primitive("write")
def write(world: World, this: Any, text: str) -> None:
    """Send the bytes of a string and nothing else."""
    real(this).output.write(text.encode("latin-1", "replace"))


@TABLE.primitive("receive")
def receive(world: World, this: Any, text: str) -> None:
    """Take a string as if the client had typed it; a lobby whose connection is gone takes nothing.

    For a lobby of one's own connection only: nobody speaks in somebody else's name.  An error if more than 8 MiB would
    wait there to be read: what was taken is read when the statement in the foreground is over.
    """
    lobby = mine(world, this)
    waiting = lobby.shell.waiting
    if waiting + len(text) > MOST_WAITING:
        raise errors.primitive(f"too much to be read: {waiting} bytes wait already, {len(text)} more are too many")
    lobby.feed(text.encode("latin-1", "replace"))


@TABLE.primitive("interrupt")
def interrupt(world: World, this: Any) -> None:
    """Kill what the client runs in the foreground, and drop what waits behind it.  Not in the manual.

    For any lobby: the console asks for it on a connection of its own, and stopping ``connectionTag`` does as much.
    """
    world.scheduler.post(real(this).shell.interrupt)


@TABLE.primitive("quit")
def quit_(world: World, this: Any) -> None:
    """Close the connection, one's own; the server goes on."""
    mine(world, this).quit()


# ---------------------------------------------------------------- asking


@TABLE.primitive("lobby")
def lobby(world: World, this: Any) -> Any:
    """The lobby of the connection whose code is running."""
    return current(world)


@TABLE.primitive("connected")
def connected(world: World, this: Any) -> bool:
    """Whether the connection is still there."""
    return real(this).connected


def _alive(this: Any) -> Lobby:
    lobby = real(this)
    if not lobby.connected:
        raise errors.primitive("Lobby is not connected")
    return lobby


@TABLE.primitive("bytesSent")
def bytes_sent(world: World, this: Any) -> float:
    """How many bytes were sent to the client."""
    return float(_alive(this).output.sent)


@TABLE.primitive("bytesReceived")
def bytes_received(world: World, this: Any) -> float:
    """How many bytes came from the client."""
    return float(_alive(this).received)


@TABLE.primitive("asString", "asPrintable")
def as_string(world: World, this: Any) -> str:
    """``Lobby`` itself, or ``Lobby_`` and the identity."""
    return "Lobby" if this is world.lobby_proto else f"Lobby_{world.uid(this)}"


@TABLE.primitive("clone", "new")
def clone(world: World, this: Any) -> None:
    """Always an error: see ``create``."""
    raise errors.primitive("`Lobby' objects cannot be cloned")


# ---------------------------------------------------------------- Global


@GLOBAL.primitive("echo")
def global_echo(world: World, this: Any, value: Any, channel: str = "") -> None:
    """Send the text of a value behind three stars to the running job's connection, labelled if a label is given."""
    context = world.scheduler.running().context
    if context is not None:
        echo_to(world, context, value, channel)


def install(world: World, programs: Any) -> None:
    """What needs to know all lobbies."""
    table = Table("Lobby")
    shared = Table("Global")

    @table.primitive("instances")
    def instances(world: World, this: Any) -> Any:
        """The list of Lobby itself and the lobbies of all connections."""
        return _all(world, programs)

    @table.primitive("create")
    def create(world: World, this: Any) -> Any:
        """A fresh lobby without connection; what it says goes where the running job's lobby speaks to.  It ends with
        the connection of that lobby, if not before by ``quit``."""
        return _created(world, current(world))

    @table.primitive("wall")
    @shared.primitive("wall")
    def wall(world: World, this: Any, value: Any, channel: str = "") -> None:
        """``echo`` to every connection, under a label if one is given."""
        for lobby in _all(world, programs).l[1:]:
            echo_to(world, lobby, value, channel)

    table.install(world, world.lobby_proto)
    shared.install(world, world.global_)
    world.lobby_proto.slots["onDisconnect"] = world.event_proto.clone()


def _all(world: World, programs: Any) -> List:
    return world.new_list([world.lobby_proto, *programs.lobbies])


def _created(world: World, maker: Any) -> Any:
    """A lobby of the maker's class that speaks through the maker's output."""
    speaker = real(maker)
    speaker.holdings.check("lobbies", MOST_CREATED)
    make: Callable[..., Any] = type(maker)
    made = make(world, speaker.programs, lambda lobby: None)
    made.output = Relay(speaker.output)
    made.belong_to(speaker)
    speaker.holdings.own(made, "lobbies", MOST_CREATED)
    return made


class Relay:
    """An output that hands everything on to another one until it is closed."""

    def __init__(self, output: Output) -> None:
        self._output = output
        self.root = output.root
        self.sent = 0
        self.open = True

    def line(self, text: str, channel: str = "") -> None:
        """Send one line."""
        if self.open:
            self.sent += len(text)
            self._output.line(text, channel)

    def write(self, data: bytes) -> None:
        """Send bytes."""
        if self.open:
            self.sent += len(data)
            self._output.write(data)

    def take(self) -> bytes:
        """Nothing waits here."""
        return b""

    def close(self) -> None:
        """Nothing more is handed on."""
        self.open = False

    def let_go(self) -> None:
        """Who waits for room waits at the other output."""
