"""Lobby: a connection as an urbiscript object.

Source: manual, specs/lobby; server protocol, sections 1 and 5.  The object is implemented in ``kernel/lobby``; the
protocol class ``SpeakerLobby`` declares the members used here.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any, Final, Protocol

from urbihw.kernel import errors
from urbihw.kernel.runtime.holdings import Holdings
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import List
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.tag import Tag
from urbihw.kernel.stdlib.channel import starred
from urbihw.kernel.stdlib.members import members_of
from urbihw.kernel.stdlib.support import field, send_line
from urbihw.kernel.value import Value

log = logging.getLogger("urbihw.server")

TABLE = Table("Lobby")
GLOBAL = Table("Global")
TABLES = [TABLE, GLOBAL]

MAX_UNREAD_SIZE: Final = 8 * 1024 * 1024
"""Maximum number of unread bytes in the input of a lobby."""
MAX_CREATED_LOBBIES: Final = 64
"""Maximum number of lobbies made by ``Lobby.create`` per connection."""

MAX_LABEL_LENGTH: Final = 80
"""Maximum length of the name that a client gives to its connection."""
MAX_NOTE_LENGTH: Final = 200
"""Maximum length of a line that a client writes into the log."""
NOTE_PAUSE_S: Final = 0.2
"""Seconds between such lines, in the long run."""
NOTE_BURST_S: Final = 2.0
"""Seconds by which lines may be ahead of that."""

NOTES = {
    "Lobby.connectionTag": "The tag of all jobs of the connection; after it is stopped, the connection remains usable.",
    "Lobby.remoteIP": "The address of the client; only for a TCP connection.",
    "Lobby.lease": "The time in which the client has to send something, an empty line at least; 0 (the default) is no "
    "limit.  A client that is silent for longer loses its lease: what it has moved stops, the statements that move it "
    "end, and nothing of its connection moves anything until it sends again.  From 0.1 s to an hour; for one's own "
    "connection only.  Not in the manual.",
    "Lobby.onDisconnect": "The event that is emitted with the lobby of a connection that has ended.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


class LobbyOutput(Protocol):
    """The members of a lobby's output that are used here."""

    sent: int
    root: Any

    @property
    def backlog(self) -> int:
        """The number of bytes that the client has not read."""
        ...

    def line(self, text: str, channel: str = "") -> None:
        """Send one line on a channel."""
        ...

    def write(self, data: bytes) -> None:
        """Send bytes as they are."""
        ...

    def take_bytes(self) -> bytes:
        """Return and remove the bytes that wait to be sent."""
        ...


class LobbyLease(Protocol):
    """The members of a lobby's lease that are used here."""

    seconds: float

    def set_length(self, seconds: float) -> None:
        """Begin a lease.  Raises ValueError."""
        ...


class SpeakerLobby(Protocol):
    """The members of a connection's lobby that are used here."""

    output: LobbyOutput
    answering: dict[str, Tag]
    connected: bool
    received: int
    programs: Any
    shell: Any
    holdings: Holdings
    label: str
    lease: LobbyLease
    noted_until: float

    @property
    def title(self) -> str:
        """The name of the connection, with its user and its address."""
        ...

    def take_input(self, data: bytes, ordered: int) -> None:
        """Add bytes to the input, as if the client had sent them."""
        ...

    def release_devices(self) -> None:
        """Stop the devices that the lobby moves."""
        ...

    def quit(self) -> None:
        """Close the connection of the lobby."""
        ...


def current(world: World) -> Any:
    """The lobby of the running job, nil if there is none."""
    context = world.scheduler.running().context
    return world.nil if context is None else context


def connected_lobby(this: Value) -> SpeakerLobby:
    """A lobby that has a connection.  Raises an error for Lobby itself."""
    if type(this).__name__ != "Lobby":
        raise errors.primitive("must be called on Lobby derivative")
    lobby: SpeakerLobby = this
    return lobby


def own_lobby(world: World, this: Value) -> SpeakerLobby:
    """A lobby of the running job's own connection, or one that it has created.  Raises an error for the lobby of
    another connection.
    """
    lobby = connected_lobby(this)
    context = current(world)
    if context is not world.nil and lobby.output.root is not context.output.root:
        raise errors.primitive(f"{world.text(this)} belongs to another connection: only that one may do this")
    return lobby


def echo_to(world: World, lobby: SpeakerLobby, value: Value, channel: str, prefix: str = "***") -> None:
    """Send one line after a prefix."""
    lobby.output.line(starred(world.text(value), prefix), channel)


