"""The robot as a Python object: ``robot = urbihw.connect("robot.local")``; attributes are slots.

Reading a slot that holds a value (number, text, list, picture) returns it; one that holds an object or a function
returns something with slots of its own, or to be called.  Reading never calls a function, so completion moves no robot.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Final

from urbihw.client.connection import Connection
from urbihw.client.credentials import ARGUMENTS, Credentials
from urbihw.client.errors import ClientError
from urbihw.client.iterators import Events, Shots, SlotWatch
from urbihw.client.literals import (
    CONSTANTS,
    assignment_text,
    call_text,
    checked_name,
    checked_path,
    checked_slot,
    checked_text,
    literal,
    written_path,
)
from urbihw.client.session import Message, NoPlainValue, message_of
from urbihw.client.streams import EventStream, SampleStream, ShotStream
from urbihw.client.where import where_is

DEFAULT_PORT: Final = 54000
MAX_KEPT_MESSAGES: Final = 1000


class Slot:
    """A slot by its path, also one that is named like a method of ``Robot``: ``robot.slot("run")``.

    ``slot.get()`` reads it, ``slot.set(0.5, time=2)`` writes it, ``slot(1, 2)`` calls the function in it.
    """

    def __init__(self, connection: Connection, path: str) -> None:
        """Raises ValueError if the path is invalid."""
        self._connection = connection
        self.path = checked_path(path)

    def get(self) -> Any:
        """The value, or an object or a function.  Raises SlotMissing, UrbiError, or why there is no answer."""
        path = self.path
        answer = self._connection.ask(lambda dialect, channel: dialect.read(channel, path), self._connection.timeout)
        return wrapped(self._connection, answer, path)

    def set(self, value: Any, timeout: float | None = None, keep: bool = False, **modifiers: Any) -> None:
        """Write a value; ``set(0, sin=1, ampli=0.3)`` writes a trajectory, and returns at its end, if it has one.

        Raises UrbiError, TypeError for a value that urbiscript has not, or why there is no answer.  ``timeout`` in
        seconds, by default that of the connection, without modifiers; None: no limit.  ``keep`` as for ``Robot.run``.
        """
        path, text = checked_slot(self.path), literal(value)
        if not modifiers:
            limit = self._connection.timeout if timeout is None else timeout
            self._connection.ask(lambda dialect, channel: dialect.write(channel, path, text), limit, keep=keep)
            return
        body = assignment_text(path, text, modifiers)
        self._connection.ask(lambda dialect, channel: dialect.evaluate(channel, body), timeout, keep=keep)

    def __call__(self, *args: Any, timeout: float | None = None, keep: bool = False) -> Any:
        """Call the function in the slot, and return its result.  Raises what ``get`` raises.

        ``timeout`` in seconds; None waits for the end.  ``keep`` as for ``Robot.run``.
        """
        body = call_text(self.path, args)
        answer = self._connection.ask(lambda dialect, channel: dialect.evaluate(channel, body), timeout, keep=keep)
        return wrapped(self._connection, answer, "")

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.path}>"


class UrbiFunction(Slot):
    """A function of the robot, such as ``robot.motor6.readRegister``; parentheses call it."""


class UrbiObject:
    """An object of the robot, such as ``robot.motor6``: its attributes are its slots.

    Beside them there is only ``slot``; ``object["slot"]`` is the slot of that name, and ``object[6]`` a member.
    """

    _connection: Connection
    _path: str
    _printed: str
    _classes: tuple[str, ...]

    def __init__(self, connection: Connection, path: str, printed: str = "", classes: tuple[str, ...] = ()) -> None:
        for name, value in (("_connection", connection), ("_path", path), ("_printed", printed), ("_classes", classes)):
            object.__setattr__(self, name, value)

    def slot(self, name: str) -> Slot:
        """A slot by its name, or by its path from here."""
        return Slot(self._connection, f"{self._path}.{name}" if self._path else name)

    def __getattr__(self, name: str) -> Any:
        """The value of a slot.  Raises SlotMissing, which is an AttributeError, and what ``Slot.get`` raises."""
        if name.startswith("_"):
            raise AttributeError(f"{name}: for a slot with such a name there is .slot({name!r})")
        return self.slot(name).get()

    def __setattr__(self, name: str, value: Any) -> None:
        """Write a slot.  Raises what ``Slot.set`` raises."""
        if name.startswith("_") or hasattr(type(self), name):
            raise AttributeError(f"{name} is no slot; for a slot with such a name there is [{name!r}]")
        self.slot(name).set(value)

    def __getitem__(self, key: str | int) -> Any:
        """The slot of a name or path, or the member with an index."""
        return self._at(key).get()

    def __setitem__(self, key: str | int, value: Any) -> None:
        """Write the slot of a name or path, or a member."""
        self._at(key).set(value)

    def __iter__(self) -> Iterator[Any]:
        """Nothing that can be iterated: ``[]`` asks the server."""
        raise TypeError(f"{self!r} cannot be iterated")

    def _at(self, key: str | int) -> Slot:
        return self.slot(key) if isinstance(key, str) else Slot(self._connection, f"{self._path}[{int(key)}]")

    def urbiscript_path(self) -> str:
        """How it is written in urbiscript."""
        return written_path(checked_path(self._path))

    def __dir__(self) -> list[str]:
        """The slots that not every object has, for completion; none when the server does not answer."""
        found = {name for name in self._slot_names() if name.isidentifier() and not name.startswith("_")}
        methods = {name for name in vars(type(self)) if not name.startswith("_")} - {"urbiscript_path"}
        return sorted(found | methods | {"slot"})

    def _slot_names(self) -> set[str]:
        here = written_path(self._path)
        every, own, common = self._names(f"{COMMON_SLOTS} | [{here}.slotNames, {here}.localSlotNames, common]", 3)
        return every - common | own

    def _names(self, body: str, count: int) -> list[set[str]]:
        """So many lists of names, which an expression tells; empty ones when the server does not answer."""
        try:
            told = self._connection.ask(lambda dialect, channel: dialect.evaluate(channel, body), 1.0)
            return [set(map(str, names)) for names in told] if len(told) == count else [set()] * count
        except (ClientError, TypeError):
            return [set()] * count

    def __repr__(self) -> str:
        """How the server prints it, and its class."""
        return f"<{self._classes[0] if self._classes else 'object'} {self._path or self._printed}>"

    def __eq__(self, other: object) -> bool:
        """Whether both have the same path on the same connection."""
        same = isinstance(other, UrbiObject) and self._connection is other._connection
        return same and isinstance(other, UrbiObject) and self._path == other._path

    def __hash__(self) -> int:
        return hash(self._path)

    def _repr_html_(self) -> str:
        """The slots of a device as a table, for notebooks."""
        from urbihw.client.shown import object_html

        try:
            body = f"System.slotTable({written_path(self._path)})"
            rows = self._connection.ask(lambda dialect, channel: dialect.evaluate(channel, body), 2.0)
        except ClientError:
            rows = []
        return object_html(repr(self), rows)


class Robot(UrbiObject):
    """A connection to the server of a robot, for any number of threads.

    Slots whose names are those of its methods: ``robot["run"]``, ``robot.slot("run")``.
    """

    messages: deque[Message]

    def __init__(self, connection: Connection, messages: deque[Message]) -> None:
        super().__init__(connection, "")
        object.__setattr__(self, "messages", messages)

    # ---------------------------------------------------------------- programs

    def run(self, text: str, tag: str = "", timeout: float | None = None, keep: bool = False) -> Any:
        """Run urbiscript, and return the value of its last statement.

        A statement that ends with ``,`` runs on in the background.  ``tag``: its name for ``stop``; variables live as
        long as the connection.  Returns None when it is stopped.  Raises UrbiError, whose location is one in ``text``;
        TimedOut after ``timeout`` seconds, and why there is no answer.  What runs on the server ends when the waiting
        ends before the answer, by a timeout or an interrupt, unless ``keep``.
        """
        if tag:
            checked_name(tag)
        checked_text(text)
        answer = self._connection.ask(
            lambda dialect, channel: dialect.run(channel, text, tag), timeout, located=True, keep=keep
        )
        return wrapped(self._connection, answer, "")

    def stop(self, tag: str | None = None) -> None:
        """Stop the robot, whatever moves it; with ``tag``, only what runs under this tag.

        Raises SlotMissing if this connection has no such tag, or the server no robot.
        """
        if tag is not None:
            checked_name(tag)
        stopped = tag or "robot"
        limit = self._connection.timeout
        self._connection.ask(lambda dialect, channel: dialect.stop(channel, stopped), limit, keep=True)

    def estop(self) -> None:
        """Stop the robot and hold it until the release: ``urbihw release``, or ``robot.robot.estop = False``."""
        limit = self._connection.timeout
        self._connection.ask(lambda dialect, channel: dialect.estop(channel), limit, keep=True)

    # ---------------------------------------------------------------- what the server sends

    def watch(self, *slots: str, hz: float = 10.0, timeout: float | None = None) -> SlotWatch:
        """Iterate over the values of slots: ``for t, v in robot.watch("motor6.val", hz=50)``.

        ``t`` is the time of the reading in seconds since 1970, ``v`` a tuple with a value for each slot.  The server
        sends, nothing is asked; ``hz=0`` only sends changes.  ``timeout``: TimedOut after so many seconds without one.
        """
        stream = SampleStream(slots, hz)
        self._connection.open_stream(stream)
        return SlotWatch(self._connection, stream, timeout)

    def pictures(self, slot: str, hz: float = 10.0, timeout: float | None = None) -> Shots:
        """Iterate over the pictures or sounds of a slot, the newest each time: ``for t, p in
        robot.pictures("camera.val")``.
        """
        stream = ShotStream(slot, hz)
        self._connection.open_stream(stream)
        return Shots(self._connection, stream, timeout)

    def events(self, event: str, timeout: float | None = None) -> Events:
        """Iterate over the emissions of an event: ``with robot.events("bioloid.lost") as lost``."""
        stream = EventStream(event)
        self._connection.open_stream(stream)
        return Events(self._connection, stream, timeout)

    def plot(self, *slots: str, hz: float = 10.0, seconds: float = 10.0) -> Any:
        """A live plot of slots in a notebook; needs the extra jupyter."""
        from urbihw.client.live_plot import LivePlot

        return LivePlot(self.watch(*slots, hz=hz), seconds)

    # ---------------------------------------------------------------- the connection

    def close(self) -> None:
        """End the connection, and with it what it has running; also from another thread."""
        self._connection.close()

    @property
    def connected(self) -> bool:
        """Whether the connection is open, as far as is known; a command connects again."""
        return self._connection.connected

    def __enter__(self) -> Robot:
        """``with urbihw.connect() as robot``."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def urbiscript_path(self) -> str:
        """How it is written in urbiscript."""
        return "lobby"

    def _slot_names(self) -> set[str]:
        """Variables of the connection and devices, but not the classes, which begin with a capital letter."""
        own, everybodys = self._names("[lobby.localSlotNames, Global.localSlotNames]", 2)
        return own | {name for name in everybodys if name[:1].islower()} - {*CONSTANTS} | {"messages"}

    def __repr__(self) -> str:
        state = "" if self.connected else ", not connected"
        return f"<Robot at {self._connection.where}{state}>"

    def _repr_html_(self) -> str:
        """The address and the devices, for notebooks."""
        from urbihw.client.shown import robot_html

        try:
            names = self._connection.ask(lambda dialect, channel: dialect.evaluate(channel, DEVICES), 2.0)
        except ClientError as error:
            return robot_html(repr(self), [], str(error))
        return robot_html(repr(self), [str(name) for name in names])


