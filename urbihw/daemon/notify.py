"""Tells the service manager how we are: systemd's sd_notify protocol, by hand.

Source: ``man 3 sd_notify``.  Newline-separated ``KEY=value`` lines in one datagram to the socket that the environment
names in ``NOTIFY_SOCKET``; a name that begins with ``@`` is in the abstract namespace.  ``WATCHDOG_USEC`` is the time
within which we must be heard again, and is meant for the process in ``WATCHDOG_PID`` only.

Telling is best effort: a service manager that has gone away must not take the robot's daemon with it.
"""

from __future__ import annotations

import logging
import os
import socket
from collections.abc import Mapping
from types import TracebackType

log = logging.getLogger("urbihw.notify")


class Notifier:
    """Speaks to the service manager; without an address it says nothing.

    ::

        with Notifier.from_environment(os.environ) as notifier:
            notifier.ready("bioloid: 18 servos")
            if notifier.watchdog_period is not None: ...    # call watchdog() this often

    ``address`` is a path or ``@name``; ``watchdog_period`` is in seconds, half of what the manager asks for (None: it
    does not).
    """

    def __init__(self, address: str = "", watchdog_period: float | None = None) -> None:
        self.watchdog_period = watchdog_period
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._socket: socket.socket | None = None
        if address and address[0] not in "@/":
            log.warning("NOTIFY_SOCKET=%s is of a kind we do not speak: the service manager is told nothing", address)
        elif address:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
            # A manager that does not read must not hold us up.
            self._socket.setblocking(False)

    @classmethod
    def from_environment(cls, environment: Mapping[str, str], pid: int | None = None) -> Notifier:
        """The notifier that the environment asks for; ``pid`` is the own process id."""
        wanted = environment.get("WATCHDOG_USEC", "")
        whose = environment.get("WATCHDOG_PID", "")
        mine = not whose or whose == str(os.getpid() if pid is None else pid)
        period = int(wanted) / 2e6 if mine and wanted.isdecimal() and int(wanted) > 0 else None
        return cls(environment.get("NOTIFY_SOCKET", ""), period)

    def ready(self, status: str) -> None:
        """Clients can connect."""
        self._send("READY=1", _status(status))

    def status(self, text: str) -> None:
        """A few words for ``systemctl status``."""
        self._send(_status(text))

    def stopping(self, status: str = "stopping") -> None:
        """We are on our way out."""
        self._send("STOPPING=1", _status(status))

    def watchdog(self) -> None:
        """We are alive."""
        self._send("WATCHDOG=1")

    def close(self) -> None:
        """Say no more; twice is fine."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def __enter__(self) -> Notifier:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _send(self, *lines: str) -> None:
        if self._socket is None:
            return
        try:
            self._socket.sendto("\n".join(lines).encode(), self._address)
        except OSError as error:
            log.debug("the service manager does not listen: %s", error)


def _status(text: str) -> str:
    # A line end would begin another assignment.
    return "STATUS=" + " ".join(text.split())
