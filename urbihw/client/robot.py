"""The robot as a Python object: ``robot = urbihw.connect("robot.local")``; attributes are slots (``objects``)."""

from __future__ import annotations

import json
import os
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Final

from urbihw.client.connection import Connection
from urbihw.client.credentials import ARGUMENTS, Credentials
from urbihw.client.errors import ClientError
from urbihw.client.iterators import Events, Shots, SlotWatch
from urbihw.client.leases import RequestLease
from urbihw.client.literals import (
    CONSTANTS,
    checked_name,
    checked_text,
    checked_writes,
)
from urbihw.client.objects import UrbiObject, evaluated, wrapped
from urbihw.client.session import Message, message_of
from urbihw.client.streams import EventStream, SampleStream, ShotStream
from urbihw.client.values import Written, written_of
from urbihw.client.where import where_is

DEFAULT_PORT: Final = 54000
MAX_KEPT_MESSAGES: Final = 1000


SERVER_SLOTS: Final = frozenset(
    ("cerr", "clog", "connectionTag", "cout", "detach", "disown", "echo", "evaluate", "external", "isdef",
     "methodToFunction", "persist", "remoteIP", "type", "uobjects", "uobjects_handle", "wall", "warn")
)  # fmt: skip
"""Slots of each server and connection, which are no use in completion: they can be read all the same."""

DEVICES: Final = (
    "Global.localSlotNames.filter(closure (name) "
    "{ !Global.getSlot(name).acceptVoid.isVoid && !Global.getSlot(name).isA(Executable) "
    "&& Global.getSlot(name).isA(UObject) && name != \"UObject\" })"
)
"""The devices by their names."""


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

    # ---------------------------------------------------------------- joints

    @property
    def joints(self) -> list[str]:
        """The names of the joints, such as ``motor6`` or ``shoulder_pan``, in an order that stays the same: that of the
        settings, else that which the robot has for them.  ``robot[f"{name}.val"]`` is one."""
        names: list[str] = evaluated(self._connection, "System.jointNames(robot)")
        return names

    def write(self, values: Mapping[str, Any], timeout: float | None = None) -> dict[str, Written]:
        """Write several slots at once: ``robot.write({"motor6.val": 0.5, "motor7.val": 0.1})``.

        One way to the server and back; the values go out with one tick of the bus.  Returns what the devices tell of
        each: the value after the limits, and the limit that acts.  Nothing is written if one of the slots does not
        exist (SlotMissing); a value that is refused ends the rest.  ``timeout`` in seconds, by default that of the
        connection.
        """
        texts = checked_writes(values)
        limit = self._connection.timeout if timeout is None else timeout
        told = self._connection.ask(lambda dialect, channel: dialect.write_all(channel, texts), limit)
        return written_of(texts, told)

    def overview(self) -> dict[str, Any]:
        """What moves and what measures, about 2 kB: ``robot``, ``type``, and in ``effectors`` and ``sensors`` for each
        slot ``slot`` (its path), ``role``, and where there are ``unit``, ``min`` and ``max``."""
        told: dict[str, Any] = json.loads(evaluated(self._connection, "System.overviewText(robot)"))
        return told

    def lease(self, seconds: float = 0.5, fed: bool = True) -> RequestLease:
        """A lease for a block: ``with robot.lease(seconds=0.5)``.

        What this connection moves stops when its program is held for so long (0.1 to 3600 s), and at the end of the
        block, also by an exception.  With ``fed=False`` the library gives no sign of life: the program calls ``feed``
        of the lease, or any command, when the one for whom it moves the robot has given one.  A lease counts for all
        of the connection; one inside another one takes its place.  Raises ValueError for ``seconds`` that are not
        above 0.
        """
        return RequestLease(self._connection, seconds, fed)

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
        here = {name for name in own | everybodys if name[:1].islower() or name in own}
        return here - SERVER_SLOTS - {*CONSTANTS} | {"messages"}

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