COMMON_SLOTS: Final = (
    "var common = Object.slotNames | if (Global.hasSlot(\"Interface\")) { common += Interface.localSlotNames }"
)
"""Sets the names of the slots that every object has, or every device: those are no use in completion."""
DEVICES: Final = (
    "Global.localSlotNames.filter(closure (name) "
    "{ !Global.getSlot(name).acceptVoid.isVoid && !Global.getSlot(name).isA(Executable) "
    "&& Global.getSlot(name).isA(UObject) && name != \"UObject\" })"
)
"""The devices by their names."""


def wrapped(connection: Connection, answer: Any, path: str) -> Any:
    """An answer as the program gets it: objects as ``UrbiObject``.  ``path`` is where it was read, "" for nowhere."""
    if isinstance(answer, NoPlainValue):
        if answer.kind == "function":
            return UrbiFunction(connection, path)
        return UrbiObject(connection, path or answer.printed, answer.printed, answer.classes)
    if isinstance(answer, list):
        return [wrapped(connection, member, "") for member in answer]
    if isinstance(answer, dict):
        return {key: wrapped(connection, member, "") for key, member in answer.items()}
    return answer


def credentials_of(token: str, token_file: str | Path | None, trust: bool) -> Credentials:
    """The credentials of a program, which cannot be asked."""
    environment = {**os.environ, "URBIHW_TOKEN": token} if token else os.environ
    file = None if token_file is None else Path(token_file)
    return Credentials(file, trust, environment=environment, words=ARGUMENTS)


