"""Reports the state of the daemon to the service manager: systemd's sd_notify protocol, without its library.

Source: ``man 3 sd_notify``.  Newline-separated ``KEY=value`` lines in one datagram to the socket that the environment
names in ``NOTIFY_SOCKET``; a name that begins with ``@`` is in the abstract namespace.  ``WATCHDOG_USEC`` is the
maximum time between two watchdog messages of the process in ``WATCHDOG_PID``.

Errors are ignored: a service manager that has ended must not end the daemon.
"""

from __future__ import annotations

import logging
import os
import socket
import time
from collections.abc import Mapping
from types import TracebackType

from urbihw.settings import one_line

log = logging.getLogger("urbihw.notify")


class ServiceNotifier:
    """Sends messages to the service manager; without an address it sends nothing.

    ::

        with Notifier.from_environment(os.environ) as notifier:
            notifier.ready("bioloid: 18 servos")
            if notifier.watchdog_period is not None: ...    # call watchdog() this often

    ``address`` is a path or ``@name``; ``watchdog_period`` is in seconds, half of what the manager requires (None: no
    watchdog).
    """

    def __init__(self, address: str = "", watchdog_period: float | None = None) -> None:
        self.watchdog_period = watchdog_period
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._socket: socket.socket | None = None
        if address and address[0] not in "@/":
            log.warning("NOTIFY_SOCKET=%s is no supported address: the service manager gets no messages", address)
        elif address:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
            # A manager that does not read must not block the daemon.
            self._socket.setblocking(False)

    @classmethod
    def from_environment(cls, environment: Mapping[str, str], pid: int | None = None) -> ServiceNotifier:
        """The notifier for the variables of the environment; ``pid`` is the own process id."""
        wanted = environment.get("WATCHDOG_USEC", "")
        whose = environment.get("WATCHDOG_PID", "")
        mine = not whose or whose == str(os.getpid() if pid is None else pid)
        period = int(wanted) / 2e6 if mine and wanted.isdecimal() and int(wanted) > 0 else None
        return cls(environment.get("NOTIFY_SOCKET", ""), period)

    def ready(self, status: str) -> None:
        """Report that clients can connect, or that a reload is over."""
        self._send("READY=1", _status(status))

    def reloading(self) -> None:
        """Report that the settings are read again; ``ready`` reports the end of it.

        ``MONOTONIC_USEC`` (microseconds of CLOCK_MONOTONIC) is for managers that asked for the reload by
        ``Type=notify-reload``.
        """
        self._send("RELOADING=1", f"MONOTONIC_USEC={time.monotonic_ns() // 1000}")

    def status(self, text: str) -> None:
        """Report a short status for ``systemctl status``."""
        self._send(_status(text))

    def stopping(self, status: str = "stopping") -> None:
        """Report that the daemon is shutting down."""
        self._send("STOPPING=1", _status(status))

    def watchdog(self) -> None:
        """Send the watchdog message."""
        self._send("WATCHDOG=1")

    def close(self) -> None:
        """Close the socket.  A second call does nothing."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def __enter__(self) -> ServiceNotifier:
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
    # A line end would begin another assignment; names of robots are part of the text.
    return "STATUS=" + one_line(" ".join(text.split()))