@TABLE.primitive("introduce")
def introduce(world: World, this: Value, name: str) -> None:
    """Give one's own connection a name, which ``why`` of a device, the log and the list of jobs show instead of
    ``Lobby_7``.  Not in the manual.

    At most 80 characters that can be printed; the address of the client is shown behind it.
    """
    if not 0 < len(name) <= MAX_LABEL_LENGTH or not name.isprintable():
        raise errors.primitive(f"a name of a connection has 1 to {MAX_LABEL_LENGTH} characters that can be printed")
    own_lobby(world, this).label = name


@TABLE.primitive("note")
def note(world: World, this: Value, text: str) -> None:
    """Write a line into the log of the server, behind the name of one's own connection: what it does for somebody else,
    say.  Not in the manual.

    At most 200 characters that can be printed, and 5 lines a second, of which 10 may come at once.
    """
    if not 0 < len(text) <= MAX_NOTE_LENGTH or not text.isprintable():
        raise errors.primitive(f"a line of the log has 1 to {MAX_NOTE_LENGTH} characters that can be printed")
    lobby, now = own_lobby(world, this), world.scheduler.clock.now()
    until = max(now, lobby.noted_until) + NOTE_PAUSE_S
    if until > now + NOTE_BURST_S + NOTE_PAUSE_S / 2:
        raise errors.primitive(f"one line every {NOTE_PAUSE_S:g} s goes into the log: this one does not")
    lobby.noted_until = until
    log.info("%s: %s", lobby.title, text)


# ---------------------------------------------------------------- saying


@TABLE.primitive("echo")
def echo(world: World, this: Value, value: Value, channel: str = "", prefix: str = "***") -> None:
    """Send the text of a value after three stars or another prefix, with a label if one is given."""
    echo_to(world, connected_lobby(this), value, channel, prefix)


@TABLE.primitive("echoEach")
def echo_each(world: World, this: Value, values: Value, channel: str = "") -> None:
    """Call ``echo`` for every member of a list."""
    for value in members_of(world, values):
        echo_to(world, connected_lobby(this), value, channel)


@TABLE.primitive("send")
def send(world: World, this: Value, text: str, channel: str = "") -> None:
    """Send one line with a time stamp, unchanged, with a label if one is given."""
    connected_lobby(this).output.line(text, channel)


@TABLE.primitive("write")
def write(world: World, this: Value, text: str) -> None:
    """Send the bytes of a string without a time stamp or a line end."""
    connected_lobby(this).output.write(text.encode("latin-1", "replace"))


@TABLE.primitive("releaseDevices")
def release_devices(world: World, this: Value) -> None:
    """Stop the devices that one's own connection has moved last, as its end would: wheels stand, joints hold their
    position.  Not in the manual.

    The statements that move them end with an error; statements that begin later may move them again.
    """
    own_lobby(world, this).release_devices()
    world.scheduler.running().renew()


@TABLE.primitive("receive")
def receive(world: World, this: Value, text: str) -> None:
    """Process a string as if the client had sent it; no effect if the connection has ended.

    Only for a lobby of one's own connection: no client can send input for another one.  Raises an error if more than 8
    MiB would wait to be read: the input is read when the statement in the foreground has ended.
    """
    lobby = own_lobby(world, this)
    waiting = lobby.shell.waiting
    if waiting + len(text) > MAX_UNREAD_SIZE:
        raise errors.primitive(f"too much to be read: {waiting} bytes wait already, {len(text)} more are too many")
    lobby.take_input(text.encode("latin-1", "replace"), world.scheduler.running().ordered)


@TABLE.primitive("interrupt")
def interrupt(world: World, this: Value) -> None:
    """Kill the client's foreground statement, and discard its waiting input.  Not in the manual.

    Allowed for any lobby: the console calls it on a connection of its own, and stopping ``connectionTag`` has the same
    effect.
    """
    world.scheduler.post(connected_lobby(this).shell.interrupt)


@TABLE.primitive("quit")
def quit_(world: World, this: Value) -> None:
    """Close one's own connection; the server continues."""
    own_lobby(world, this).quit()


# ---------------------------------------------------------------- asking


@TABLE.primitive("lobby")
def lobby(world: World, this: Value) -> Value:
    """The lobby of the connection whose code is running."""
    return current(world)


@TABLE.primitive("connected")
def connected(world: World, this: Value) -> bool:
    """Whether the connection is open."""
    return connected_lobby(this).connected


