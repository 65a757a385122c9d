"""The control socket of a worker: stop, emergency stop, release, state and telemetry, independent of the interpreter.

A UNIX stream socket, mode 0660.  Each line is a JSON object, in both directions (docs/safety.md has the schema)::

    > {"do": "estop", "who": "the red button"}
    < {"ok": true, "do": "estop", "epoch": 4, "estop": "the red button", "link": true}

The file may be deleted under the worker, by somebody who cleans up: it is made again within half a second. Meanwhile
there is an abstract socket (``urbihw.control_address``), for the user of the worker and for root.

Nothing here blocks: the engine calls `poll` between two transactions on the wire.  ``control_client`` has what a client
says and gets; a slow client delays neither the worker nor the others.
"""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from urbihw.buses.control_client import HEALTH, RECORD, STATE, TRACE, URGENT, ControlClient, ControlCommand
from urbihw.buses.errors import Unavailable
from urbihw.buses.events import message_event
from urbihw.buses.messages import (
    DeviceReport,
    DeviceState,
    FromWorker,
    Latched,
    LinkState,
    Samples,
    Statistics,
    Stopped,
)
from urbihw.control_address import abstract_address, user_at

MAX_CLIENTS: Final = 16
"""Connections at a time; one more ends the oldest."""
BACKLOG: Final = 128
"""Connections that may wait for the next look at the socket; one more would be refused by the system without a word."""
LOOK_PERIOD_S: Final = 0.5
"""Seconds between two looks whether the file is still there."""
MOST_LISTENERS: Final = 3
"""Sockets at files of which all but the last were deleted."""
REST_S: Final = 0.05
"""Seconds for which a client is not read after a question whose answer takes about a millisecond to make."""
_COSTLY: Final = (STATE, HEALTH, TRACE, RECORD)
_EVENTS: Final = (Samples, DeviceState, LinkState, DeviceReport, Stopped, Latched, Statistics)


