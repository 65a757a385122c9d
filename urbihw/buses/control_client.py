"""One client of the control socket of a worker: its lines as commands, and the lines that it gets.

A stop is executed whatever else the line says, even if the line is too long to be read as JSON.  An emergency stop
belongs to the user at the other end, whom the system names; the user of this worker and root, such as the gateway, may
name another one in ``user``, and they may release the stops of others.

Nothing here blocks.  A client that does not read loses telemetry and gets the number of lost messages.
"""

from __future__ import annotations

import json
import os
import re
import socket
from collections import deque
from collections.abc import Iterator, Mapping
from typing import Any, Final

from urbihw.buses.events import event_line
from urbihw.buses.latches import plain_name
from urbihw.buses.messages import Release
from urbihw.control_address import local_user
from urbihw.frozen import frozen

STOP, ESTOP, RELEASE, STATE, SUBSCRIBE, HEALTH = "stop", "estop", "release", "state", "subscribe", "health"
TRACE: Final = "trace"
VALUES: Final = "values"
RECORD: Final = "record"
VERBS: Final = (STOP, ESTOP, RELEASE, STATE, SUBSCRIBE, HEALTH, TRACE, VALUES, RECORD)
NAMELESS: Final = "control socket"
"""Who asks, where a command does not say."""
MAX_LINE_BYTES: Final = 4096
MAX_LONG_LINE_BYTES: Final = 1 << 20
"""Bytes of a longer line in which a stop is still looked for."""
MAX_NAME_LENGTH: Final = 100
"""Characters of a name, or of a user; what is longer is cut."""
MOST_OTHERS: Final = 64
"""Stops of others that a client may release by name at a time."""
URGENT: Final = (STOP, ESTOP)
"""Commands that are executed before all others."""
_ESTOPS: Final = (ESTOP, RELEASE)
_URGENT_WORDS: Final = re.compile(rb'"do"\s*:\s*"(e?stop)"')
"""A stop in a line that is too long to be read as JSON.  Within a text the quotation marks would be escaped."""
_NAME_WORDS: Final = re.compile(rb'"who"\s*:\s*"((?:[^"\\]|\\.){1,100})')
_OVERLAP: Final = 64
"""Bytes of a piece of such a line that are searched again with the next one."""
MAX_QUEUED_LINES: Final = 256
"""Lines that wait for a subscriber; older telemetry is dropped for newer."""
MIN_VALUES_HZ: Final = 0.1
MAX_VALUES_HZ: Final = 50.0
MAX_WAITING_VALUES: Final = 4
"""Lines that wait for a client from which on values are left out: a plot wants the newest ones."""


@frozen
class ControlCommand:
    """A command of a client: `verb` of VERBS, `who` asked, and the `client` that gets the answer.  `rate` is that of
    VALUES, in Hz; 0 ends them.  `user` is whose emergency stop it is; a release may be for `others`, or for all.
    """

    verb: str
    who: str
    client: ControlClient
    rate: float = 0.0
    user: str = ""
    others: tuple[str, ...] = ()
    everyone: bool = False

    @property
    def release(self) -> Release:
        """The message that the daemon would send for the same."""
        return Release(self.who, self.user, self.others, self.everyone)

    def answer(self, state: Mapping[str, Any]) -> None:
        """Send the client the state after the command."""
        self.client.send_line({"ok": True, "do": self.verb, **state})


class _LongLine:
    """A line with more bytes than are kept; a stop is found in it also across its pieces."""

    def __init__(self, beginning: bytes) -> None:
        name = _NAME_WORDS.search(beginning)
        self.name = plain_name(name[1].decode("utf-8", "replace"), MAX_NAME_LENGTH) if name else NAMELESS
        self.most = MAX_LONG_LINE_BYTES if beginning.lstrip().startswith(b"{") else MAX_LINE_BYTES
        """Bytes from which on it is refused: what is no object of JSON contains no stop."""
        self.found = False
        self.size = 0
        self._tail = b""

    def search(self, piece: bytes) -> str:
        """Return the verb of the stop that is complete with this piece, "" for none or for one that was found."""
        self.size += len(piece)
        text = self._tail + piece
        self._tail = text[-_OVERLAP:]
        found = None if self.found else _URGENT_WORDS.search(text)
        self.found = self.found or found is not None
        return found[1].decode() if found is not None else ""