def split_address(host: str, port: int) -> tuple[str, int]:
    """``robot:54000`` as host and port; an address without a port, or the path of a UNIX socket, as it is."""
    name, colon, number = host.rpartition(":")
    if colon and "/" not in host and ":" not in name.strip("[]") and number.isdigit():
        return name.strip("[]"), int(number)
    return host, port


def connect(
    host: str = "127.0.0.1",
    port: int = DEFAULT_PORT,
    *,
    token: str = "",
    token_file: str | Path | None = None,
    tls: bool | None = None,
    trust: bool = False,
    timeout: float = 10.0,
    reconnect: bool = True,
    lease: float = 0.0,
    on_message: Callable[[Message], None] | None = None,
) -> Robot:
    """Connect to a server.  Raises CannotConnect, AccessDenied or TimedOut.

    ``host``: a name, an address, ``name:port``, or the path of a UNIX socket.  ``token``, or ``token_file``, or
    ``URBIHW_TOKEN``, or ``~/.config/urbihw/tokens``: for TLS, which is the default to other machines (``tls``).
    ``trust``: store the certificate of an unknown server.  ``timeout``: seconds to connect, and for an answer.
    ``reconnect``: whether a command after a lost connection connects again; what was watched goes on.
    ``lease``: seconds (0.1 to 3600; 0 is no limit) after which the server stops what this program has moved if it is
    held, by a debugger for example; the connection says by itself that it lives (``lobby.lease``).
    ``on_message`` is called with what the server says by itself; by default it is kept in ``robot.messages``.
    """
    messages: deque[Message] = deque(maxlen=MAX_KEPT_MESSAGES)
    where = where_is(*split_address(host, port), tls)
    credentials = credentials_of(token, token_file, trust)
    hear = on_message or messages.append
    connection = Connection(
        where, credentials, timeout, reconnect, lambda line, at: hear(message_of(line, at)), lease=lease
    )
    return Robot(connection, messages)