def _alive(this: Value) -> SpeakerLobby:
    lobby = connected_lobby(this)
    if not lobby.connected:
        raise errors.primitive("Lobby is not connected")
    return lobby


@TABLE.primitive("bytesSent")
def bytes_sent(world: World, this: Value) -> float:
    """The number of bytes sent to the client."""
    return float(_alive(this).output.sent)


@TABLE.primitive("bytesReceived")
def bytes_received(world: World, this: Value) -> float:
    """The number of bytes received from the client."""
    return float(_alive(this).received)


@TABLE.primitive("asString", "asPrintable")
def as_string(world: World, this: Value) -> str:
    """``Lobby`` itself, or ``Lobby_`` and the uid."""
    return "Lobby" if this is world.lobby_proto else f"Lobby_{world.uid(this)}"


@TABLE.primitive("clone", "new")
def clone(world: World, this: Value) -> None:
    """Always raises an error: use ``create``."""
    raise errors.primitive("`Lobby' objects cannot be cloned")


# ---------------------------------------------------------------- Global


@GLOBAL.primitive("echo")
def global_echo(world: World, this: Value, value: Value, channel: str = "", prefix: str = "***") -> None:
    """Send the text of a value after three stars or another prefix to the running job's connection, with a label if one
    is given."""
    send_line(world, starred(world.text(value), prefix), channel)


def install(world: World, programs: Any) -> None:
    """Install the functions that use the list of all lobbies."""
    table = Table("Lobby")
    shared = Table("Global")

    @table.primitive("instances")
    def instances(world: World, this: Value) -> Value:
        """The list of Lobby itself and the lobbies of all connections."""
        return _all(world, programs)

    @table.primitive("create")
    def create(world: World, this: Value) -> Value:
        """Make a lobby without a connection; its output goes to the output of the running job's lobby.  It ends with
        the connection of that lobby, or by ``quit``."""
        return _created(world, current(world))

    @table.primitive("wall")
    @shared.primitive("wall")
    def wall(world: World, this: Value, value: Value, channel: str = "") -> None:
        """Call ``echo`` for every connection, with a label if one is given."""
        for lobby in _all(world, programs).l[1:]:
            echo_to(world, lobby, value, channel)

    table.install(world, world.lobby_proto)
    shared.install(world, world.global_)
    world.lobby_proto.slots["onDisconnect"] = world.event_proto.clone()
    _install_lease(world)


def _install_lease(world: World) -> None:
    """Install ``lease``."""

    def read(this: Value) -> float:
        return 0.0 if this is world.lobby_proto else connected_lobby(this).lease.seconds

    def write(this: Value, value: Value) -> None:
        lobby = own_lobby(world, this)
        try:
            lobby.lease.set_length(world.as_float(value, None, "lease"))
        except ValueError as error:
            raise errors.primitive(str(error)) from error

    field(world, world.lobby_proto, "lease", read, write)


def _all(world: World, programs: Any) -> List:
    return world.new_list([world.lobby_proto, *programs.lobbies])


def _created(world: World, maker: Any) -> Any:
    """A lobby of the maker's class that writes to the maker's output."""
    speaker = connected_lobby(maker)
    speaker.holdings.check("lobbies", MAX_CREATED_LOBBIES)
    make: Callable[..., Any] = type(maker)
    made = make(world, speaker.programs, lambda lobby: None)
    made.output = Relay(speaker.output)
    made.set_maker(speaker)
    made.ordered = world.scheduler.running().ordered
    speaker.holdings.register(made, "lobbies", MAX_CREATED_LOBBIES)
    return made


class Relay:
    """An output that forwards everything to another one until it is closed."""

    def __init__(self, output: LobbyOutput) -> None:
        self._output = output
        self.root = output.root
        self.sent = 0
        self.open = True

    @property
    def backlog(self) -> int:
        """The number of bytes that the client of the other output has not read."""
        return self._output.backlog

    def line(self, text: str, channel: str = "") -> None:
        """Send one line to the other lobby."""
        if self.open:
            self.sent += len(text)
            self._output.line(text, channel)

    def write(self, data: bytes) -> None:
        """Send bytes to the other lobby."""
        if self.open:
            self.sent += len(data)
            self._output.write(data)

    def take_bytes(self) -> bytes:
        """Return nothing: no bytes wait here."""
        return b""

    def close(self) -> None:
        """Stop forwarding to the other lobby."""
        self.open = False

    def release_writers(self) -> None:
        """No operation: writers wait at the other output."""