class ControlClient:
    """The connection of one client of the control socket."""

    def __init__(self, connection: socket.socket, user: int) -> None:
        connection.setblocking(False)
        self.socket = connection
        self._own_user = local_user(user)
        self._is_trusted = user in (0, os.getuid())
        self._long: _LongLine | None = None
        self.subscribed = False
        self.traces = False
        self.records = False
        self.backlog: Iterator[Mapping[str, Any]] = iter(())
        self.values_rate = 0.0
        self.values_due = 0.0
        self.closed = False
        self.rests_until = 0.0
        self._line = b""
        self._waiting: deque[bytes] = deque()
        self._rest = b""
        self._dropped = 0

    def fileno(self) -> int:
        return self.socket.fileno()

    def read_command(self) -> list[ControlCommand]:
        """Return the next command, if a line of it has arrived; a malformed line is answered with an error.

        What comes behind the line stays in the socket: a client that floods is served like the others.
        """
        try:
            seen = self.socket.recv(MAX_LINE_BYTES, socket.MSG_PEEK)
            line = self.socket.recv(seen.find(b"\n") + 1 or len(seen)) if seen else b""
        except BlockingIOError:
            return []
        except OSError:
            line = b""
        if not line:
            self.close()
            return []
        self._line += line
        if self._long is not None or len(self._line) > MAX_LINE_BYTES:
            return self._search_stop(line.endswith(b"\n"))
        if not line.endswith(b"\n"):
            return []
        whole, self._line = self._line, b""
        order = self._parse_command(whole) if whole.strip() else None
        return [] if order is None else [order]

    def _search_stop(self, ends: bool) -> list[ControlCommand]:
        """Return the stop in a line that has too many bytes: the robot must stand, whatever else the line says.

        A long line without one ends the connection with an error; the rest of the line behind a stop is left out.
        """
        long = self._long = self._long or _LongLine(self._line)
        verb = long.search(self._line)
        self._line = b""
        if ends:
            self._long = None
        if ends and not long.found or long.size > long.most:
            self._send_error(f"a line has {MAX_LINE_BYTES} bytes at most")
            self.close()
        return [ControlCommand(verb, long.name, self, user=self._own_user)] if verb else []

    def _parse_command(self, line: bytes) -> ControlCommand | None:
        try:
            wanted = json.loads(line)
        except (ValueError, RecursionError):
            self._send_error("each line must be a JSON object")
            return None
        verb = wanted.get("do") if isinstance(wanted, dict) else None
        if verb not in VERBS:
            self._send_error(f'"do" must be one of {", ".join(VERBS)}')
            return None
        who = wanted.get("who", NAMELESS)
        if not isinstance(who, str):
            if verb not in URGENT:
                self._send_error('"who" must be a text')
                return None
            # The robot must stand, whatever name the client gives itself.
            who = NAMELESS
        who = plain_name(who, MAX_NAME_LENGTH) or NAMELESS
        if verb in _ESTOPS:
            return self._parse_estop(verb, who, wanted)
        rate = wanted.get("hz", 0.0)
        if verb == VALUES and not (_is_number(rate) and (rate == 0 or MIN_VALUES_HZ <= rate <= MAX_VALUES_HZ)):
            self._send_error(f'"hz" must be 0 or from {MIN_VALUES_HZ:g} to {MAX_VALUES_HZ:g}')
            return None
        return ControlCommand(verb, who, self, rate if verb == VALUES else 0.0)

    def _parse_estop(self, verb: str, who: str, wanted: Mapping[str, Any]) -> ControlCommand | None:
        """An emergency stop, which is never refused, or a release."""
        named = wanted.get("user")
        named = plain_name(named, MAX_NAME_LENGTH) if self._is_trusted and isinstance(named, str) else ""
        user = named or self._own_user
        others, everyone = wanted.get("others", []), wanted.get("everyone", False)
        if verb == ESTOP:
            return ControlCommand(verb, who, self, user=user)
        if not isinstance(everyone, bool) or not isinstance(others, list) or len(others) > MOST_OTHERS:
            self._send_error(f'"others" must be a list of {MOST_OTHERS} names at most, "everyone" true or false')
            return None
        if (others or everyone) and not self._is_trusted:
            why = "only root and the user of the daemon may release the emergency stops of others: use sudo"
            self.send_line({"ok": False, "refused": True, "error": why})
            return None
        names = tuple(plain_name(str(each), MAX_NAME_LENGTH) for each in others)
        return ControlCommand(verb, who, self, user=user, others=names, everyone=everyone)

    def _send_error(self, why: str) -> None:
        self.send_line({"ok": False, "error": why})

    def send_line(self, message: Mapping[str, Any]) -> None:
        """Queue a line and send what the socket takes; a client that asks and never reads is disconnected."""
        if len(self._waiting) > 2 * MAX_QUEUED_LINES:
            self.close()
        self._waiting.append(event_line(message))
        self.flush()

    def send_telemetry(self, message: Mapping[str, Any]) -> None:
        """Send telemetry; when too much waits, the oldest is dropped."""
        self.flush()
        if len(self._waiting) >= MAX_QUEUED_LINES:
            self._waiting.popleft()
            self._dropped += 1
        elif self._dropped:
            message = {**message, "dropped": self._dropped}
            self._dropped = 0
        self.send_line(message)

    def send_values_at(self, rate: float, now: float) -> None:
        """Send values at a rate in Hz from now on; 0 for none."""
        self.values_rate, self.values_due = rate, now

    def send_values(self, message: Mapping[str, Any]) -> None:
        """Send telemetry of which only the newest is of use; it is left out while older lines wait."""
        self.flush()
        if len(self._waiting) >= MAX_WAITING_VALUES:
            self._dropped += 1
        else:
            self.send_telemetry(message)

    def flush(self) -> None:
        """Send what the socket takes."""
        while not self.closed and (self._rest or self._waiting):
            self._rest = self._rest or self._waiting.popleft()
            try:
                sent = self.socket.send(self._rest)
            except BlockingIOError:
                return
            except OSError:
                self.close()
                return
            self._rest = self._rest[sent:]

    def dismiss(self, why: str) -> None:
        """Send the reason, if the socket takes it, and close the connection."""
        if not self.closed:
            self._send_error(why)
        self.close()

    def close(self) -> None:
        """Close the connection and drop its queue."""
        self.closed = True
        self._waiting.clear()
        self.socket.close()


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
