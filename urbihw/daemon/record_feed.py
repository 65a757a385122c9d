"""What a daemon tells to those who record its robot, beside what the bus worker tells.

These are its settings without secrets, its log, and what clients send and get: lines of JSON on a UNIX socket beside
the control socket, for the user of the daemon; the first line has the settings.  Nothing is made of what happens while
there is no recorder, and one that does not read loses lines, which are counted.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import re
import socket
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from urbihw.daemon.config import Config, Loaded, entries
from urbihw.kernel.server.connection import LobbyConnection

SUFFIX: Final = ".feed"
"""The end of the name of the socket; it begins as that of the control socket."""
MOST_UNREAD: Final = 1 << 20
"""Bytes that wait for a recorder; beyond that lines are dropped."""
MOST_TEXT: Final = 4000
"""Bytes of a piece that a client sent or gets; a longer one is cut, and its size stands beside it."""
MOST_CLIENTS: Final = 4
_TOKEN: Final = re.compile(r"^(\s*token[ \t]+)\S+", re.MULTILINE)
"""The line with which a client shows its token."""


def shown_settings(config: Config) -> dict[str, Any]:
    """The settings in force, by name; None for a secret.  Options behind a url may be secret, so they are left out."""
    shown = {each.key: each.value for each in entries(Loaded(config, "", (), (), ()))}
    shown["url"] = str(shown.get("url") or "").partition("?")[0]
    return shown


class RecordFeed:
    """Tells recorders, in the thread of the event loop."""

    def __init__(self, control: str, settings: Mapping[str, Any]) -> None:
        self._path = Path(control).with_suffix(SUFFIX)
        self._settings = settings
        self._server: asyncio.Server | None = None
        self._clients: dict[asyncio.StreamWriter, int] = {}

    async def start(self) -> None:
        """Listen beside the control socket.  Raises OSError."""
        with contextlib.suppress(FileNotFoundError):
            self._path.unlink()
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        # Nothing else may run meanwhile: the mask is that of the whole process.
        before = os.umask(0o177)
        try:
            listener.bind(str(self._path))
        except OSError:
            listener.close()
            raise
        finally:
            os.umask(before)
        self._server = await asyncio.start_unix_server(self._connected, sock=listener)

    def add_log(self, entry: Mapping[str, Any]) -> None:
        """Tell a line of the log (``urbihw.kernel.server.log_tap``)."""
        self._tell({"event": "Log", **entry})

    def overhear(self, connection: LobbyConnection, way: str, data: bytes) -> None:
        """Tell what a client sent (``>``) or gets.

        The token of a client is no part of that: the handshake has taken it.  One that was sent to a port that wants
        none is left out.
        """
        if self._clients:
            text = _TOKEN.sub(r"\1...", data[:MOST_TEXT].decode("utf-8", "backslashreplace"))
            kind = "Typed" if way == ">" else "Answered"
            self._tell({"event": kind, "client": connection.peer, "text": text, "size": len(data)})

    def close(self) -> None:
        """End listening, and all connections; a second call does nothing."""
        server, self._server = self._server, None
        if server is not None:
            server.close()
            for writer in list(self._clients):
                writer.transport.abort()
            with contextlib.suppress(OSError):
                self._path.unlink()

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if len(self._clients) >= MOST_CLIENTS:
            writer.transport.abort()
            return
        self._clients[writer] = 0
        self._send(writer, {"event": "Settings", "settings": self._settings, "at": time.monotonic()})
        with contextlib.suppress(OSError):
            while await reader.read(4096):
                pass
        self._clients.pop(writer, None)
        writer.transport.abort()

    def _tell(self, event: Mapping[str, Any]) -> None:
        if self._clients:
            event = {**event, "at": time.monotonic()}
            for writer in self._clients:
                self._send(writer, event)

    def _send(self, writer: asyncio.StreamWriter, event: Mapping[str, Any]) -> None:
        if writer.transport.get_write_buffer_size() > MOST_UNREAD:
            self._clients[writer] += 1
            return
        if self._clients[writer]:
            event = {**event, "dropped": self._clients[writer]}
            self._clients[writer] = 0
        writer.write(json.dumps(event, separators=(",", ":"), default=str).encode() + b"\n")