class ControlSocket:
    """Listens at ``path``; ``now`` is the clock of the engine.  Raises Unavailable when that cannot be."""

    def __init__(self, path: Path, now: Callable[[], float]) -> None:
        self.path = path
        self._now = now
        self._clients: list[ControlClient] = []
        try:
            # A worker that was killed leaves its socket; the daemon ensures that no other one serves this robot.
            with contextlib.suppress(FileNotFoundError):
                path.unlink()
            self._listeners = [self._listen_at_file()]
        except OSError as error:
            raise Unavailable(error.errno or 0, f"there is none: {error.strerror or error}") from error
        self._abstract = _listen_at_name(path)
        self._look_at = now() + LOOK_PERIOD_S

    def _listen_at_file(self) -> socket.socket:
        """Make the file, and return a socket that listens there.  Raises OSError."""
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_CLOEXEC)
        listener.setblocking(False)
        try:
            before = os.umask(0o117)
            try:
                listener.bind(str(self.path))
            finally:
                os.umask(before)
            made = self.path.lstat()
            self._file = made.st_dev, made.st_ino
            listener.listen(BACKLOG)
        except OSError:
            listener.close()
            raise
        return listener

    def _look_after_file(self) -> None:
        """Make the file again if it was deleted; one that somebody else has put there stays."""
        now = self._now()
        if now < self._look_at:
            return
        self._look_at = now + LOOK_PERIOD_S
        try:
            self.path.lstat()
        except FileNotFoundError:
            with contextlib.suppress(OSError):
                self.path.parent.mkdir(mode=0o700, exist_ok=True)
                # Clients that have connected at the old one may still wait there.
                self._listeners.append(self._listen_at_file())
        except OSError:
            return
        while len(self._listeners) > MOST_LISTENERS:
            self._listeners.pop(0).close()

    def _all_listeners(self) -> list[socket.socket]:
        return self._listeners if self._abstract is None else [*self._listeners, self._abstract]

    def descriptors(self) -> list[int]:
        """Return the file descriptors to wait on: those of the listeners and their clients."""
        self._look_after_file()
        if any(client.closed for client in self._clients):
            self._clients = [client for client in self._clients if not client.closed]
        now = self._now()
        listeners = [listener.fileno() for listener in self._all_listeners()]
        return [*listeners, *(each.fileno() for each in self._clients if each.rests_until <= now)]

    def poll(self, ready: list[int]) -> list[ControlCommand]:
        """Return at most one command of each descriptor in `ready`, accepting new clients; stops come first."""
        orders: list[ControlCommand] = []
        for client in self._clients:
            if client.fileno() in ready:
                orders += client.read_command()
        for listener in self._all_listeners():
            if listener.fileno() in ready:
                orders += self._accept(listener)
        for order in orders:
            if order.verb in _COSTLY:
                order.client.rests_until = self._now() + REST_S
        return sorted(orders, key=lambda order: order.verb not in URGENT)

    def publish(self, message: FromWorker) -> None:
        """Send an event to all subscribers."""
        if not isinstance(message, _EVENTS):
            return
        listeners = [client for client in self._clients if client.subscribed and not client.closed]
        if listeners:
            line = message_event(message)
            for client in listeners:
                client.send_telemetry(line)

    def publish_values(self, values: Callable[[], Mapping[str, Any]]) -> None:
        """Send the event of `values()` to the clients whose time has come; it is made only if there is one."""
        now = self._now()
        due = [each for each in self._clients if each.values_rate and each.values_due <= now and not each.closed]
        if not due:
            return
        line = {"event": "Values", "time": round(now, 4), "values": values()}
        for client in due:
            period = 1 / client.values_rate
            client.values_due = max(client.values_due, now - period) + period
            client.send_values(line)

    @property
    def is_traced(self) -> bool:
        """Whether a client wants the bytes on the wire."""
        return any(client.traces and not client.closed for client in self._clients)

    @property
    def is_recorded(self) -> bool:
        """Whether a client wants all that happens in the worker."""
        return any(client.records and not client.closed for client in self._clients)

    def publish_record(self, event: Mapping[str, Any]) -> None:
        """Send an event (`WorkerJournal`) to the clients that record."""
        for client in self._clients:
            if client.records and not client.closed:
                client.send_telemetry(event)

    def publish_backlogs(self) -> None:
        """Send each client that has begun to record the next event of what was before."""
        for client in self._clients:
            if client.records and not client.closed and (event := next(client.backlog, None)) is not None:
                client.send_telemetry(event)

    def publish_traffic(self, event: Mapping[str, Any]) -> None:
        """Send bytes of the wire (`TrafficLog.take`) to the clients that want them."""
        for client in self._clients:
            if client.traces and not client.closed:
                client.send_telemetry(event)

    def close(self) -> None:
        """Close the listener and all clients; calling it twice is allowed."""
        if not self._listeners:
            return
        for client in self._clients:
            client.close()
        for listener in self._all_listeners():
            listener.close()
        self._listeners, self._abstract = [], None
        with contextlib.suppress(OSError):
            there = self.path.lstat()
            if (there.st_dev, there.st_ino) == self._file:  # else that of the next worker, or what somebody put there
                self.path.unlink()

    def _accept(self, listener: socket.socket) -> list[ControlCommand]:
        """Let a client in; most have their order with them.  The mode of a file guards the one, this the other."""
        try:
            connection, _ = listener.accept()
            user = user_at(connection)
            if listener is self._abstract and user not in (0, os.getuid()):
                connection.close()
                return []
        except OSError:
            return []
        if len(self._clients) >= MAX_CLIENTS:
            # A new client may want to stop the robot; the oldest one has had time to do so.
            self._clients.pop(0).dismiss(f"{MAX_CLIENTS} clients at most: this one was the oldest")
        client = ControlClient(connection, user)
        self._clients.append(client)
        return client.read_command()


def _listen_at_name(path: Path) -> socket.socket | None:
    """A socket that listens at the abstract name for a path; None if the name is taken, or too long."""
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_CLOEXEC)
    listener.setblocking(False)
    try:
        listener.bind(abstract_address(path))
        listener.listen(BACKLOG)
    except OSError:
        listener.close()
        return None
    return listener
