"""The control socket of a bus worker, played by a thread: it answers, and sends the events it was given."""

from __future__ import annotations

import json
import socket
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any


class WorkerSocket:
    """Answers each verb with `state`, after "trace" sends `events` (bytes as they are), then ends the connection."""

    def __init__(
        self, path: Path, state: Mapping[str, Any], events: Sequence[Mapping[str, Any] | bytes] = ()
    ) -> None:
        self.asked: list[str] = []
        self._answer = {"ok": True, **state}
        self._events = events
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._listener.bind(str(path))
        self._listener.listen()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return
            with connection, connection.makefile("rwb") as file:
                line = file.readline()
                if not line:
                    return
                verb = json.loads(line)["do"]
                self.asked.append(verb)
                for said in [{**self._answer, "do": verb}, *(self._events if verb == "trace" else ())]:
                    file.write((said if isinstance(said, bytes) else json.dumps(said).encode()) + b"\n")

    def close(self) -> None:
        """End the thread."""
        # An accept is woken by a connection, not by a close.
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as last:
            last.connect(self._listener.getsockname())
        self._thread.join(5.0)
        self._listener.close()
