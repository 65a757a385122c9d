"""The client's side of the control socket of a bus worker: lines of JSON on a UNIX socket (``urbihw.buses.control``).

The one way to it, for the commands, for ``urbihw trace``, and for the gateway and the metrics, which read it with
asyncio (``urbihw.daemon.control_client``).  A stop waits for the import of this module, so it imports almost nothing.
"""

from __future__ import annotations

import os
import socket
import time

from urbihw.control_address import abstract_address, user_at

TYPE_CHECKING = False  # as ``typing`` has it, whose import a stop cannot wait for
if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any, Final

    Path = str | os.PathLike[str]

ANSWER_TIMEOUT_S: Final = 1.0
"""Seconds within which a worker must answer."""
MAX_LINE_BYTES: Final = 1 << 22
"""Bytes of the longest answer.  The health of 300 devices has some 400 000."""
MAX_NAME_LENGTH: Final = 100
CONNECT_PAUSE_S: Final = 0.01
"""Seconds between attempts while the queue of the socket is full, as there is no event for its end."""


def question(
    verb: str, who: str = "", user: str = "", others: Sequence[str] = (), everyone: bool = False
) -> bytes:
    """The line that asks for something; ``who`` is the name of the requester.

    ``user``: whose emergency stop it is, "" for the user of this process; ``others`` and ``everyone``: whose emergency
    stops are released too.
    """
    by = f', "who": {_quoted(who)}' if who else ""
    by += f', "user": {_quoted(user)}' if user else ""
    by += f', "others": [{", ".join(map(_quoted, others))}]' if others else ""
    by += ', "everyone": true' if everyone else ""
    return f'{{"do": "{verb}"{by}}}\n'.encode()


def _quoted(text: str) -> str:
    line = "".join(each if each.isprintable() else " " for each in text[:MAX_NAME_LENGTH])
    return '"' + line.replace("\\", "\\\\").replace('"', '\\"') + '"'


def dial_control(path: Path, timeout: float | None = ANSWER_TIMEOUT_S) -> socket.socket:
    """A socket that is connected to a worker, at its path, or at its second address if the file has been deleted.

    Raises OSError: BlockingIOError while the queue is full, PermissionError also for a second address of somebody who
    has no control sockets here, since anybody can take such a name.
    """
    try:
        return _dial(os.fspath(path), timeout)
    except (FileNotFoundError, ConnectionRefusedError) as missing:
        try:
            made = _dial(abstract_address(path), timeout)
        except OSError:
            raise missing from None
    try:
        folder = os.path.dirname(os.path.abspath(path))
        if user_at(made) not in (0, os.getuid(), os.stat(folder).st_uid):
            raise PermissionError
    except OSError:
        made.close()
        raise
    return made


def _dial(address: str | bytes, timeout: float | None) -> socket.socket:
    made = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        made.settimeout(timeout)
        made.connect(address)
    except OSError:
        made.close()
        raise
    return made


class ControlLine:
    """A blocking connection to a worker, which may answer by many lines."""

    def __init__(self, path: Path, longest: int = MAX_LINE_BYTES) -> None:
        """Connect; ``longest`` is in bytes.  Raises OSError."""
        self._buffer = b""
        self._longest = longest
        end = time.monotonic() + ANSWER_TIMEOUT_S
        while True:
            try:
                self._socket = dial_control(path)
                return
            except BlockingIOError:
                if time.monotonic() > end:
                    raise
                time.sleep(CONNECT_PAUSE_S)

    def send(self, line: bytes) -> None:
        """Send a line.  Raises OSError."""
        self._socket.sendall(line)

    def next_told(self, until: float) -> Any:
        """What the next line tells.

        Raises what ``next_line`` does, and ValueError or RecursionError for a line without sense.
        """
        line = self.next_line(until)
        import json  # not before: the request is on its way, and this takes longer

        return json.loads(line)

    def next_line(self, until: float) -> bytes:
        """The next line, without its end.

        Raises TimeoutError at a time (``time.monotonic``), ConnectionResetError at the end of the connection, other
        OSErrors, and ValueError for a line that is too long.
        """
        while b"\n" not in self._buffer:
            left = until - time.monotonic()
            if left <= 0:
                raise TimeoutError
            self._socket.settimeout(min(left, 3600.0))
            data = self._socket.recv(1 << 16)
            if not data:
                raise ConnectionResetError
            self._buffer += data
            if len(self._buffer) > self._longest:
                raise ValueError(f"more than {self._longest} bytes in a line")
        line, _, self._buffer = self._buffer.partition(b"\n")
        return line

    def close(self) -> None:
        """End the connection to the worker."""
        self._socket.close()
