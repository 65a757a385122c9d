"""The traffic of a robot's wire from the control socket of its bus worker (verb ``trace``)."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from urbihw import platforms
from urbihw.buses.link import Url
from urbihw.buses.trace import Chunk
from urbihw.cli.options import CliRefused
from urbihw.control_line import ANSWER_TIMEOUT_S, ControlLine, question
from urbihw.daemon.runtime import control_sockets
from urbihw.exitcodes import EX_CONFIG, EX_UNAVAILABLE

_MOST_BYTES: Final = 16 << 20
"""Bytes of one line at most."""


class WorkerTraffic:
    """A connection to the control socket of a worker that sends what is on its wire.

    Attributes:
        path: of the socket.
        about: the answer: ``url``, ``devices``, ``baud``, ``link`` ...
    """

    def __init__(self, path: Path) -> None:
        """Ask for the traffic.  Raises OSError, and ValueError for an answer without sense."""
        self.path = path
        self._line = ControlLine(path, _MOST_BYTES)
        try:
            self._line.send(question("trace", "urbihw trace"))
            answer = self._next_told(time.monotonic() + ANSWER_TIMEOUT_S)
            if not isinstance(answer, dict) or not answer.get("ok"):
                raise ValueError(f"{path}: this daemon shows no traffic; is it of the same version?")
        except BaseException:
            self._line.close()
            raise
        self.about: Mapping[str, Any] = answer

    @property
    def devices(self) -> Sequence[Mapping[str, Any]]:
        """The devices of the answer.  Raises CliRefused for an answer without sense."""
        rows = self.about.get("devices", [])
        if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
            raise self._refusal()
        return rows

    @property
    def baud(self) -> float:
        """The speed of the line in bits/s, 0 if it has none.  Raises CliRefused for an answer without sense."""
        told = self.about.get("baud")
        if told is None:
            return 0.0
        try:
            speed = _number(told)
        except (TypeError, ValueError, OverflowError):
            raise self._refusal() from None
        if speed != 0 and speed < 1:
            raise self._refusal()
        return speed

    def chunks(self, until: float) -> Iterator[Chunk | int]:
        """Yield chunks, or how many were lost, until a time (``time.monotonic``) or the end of the connection.

        Raises CliRefused for a lost connection, and for events without sense.
        """
        while True:
            try:
                event = self._next_told(until)
                items = _items(event)
            except OSError as error:
                raise CliRefused(f"{self.path}: the daemon has ended the connection", EX_UNAVAILABLE) from error
            except (TypeError, ValueError, OverflowError):
                raise self._refusal() from None
            if event is None:
                return
            yield from items

    def _refusal(self) -> CliRefused:
        return CliRefused(_no_sense(self.path), EX_UNAVAILABLE)

    def close(self) -> None:
        """Close the connection to the worker."""
        self._line.close()

    def __enter__(self) -> WorkerTraffic:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _next_told(self, until: float) -> Any:
        """What the next line tells; None at the time, or at the end of the connection.  Raises OSError, ValueError."""
        try:
            return self._line.next_told(until)
        except (TimeoutError, ConnectionResetError):
            return None
        except (ValueError, RecursionError):
            raise ValueError(_no_sense(self.path)) from None


def _no_sense(path: Path) -> str:
    return f"{path}: this daemon's answer has no sense; is it of the same version?"


def _items(event: Any) -> list[Chunk | int]:
    """What an event tells of the traffic.  Raises TypeError, ValueError, OverflowError for one without sense."""
    if not isinstance(event, dict) or event.get("event") != "Traffic":
        return []
    lost = int(_number(event.get("lost", 0)) + _number(event.get("dropped", 0)))
    items: list[Chunk | int] = [lost] if lost else []
    for stamp, direction, text in event.get("chunks", ()):
        items.append(Chunk(_number(stamp), ">" if direction == ">" else "<", bytes.fromhex(text)))
    return items


def _number(value: Any) -> float:
    """A finite number.  Raises TypeError, ValueError, OverflowError."""
    if not isinstance(value, int | float):
        raise TypeError("no number")
    if not math.isfinite(value):
        raise ValueError("not finite")
    return float(value)


def open_traffic(path: Path) -> WorkerTraffic:
    """Open the traffic of a worker.  Raises CliRefused."""
    try:
        return WorkerTraffic(path)
    except OSError as error:
        hint = "is the daemon running?" if not isinstance(error, PermissionError) else "use sudo, or join its group"
        raise CliRefused(f"{path}: {error.strerror or 'no answer'}; {hint}", EX_UNAVAILABLE) from error
    except ValueError as error:
        raise CliRefused(str(error), EX_UNAVAILABLE) from error


def platform_of(path: Path) -> str:
    """The platform of a control socket, by its name."""
    name = path.stem.rpartition("-")[0]
    return name if any(folder.name == name for folder in platforms.folders()) else ""


def traffic_of(url: str, port: int | None = None) -> WorkerTraffic | None:
    """Open the traffic of the daemon that serves a url, None if no daemon does; "" is the only one there is, or the one
    that listens on a port.

    Raises CliRefused.
    """
    found = []
    for path in _sockets():
        if port is not None and path.stem.rpartition("-")[2] != str(port):
            continue
        try:
            traffic = WorkerTraffic(path)
        except (OSError, ValueError):
            continue
        if not url or same_port(url, str(traffic.about.get("url", ""))):
            found.append(traffic)
        else:
            traffic.close()
    for traffic in found[1:]:
        traffic.close()
    if len(found) > 1:
        found[0].close()
        names = ", ".join(f"--socket {traffic.path}" for traffic in found)
        raise CliRefused(f"which robot? Give one of: {names}", EX_CONFIG)
    return found[0] if found else None


def same_port(one: str, other: str) -> bool:
    """Whether two urls name the same port, whatever their options say."""
    return bool(one) and bool(other) and _place(one) == _place(other)


def _place(url: str) -> tuple[str, str]:
    try:
        parsed = Url.parse(url)
    except ValueError:
        return "", url
    target = parsed.target.partition("?")[0]
    return parsed.scheme, os.path.realpath(target) if parsed.scheme == "serial" else target


def _sockets() -> list[Path]:
    try:
        return control_sockets()
    except ValueError:  # BadConfig for a folder without permission.
        return []
